#!/usr/bin/env python3
"""Plot distributed against lumped inertia, and condensed rods where there are any, over an axis of a sweep (the article's figure 5, table 3).

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
BENDING = "model.bending"
LINES = {"exact": 0, "condensed": 1, "lumped": 2}  # their styles


class Compared(NamedTuple):
    """All kinds of rods at the same values of an axis; NaN where one of them has no result."""

    x: np.ndarray  # the axis, rising
    lines: dict[str, Quantity]  # exact, condensed, lumped
    failed: list[float]  # axis values of cases without result

    def difference(self, kind: str) -> np.ndarray:
        return self.lines["exact"].values - self.lines[kind].values


def kinds(sweep: Sweep) -> dict[str, dict[str, str]]:
    """The kinds of rods that a sweep has, and by which values on its axes their cases are found."""
    inertia = sweep.axis(INERTIA)
    found = {"exact": {INERTIA: "distributed"}, "lumped": {INERTIA: "lumped"}}
    for place in found.values():
        if place[INERTIA] not in inertia:
            raise DataError(f"{sweep.path}: no case with {INERTIA} = '{place[INERTIA]}'")
    if BENDING in sweep.axes and {"dynamic", "quasistatic"} <= set(sweep.axis(BENDING)[inertia == "distributed"]):
        both = ("exact", "dynamic"), ("condensed", "quasistatic")
        return {kind: {INERTIA: "distributed", BENDING: bending} for kind, bending in both} | {"lumped": found["lumped"]}
    return found


def plot(file: str | pathlib.Path, out: str | pathlib.Path, quantities: Sequence[str] = (), axis: str | None = None,
         where: Mapping[str, Any] | None = None, time: float | None = None) -> Figure:
    """A column of two panels per quantity; by default those of the article's table 3."""
    with open_sweep(file) as sweep:
        figure = draw(sweep, quantities or table_3_quantities(sweep), axis, where or {}, time)
    style.save(figure, out)
    return figure


def table_3_quantities(sweep: Sweep) -> list[str]:
    return [*sweep.states(), "displacement_x", "rotation"] if sweep.n_rods else default_quantities(sweep)


def compare(sweep: Sweep, name: str, axis: str | None, where: Mapping[str, Any], time: float | None) -> tuple[str, Compared]:
    """The axis, and the lines."""
    axis = axis or default_axis(sweep)
    lines = {}
    for kind, place in kinds(sweep).items():
        found = sweep.series(name, [axis], dict(where) | place, time)
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
    return axis, Compared(np.array(x), aligned, failed)


def draw(sweep: Sweep, names: Sequence[str], axis: str | None, where: Mapping[str, Any], time: float | None) -> Figure:
    columns = min(2, len(names))
    rows = -(-len(names) // columns)
    figure, grid = style.new_figure(2 * rows, columns, width=style.WIDTH * (1.0 if columns > 1 else 0.6), height=0.8 + 3.6 * rows)
    figure.suptitle(f"Exact and lumped inertia: {heading(sweep, names, time, where, 24 * columns)}")
    total = int(sweep.chosen(where).sum())
    for i, name in enumerate(names):
        axis, compared = compare(sweep, name, axis, where, time)
        top, bottom = grid[2 * (i // columns):, i % columns][:2]
        places = Places(top, sweep, axis)
        Places(bottom, sweep, axis)
        x = places.of(compared.x)
        for kind, line in compared.lines.items():
            top.plot(x, line.values, label=kind, **style.mark_style(LINES[kind], x.size))
        failed = places.of(np.array(compared.failed)) if compared.failed else []
        mark_failed(top, failed, total)
        top.set(ylabel=compared.lines["exact"].label)
        top.set_title(compared.lines["exact"].meaning, loc="left")
        draw_differences(bottom, x, compared, failed)
        bottom.set(xlabel=sweep.axis_label(axis))
    for axes in grid[:, -1][2 * (len(names) // columns):]:
        axes.set_visible(False)
    style.legend_below(figure, grid.flat)
    return figure


def draw_differences(axes: Axes, x: np.ndarray, compared: Compared, failed: Sequence[float]) -> None:
    """Their sizes, on a log axis."""
    others = [kind for kind in compared.lines if kind != "exact"]
    unit = compared.lines["exact"].unit
    axes.set_ylabel(f"|exact − {others[0]}|" if len(others) == 1 else "difference from exact")
    if unit:
        axes.set_ylabel(f"{axes.get_ylabel()} [{unit}]")
    sizes = {kind: np.where(compared.difference(kind) == 0, np.nan, np.abs(compared.difference(kind))) for kind in others}
    if np.isnan(list(sizes.values())).all():
        style.note(axes, "no difference")
        return
    for kind, size in sizes.items():
        axes.semilogy(x, size, label=f"|exact − {kind}|", **style.mark_style(LINES[kind] + 3, x.size))
    if len(failed):
        mark_failed(axes, failed, 0)
        axes.lines[-1].set_label("_nolegend_")  # it is in the legend already
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
