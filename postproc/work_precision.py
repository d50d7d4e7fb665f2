#!/usr/bin/env python3
"""Work-precision diagrams from a benchmark file: time of computation against error, one line per method; other programs' marks are open.

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
    """A row of panels per scene, a panel per error."""
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
    columns = max(len(scene.errors) for scene in scenes)
    methods = list(dict.fromkeys(method for scene in scenes for method in scene.method))
    figure, grid = style.new_figure(len(scenes), columns, width=style.WIDTH if columns > 1 or len(methods) > 8 else 0.7 * style.WIDTH,
                                    height=0.7 + 2.8 * len(scenes) + 0.1 * len(methods))  # the legend
    figure.suptitle("Work against precision")
    for row, scene in zip(grid, scenes, strict=True):
        for i, axes in enumerate(row):
            if i >= len(scene.errors):
                axes.set_visible(False)
                continue
            label, error = list(scene.errors.values())[i]
            draw_panel(axes, scene, label, error, methods)
    style.legend_below(figure, grid.flat)
    return figure


def draw_panel(axes: Axes, scene: BenchmarkScene, label: str, error: np.ndarray, methods: Sequence[str]) -> None:
    failed = ~(np.isfinite(error) & np.isfinite(scene.seconds) & (error > 0))
    axes.set(xscale="log", yscale="log", xlabel=label, ylabel="wall time [s]")
    axes.set_title(style.shorten(scene.title, 46), loc="left")
    for i, method in enumerate(methods):
        rows = np.flatnonzero((scene.method == method) & ~failed)
        rows = rows[np.lexsort((scene.fixed_step[rows], scene.rtol[rows]))]
        if rows.size:
            fill = {"markerfacecolor": "white"} if scene.foreign[rows[0]] else {}
            axes.plot(error[rows], scene.seconds[rows], label=method, **style.mark_style(i) | fill)
    lost = failed & np.isfinite(scene.seconds)
    if lost.any():
        axes.plot(np.full(lost.sum(), 0.98), scene.seconds[lost], transform=axes.get_yaxis_transform(), linestyle="none", marker="x",
                  markersize=7, markeredgewidth=1.8, color=style.FAILED, label="failed, or without error")
    axes.invert_xaxis()
    style.log_labels(axes.yaxis)


def main() -> int:
    parser = command.parser(__doc__, "benchmark file, docs/postproc.md")
    parser.add_argument("--scene", nargs="+", default=[], help="only these scenes")
    arguments = parser.parse_args()
    return command.finish(lambda: plot(arguments.file, command.default_out(arguments, "work-precision"), arguments.scene))


if __name__ == "__main__":
    sys.exit(main())
