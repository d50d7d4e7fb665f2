#!/usr/bin/env python3
"""Plot quantities of a run against time; by default the motion of the spacecraft in four panels (the article's figure 3).

    postproc/histories.py example.h5
    postproc/histories.py beam.h5 --quantity "phi(1)" "phi(40)" "phi_rate(40)"
"""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Sequence

import command
import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rodyn_data import Event, Quantity, Run, open_run

MOST_MARKS = 200  # events shown
SPACECRAFT = [
    ("velocity, moving axes", ["velocity_x", "velocity_y"]),
    ("angular velocity", ["omega"]),
    ("displacement, moving axes", ["displacement_x", "displacement_y"]),
    ("rotation", ["rotation"]),
]


def plot(file: str | pathlib.Path, out: str | pathlib.Path, quantities: Sequence[str] = ()) -> Figure:
    """Four panels of the spacecraft, or the named quantities, those of one unit together."""
    with open_run(file) as run:
        if quantities:
            panels = by_unit([run.quantity(name) for name in quantities])
        else:
            panels = [(title, [run.quantity(name) for name in names]) for title, names in SPACECRAFT]
        figure = draw(run, panels, "Time histories" if quantities else "Motion of the spacecraft")
    style.save(figure, out)
    return figure


def by_unit(quantities: Sequence[Quantity]) -> list[tuple[str, list[Quantity]]]:
    panels: dict[str, list[Quantity]] = {}
    for quantity in quantities:
        panels.setdefault(quantity.unit, []).append(quantity)
    titles = ("; ".join(dict.fromkeys(q.meaning.split(" (")[0] for q in group)) for group in panels.values())
    return [(style.shorten(title, 110 if len(panels) == 1 else 54), group) for title, group in zip(titles, panels.values(), strict=True)]


def draw(run: Run, panels: Sequence[tuple[str, Sequence[Quantity]]], title: str) -> Figure:
    columns = 2 if len(panels) > 1 else 1
    rows = -(-len(panels) // columns)
    figure, grid = style.new_figure(rows, columns, sharex=True)
    time = run.time
    figure.suptitle(f"{title}: " + style.shorten(run.title, 64) + style.status_suffix(run.status, time[-1]))
    for axes, (title, quantities) in zip(grid.flat, panels, strict=False):
        draw_panel(axes, time, title, quantities)
    mark_events(grid.flat[:len(panels)], run.events())
    for axes in grid.flat[len(panels):]:
        axes.set_visible(False)
    return figure


def mark_events(panels: Sequence[Axes], events: Sequence[Event]) -> None:
    """A thin line at each event, as long as they can be told apart."""
    if len(events) > MOST_MARKS:
        return
    for axes in panels:
        for time in dict.fromkeys(event.time for event in events):
            axes.axvline(time, color="0.6", linewidth=0.6, linestyle=":", zorder=0)


def draw_panel(axes: Axes, time, title: str, quantities: Sequence[Quantity]) -> None:
    for i, quantity in enumerate(quantities):
        axes.plot(*style.envelope(time, quantity.values), label=quantity.symbol, **style.line_style(i))
    symbols = ", ".join(q.symbol for q in quantities) if len(quantities) <= 4 else quantities[0].symbol + ", …"
    axes.set_ylabel(f"{symbols} [{quantities[0].unit}]")
    style.time_axis(axes)
    axes.set_title(title, loc="left")
    if len(quantities) > 1:
        style.legend_above(axes)
    if time.size == 1:
        axes.plot(time, quantities[0].values, "o", color=style.COLOURS[0])


def representative_rods(n: int) -> list[int]:
    """At most four rods that stand for the chain."""
    return sorted({1, max(1, n // 4), max(1, n // 2), n})


def main() -> int:
    parser = command.parser(__doc__)
    parser.add_argument("-q", "--quantity", nargs="+", default=[], metavar="Q", help='such as omega, "phi(4)", energy_kinetic')
    arguments = parser.parse_args()
    out = command.default_out(arguments, "quantities" if arguments.quantity else "histories")
    return command.finish(lambda: plot(arguments.file, out, arguments.quantity))


if __name__ == "__main__":
    sys.exit(main())
