#!/usr/bin/env python3
"""The article's studies from their sweep files, beside the article's numbers.

    python postproc/studies.py table1|table2|table3|figure5 SWEEP.h5 [--plot FILE.png]
"""

import argparse
import sys

import numpy as np
from article import TABLE_3, TABLE_3_AXIS, TABLE_3_QUANTITIES, TABLE_3_TIME, printed, range_text
from rodyn_data import DataError, Sweep, distinct, open_sweep

HINGES = np.array([7000.0, 5000.0, 5000.0, 5000.0])  # N m/rad, table 3
N_RODS = HINGES.size


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


def pairs(sweep: Sweep) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass ratios, and the numbers of the exact and of the lumped cases, in the same order."""
    exact = np.flatnonzero(sweep.chosen({"model.inertia": "distributed"}))
    lumped = np.flatnonzero(sweep.chosen({"model.inertia": "lumped"}))
    ratios = sweep.axis(TABLE_3_AXIS)
    if not np.array_equal(ratios[exact], ratios[lumped]):
        raise DataError(f"{sweep.path}: the exact and the lumped cases have other mass ratios")
    return ratios[exact], exact, lumped


def per_rod(sweep: Sweep, name: str, t: float) -> np.ndarray:
    """A state of all four rods at a probe time (case, rod)."""
    return np.stack([sweep.quantity(f"{name}({k})", t).values for k in range(1, N_RODS + 1)], axis=1)


def hinge_energies(sweep: Sweep, t: float) -> np.ndarray:
    """Energy that the hinges of each case hold, J."""
    phi, alpha, beta = (per_rod(sweep, name, t) for name in ("phi", "alpha", "beta"))
    none = np.zeros((len(phi), 1))
    angle = np.diff(phi, axis=1, prepend=none) + alpha - np.hstack([none, beta[:, :-1]])
    return 0.5 * (HINGES * angle**2).sum(axis=1)


def table_3(sweep: Sweep) -> None:
    """phi_1, phi_4, u_x, theta at t = 1 s, ours and the article's, and the energy that the hinges hold."""
    ratios, exact, lumped = pairs(sweep)
    columns = [sweep.quantity(name, TABLE_3_TIME).values for name, _ in TABLE_3_QUANTITIES]
    energy = hinge_energies(sweep, TABLE_3_TIME)
    print(" ratio   phi_1, deg      phi_4, deg        u_x, m          theta, rad      hinges, J   | the article's; hinges, J")
    for row, ratio in enumerate(ratios):
        for kind, cases in enumerate((exact, lumped)):
            i = cases[row]
            phi_1, phi_4, u_x, theta = (column[i] for column in columns)
            theirs = [float(text) for text in TABLE_3[int(ratio)][kind]]
            # only phi_1 and phi_4 are printed: at least C_0 phi_1^2 / 2, and the rest shared by three equal hinges
            bend = np.radians(theirs[1] - theirs[0])
            least = 0.5 * HINGES[0] * np.radians(theirs[0]) ** 2 + 0.5 * HINGES[1] * bend**2 / 3
            print(f"{ratio:6g} {'exact ' if kind == 0 else 'lumped'}{np.degrees(phi_1):10.3f}{np.degrees(phi_4):15.3f}"
                  f"{u_x:14.4f}{theta:17.4f}{energy[i]:13.0f}     | "
                  + "".join(f"{value:10.3f}" for value in theirs) + f"{least:9.0f}")


def differences(sweep: Sweep) -> tuple[np.ndarray, np.ndarray]:
    """Mass ratios, and the largest |exact - lumped| of the four chord angles at each probe time, rad."""
    ratios, exact, lumped = pairs(sweep)
    angles = [per_rod(sweep, "phi", t) for t in sweep.probe_times]
    return ratios, np.stack([np.abs(phi[exact] - phi[lumped]).max(axis=1) for phi in angles], axis=1)


def figure_5(sweep: Sweep, plot: str | None) -> None:
    """How exact - lumped shrinks."""
    ratios, largest = differences(sweep)
    times = sweep.probe_times
    print("largest |phi exact - phi lumped| of the four rods, rad")
    print("    ratio" + "".join(f"   t = {t:g} s".rjust(13) for t in times) + "   mean of the times")
    for ratio, row in zip(ratios, largest, strict=True):
        print(f"{ratio:9.3f}" + "".join(f"{value:13.5f}" for value in row) + f"{row.mean():13.5f}")
    high = ratios >= 8
    slope = np.polyfit(np.log(ratios[high]), np.log(largest[high].mean(axis=1)), 1)[0]
    print(f"from ratio 8 on the mean falls like ratio^{slope:.2f}")
    if plot:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot

        figure, axes = pyplot.subplots(figsize=(7, 4.5))
        for k, t in enumerate(times):
            axes.loglog(ratios, largest[:, k], marker=".", label=f"t = {t:g} s")
        axes.set(xlabel="total node mass / total rod mass", ylabel="largest |phi exact - phi lumped|, rad")
        axes.grid(visible=True, which="both", alpha=0.3)
        axes.legend()
        figure.tight_layout()
        figure.savefig(plot, dpi=120)


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
