#!/usr/bin/env python3
"""The article's studies from their sweep files, beside the article's numbers.

    python postproc/studies.py table1|table2|table3|figure5 SWEEP.h5 [--plot FILE.png]
"""

import argparse
import sys

import numpy as np
import xarray
from article import TABLE_3, printed, range_text

HINGES = np.array([7000.0, 5000.0, 5000.0, 5000.0])  # N m/rad, table 3


def parameter_columns(sweep: xarray.Dataset) -> list[str]:
    """The axes that have more than one value."""
    return [name for name in sweep if name.startswith("param_") and len(np.unique(sweep[name])) > 1]


def print_times(sweep: xarray.Dataset, times: list[int]) -> None:
    """Tables 1 and 2: phi_4 and alpha_1' at given times."""
    names = parameter_columns(sweep)
    for t in times:
        state = sweep.sel(probe_time=t)
        angle, slope_rate = printed("phi(4)", t), printed("alpha_rate(1)", t)
        true_phi, true_rate = float(angle.reference), float(slope_rate.reference)
        print(f"t = {t} s: reference phi_4 {true_phi:.12f} rad, alpha_1' {true_rate:.10g} rad/s; "
              f"the article {range_text(angle)}, {range_text(slope_rate)}")
        print("  ".join(f"{name.removeprefix('param_'):>17}" for name in names), f"{'phi_4, rad':>17}{'error':>10}",
              f"{'alpha_1, rad/s':>16}{'error':>10}{'n_rhs':>10}")
        for i in range(sweep.sizes["case"]):
            phi, rate = float(state.phi[i, 3]), float(state.alpha_rate[i, 0])
            if np.isnan(phi):
                continue
            print("  ".join(f"{sweep[name].values[i]!s:>17.17}" for name in names),
                  f"{phi:17.12f}{phi - true_phi:10.1e} {rate:15.10f}{rate - true_rate:10.1e}{int(sweep.n_rhs[i]):10d}")


def pairs(sweep: xarray.Dataset) -> tuple[np.ndarray, xarray.Dataset, xarray.Dataset]:
    """Mass ratios, and the exact and the lumped cases, in the same order."""
    kind = sweep["param_model.inertia"].values
    exact = sweep.isel(case=np.flatnonzero(kind == "distributed"))
    lumped = sweep.isel(case=np.flatnonzero(kind == "lumped"))
    assert np.array_equal(exact.param_mass_ratio, lumped.param_mass_ratio)
    return exact.param_mass_ratio.values, exact, lumped


def hinge_energy(state: xarray.Dataset) -> float:
    """Energy of the hinges, J, if the slopes at the hinges are zero (they are not given in the article)."""
    phi = state.phi.values + 0.0
    alpha, beta = state.alpha.values, state.beta.values
    angle = np.diff(np.concatenate([[0.0], phi])) + alpha - np.concatenate([[0.0], beta[:-1]])
    return float(0.5 * (HINGES * angle**2).sum())


def table_3(sweep: xarray.Dataset) -> None:
    """phi_1, phi_4, u_x, theta at t = 1 s, ours and the article's, and the energy that the hinges hold."""
    ratios, exact, lumped = pairs(sweep)
    print(" ratio   phi_1, deg      phi_4, deg        u_x, m          theta, rad      hinges, J   | the article's; hinges, J")
    for i, ratio in enumerate(ratios):
        for kind, cases in enumerate((exact, lumped)):
            state = cases.isel(case=i, probe_time=-1)
            phi = np.degrees(state.phi.values)
            theirs = [float(text) for text in TABLE_3[int(ratio)][kind]]
            # only phi_1 and phi_4 are printed: at least C_0 phi_1^2 / 2, and the rest shared by three equal hinges
            bend = np.radians(theirs[1] - theirs[0])
            least = 0.5 * HINGES[0] * np.radians(theirs[0]) ** 2 + 0.5 * HINGES[1] * bend**2 / 3
            print(f"{ratio:6g} {'exact ' if kind == 0 else 'lumped'}{phi[0]:10.3f}{phi[3]:15.3f}"
                  f"{float(state.displacement_x):14.4f}{float(state.rotation):17.4f}{hinge_energy(state):13.0f}     | "
                  + "".join(f"{value:10.3f}" for value in theirs) + f"{least:9.0f}")


def differences(sweep: xarray.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Mass ratios, and the largest |exact - lumped| of the four chord angles at each probe time, rad."""
    ratios, exact, lumped = pairs(sweep)
    return ratios, np.abs(exact.phi.values - lumped.phi.values).max(axis=2)


def figure_5(sweep: xarray.Dataset, plot: str | None) -> None:
    """How exact - lumped shrinks."""
    ratios, largest = differences(sweep)
    times = sweep.probe_time.values
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
    with xarray.open_dataset(arguments.file) as sweep:
        if arguments.study == "table1":
            print_times(sweep, [1])
        elif arguments.study == "table2":
            print_times(sweep, [30, 60, 120, 240])
        elif arguments.study == "table3":
            table_3(sweep)
        else:
            figure_5(sweep, arguments.plot)
    return 0


if __name__ == "__main__":
    sys.exit(main())
