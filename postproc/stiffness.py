#!/usr/bin/env python3
"""Where which method wins: fastest method over bending stiffness and dampers, a panel per n and tolerance.

    postproc/stiffness.py stiffness.h5

The number in a field is how many times as fast the fastest method is as the explicit one. Only runs count whose chord
angles are within 30 rtol. A ring marks the method of `auto`: filled where it is within 1.5 of the fastest.
"""

from __future__ import annotations

import pathlib
import sys

import command
import numpy as np
import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from rodyn_data import read_stiffness

ACCEPTED = 30.0  # error of the chord angles over rtol
LIMIT = 1.5      # of auto over the best
EXPLICIT = 1     # method number of the explicit method


def plot(file: str | pathlib.Path, out: str | pathlib.Path) -> Figure:
    methods, runs = read_stiffness(file)
    sizes, tolerances = np.unique(runs["n"]), np.unique(runs["rtol"])[::-1]
    figure, grid = style.new_figure(len(sizes), len(tolerances), height=0.9 + 1.6 * len(sizes), sharex=True, sharey=True)
    for row, n in zip(grid, sizes, strict=True):
        for axes, rtol in zip(row, tolerances, strict=True):
            chosen = (runs["n"] == n) & (runs["rtol"] == rtol)
            draw_panel(axes, {name: column[chosen] for name, column in runs.items()}, rtol)
            axes.set_title(f"n = {n:.0f}, rtol = {style.power_text(rtol)}", loc="left")
    for axes in grid[-1]:
        axes.set_xlabel("factor of $EI$")
    for axes in grid[:, 0]:
        axes.set_ylabel("factor of $D$")
    figure.legend([Patch(color=colour(i)) for i in range(len(methods))], [name_of(m) for m in methods],
                  loc="outside lower center", ncols=len(methods))
    style.save(figure, out)
    return figure


def name_of(method: str) -> str:
    return method if " " not in method else f"{method.split()[0]}, order {method.split()[1]}"


def colour(i: int) -> str:
    return ["#DDDDDD", "#E69F00", "#56B4E9", "#7FC8A9"][i % 4]


def scenes(runs: dict[str, np.ndarray]) -> list[tuple[float, float, np.ndarray]]:
    """Each bending and damper factor with the indices of its runs."""
    pairs = np.unique(np.stack([runs["bending_factor"], runs["damper_factor"]], axis=1), axis=0)
    return [(x, y, np.flatnonzero((runs["bending_factor"] == x) & (runs["damper_factor"] == y))) for x, y in pairs]


def best_of(runs: dict[str, np.ndarray], rows: np.ndarray, rtol: float, cost: str = "seconds") -> int:
    """Row of the cheapest run that is accurate enough; of the cheapest if none is."""
    accurate = rows[runs["error_phi"][rows] <= ACCEPTED * rtol]
    rows = accurate if accurate.size else rows
    return int(rows[np.argmin(runs[cost][rows])])


def draw_panel(axes: Axes, runs: dict[str, np.ndarray], rtol: float) -> None:
    x_values, y_values = np.unique(runs["bending_factor"]), np.unique(runs["damper_factor"])
    for x, y, rows in scenes(runs):
        best = best_of(runs, rows, rtol)
        i, j = np.searchsorted(x_values, x), np.searchsorted(y_values, y)
        axes.fill_between([i - 0.5, i + 0.5], j - 0.5, j + 0.5, color=colour(round(runs["method"][best]) - 1), linewidth=0)
        explicit = rows[runs["method"][rows] == EXPLICIT]
        gain = runs["seconds"][explicit[0]] / runs["seconds"][best]
        axes.text(i, j + 0.12, f"{gain:.3g}" if gain < 1000 else f"{gain:.0f}", ha="center", va="center", fontsize=7)
        auto = rows[runs["auto"][rows] == 1]
        if auto.size:
            near = runs["seconds"][auto[0]] <= LIMIT * runs["seconds"][best]
            axes.plot(i, j - 0.28, "o", markersize=4, color="black", fillstyle="full" if near else "none")
    axes.grid(False)
    axes.set(xlim=(-0.5, len(x_values) - 0.5), ylim=(-0.5, len(y_values) - 0.5))
    axes.set_xticks(range(len(x_values)), [style.power_text(v) for v in x_values])
    axes.set_yticks(range(len(y_values)), [style.power_text(v) for v in y_values])


def main() -> int:
    parser = command.parser(__doc__, "file of tools/bench stiffness")
    arguments = parser.parse_args()
    return command.finish(lambda: plot(arguments.file, command.default_out(arguments, "stiffness")))


if __name__ == "__main__":
    sys.exit(main())
