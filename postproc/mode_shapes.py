#!/usr/bin/env python3
"""Mode shapes of a file of `rodyn modes`: the state, and the chain at both ends of each swing.

    postproc/mode_shapes.py example_modes.h5                    the six slowest oscillations
    postproc/mode_shapes.py example_modes.h5 --modes 4 12 15 --frame moving --amplitude 0.2
"""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Sequence

import command
import numpy as np
import style
from geometry import Place, Shape, limits
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rodyn_data import DataError, Modes, open_modes
from shape import FRAMES, axis_names, draw_body

MOST_PANELS = 6  # without --modes
COLUMNS = 3


def plot(file: str | pathlib.Path, out: str | pathlib.Path, modes: Sequence[int] = (), amplitude: float = 0.06,
         frame: str = "inertial") -> Figure:
    """One panel per mode; the largest displacement of a node is `amplitude` times the length of the chain."""
    with open_modes(file) as found:
        figure = draw(found, modes, amplitude, frame)
    style.save(figure, out)
    return figure


def draw(found: Modes, modes: Sequence[int], amplitude: float, frame: str) -> Figure:
    chosen = [found.index(number) for number in modes] or found.oscillations()[:MOST_PANELS]
    if not chosen:
        raise DataError(f"{found.path}: no mode oscillates; choose some with --modes")
    panels = [swing(found, i, amplitude, frame) for i in chosen]
    left, right, bottom, top = limits([shape for panel in panels for shape in panel])
    columns = min(COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    panel_height = style.WIDTH / columns * (top - bottom) / (right - left) + 0.55
    figure, grid = style.new_figure(rows, columns, height=float(np.clip(0.7 + rows * panel_height, 2.2, 9.0)), sharex=True, sharey=True)
    figure.suptitle(f"{style.shorten(found.title, 60)}\nModes at the {found.attribute('at', 'state')}, {frame} frame")
    for axes, i, panel in zip(grid.flat, chosen, panels, strict=False):
        draw_mode(axes, panel, frame)
        axes.set_title(mode_title(found, i), loc="left", fontsize=8)
        axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    for axes in grid[-1]:
        axes.set_xlabel(axis_names(frame)["xlabel"])
    for axes in grid[:, 0]:
        axes.set_ylabel(axis_names(frame)["ylabel"])
    for axes in grid.flat[len(panels):]:
        axes.set_visible(False)
    style.legend_below(figure, grid.flat[:1])
    return figure


def swing(found: Modes, i: int, amplitude: float, frame: str) -> list[Shape]:
    """The state, then the mode at four phases: both ends of the swing, and a quarter after each."""
    place, state, change = Place(found), found.state(), found.shape(i)

    def moved(factor: complex) -> Shape:
        return place.shape({name: state[name] + np.real(change[name] * factor) for name in state}, frame)

    still = place.shape(state, frame)
    largest = max(np.abs(moved(1e-6 * turn).nodes - still.nodes).max() for turn in (1, 1j)) / 1e-6
    scale = amplitude * found.per_rod("length").sum() / largest if largest > 0 else 0.0
    # A slope alone moves no node: keep angles within what a picture can show.
    widest = max(np.abs(change[name]).max(initial=0.0) for name in ("phi", "alpha", "beta", "rotation"))
    if "bubble" in change:
        widest = max(widest, np.max(3.0 * np.abs(change["bubble"]) / place.length))  # the slope of that shape
    scale = min(scale, 0.5 / widest) if widest > 0 else scale
    return [still, *(moved(scale * turn) for turn in (1, -1, 1j, -1j))]


def draw_mode(axes: Axes, panel: Sequence[Shape], frame: str) -> None:
    still, ahead, behind, later, last = panel
    draw_curve(axes, still, style.GREY, "-", 0.8, "state")
    draw_curve(axes, ahead, style.COLOURS[1], "-", 1.5, "end of the swing")
    draw_curve(axes, behind, style.COLOURS[2], style.DASHES[1], 1.2, "other end")
    if np.abs(later.nodes - still.nodes).max() > 0.02 * np.abs(ahead.nodes - still.nodes).max():
        draw_curve(axes, later, style.COLOURS[3], style.DASHES[3], 0.9, "a quarter later")
        draw_curve(axes, last, style.COLOURS[4], style.DASHES[3], 0.9, "three quarters later")
    if frame == "moving":
        draw_body(axes, still, style.GREY)
    else:
        draw_body(axes, ahead, style.COLOURS[1])


def draw_curve(axes: Axes, shape: Shape, colour: str, dashes, width: float, label: str) -> None:
    axes.plot(*np.concatenate(list(shape.rods)).T, color=colour, linestyle=dashes, linewidth=width, label=label)
    if len(shape.rods) <= 12:
        axes.plot(*shape.nodes.T, color=colour, linestyle="none", marker="o", markersize=2.2)


def mode_title(found: Modes, i: int) -> str:
    number, kind = int(found.rows("mode")[i]), found.kinds()[i]
    if kind == "oscillation":
        frequency, ratio = found.rows("frequency")[i], found.rows("damping_ratio")[i]
        text = f"mode {number}: {frequency:.5g} rad/s, {frequency / (2 * np.pi):.4g} Hz"
        return text if abs(ratio) < 1e-9 else text + f"\ndamping ratio {ratio:.3g}"
    if kind == "relaxation":
        return f"mode {number}: decay {found.rows('decay')[i]:.4g} 1/s"
    return f"mode {number}: {kind}"


def main() -> int:
    parser = command.parser(__doc__, "file of rodyn modes")
    parser.add_argument("-m", "--modes", type=int, nargs="+", default=[], metavar="N", help="(default: the six slowest oscillations)")
    parser.add_argument("-a", "--amplitude", type=float, default=0.06, help="largest displacement over the length of the chain")
    parser.add_argument("--frame", choices=FRAMES, default="inertial")
    arguments = parser.parse_args()
    out = command.default_out(arguments, "shapes")
    return command.finish(lambda: plot(arguments.file, out, arguments.modes, arguments.amplitude, arguments.frame))


if __name__ == "__main__":
    sys.exit(main())
