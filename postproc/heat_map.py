#!/usr/bin/env python3
"""Map a quantity of a sweep over two of its axes; failed cases are crossed out.

    postproc/heat_map.py results/grid --quantity "phi(4)" --axes mass_ratio "chain.hinge_stiffness(0)"
"""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import command
import numpy as np
import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rodyn_data import DataError, Sweep, distinct, open_sweep
from sweep_lines import default_quantities, heading


def plot(file: str | pathlib.Path, out: str | pathlib.Path, quantity: str | None = None, axes: Sequence[str] = (),
         where: Mapping[str, Any] | None = None, time: float | None = None) -> Figure:
    """By default the last rod's angle, or a frequency, over the two axes with the most values."""
    with open_sweep(file) as sweep:
        figure = draw(sweep, quantity or default_quantity(sweep), axes or default_axes(sweep), where or {}, time)
    style.save(figure, out)
    return figure


def default_quantity(sweep: Sweep) -> str:
    return sweep.states()[-1] if sweep.states() else default_quantities(sweep)[0]


def default_axes(sweep: Sweep) -> list[str]:
    changing = [name for name, values in sweep.axes.items() if len(distinct(values)) > 1]
    if len(changing) < 2:
        raise DataError(f"{sweep.path}: a map needs two axes that change; it has {', '.join(changing) or 'none'}")
    return sorted(changing, key=lambda name: -len(distinct(sweep.axes[name])))[:2]


def draw(sweep: Sweep, name: str, names: Sequence[str], where: Mapping[str, Any], time: float | None) -> Figure:
    found = sweep.series(name, names, where, time)
    if len(found) > 1:
        raise DataError(f"{sweep.path}: more than two axes change; fix {', '.join(found[0].where)} by --where")
    cases, quantity = found[0].cases, found[0].quantity
    values = [distinct(sweep.axis(n)[cases]) for n in names]
    column, row = (np.array([values[i].index(v.item() if v.dtype.kind in "fiu" else str(v)) for v in sweep.axis(n)[cases]])
                   for i, n in enumerate(names))
    picture = np.full((len(values[1]), len(values[0])), np.nan)
    picture[row, column] = quantity.values

    figure, grid = style.new_figure(width=0.85 * style.WIDTH, height=4.2)
    axes = grid[0, 0]
    meaning = quantity.meaning[:1].upper() + quantity.meaning[1:]
    figure.suptitle(f"{meaning}: {heading(sweep, [name], time, where, 40)}")
    axes.grid(False)
    signed = np.nanmin(picture, initial=0.0) < 0 < np.nanmax(picture, initial=0.0)
    mesh = axes.pcolormesh(np.arange(len(values[0]) + 1) - 0.5, np.arange(len(values[1]) + 1) - 0.5, np.ma.masked_invalid(picture),
                           cmap=style.SEQUENCE, edgecolors="white" if picture.size <= 400 else "none", linewidth=0.4)
    bar = figure.colorbar(mesh, ax=axes, label=quantity.label)
    if signed and picture.size > 16 and np.isfinite(picture).sum() > 4 and min(picture.shape) > 2:
        zero = axes.contour(np.ma.masked_invalid(picture), levels=[0.0], colors="white", linestyles="--", linewidths=0.9)
        bar.add_lines(zero)
        bar.set_label(f"{quantity.label}; dashed line: zero")
    ticks(axes.xaxis, values[0])
    ticks(axes.yaxis, values[1])
    axes.set(xlabel=sweep.axis_label(names[0]), ylabel=sweep.axis_label(names[1]))
    cross_out(axes, column[sweep.failed[cases]], row[sweep.failed[cases]], cases.size)
    return figure


def ticks(axis, values: Sequence[Any]) -> None:
    """At most ten labels at the middle of their cells."""
    every = max(1, -(-len(values) // 10))
    shown = list(range(0, len(values), every))
    axis.set_ticks(shown, [values[i] if isinstance(values[i], str) else style.number_text(values[i]) for i in shown])


def cross_out(axes: Axes, column: np.ndarray, row: np.ndarray, total: int) -> None:
    if not column.size:
        return
    axes.plot(column, row, linestyle="none", marker="x", color=style.FAILED, markersize=8, markeredgewidth=1.8,
              label=f"failed: {column.size} of {total} cases")
    style.legend_above(axes)


def main() -> int:
    parser = command.parser(__doc__, "sweep file, or its directory")
    parser.add_argument("-q", "--quantity", metavar="Q", help='such as "phi(4)"')
    parser.add_argument("-a", "--axes", nargs=2, default=[], metavar=("X", "Y"))
    command.add_where(parser)
    arguments = parser.parse_args()
    out = command.default_out(arguments, "map")
    return command.finish(
        lambda: plot(arguments.file, out, arguments.quantity, arguments.axes, dict(arguments.where), arguments.time)
    )


if __name__ == "__main__":
    sys.exit(main())
