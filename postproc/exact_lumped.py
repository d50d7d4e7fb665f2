#!/usr/bin/env python3
"""Plot distributed against lumped inertia over an axis of a sweep, and their difference (the article's figure 5, table 3).

    postproc/exact_lumped.py results/table3 --axis mass_ratio
"""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import command
import numpy as np
import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rodyn_data import DataError, Quantity, Sweep, open_sweep, text_of
from sweep_lines import Places, default_axis, default_quantities, heading, mark_failed

INERTIA = "model.inertia"
KINDS = ("distributed", "lumped")


class Pair(NamedTuple):
    """Both kinds of inertia at the same values of an axis; NaN where one of them has no result."""

    x: np.ndarray  # the axis, rising
    exact: Quantity
    lumped: Quantity
    failed: list[float]  # axis values of cases without result

    @property
    def difference(self) -> np.ndarray:
        return self.exact.values - self.lumped.values


def plot(file: str | pathlib.Path, out: str | pathlib.Path, quantities: Sequence[str] = (), axis: str | None = None,
         where: Mapping[str, Any] | None = None, time: float | None = None) -> Figure:
    """A column of two panels per quantity; by default those of the article's table 3."""
    with open_sweep(file) as sweep:
        figure = draw(sweep, quantities or table_3_quantities(sweep), axis, where or {}, time)
    style.save(figure, out)
    return figure


def table_3_quantities(sweep: Sweep) -> list[str]:
    return [*sweep.states(), "displacement_x", "rotation"] if sweep.n_rods else default_quantities(sweep)


def pair_up(sweep: Sweep, name: str, axis: str | None, where: Mapping[str, Any], time: float | None) -> tuple[str, Pair]:
    """The axis, and the pair of lines."""
    kinds = sweep.axis(INERTIA)
    axis = axis or default_axis(sweep)
    lines = {}
    for kind in KINDS:
        if kind not in kinds:
            raise DataError(f"{sweep.path}: no case with {INERTIA} = '{kind}'")
        found = sweep.series(name, [axis], dict(where) | {INERTIA: kind}, time)
        # Whatever changes together with the inertia ('bending', say) does not split its cases.
        if len(found) > 1:
            raise DataError(f"{sweep.path}: fix {', '.join(found[0].where)} by --where")
        lines[kind] = found[0]
    values = sweep.axis(axis)
    x = sorted({text_of(v) for line in lines.values() for v in values[line.cases]})
    aligned, failed = {}, []
    for kind, line in lines.items():
        column = np.full(len(x), np.nan)
        for case, value in zip(line.cases, line.quantity.values, strict=True):
            column[x.index(text_of(values[case]))] = value
            if sweep.failed[case]:
                failed.append(text_of(values[case]))
        aligned[kind] = line.quantity._replace(values=column)
    return axis, Pair(np.array(x), aligned["distributed"], aligned["lumped"], failed)


def draw(sweep: Sweep, names: Sequence[str], axis: str | None, where: Mapping[str, Any], time: float | None) -> Figure:
    columns = min(2, len(names))
    rows = -(-len(names) // columns)
    figure, grid = style.new_figure(2 * rows, columns, width=style.WIDTH * (1.0 if columns > 1 else 0.6), height=0.8 + 3.6 * rows)
    figure.suptitle(f"Exact and lumped inertia: {heading(sweep, names, time, where, 24 * columns)}")
    total = int(sweep.chosen(where).sum())
    for i, name in enumerate(names):
        axis, pair = pair_up(sweep, name, axis, where, time)
        top, bottom = grid[2 * (i // columns):, i % columns][:2]
        places = Places(top, sweep, axis)
        Places(bottom, sweep, axis)
        x = places.of(pair.x)
        top.plot(x, pair.exact.values, label="exact", **style.mark_style(0, x.size))
        top.plot(x, pair.lumped.values, label="lumped", **style.mark_style(2, x.size))
        failed = places.of(np.array(pair.failed)) if pair.failed else []
        mark_failed(top, failed, total)
        top.set(ylabel=pair.exact.label)
        top.set_title(pair.exact.meaning, loc="left")
        draw_difference(bottom, x, pair, failed)
        bottom.set(xlabel=sweep.axis_label(axis))
    for axes in grid[:, -1][2 * (len(names) // columns):]:
        axes.set_visible(False)
    style.legend_below(figure, grid.flat)
    return figure


def draw_difference(axes: Axes, x: np.ndarray, pair: Pair, failed: Sequence[float]) -> None:
    """Its size, on a log axis."""
    size = np.abs(pair.difference)
    size[size == 0] = np.nan
    axes.set_ylabel("|exact − lumped|" + (f" [{pair.exact.unit}]" if pair.exact.unit else ""))
    if np.all(np.isnan(size)):
        style.note(axes, "no difference")
        return
    axes.semilogy(x, size, **style.mark_style(1, x.size))
    mark_failed(axes, failed, 0)
    axes.lines[-1].set_label("_nolegend_" if len(failed) else "|exact − lumped|")
    style.log_labels(axes.yaxis)


def main() -> int:
    parser = command.parser(__doc__, "sweep file, or its directory")
    parser.add_argument("-q", "--quantity", nargs="+", default=[], metavar="Q", help="default: phi of first and last rod, u_x, rotation")
    parser.add_argument("-a", "--axis", help="such as mass_ratio")
    command.add_where(parser)
    arguments = parser.parse_args()
    out = command.default_out(arguments, "exact-lumped")
    return command.finish(
        lambda: plot(arguments.file, out, arguments.quantity, arguments.axis, dict(arguments.where), arguments.time)
    )


if __name__ == "__main__":
    sys.exit(main())
