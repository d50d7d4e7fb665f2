#!/usr/bin/env python3
"""Plot quantities of a sweep against one of its axes; other axes become lines, failed cases are marked.

    postproc/sweep_lines.py results/table3 --quantity "phi(1)" displacement_x --axis mass_ratio
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

MOST_LINES = 14


def plot(file: str | pathlib.Path, out: str | pathlib.Path, quantities: Sequence[str] = (), axis: str | None = None,
         where: Mapping[str, Any] | None = None, time: float | None = None) -> Figure:
    """One panel per quantity. By default angles of the first and last rod, or frequencies, against the longest axis of numbers."""
    with open_sweep(file) as sweep:
        names = quantities or default_quantities(sweep)
        figure = draw(sweep, names, axis or default_axis(sweep), where or {}, time)
    style.save(figure, out)
    return figure


def default_quantities(sweep: Sweep) -> list[str]:
    found = sweep.states() or sweep.frequencies()
    if not found:
        raise DataError(f"{sweep.path}: neither states nor frequencies; say with --quantity what to plot")
    return found


def default_axis(sweep: Sweep) -> str:
    """The axis of numbers with the most values."""
    numbers = [name for name, values in sweep.axes.items() if values.dtype.kind in "fiu"]
    if not sweep.axes:
        raise DataError(f"{sweep.path}: the sweep has no axes")
    return max(numbers or sweep.axes, key=lambda name: (len(distinct(sweep.axes[name])), name != "solver.atol"))


def count(sweep: Sweep, axis: str) -> int:
    """How many lines all cases make over this axis."""
    return len(sweep.split([axis], {})[1])


def draw(sweep: Sweep, quantities: Sequence[str], axis: str, where: Mapping[str, Any], time: float | None) -> Figure:
    columns = min(2, len(quantities))
    rows = -(-len(quantities) // columns)
    figure, grid = style.new_figure(rows, columns, height=0.9 + 2.5 * rows)
    figure.suptitle(heading(sweep, quantities, time, where))
    for axes, name in zip(grid.flat, quantities, strict=False):
        draw_panel(axes, sweep, name, axis, where, time)
    for axes in grid.flat[len(quantities):]:
        axes.set_visible(False)
    style.legend_below(figure, grid.flat[: len(quantities)])
    return figure


def draw_panel(axes: Axes, sweep: Sweep, name: str, axis: str, where: Mapping[str, Any], time: float | None) -> None:
    found = sweep.series(name, [axis], where, time)
    if len(found) > MOST_LINES:
        others = ", ".join(found[0].where)
        raise DataError(f"{sweep.path}: {len(found)} lines are too many for one picture; fix some of {others} by --where")
    place = Places(axes, sweep, axis)
    failed: list[float] = []
    for i, series in enumerate(found):
        x = place.of(sweep.axis(axis)[series.cases])
        order = np.argsort(x, kind="stable")
        axes.plot(x[order], series.quantity.values[order], label=series.label or None, **style.mark_style(i, x.size))
        failed.extend(x[sweep.failed[series.cases]])
    mark_failed(axes, failed, int(sweep.chosen(where).sum()))
    quantity = found[0].quantity
    axes.set(xlabel=sweep.axis_label(axis), ylabel=quantity.label)
    axes.set_title(quantity.meaning, loc="left")


class Places:
    """Where the values of an axis stand: numbers at themselves, texts one beside another."""

    def __init__(self, axes: Axes, sweep: Sweep, axis: str):
        values = sweep.axis(axis)
        self.texts: list[str] | None = None
        if values.dtype.kind not in "fiu":
            self.texts = distinct(values)
            axes.set_xticks(range(len(self.texts)), self.texts)
            axes.set_xlim(-0.5, len(self.texts) - 0.5)
            return
        numbers = np.array(distinct(values), dtype=float)
        if is_logarithmic(numbers):
            axes.set_xscale("log", base=2 if is_powers_of_two(numbers) else 10)
            if numbers.size <= 8:
                axes.set_xticks(numbers, [style.number_text(v) for v in numbers])
                axes.minorticks_off()

    def of(self, values: np.ndarray) -> np.ndarray:
        if self.texts is None:
            return values.astype(float)
        return np.array([self.texts.index(str(v)) for v in values], dtype=float)


def is_logarithmic(numbers: np.ndarray) -> bool:
    """True if a log axis serves these distinct rising numbers better."""
    if numbers.size < 3 or numbers[0] <= 0 or numbers[-1] / numbers[0] < 8:
        return False
    return np.ptp(np.diff(np.log(numbers))) < np.ptp(np.diff(numbers)) / np.mean(np.diff(numbers)) * np.mean(np.diff(np.log(numbers)))


def is_powers_of_two(numbers: np.ndarray) -> bool:
    return numbers.size <= 8 and bool(np.all(np.mod(np.log2(numbers), 1) == 0))


def mark_failed(axes: Axes, x: Sequence[float], total: int) -> None:
    """A cross at the lower edge of the axes for each failed case."""
    if not len(x):
        return
    axes.plot(x, np.full(len(x), 0.03), transform=axes.get_xaxis_transform(), linestyle="none", marker="x", markersize=7,
              markeredgewidth=1.8, color=style.FAILED, clip_on=False, zorder=5, label=f"failed: {len(x)} of {total} cases")


def probe_text(sweep: Sweep, time: float | None) -> str:
    t = sweep.probe_times[sweep.probe(time)]
    return "" if np.isnan(t) else f"t = {t:g} s"


def heading(sweep: Sweep, names: Sequence[str], time: float | None, where: Mapping[str, Any], width: int = 60) -> str:
    """Title of the sweep, probe time if a quantity depends on it, fixed axes."""
    parts = [style.shorten(sweep.title, width), probe_text(sweep, time) if any(map(sweep.is_probed, names)) else ""]
    return ", ".join(part for part in parts if part) + where_text(where)


def where_text(where: Mapping[str, Any]) -> str:
    return "".join(f", {name.rpartition('.')[2]} = {value}" for name, value in where.items())


def main() -> int:
    parser = command.parser(__doc__, "sweep file, or its directory")
    parser.add_argument("-q", "--quantity", nargs="+", default=[], metavar="Q", help='such as "phi(4)", displacement_x, "frequency(2)", n_rhs')
    parser.add_argument("-a", "--axis", help="such as mass_ratio")
    command.add_where(parser)
    arguments = parser.parse_args()
    out = command.default_out(arguments, "lines")
    return command.finish(
        lambda: plot(arguments.file, out, arguments.quantity, arguments.axis, dict(arguments.where), arguments.time)
    )


if __name__ == "__main__":
    sys.exit(main())
