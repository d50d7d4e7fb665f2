#!/usr/bin/env python3
"""The article's studies from their sweep files, beside the article's numbers.

    python postproc/studies.py table1|table2|table3|figure5 SWEEP.h5 [--plot FILE.png]
"""

import argparse
import sys

import numpy as np
import style
from article import TABLE_3, TABLE_3_AXIS, TABLE_3_QUANTITIES, TABLE_3_TIME, printed, range_text, slipped_displacement
from exact_lumped import kinds
from rodyn_data import DataError, Sweep, distinct, open_sweep

N_RODS = 4
PRINTED = ("exact", "lumped")


def print_times(sweep: Sweep, times: list[int]) -> None:
    """Tables 1 and 2: phi_4 and alpha_1' at given times."""
    names = [name for name, values in sweep.axes.items() if len(distinct(values)) > 1]
    n_rhs = sweep.quantity("n_rhs").values
    for t in times:
        angle, slope_rate = printed("phi(4)", t), printed("alpha_rate(1)", t)
        true_phi, true_rate = float(angle.reference), float(slope_rate.reference)
        phi, rate = (sweep.quantity(name, t).values for name in ("phi(4)", "alpha_rate(1)"))
        print(f"t = {t} s: reference phi_4 {true_phi:.12f} rad, alpha_1' {true_rate:.10g} rad/s; "
              f"the article {range_text(angle)}, {range_text(slope_rate)}")
        print("  ".join(f"{name:>17}" for name in names), f"{'phi_4, rad':>17}{'error':>10}",
              f"{'alpha_1, rad/s':>16}{'error':>10}{'n_rhs':>10}")
        for i in np.flatnonzero(~np.isnan(phi)):
            print("  ".join(f"{sweep.axis(name)[i]!s:>17.17}" for name in names),
                  f"{phi[i]:17.12f}{phi[i] - true_phi:10.1e} {rate[i]:15.10f}{rate[i] - true_rate:10.1e}{int(n_rhs[i]):10d}")


def cases_by_kind(sweep: Sweep) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Mass ratios, and the numbers of the exact, the lumped and, where there are any, the condensed cases, in the same order."""
    cases = {kind: np.flatnonzero(sweep.chosen(place)) for kind, place in kinds(sweep).items()}
    ratios = sweep.axis(TABLE_3_AXIS)
    if not all(np.array_equal(ratios[cases["exact"]], ratios[found]) for found in cases.values()):
        raise DataError(f"{sweep.path}: the exact and the other cases have other mass ratios")
    return ratios[cases["exact"]], cases


def per_rod(sweep: Sweep, name: str, t: float) -> np.ndarray:
    """A state of all four rods at a probe time (case, rod)."""
    return np.stack([sweep.quantity(f"{name}({k})", t).values for k in range(1, N_RODS + 1)], axis=1)


def table_3(sweep: Sweep) -> None:
    """phi_1, phi_4, u_x as the article has it and theta at t = 1 s, ours beside the printed numbers; the true u_x."""
    ratios, cases = cases_by_kind(sweep)
    columns = {name: sweep.quantity(name, TABLE_3_TIME).values for name, _ in TABLE_3_QUANTITIES}
    true = columns["displacement_x"]
    columns["displacement_x"] = slipped_displacement(sweep)
    scales = {"deg": 180.0 / np.pi}
    heads = ["phi_1, deg", "phi_4, deg", "u of u' = Vx - w u", "theta, rad"]
    print(" ratio          " + "".join(f"{head:>20}" for head in heads) + "     u_x, m   (ours and the article's; ours)")
    equal = dict.fromkeys(PRINTED, 0)
    for row, ratio in enumerate(ratios):
        for kind, found in cases.items():
            ours = [f"{columns[name][found[row]] * scales.get(unit, 1.0):.3f}" for name, unit in TABLE_3_QUANTITIES]
            theirs = TABLE_3[int(ratio)][PRINTED.index(kind)] if kind in PRINTED else [""] * len(ours)
            if kind in PRINTED:
                equal[kind] += sum(a == b for a, b in zip(ours, theirs, strict=True))
            print(f"{ratio:6g} {kind:9}" + "".join(f"{a:>11}{b:>9}" for a, b in zip(ours, theirs, strict=True))
                  + f"{true[found[row]]:11.5f}")
    print(", ".join(f"{kind}: {number} of {4 * len(ratios)} numbers are the printed ones" for kind, number in equal.items()))


def differences(sweep: Sweep) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Mass ratios, and of each other kind the largest |phi exact - phi| of the four rods at each probe time, rad."""
    ratios, cases = cases_by_kind(sweep)
    angles = np.stack([per_rod(sweep, "phi", t) for t in sweep.probe_times], axis=1)
    exact = angles[cases["exact"]]
    return ratios, {kind: np.abs(exact - angles[found]).max(axis=2) for kind, found in cases.items() if kind != "exact"}


def figure_5(sweep: Sweep, plot: str | None) -> None:
    """How the differences from exact shrink."""
    ratios, largest = differences(sweep)
    times = sweep.probe_times
    for kind, found in largest.items():
        print(f"largest |phi exact - phi {kind}| of the four rods, rad")
        print("    ratio" + "".join(f"   t = {t:g} s".rjust(13) for t in times) + "   mean of the times")
        for ratio, row in zip(ratios, found, strict=True):
            print(f"{ratio:9.3f}" + "".join(f"{value:13.3g}" for value in row) + f"{row.mean():13.3g}")
        high = ratios >= 8
        slope = np.polyfit(np.log(ratios[high]), np.log(found[high].mean(axis=1)), 1)[0]
        print(f"from ratio 8 on the mean falls like ratio^{slope:.2f}")
    if plot:
        figure, ((axes,),) = style.new_figure(width=0.7 * style.WIDTH, height=3.6)
        for i, (kind, found) in enumerate(largest.items()):
            axes.loglog(ratios, found.mean(axis=1), label=f"exact − {kind}, mean of {len(times)} times", **style.mark_style(i, ratios.size))
        axes.set(xlabel="total node mass / total rod mass", ylabel=r"largest $|\Delta\varphi|$ of the rods [rad]")
        style.legend_below(figure, [axes])
        style.save(figure, plot)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", choices=["table1", "table2", "table3", "figure5"])
    parser.add_argument("file")
    parser.add_argument("--plot", help="picture of figure 5")
    arguments = parser.parse_args()
    try:
        with open_sweep(arguments.file) as sweep:
            if arguments.study == "table1":
                print_times(sweep, [1])
            elif arguments.study == "table2":
                print_times(sweep, [30, 60, 120, 240])
            elif arguments.study == "table3":
                table_3(sweep)
            else:
                figure_5(sweep, arguments.plot)
    except (OSError, DataError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
