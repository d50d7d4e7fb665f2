#!/usr/bin/env python3
"""Plot errors of a sweep against a step, tolerance or number of steps, with fitted orders (the scenes of tables 1 and 2).

    postproc/convergence.py results/steps --axis solver.fixed_step --quantity "phi(4)" "alpha_rate(1)"
    postproc/convergence.py results/tolerances --axis solver.rtol --reference table1.h5

The reference is a run, numbers, or the finest case of each line. Filled marks are those that the fit used. Along an axis that
refines nothing, such as mass_ratio, no order is fitted, and the finest case is that of the smallest value.
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
from rodyn_data import DataError, Sweep, distinct, open_run, open_sweep
from sweep_lines import default_quantities, heading, mark_failed

COUNTS = ("case.n_outputs", "chain.n_rods", "model.gauss_points")  # finer when larger
DEFAULT_AXES = ("solver.fixed_step", "solver.rtol", *COUNTS)
REFINEMENTS = (*DEFAULT_AXES, "solver.atol", "solver.max_step")  # over others nothing converges, and there is no order
FEWEST_FITTED, MOST_FITTED = 3, 5


class Fit(NamedTuple):
    """error = factor * x ** order, from the points in `used`."""

    order: float
    factor: float
    used: np.ndarray  # (points) bool


def plot(file: str | pathlib.Path, out: str | pathlib.Path, quantities: Sequence[str] = (), axis: str | None = None,
         reference: str | pathlib.Path | Sequence[float] | None = None, where: Mapping[str, Any] | None = None,
         time: float | None = None) -> Figure:
    """One panel per quantity. Fits are kept as figure.fits: {(quantity, label of the line): Fit or None}."""
    with open_sweep(file) as sweep:
        names = quantities or table_1_quantities(sweep)
        axis = axis or default_axis(sweep)
        known = references(sweep, names, reference, time)
        figure = draw(sweep, names, axis, known, where or {}, time)
    style.save(figure, out)
    return figure


def table_1_quantities(sweep: Sweep) -> list[str]:
    return [f"phi({sweep.n_rods})", "alpha_rate(1)"] if sweep.n_rods else default_quantities(sweep)[:2]


def default_axis(sweep: Sweep) -> str:
    for name in DEFAULT_AXES:
        if name in sweep.axes and len(distinct(sweep.axes[name])) > 1:
            return name
    raise DataError(f"{sweep.path}: none of {', '.join(DEFAULT_AXES)} changes; say with --axis what does")


def references(sweep: Sweep, names: Sequence[str], reference, time: float | None) -> list[float | None]:
    """The exact values, or None where the finest case of each line serves."""
    if reference is None:
        return [None] * len(names)
    if isinstance(reference, str | pathlib.Path):
        t = float(sweep.probe_times[sweep.probe(time)])
        with open_run(reference) as run:
            row = run.nearest_row(t)
            if abs(run.time[row] - t) > 1e-9 * max(1.0, t):
                raise DataError(f"{run.path}: no row at t = {t:g} s; the nearest is at {run.time[row]:g} s")
            return [float(run.quantity(name).values[row]) for name in names]
    if len(reference) != len(names):
        raise DataError(f"{len(names)} quantities, but {len(reference)} reference values")
    return list(reference)


def fit_order(x: np.ndarray, error: np.ndarray, floor: float) -> Fit | None:
    """Least squares in logarithms over the finest points above the floor, or above the plateau where errors end.

    x falls towards finer cases.
    """
    order = np.argsort(-x)
    good = np.array([i for i in order if np.isfinite(error[i]) and error[i] > floor], dtype=int)
    above = error[good] > 3.0 * plateau(np.log(x[good]), error[good])
    chosen = good[above][-MOST_FITTED:]
    if chosen.size < FEWEST_FITTED:
        return None
    slope, constant = np.polyfit(np.log(x[chosen]), np.log(error[chosen]), 1)
    used = np.zeros(x.size, dtype=bool)
    used[chosen] = True
    return Fit(float(slope), float(np.exp(constant)), used)


def plateau(log_x: np.ndarray, error: np.ndarray) -> float:
    """The largest error of the longest tail of fine cases that does not converge any more; 0 if all do."""
    for start in range(error.size - 1):
        tail = error[start:]
        if tail.max() < 10.0 * tail.min() and np.polyfit(log_x[start:], np.log(tail), 1)[0] < 0.3:
            return float(tail.max())
    return 0.0


def draw(sweep: Sweep, names: Sequence[str], axis: str, known: Sequence[float | None], where: Mapping[str, Any],
         time: float | None) -> Figure:
    if sweep.axis(axis).dtype.kind not in "fiu":
        raise DataError(f"{sweep.path}: axis '{axis}' holds texts; orders need numbers")
    columns = min(2, len(names))
    rows = -(-len(names) // columns)
    figure, grid = style.new_figure(rows, columns, height=0.9 + 2.9 * rows)
    than = "reference" if known[0] is not None else f"{'finest case' if axis in REFINEMENTS else 'smallest value'} of each line"
    figure.suptitle(f"{heading(sweep, names, time, where)}\nerror against the {than}")
    figure.fits = {}
    for axes, name, value in zip(grid.flat, names, known, strict=False):
        figure.fits.update(draw_panel(axes, sweep, name, axis, value, where, time))
    for axes in grid.flat[len(names):]:
        axes.set_visible(False)
    return figure


def draw_panel(axes: Axes, sweep: Sweep, name: str, axis: str, exact: float | None, where: Mapping[str, Any],
               time: float | None) -> dict[tuple[str, str], Fit | None]:
    fits: dict[tuple[str, str], Fit | None] = {}
    failed: list[float] = []
    axes.set(xscale="log", yscale="log")
    rising = axis in COUNTS
    for i, series in enumerate(sweep.series(name, [axis], where, time)):
        x = sweep.axis(axis)[series.cases].astype(float)
        fineness = 1.0 / x if rising else x
        values = series.quantity.values
        failed.extend(x[sweep.failed[series.cases]])
        done = np.flatnonzero(np.isfinite(values))
        if not done.size:
            fits[name, series.label] = None
            continue
        finest = done[np.argmin(fineness[done])]
        best = values[finest] if exact is None else exact
        error = np.abs(values - best)
        error[error == 0] = np.nan
        floor = 8 * np.finfo(float).eps * max(abs(best), np.finfo(float).tiny)
        fit = fit_order(fineness, error, floor) if axis in REFINEMENTS else None
        fits[name, series.label] = fit
        draw_line(axes, i, x, error, fit, series.label, rising)
    mark_failed(axes, failed, int(sweep.chosen(where).sum()))
    quantity = sweep.quantity(name, time)
    axes.set(xlabel=sweep.axis_label(axis), ylabel=f"|error of {quantity.symbol}|" + (f" [{quantity.unit}]" if quantity.unit else ""))
    axes.set_title(quantity.meaning, loc="left")
    if not any(np.isfinite(line.get_ydata()).any() for line in axes.lines if line.get_marker() != "x"):
        chosen = sweep.chosen(where)
        style.note(axes, "every case failed" if sweep.failed[chosen].all() else "no case differs from the reference")
        axes.set_yticks([])
        axes.set_yticks([], minor=True)
    numbers = np.unique(sweep.axis(axis)[sweep.chosen(where)])
    if numbers.size > 1:
        axes.set_xlim(numbers[0] / 1.2, numbers[-1] * 1.2)
    style.log_labels(axes.xaxis)
    style.log_labels(axes.yaxis)
    if axes.get_legend_handles_labels()[1]:
        style.legend_above(axes, ncols=1 if len(fits) < 4 else 2)
    return fits


def draw_line(axes: Axes, i: int, x: np.ndarray, error: np.ndarray, fit: Fit | None, label: str, rising: bool) -> None:
    look = style.mark_style(i)
    order = np.argsort(x)
    used = np.zeros(x.size, dtype=bool) if fit is None else fit.used
    text = "no order" if fit is None else f"order {fit.order:.2f}"
    axes.plot(x[order], error[order], label=f"{label}: {text}" if label else text, **look | {"linewidth": 0.7},
              markerfacecolor="white")
    axes.plot(x[used], error[used], linestyle="none", marker=look["marker"], color=look["color"])
    if fit is not None:
        ends = np.array([x[used].min(), x[used].max()])
        line = fit.factor * ends ** (-fit.order if rising else fit.order)
        axes.plot(ends, line, color=look["color"], linestyle="-", linewidth=2.2, alpha=0.35)


def main() -> int:
    parser = command.parser(__doc__, "sweep file, or its directory")
    parser.add_argument("-q", "--quantity", nargs="+", default=[], metavar="Q", help="default: phi of the last rod, alpha_rate(1)")
    parser.add_argument("-a", "--axis", help="such as solver.fixed_step")
    parser.add_argument("--reference", nargs="+", help="a run file, or one number per quantity (default: the finest case)")
    command.add_where(parser)
    arguments = parser.parse_args()
    out = command.default_out(arguments, "convergence")
    return command.finish(lambda: plot(arguments.file, out, arguments.quantity, arguments.axis, as_reference(arguments.reference),
                                       dict(arguments.where), arguments.time))


def as_reference(words: Sequence[str] | None) -> str | list[float] | None:
    if not words:
        return None
    try:
        return [float(word) for word in words]
    except ValueError:
        return words[0]


if __name__ == "__main__":
    sys.exit(main())
