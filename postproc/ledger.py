#!/usr/bin/env python3
"""Plot the ledger of a run: energies, the residual of their balance, momenta.

    postproc/ledger.py example.h5
"""

from __future__ import annotations

import pathlib
import sys

import command
import numpy as np
import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rodyn_data import Run, open_run

ENERGIES = {"energy_kinetic": "kinetic", "energy_elastic": "elastic", "energy_dissipated": "dissipated", "work_external": "work"}


def plot(file: str | pathlib.Path, out: str | pathlib.Path) -> Figure:
    with open_run(file) as run:
        figure = draw(run)
    style.save(figure, out)
    return figure


def draw(run: Run) -> Figure:
    energies = [run.quantity(name) for name in ENERGIES]
    residual = run.quantity("energy_residual")
    momenta = [run.quantity(name) for name in ("momentum_x", "momentum_y")]
    angular = run.quantity("angular_momentum")
    time = run.time
    figure, grid = style.new_figure(2, 2, sharex=True)
    figure.suptitle("Ledger: " + style.shorten(run.title, 68) + style.status_suffix(run.status, time[-1]))
    lines(grid[0, 0], time, [q._replace(symbol=ENERGIES[q.name]) for q in energies])
    grid[0, 0].set(ylabel=f"energy [{energies[0].unit}]")
    grid[0, 0].set_title("energies", loc="left")
    style.legend_above(grid[0, 0], ncols=2)
    draw_residual(grid[0, 1], run, time, residual.values, residual.unit, max(np.max(np.abs(q.values)) for q in energies))
    lines(grid[1, 0], time, momenta)
    grid[1, 0].set(ylabel=f"{momenta[0].symbol}, {momenta[1].symbol} [{momenta[0].unit}]")
    grid[1, 0].set_title("linear momentum, inertial axes", loc="left")
    style.legend_above(grid[1, 0])
    lines(grid[1, 1], time, [angular])
    grid[1, 1].set(ylabel=angular.label)
    grid[1, 1].set_title("angular momentum, inertial origin", loc="left")
    for axes in grid.flat:
        style.time_axis(axes)
    return figure


def lines(axes: Axes, time: np.ndarray, quantities: list) -> None:
    for i, quantity in enumerate(quantities):
        axes.plot(*style.envelope(time, quantity.values), label=quantity.symbol, **style.line_style(i))


def draw_residual(axes: Axes, run: Run, time: np.ndarray, residual: np.ndarray, unit: str, scale: float) -> None:
    """Its size on a log axis; zeros cannot be shown there."""
    size = np.where(residual == 0, np.nan, np.abs(residual))
    axes.set_ylabel(f"|residual| [{unit}]")
    paper = run.group("model").get("formulation") == "paper" if "resolved_input" in run.file.attrs else False
    axes.set_title("residual: energy is not exact in 'paper'" if paper else "residual of the energy balance", loc="left")
    if np.all(np.isnan(size)):
        style.note(axes, "zero at all times")
        return
    axes.semilogy(*style.envelope(time, size), **style.line_style(0))
    if scale > 0:
        low, high = np.nanmin(size), max(np.nanmax(size), scale)
        axes.axhline(scale, **style.line_style(1) | {"linewidth": 0.9})
        axes.annotate("largest energy", (0.98, scale), xycoords=("axes fraction", "data"), xytext=(0, -3),
                      textcoords="offset points", ha="right", va="top", fontsize=8, color=style.COLOURS[1])
        axes.set_ylim(max(low, 1e-18 * high) / 3, high * 5)


def main() -> int:
    parser = command.parser(__doc__)
    arguments = parser.parse_args()
    return command.finish(lambda: plot(arguments.file, command.default_out(arguments, "ledger")))


if __name__ == "__main__":
    sys.exit(main())
