#!/usr/bin/env python3
"""Work-precision diagrams from a benchmark file: time of computation against error, one line per method; other programs' marks are open.
Where models of a beam are compared, a line is a model, and its points are numbers of rods that the beam is cut into.

    postproc/work_precision.py benchmark.h5
"""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Sequence

import command
import numpy as np
import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rodyn_data import BenchmarkScene, DataError, read_benchmark


def plot(file: str | pathlib.Path, out: str | pathlib.Path, scenes: Sequence[str] = ()) -> Figure:
    """A row of panels per scene, a panel per error; models of a beam: a panel per scene."""
    found = read_benchmark(file)
    for name in scenes:
        if name not in [scene.name for scene in found]:
            raise DataError(f"{file}: no scene '{name}'; it has {', '.join(scene.name for scene in found)}")
    figure = draw([scene for scene in found if not scenes or scene.name in scenes])
    style.save(figure, out)
    return figure


def scene_names(file: str | pathlib.Path) -> list[str]:
    """Names of the scenes in a benchmark file."""
    return [scene.name for scene in read_benchmark(file)]


def draw(scenes: Sequence[BenchmarkScene]) -> Figure:
    rows = [[(scene, label, error) for label, error in scene.errors.values()] for scene in scenes]
    beams = all(scene.rods.any() for scene in scenes)
    if beams:
        rows = [[panel for row in rows for panel in row]]
    columns = max(map(len, rows))
    lines = list(dict.fromkeys(line for scene in scenes for line in scene.line))
    figure, grid = style.new_figure(len(rows), columns, width=style.WIDTH if columns > 1 or len(lines) > 8 else 0.7 * style.WIDTH,
                                    height=0.7 + 2.8 * len(rows) + 0.1 * len(lines), sharey=beams)  # the legend
    figure.suptitle("Run time against the error to the beam; numbers: rods that each beam is cut into" if beams else "Work against precision")
    for row, axes_row in zip(rows, grid, strict=True):
        for i, axes in enumerate(axes_row):
            if i < len(row):
                draw_panel(axes, *row[i], lines)
            else:
                axes.set_visible(False)
    if beams:
        for axes in grid[0, 1:]:
            axes.set_ylabel("")
    style.legend_below(figure, grid.flat)
    return figure


def draw_panel(axes: Axes, scene: BenchmarkScene, label: str, error: np.ndarray, lines: Sequence[str]) -> None:
    failed = ~(np.isfinite(error) & np.isfinite(scene.seconds) & (error > 0))
    axes.set(xscale="log", yscale="log", xlabel=label, ylabel="wall time [s]")
    axes.set_title(style.shorten(scene.title, 46), loc="left")
    for i, line in enumerate(lines):
        rows = np.flatnonzero((scene.line == line) & ~failed)
        rows = rows[np.lexsort((scene.fixed_step[rows], scene.rtol[rows], scene.rods[rows]))]
        if rows.size:
            fill = {"markerfacecolor": "white"} if scene.foreign[rows[0]] else {}
            axes.plot(error[rows], scene.seconds[rows], label=line, **style.mark_style(i) | fill)
        for row in {rows[0], rows[-1]} if rows.size and scene.rods.any() else ():
            axes.annotate(f"{scene.rods[row]:.0f}", (error[row], scene.seconds[row]), (4, -2), textcoords="offset points", fontsize=7,
                          color=style.line_style(i)["color"])
    lost = failed & np.isfinite(scene.seconds)
    if lost.any():
        axes.plot(np.full(lost.sum(), 0.98), scene.seconds[lost], transform=axes.get_yaxis_transform(), linestyle="none", marker="x",
                  markersize=7, markeredgewidth=1.8, color=style.FAILED, label="failed, or without error")
    if scene.rods.any():
        axes.margins(x=0.1)  # numbers stand beside the points
    axes.invert_xaxis()
    style.log_labels(axes.yaxis)


def main() -> int:
    parser = command.parser(__doc__, "benchmark file, docs/postproc.md")
    parser.add_argument("--scene", nargs="+", default=[], help="only these scenes")
    arguments = parser.parse_args()
    return command.finish(lambda: plot(arguments.file, command.default_out(arguments, "work-precision"), arguments.scene))


if __name__ == "__main__":
    sys.exit(main())
