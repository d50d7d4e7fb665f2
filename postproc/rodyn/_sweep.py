"""Many cases over the cores of this machine."""

from __future__ import annotations

import itertools
import multiprocessing
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray

from ._case import Case, RodynError

Measures = Mapping[str, Callable[[xarray.Dataset], Any]]
_work: list[tuple[Case, list[dict[str, Any]], Measures]] = []  # of forked processes, which inherit it


def sweep(case: Case, axes: Mapping[str, Sequence[Any]], measures: Measures, *, combine: str = "grid",
          workers: int | None = None) -> xarray.Dataset:
    """Run a case with each combination of values of the axes, and keep what the measures read off the runs.

    A measure is a function of a run: a number or an array, of the same shape for all cases. combine = 'grid' gives each axis a
    dimension of its name; 'zip' takes the values of all axes side by side, over the dimension `case`. A case that is refused or fails
    is NaN, with its `message`. Cases run in `workers` processes, by default as many as there are cores.
    """
    if combine == "grid":
        dims, shape = list(axes), tuple(len(values) for values in axes.values())
        cases = [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]
        coordinates = {key: values for key, values in axes.items() if np.ndim(values) == 1}
    elif combine == "zip":
        cases = [dict(zip(axes, values, strict=True)) for values in zip(*axes.values(), strict=True)]
        dims, shape = ["case"], (len(cases),)
        coordinates = {key: ("case", values) for key, values in axes.items() if np.ndim(values) == 1}
    else:
        raise ValueError(f"combine = {combine!r}: must be 'grid' or 'zip'")
    case.check()
    results = _run_all(case, cases, measures, workers or len(os.sched_getaffinity(0)))
    table = xarray.Dataset(coords=coordinates)
    for name in measures:
        values = _stack([values.get(name) for values, _ in results])
        table[name] = ([*dims, *(f"{name}_{i}" for i in range(values.ndim - 1))], values.reshape(shape + values.shape[1:]))
    table["message"] = (dims, np.array([message for _, message in results], dtype=object).reshape(shape))
    return table


def _run_all(case: Case, cases: list[dict[str, Any]], measures: Measures, workers: int) -> list[tuple[dict[str, np.ndarray], str]]:
    workers = min(workers, len(cases))
    _work.append((case, cases, measures))
    try:
        if workers <= 1:
            return [_run_one(i) for i in range(len(cases))]
        with multiprocessing.get_context("fork").Pool(workers) as pool:
            return pool.map(_run_one, range(len(cases)))
    finally:
        _work.pop()


def _run_one(i: int) -> tuple[dict[str, np.ndarray], str]:
    base, cases, measures = _work[-1]
    case = base.copy()
    try:
        for key, value in cases[i].items():
            case[key] = value
        run = case.run()
    except RodynError as error:
        return {}, str(error)
    return {name: np.asarray(measure(run)) for name, measure in measures.items()}, ""


def _stack(values: list[np.ndarray | None]) -> np.ndarray:
    """One row for each case; NaN where there is nothing."""
    missing = next((np.full(x.shape, np.nan) for x in values if x is not None), np.array(np.nan))
    return np.stack([missing if x is None else x for x in values])
