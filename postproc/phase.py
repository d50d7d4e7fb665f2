#!/usr/bin/env python3
"""Phase portraits of a run: a rate against its quantity, or any two quantities against each other.

    postproc/phase.py example.h5                      first and last rod
    postproc/phase.py example.h5 --x "phi(4)" --y omega
"""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Sequence

import command
import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rodyn_data import RATE_OF, DataError, Quantity, Run, open_run, split_name


def plot(file: str | pathlib.Path, out: str | pathlib.Path, x: Sequence[str] = (), y: Sequence[str] = ()) -> Figure:
    """One panel per name in `x`, against the one in `y`, by default its rate."""
    with open_run(file) as run:
        figure = draw(run, pairs(run, x, y))
    style.save(figure, out)
    return figure


def pairs(run: Run, x: Sequence[str], y: Sequence[str]) -> list[tuple[Quantity, Quantity]]:
    names = x or ([f"phi({k})" for k in sorted({1, run.n_rods})])
    others = y or [rate_of(name) for name in names]
    if len(names) != len(others):
        raise DataError(f"{len(names)} quantities for --x, but {len(others)} for --y")
    return [(run.quantity(a), run.quantity(b)) for a, b in zip(names, others, strict=True)]


def rate_of(text: str) -> str:
    name, rod = split_name(text)
    if name not in RATE_OF:
        raise DataError(f"'{text}' has no rate in the file; say with --y what to plot it against")
    return RATE_OF[name] + ("" if rod is None else f"({rod})")


def draw(run: Run, found: Sequence[tuple[Quantity, Quantity]]) -> Figure:
    columns = min(2, len(found))
    rows = -(-len(found) // columns)
    figure, grid = style.new_figure(rows, columns, height=0.6 + 2.9 * rows)
    figure.suptitle("Phase portrait: " + style.shorten(run.title, 64) + style.status_suffix(run.status, run.time[-1]))
    for axes, (x, y) in zip(grid.flat, found, strict=False):
        draw_portrait(axes, x, y)
    for axes in grid.flat[len(found):]:
        axes.set_visible(False)
    return figure


def draw_portrait(axes: Axes, x: Quantity, y: Quantity) -> None:
    rows = style.envelope_rows(x.values, y.values, points=12000)
    axes.plot(x.values[rows], y.values[rows], color=style.COLOURS[1], linestyle="-", linewidth=0.7)
    axes.plot(x.values[:1], y.values[:1], linestyle="none", marker="o", color="black", label="start")
    axes.plot(x.values[-1:], y.values[-1:], linestyle="none", marker="s", color=style.COLOURS[2], label="end")
    axes.set(xlabel=x.label, ylabel=y.label)
    axes.set_title(f"{x.meaning}", loc="left")
    style.legend_above(axes, handlelength=1.0)


def main() -> int:
    parser = command.parser(__doc__)
    parser.add_argument("-x", "--x", nargs="+", default=[], metavar="Q", help='such as "phi(4)"; one panel each')
    parser.add_argument("-y", "--y", nargs="+", default=[], metavar="Q", help="against it (default: its rate)")
    arguments = parser.parse_args()
    return command.finish(lambda: plot(arguments.file, command.default_out(arguments, "phase"), arguments.x, arguments.y))


if __name__ == "__main__":
    sys.exit(main())
