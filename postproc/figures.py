#!/usr/bin/env python3
"""Make all pictures that a run or a sweep allows, with settings chosen from the scene.

    postproc/figures.py results/example.h5          -> results/example-histories.pdf, .png and so on
"""

from __future__ import annotations

import argparse
import pathlib
import sys
from collections.abc import Callable, Iterator
from typing import NamedTuple

import command
import convergence
import exact_lumped
import heat_map
import histories
import ledger
import numpy as np
import phase
import shape
import spectrum
import sweep_lines
from geometry import largest_deflection
from matplotlib.figure import Figure
from rodyn_data import DataError, Run, Sweep, distinct, is_sweep, open_run, open_sweep


class Picture(NamedTuple):
    """One picture of a file; `plot` writes it to a path."""

    name: str
    caption: str
    plot: Callable[[pathlib.Path], Figure]


def pictures(file: str | pathlib.Path) -> list[Picture]:
    """What can be drawn of this file."""
    if is_sweep(file):
        with open_sweep(file) as sweep:
            return list(of_sweep(file, sweep))
    with open_run(file) as run:
        return list(of_run(file, run))


def of_run(file: str | pathlib.Path, run: Run) -> Iterator[Picture]:
    free = run.group("spacecraft").get("motion") != "fixed"
    rods = histories.representative_rods(run.n_rods)
    chain = [f"{name}({k})" for name in ("phi", "phi_rate") for k in rods]
    if free:
        yield Picture("histories", "Motion of the spacecraft.", lambda out: histories.plot(file, out))
    yield Picture("chain", f"Chord angles and their rates, rods {', '.join(map(str, rods))}.",
                  lambda out: histories.plot(file, out, chain))
    magnification = default_magnification(run)
    bent = "" if magnification == 1 else f"; bending magnified {magnification:g} times"
    yield Picture("shape", f"Shapes of the chain, in the frame of the spacecraft{bent}.",
                  lambda out: shape.plot(file, out, (), magnification))
    if free:
        yield Picture("shape-inertial", f"Shapes of the chain, in the inertial frame{bent}.",
                      lambda out: shape.plot(file, out, (), magnification, "inertial"))
    yield Picture("phase", "Phase portraits of the first and the last rod.", lambda out: phase.plot(file, out))
    if run.has_ledger:
        yield Picture("ledger", "Ledger of energy and momentum.", lambda out: ledger.plot(file, out))
    if spectrum.possible(run.time):
        yield Picture("spectrum", "Amplitude spectra, and the natural frequencies of the scene at rest in its initial shape.",
                      lambda out: spectrum.plot(file, out))


def default_magnification(run: Run) -> float:
    """The largest round factor that keeps the drawn deflection within about a quarter of the shortest rod."""
    time = run.time
    rows = [run.nearest_row(t) for t in np.linspace(time[0], time[-1], 5)]
    largest = max(largest_deflection(run, row) for row in rows)
    allowed = 0.26 * run.per_rod("length").min()
    factors = [f for f in (1, 2, 5, 10, 25, 50, 100, 250, 500, 1000) if f * largest <= allowed]
    return float(factors[-1]) if factors and largest > 1e-9 * allowed else 1.0


def of_sweep(file: str | pathlib.Path, sweep: Sweep) -> Iterator[Picture]:
    changing = {name: values for name, values in sweep.axes.items() if len(distinct(values)) > 1}
    numbers = [name for name, values in changing.items() if values.dtype.kind in "fiu"]
    if not changing or not sweep.done.any():
        return
    paired = exact_lumped.INERTIA in changing and {"distributed", "lumped"} <= set(changing[exact_lumped.INERTIA])
    few = sweep_lines.count(sweep, sweep_lines.default_axis(sweep)) <= sweep_lines.MOST_LINES
    if few and sweep.states():
        yield Picture("lines", "Angles of the first and the last rod.", lambda out: sweep_lines.plot(file, out))
    if few and sweep.frequencies():
        frequencies = sweep.frequencies()
        yield Picture("frequencies", "The slowest natural frequencies.", lambda out: sweep_lines.plot(file, out, frequencies))
    if not (sweep.states() or sweep.frequencies()):
        return
    if paired and len(numbers) == 1:
        yield Picture("exact-lumped", "Distributed (exact) against lumped inertia, and their difference.",
                      lambda out: exact_lumped.plot(file, out))
    if len(changing) == 2 and not paired:
        what = "angle of the last rod" if sweep.states() else "slowest natural frequency"
        yield Picture("map", f"The {what} over both axes.", lambda out: heat_map.plot(file, out))
    if any(name in numbers for name in convergence.DEFAULT_AXES):
        yield Picture("convergence", "Differences from the finest case, and fitted orders.", lambda out: convergence.plot(file, out))


def plot(file: str | pathlib.Path, out: str | pathlib.Path) -> list[pathlib.Path]:
    """Write them as OUT-name.pdf and .png."""
    out = pathlib.Path(out)
    found = pictures(file)
    if not found:
        raise DataError(f"{file}: nothing to draw: no case is done, or nothing changes")
    return [path for picture in found for path in picture.plot(out.with_name(f"{out.name}-{picture.name}")).saved]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument("file", type=pathlib.Path, help="run or sweep file")
    parser.add_argument("-o", "--out", type=pathlib.Path, help="begin of the names (default: the file's, beside it)")
    arguments = parser.parse_args()
    file = arguments.file
    out = arguments.out or (file / file.name if file.is_dir() else file.with_suffix(""))
    return command.finish(lambda: plot(file, out))


if __name__ == "__main__":
    sys.exit(main())
