#!/usr/bin/env python3
"""Plot the amplitude spectrum of any quantity of a run, with the natural frequencies of the scene marked.

    postproc/spectrum.py table1.h5 --quantity "alpha(1)" --start 1
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
from natural_frequencies import beyond_us, natural_frequencies
from rodyn_data import DataError, Quantity, Run, open_run

MANY_RODS = 300  # the frequencies of a longer chain take long


def plot(file: str | pathlib.Path, out: str | pathlib.Path, quantities: Sequence[str] = (), start: float | None = None,
         highest: float | None = None) -> Figure:
    """Spectra of the rows from `start` on, up to `highest` rad/s; by default of the tip's angle and the inner slope."""
    with open_run(file) as run:
        names = quantities or default_quantities(run)
        figure = draw(run, [run.quantity(name) for name in names], start, highest)
    style.save(figure, out)
    return figure


def default_quantities(run: Run) -> list[str]:
    slope = "alpha_rate(1)" if run.group("model").get("bending") != "rigid" else "phi_rate(1)"
    return [f"phi_rate({run.n_rods})", slope]


def possible(time: np.ndarray) -> bool:
    """Enough rows, at equal distances."""
    steps = np.diff(time)
    return time.size >= 16 and bool(np.ptp(steps) <= 1e-6 * steps.mean())


def amplitudes(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angular frequencies and amplitudes of the line without its straight part, Hann window: a sine of amplitude a gives a."""
    if time.size < 16:
        raise DataError(f"a spectrum needs 16 rows or more, here are {time.size}")
    steps = np.diff(time)
    if not possible(time):
        raise DataError("a spectrum needs rows at equal distances in time")
    window = np.hanning(time.size)
    straight = np.polynomial.Polynomial.fit(time, values, 1)(time)
    amplitude = 2.0 * np.abs(np.fft.rfft((values - straight) * window)) / window.sum()
    return 2.0 * np.pi * np.fft.rfftfreq(time.size, steps.mean()), amplitude


def draw(run: Run, quantities: Sequence[Quantity], start: float | None, highest: float | None) -> Figure:
    time = run.time
    rows = slice(run.nearest_row(start) if start is not None else 0, None)
    frequencies = natural_frequencies(run) if run.n_rods <= MANY_RODS else np.array([])
    figure, grid = style.new_figure(len(quantities), 1, sharex=True, height=0.8 + 2.4 * len(quantities))
    since = "" if start is None else f", t ≥ {time[rows][0]:.4g} s"
    figure.suptitle("Spectrum: " + style.shorten(run.title, 60) + since + style.status_suffix(run.status, time[-1]))
    for i, (axes, quantity) in enumerate(zip(grid.flat, quantities, strict=True)):
        try:
            omega, amplitude = amplitudes(time[rows], quantity.values[rows])
        except DataError as error:
            raise DataError(f"{run.path}: {error}") from None
        draw_panel(axes, quantity, omega, amplitude)
        upper = highest or min(omega[-1], 1.1 * np.max(frequencies, initial=0.0) or omega[-1])
        lower = omega[1]
        axes.set_xlim(lower, upper)
        mark_frequencies(axes, frequencies[(frequencies <= upper) & (frequencies >= lower)], label=i == 0)
    axes.set_xlabel("angular frequency [rad/s]" + left_out(run, frequencies, upper))
    return figure


def left_out(run: Run, frequencies: np.ndarray, upper: float) -> str:
    """Which natural frequencies are not marked, and why; empty if all are."""
    if run.n_rods > MANY_RODS:
        return f"; natural frequencies of more than {MANY_RODS} rods are not marked"
    if groups := beyond_us(run):
        return f"; natural frequencies are not marked: the scene has {' and '.join(groups)} (see rodyn modes)"
    beyond = int(np.sum(frequencies > upper))
    return f"; {beyond} of {frequencies.size} natural frequencies lie beyond {upper:.4g} rad/s" if beyond else ""


def draw_panel(axes: Axes, quantity: Quantity, omega: np.ndarray, amplitude: np.ndarray) -> None:
    axes.set_ylabel(f"amplitude of {quantity.symbol} [{quantity.unit}]")
    axes.set_title(quantity.meaning, loc="left")
    axes.set_xscale("log")
    if not np.any(amplitude > 0):
        style.note(axes, "zero at all times")
        return
    axes.semilogy(*style.envelope(omega[1:], amplitude[1:], points=6000), color=style.COLOURS[1], linestyle="-", linewidth=0.9)
    top = amplitude[1:].max()
    axes.set_ylim(max(amplitude[1:][amplitude[1:] > 0].min() / 2, 1e-9 * top), 3 * top)


def mark_frequencies(axes: Axes, frequencies: np.ndarray, label: bool) -> None:
    for i, frequency in enumerate(frequencies):
        axes.axvline(frequency, color=style.COLOURS[2], linestyle=(0, (4, 2)), linewidth=0.7, zorder=1,
                     label="natural frequencies, at rest in the initial shape" if i == 0 else None)
    if label and frequencies.size:
        style.legend_above(axes)


def main() -> int:
    parser = command.parser(__doc__)
    parser.add_argument("-q", "--quantity", nargs="+", default=[], metavar="Q", help='such as omega, "phi(4)"')
    parser.add_argument("--start", type=float, help="leave out what is before this time [s], such as the end of the loads")
    parser.add_argument("--highest", type=float, help="upper end of the axis [rad/s]")
    arguments = parser.parse_args()
    out = command.default_out(arguments, "spectrum")
    return command.finish(lambda: plot(arguments.file, out, arguments.quantity, arguments.start, arguments.highest))


if __name__ == "__main__":
    sys.exit(main())
