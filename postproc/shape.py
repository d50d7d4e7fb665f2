#!/usr/bin/env python3
"""Draw spacecraft and chain at given times, bending magnified (the article's figure 4: one time, magnification 25).

    postproc/shape.py example.h5 --times 0.4 --magnification 25
    postproc/shape.py example.h5 --times 0 0.5 1 1.5 2 --frame inertial
"""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Sequence

import command
import numpy as np
import style
from geometry import Shape, limits, shapes
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from rodyn_data import Run, open_run

FRAMES = ("moving", "inertial")


def plot(file: str | pathlib.Path, out: str | pathlib.Path, times: Sequence[float] = (), magnification: float = 1.0,
         frame: str = "moving") -> Figure:
    """Shapes at the rows nearest to `times`; by default at five times spread over the run."""
    with open_run(file) as run:
        figure = draw(run, times, magnification, frame)
    style.save(figure, out)
    return figure


def draw(run: Run, times: Sequence[float], magnification: float, frame: str) -> Figure:
    time = run.time
    rows = np.unique([run.nearest_row(t) for t in (times or np.linspace(time[0], time[-1], 5))])
    found = shapes(run, rows, magnification, frame)
    left, right, bottom, top = limits(found)
    figure, grid = style.new_figure(height=np.clip(1.1 + 5.3 * (top - bottom) / (right - left), 2.4, 6.4))
    axes = grid[0, 0]
    when = f" at t = {found[0].time:.6g} s" if len(found) == 1 else ""
    bending = "rigid rods" if is_rigid(run) else f"bending × {magnification:g}"
    title = style.shorten(run.title, 60) + style.status_suffix(run.status, time[-1])
    axes.set_title(f"{title}\nShape{when}, {frame} frame, {bending}", loc="left")
    colours = style.sequence_colours(len(found))
    radii = node_radii(run)
    if frame == "moving":
        draw_body(axes, found[0], style.GREY)
    for i, shape in enumerate(found):
        if frame == "inertial":
            draw_body(axes, shape, colours[i])
        draw_shape(axes, shape, colours[i], radii, style.DASHES[i % len(style.DASHES)])
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", **axis_names(frame))
    axes.legend(handles=time_handles(found, colours) + mark_handles(radii), loc="center left", bbox_to_anchor=(1.01, 0.5))
    return figure


def axis_names(frame: str) -> dict[str, str]:
    names = ("x", "y") if frame == "moving" else ("X", "Y")
    return {"xlabel": f"${names[0]}$ [m]", "ylabel": f"${names[1]}$ [m]"}


def is_rigid(run: Run) -> bool:
    return run.group("model").get("bending") == "rigid"


def node_radii(run: Run) -> np.ndarray:
    """Sizes of the marks of nodes 1..n [points]: area as the mass, none without mass."""
    mass = run.per_rod("node_mass")
    largest = mass.max(initial=0.0)
    if largest == 0.0:
        return np.zeros(run.n_rods)
    return (7.0 if run.n_rods <= 12 else 3.5) * np.sqrt(mass / largest)


def draw_body(axes: Axes, shape: Shape, colour) -> None:
    """The spacecraft as a square with its centre of mass; a fixed one as a small block at the hinge."""
    if shape.body.size:
        axes.add_patch(Polygon(shape.body, closed=True, facecolor=colour, alpha=0.18, edgecolor="none"))
        axes.plot(*shape.body.T, color=colour, linestyle="-", linewidth=0.9)
        axes.plot(*shape.centre, marker="+", color=colour, markersize=5)
        axes.plot(*np.array([shape.centre, shape.nodes[0]]).T, color=colour, linestyle=":", linewidth=0.7)
    else:
        axes.plot(*shape.nodes[0], marker="s", markersize=9, markerfacecolor="#DDDDDD", markeredgecolor=colour)


def draw_shape(axes: Axes, shape: Shape, colour, radii: np.ndarray, dashes="-") -> None:
    """Rods as curves, hinges as open and node masses as filled circles."""
    few = len(shape.rods) <= 12
    curve = np.concatenate(list(shape.rods))
    axes.plot(*curve.T, color=colour, linestyle=dashes, linewidth=1.5 if few else 1.2, label=f"t = {shape.time:.6g} s")
    for node, size in zip(shape.nodes[1:], radii, strict=True):
        if size > 0:
            axes.plot(*node, marker="o", markersize=size, color=colour, linestyle="none")
    axes.plot(*shape.nodes[:-1].T, marker="o", markersize=3.6 if few else 2.2, linestyle="none",
              markerfacecolor="white", markeredgecolor=colour, markeredgewidth=0.9 if few else 0.6)


def time_handles(found: Sequence[Shape], colours: Sequence) -> list[Line2D]:
    return [
        Line2D([], [], color=colours[i], linestyle=style.DASHES[i % len(style.DASHES)], linewidth=1.5, label=f"$t$ = {shape.time:.6g} s")
        for i, shape in enumerate(found)
    ]


def mark_handles(radii: np.ndarray) -> list[Line2D]:
    hinge = Line2D([], [], marker="o", markersize=3.6, markerfacecolor="white", markeredgecolor="black", linestyle="none", label="hinge")
    if not radii.any():
        return [hinge]
    return [hinge, Line2D([], [], marker="o", markersize=min(7.0, radii.max()), color="black", linestyle="none", label="node mass")]


def main() -> int:
    parser = command.parser(__doc__)
    parser.add_argument("-t", "--times", type=float, nargs="+", default=[], help="[s] (default: five, from start to end)")
    parser.add_argument("-m", "--magnification", type=float, default=1.0, help="of the bending (default 1)")
    parser.add_argument("--frame", choices=FRAMES, default="moving")
    arguments = parser.parse_args()
    out = command.default_out(arguments, "shape")
    return command.finish(lambda: plot(arguments.file, out, arguments.times, arguments.magnification, arguments.frame))


if __name__ == "__main__":
    sys.exit(main())
