#!/usr/bin/env python3
"""The article's studies from their sweep files, beside the article's numbers.

    python postproc/studies.py table1|table2|table3|figure5 SWEEP.h5 [--plot FILE.png]
"""

import argparse
import sys

import numpy as np
import xarray

PHI_4 = {1: 0.491356055226, 30: 0.01360950381, 60: 0.48224726060, 120: -0.22652528471, 240: 0.50494415485}
ALPHA_1_RATE = {1: 0.394155296535, 30: -0.3051786, 60: -1.0107406, 120: -0.5632104, 240: 0.4811614}
ARTICLE_PHI_4 = {1: "0.49135614", 30: "0.01361031 to 0.01361079", 60: "0.48224758 to 0.48224818",
                 120: "-0.22652622 to -0.22652627", 240: "0.50494062 to 0.50494089"}
ARTICLE_ALPHA_1_RATE = {1: "0.39531 to 0.39535", 30: "-0.29849 to -0.29895", 60: "-1.01004 to -1.01022",
                        120: "-0.56372 to -0.56379", 240: "0.48113 to 0.48115"}
ARTICLE_TABLE_3 = {  # exact and lumped: phi_1, phi_4 [deg], u_x [m], theta [rad]
    2: ((-16.436, 21.920, 0.194, 4.046), (-18.122, 17.160, 0.192, 4.040)),
    4: ((14.277, 22.652, 0.258, 2.240), (13.212, 20.339, 0.246, 2.255)),
    8: ((-60.441, -142.412, 0.104, 3.611), (-60.982, -142.663, 0.103, 3.627)),
    16: ((-44.534, -180.568, 0.354, 2.849), (-44.189, -180.659, 0.355, 2.844)),
    32: ((-39.314, -177.633, 0.627, 1.894), (-38.930, -177.281, 0.629, 1.887)),
}
HINGES = np.array([7000.0, 5000.0, 5000.0, 5000.0])  # N m/rad, table 3


def parameter_columns(sweep: xarray.Dataset) -> list[str]:
    """The axes that have more than one value."""
    return [name for name in sweep if name.startswith("param_") and len(np.unique(sweep[name])) > 1]


def print_times(sweep: xarray.Dataset, times: list[int]) -> None:
    """Tables 1 and 2: phi_4 and alpha_1' at given times."""
    names = parameter_columns(sweep)
    for t in times:
        state = sweep.sel(probe_time=t)
        print(f"t = {t} s: reference phi_4 {PHI_4[t]:.12f} rad, alpha_1' {ALPHA_1_RATE[t]:.10g} rad/s; "
              f"the article {ARTICLE_PHI_4[t]}, {ARTICLE_ALPHA_1_RATE[t]}")
        print("  ".join(f"{name.removeprefix('param_'):>17}" for name in names), f"{'phi_4, rad':>17}{'error':>10}",
              f"{'alpha_1, rad/s':>16}{'error':>10}{'n_rhs':>10}")
        for i in range(sweep.sizes["case"]):
            phi, rate = float(state.phi[i, 3]), float(state.alpha_rate[i, 0])
            if np.isnan(phi):
                continue
            print("  ".join(f"{sweep[name].values[i]!s:>17.17}" for name in names),
                  f"{phi:17.12f}{phi - PHI_4[t]:10.1e} {rate:15.10f}{rate - ALPHA_1_RATE[t]:10.1e}{int(sweep.n_rhs[i]):10d}")


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
            theirs = ARTICLE_TABLE_3[int(ratio)][kind]
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
