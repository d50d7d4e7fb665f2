"""One style for all pictures: sizes, fonts, colours, line styles; how figures are made and saved.

Colours are Okabe and Ito's, which colour-blind readers can tell apart, in an order that also changes in grey; every
line has its own dash pattern besides. Figures are drawn without a display and without pyplot.
"""

from __future__ import annotations

import pathlib
import re
from collections.abc import Iterable
from typing import Any

import matplotlib
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, MaxNLocator

COLOURS = ["#000000", "#0072B2", "#D55E00", "#009E73", "#E69F00", "#56B4E9", "#CC79A7"]
DASHES: list[Any] = ["-", (0, (5, 1.6)), (0, (6, 1.5, 1.2, 1.5)), (0, (1.4, 1.2)), (0, (9, 2)),
                     (0, (3, 1.2, 1, 1.2, 1, 1.2)), (0, (2.5, 2.5))]
MARKERS = ["o", "s", "^", "D", "v", "P", "X"]
FAILED = "#B2182B"
GREY = "#767676"
SEQUENCE = "cividis"  # for what has an order; also monotonic in grey
WIDTH = 7.2  # inches, both columns of a page
FORMATS = (".pdf", ".png")

matplotlib.rcParams.update({
    "font.family": "DejaVu Sans",
    "mathtext.fontset": "dejavusans",
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 9,
    "figure.titlesize": 10,
    "figure.dpi": 100,
    "figure.autolayout": False,
    "legend.fontsize": 8,
    "legend.frameon": True,
    "legend.framealpha": 0.85,
    "legend.edgecolor": "none",
    "legend.handlelength": 2.6,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "axes.prop_cycle": cycler(color=COLOURS) + cycler(linestyle=DASHES),
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#D9D9D9",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.2,
    "lines.markersize": 4.5,
    "axes.formatter.limits": (-3, 5),
    "axes.formatter.useoffset": False,
    "savefig.dpi": 160,
    "pdf.fonttype": 42,
    "svg.fonttype": "path",
    "path.simplify": True,
})


def new_figure(rows: int = 1, columns: int = 1, *, width: float = WIDTH, height: float | None = None,
               **options: Any) -> tuple[Figure, np.ndarray]:
    """A figure and its axes, as a two-dimensional array."""
    figure = Figure(figsize=(width, height or 0.6 + 2.1 * rows), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def line_style(i: int) -> dict[str, Any]:
    """Colour and dashes of line number i."""
    return {"color": COLOURS[i % len(COLOURS)], "linestyle": DASHES[(i + i // len(COLOURS)) % len(DASHES)]}


def mark_style(i: int, points: int = 1) -> dict[str, Any]:
    """Line style and marks, smaller ones on a line of many points."""
    size = 4.5 if points <= 16 else 2.6 if points <= 80 else 0.0
    return line_style(i) | {"marker": MARKERS[i % len(MARKERS)] if size else "", "markersize": size}


def sequence_colours(n: int) -> list[Any]:
    """n colours from dark to light, for times in their order; the lightest are left out."""
    colour_map = matplotlib.colormaps[SEQUENCE]
    return [colour_map(x) for x in np.linspace(0.0, 0.82, n)]


def legend_above(axes: Axes, **options: Any) -> None:
    """A legend in rows between the axes and their title, where no data are."""
    options = {"ncols": 4} | options
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.15, borderpad=0.15, columnspacing=1.4, **options)
    rows = -(-len(axes.get_legend_handles_labels()[1]) // options["ncols"])
    axes.set_title(axes.get_title(loc="left"), loc="left", pad=5 + 12.5 * rows)


def number_text(value: float) -> str:
    """At most four digits, without an exponent below a million."""
    text = f"{value:.4g}"
    return f"{value:.0f}" if "e+" in text and abs(value) < 1e6 else text


def log_labels(axis: Axis) -> None:
    """Labels at decades; at 2 and 5 too where less than two decades are seen. Call it when the limits are known."""
    low, high = axis.get_view_interval()
    decades = abs(np.log10(high / low))
    if decades < 1.7:
        axis.set_major_formatter(FuncFormatter(lambda v, _: power_text(v)))
    axis.set_minor_formatter(FuncFormatter(lambda v, _: power_text(v) if decades < 1.7 and mantissa(v) in (2, 5) else ""))


def mantissa(value: float) -> int:
    return round(value / 10 ** np.floor(np.log10(value) + 1e-9))


def power_text(value: float) -> str:
    exponent = int(np.floor(np.log10(value) + 1e-9))
    if -2 <= exponent <= 3:
        return f"{value:.4g}"
    factor = "" if mantissa(value) == 1 else rf"{mantissa(value)}\cdot"
    return rf"${factor}10^{{{exponent}}}$"


def legend_below(figure: Figure, panels: Iterable[Axes]) -> None:
    """One legend for all panels, below them: each label once."""
    found = {label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    if found:
        widest = max(len(label) for label in found) * 0.075 + 0.6  # inches
        columns = max(1, min(len(found), int(0.95 * figure.get_figwidth() / widest)))
        figure.legend(found.values(), found.keys(), loc="outside lower center", ncols=columns)


def factor_into_label(axis: Axis) -> None:
    """Write a common factor of the tick labels into the unit: [m] becomes [10^-5 m]. At the end of the axis it may be covered."""
    factor = re.fullmatch(r"1e(-?\d+)", axis.get_offset_text().get_text().replace("−", "-"))
    if factor is None or not axis.get_offset_text().get_visible():
        return
    power = f"$10^{{{factor[1]}}}$"
    words, bracket, unit = axis.get_label_text().rpartition(" [")
    axis.set_label_text(f"{words} [{power} {unit}" if bracket else f"{unit} [{power}]")
    axis.get_offset_text().set_visible(False)


def time_axis(axes: Axes) -> None:
    """The lower axis of a time history."""
    axes.margins(x=0)
    axes.set_xlabel("time $t$ [s]")
    axes.tick_params(labelbottom=True)
    axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))


def wrap_title(axes: Axes) -> None:
    """Have a title that would meet the next axes, or the edge of the figure, broken at the width of its own. Call it when the
    figure has been drawn."""
    words = axes.get_title(loc="left")
    if not words:
        return
    figure = axes.figure
    title = next(text for text in axes.findobj(Text) if text.get_text() == words)
    right = min((other.bbox.x0 for other in figure.axes if other.bbox.x0 > axes.bbox.x1), default=figure.bbox.x1)
    if title.get_window_extent().x1 > right:
        inches = axes.bbox.width / figure.dpi
        title.set_wrap(True)
        title._get_wrap_line_width = lambda: inches * figure.dpi  # matplotlib itself wraps at the edges of the figure only


def settle(figure: Figure) -> None:
    """Find the layout once for all formats; again with the labels and titles that follow from the first one."""
    engine = figure.get_layout_engine()
    engine.execute(figure)
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            factor_into_label(axis)
        wrap_title(axes)
    engine.execute(figure)
    figure.set_layout_engine(None)  # with any other, each file would be drawn twice


def save(figure: Figure, out: str | pathlib.Path) -> list[pathlib.Path]:
    """Save as `out`; without one of the known suffixes as vector PDF and as PNG. The paths are kept as figure.saved."""
    out = pathlib.Path(out)
    known = (".pdf", ".png", ".svg")
    paths = [out] if out.suffix in known else [out.with_name(out.name + suffix) for suffix in FORMATS]
    settle(figure)
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        # No time of creation, so that the same picture gives the same file.
        figure.savefig(path, metadata={".png": {"Software": None}, ".pdf": {"CreationDate": None}, ".svg": {"Date": None}}[path.suffix])
    figure.saved = paths
    return paths


def envelope(x: np.ndarray, y: np.ndarray, points: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    """Thin out a long line without losing a peak: first, lowest, highest and last point of each of many short pieces."""
    if x.size <= points:
        return x, y
    keep = envelope_rows(y, points=points)
    return x[keep], y[keep]


def envelope_rows(*columns: np.ndarray, points: int = 4000) -> np.ndarray:
    """Rows that `envelope` keeps; extremes of every column are among them."""
    n = columns[0].size
    if n <= points:
        return np.arange(n)
    pieces = max(1, points // (2 + 2 * len(columns)))
    edges = np.linspace(0, n, pieces + 1).astype(int)
    length = int(np.max(np.diff(edges)))
    rows = np.minimum(edges[:-1, None] + np.arange(length), edges[1:, None] - 1)  # (pieces, length)
    keep = [edges[:-1], edges[1:] - 1]
    for values in columns:
        pieces_of = values[rows]
        for fill, choose in ((np.inf, np.argmin), (-np.inf, np.argmax)):
            best = choose(np.where(np.isnan(pieces_of), fill, pieces_of), axis=1)
            keep.append(rows[np.arange(pieces), best])
    return np.unique(np.concatenate(keep))


def note(axes: Axes, text: str) -> None:
    """A remark inside the axes."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=GREY, fontsize=8)


def status_suffix(status: str, t_reached: float) -> str:
    """What a title must say of a run that is not complete."""
    return "" if status == "done" else f" ({status} at t = {t_reached:.4g} s)"


def shorten(text: str, width: int = 80) -> str:
    """A title that fits on the line."""
    return text if len(text) <= width else text[: width - 1].rstrip() + "…"
