#!/usr/bin/env python3
"""Animate the motion, with a time readout, as a GIF (or an MP4 if ffmpeg is there).

    postproc/animate.py example.h5 --out example.gif --seconds 8
"""

from __future__ import annotations

import pathlib
import shutil
import sys

import command
import numpy as np
import style
from geometry import limits, shapes, tip_path
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from rodyn_data import DataError, Run, open_run
from shape import FRAMES, axis_names, draw_body, draw_shape, is_rigid, node_radii


def plot(file: str | pathlib.Path, out: str | pathlib.Path, magnification: float = 1.0, frame: str = "inertial",
         seconds: float = 8.0, fps: int = 15, dpi: int = 80) -> Figure:
    """`seconds` long, whatever the simulated time. Each frame's time is kept in figure.times."""
    out = pathlib.Path(out)
    if out.suffix not in (".gif", ".mp4"):
        raise DataError(f"{out}: an animation is a .gif or an .mp4")
    if out.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise DataError(f"{out}: an MP4 needs the program ffmpeg; write a .gif instead")
    with open_run(file) as run:
        figure = record(run, out, magnification, frame, max(2, round(seconds * fps)), fps, dpi)
    figure.saved = [out]
    return figure


def record(run: Run, out: pathlib.Path, magnification: float, frame: str, frames: int, fps: int, dpi: int) -> Figure:
    time = run.time
    rows = np.unique([int(np.argmin(np.abs(time - t))) for t in np.linspace(time[0], time[-1], frames)])
    found = shapes(run, rows, magnification, frame)
    left, right, bottom, top = limits(found)
    height = float(np.clip(0.9 + 4.2 * (top - bottom) / (right - left), 2.4, 5.2))
    figure, grid = style.new_figure(width=4.8, height=height)
    FigureCanvasAgg(figure)
    axes, radii = grid[0, 0], node_radii(run)
    bending = "rigid rods" if is_rigid(run) else f"bending × {magnification:g}"
    title = style.shorten(run.title, 50) + style.status_suffix(run.status, time[-1])
    out.parent.mkdir(parents=True, exist_ok=True)
    writer = (PillowWriter if out.suffix == ".gif" else FFMpegWriter)(fps=fps)
    path_time, path = tip_path(run, frame)
    span = time[-1] - time[0]
    digits = max(0, 2 - int(np.floor(np.log10(span)))) if span > 0 else 3
    figure.times = []
    with writer.saving(figure, str(out), dpi):
        for i, shape in enumerate(found):
            axes.clear()
            axes.plot(*path[path_time <= shape.time].T, color=style.GREY, linestyle="-", linewidth=0.6)
            draw_body(axes, shape, style.COLOURS[1])
            draw_shape(axes, shape, style.COLOURS[1], radii)
            axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", **axis_names(frame))
            axes.set_title(f"{title}\nt = {shape.time:.{digits}f} s, {frame} frame, {bending}", loc="left")
            if i == 0:
                style.settle(figure)  # the frames must not jump
            writer.grab_frame()
            figure.times.append(shape.time)
    return figure


def main() -> int:
    parser = command.parser(__doc__)
    parser.add_argument("-m", "--magnification", type=float, default=1.0, help="of the bending (default 1)")
    parser.add_argument("--frame", choices=FRAMES, default="inertial")
    parser.add_argument("--seconds", type=float, default=8.0, help="length of the animation (default 8)")
    parser.add_argument("--fps", type=int, default=15, help="pictures per second (default 15)")
    arguments = parser.parse_args()
    out = arguments.out or arguments.file.with_suffix(".gif")
    return command.finish(lambda: plot(arguments.file, out, arguments.magnification, arguments.frame, arguments.seconds, arguments.fps))


if __name__ == "__main__":
    sys.exit(main())
