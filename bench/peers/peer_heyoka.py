"""heyoka: Taylor's method, its recursion of derivatives compiled from the model's expressions.

Settings found best on the table-1 scene: no compact mode (2 to 3 times faster than with it, but compiles for minutes beyond
a few rods), fast arithmetic, vectors of 512 bits where the processor has them. `batch` integrates eight scenes in eight lanes.
"""

from __future__ import annotations

import functools
import time
from typing import Any

import heyoka as hy
import numpy as np
from model import Scene, read_scene
from right_hand_side import expressions

MOST_RODS = 64
MOST_RODS_UNROLLED = 4
LANES = 8
OPTIONS = {"fast_math": True, "force_avx512": True}


def version() -> str:
    return f"heyoka {hy.__version__}"


def lines(scene: str) -> list[dict[str, Any]]:
    known = read_scene(scene)
    return [{"method": "heyoka"}] if known.n <= MOST_RODS else []


@functools.lru_cache(maxsize=64)
def integrators(path: str, tol: float) -> tuple[Scene, list[Any]]:
    """One for each segment between switches of the loads; segments that differ in constant loads only share one."""
    scene = read_scene(path)
    options = OPTIONS | {"tol": tol, "compact_mode": scene.n > MOST_RODS_UNROLLED}
    y = np.zeros(2 * scene.n_dof)
    if len(scene.segments) > 1 and not any(s.tip.any() for s in scene.segments):
        system = expressions(scene, scene.segments[0], base=[hy.par[0], hy.par[1], hy.par[2]])
        return scene, [hy.taylor_adaptive(system, y, pars=np.zeros(3), **options)] * len(scene.segments)
    return scene, [hy.taylor_adaptive(expressions(scene, s), y.copy(), **options) for s in scene.segments]


def prepare(job: dict[str, Any]):
    if job["method"] == "batch":
        return prepare_batch(job)
    if job["method"] == "reference":
        return prepare_reference(job)
    scene, made = integrators(job["scene"], max(job["rtol"], 2.3e-16))
    probes = job["probe_times"]

    def run():
        states, steps = [], 0
        start = time.perf_counter()
        state = np.zeros(2 * scene.n_dof)
        for segment, ta in zip(scene.segments, made, strict=True):
            ta.time = segment.start
            ta.state[:] = state
            if ta.pars.size:
                ta.pars[:] = segment.base
            for t in [t for t in probes if segment.start < t < segment.end] + [segment.end]:
                outcome = ta.propagate_until(t)
                if outcome[0] != hy.taylor_outcome.time_limit:
                    raise RuntimeError(str(outcome[0]))
                steps += outcome[3]
                if t in probes:
                    states.append(ta.state.copy())
            state = ta.state.copy()
        seconds = time.perf_counter() - start
        return seconds, result(scene, states) | {"n_steps": steps, "order": made[0].order}

    return run


def result(scene: Scene, states: list[np.ndarray]) -> dict[str, Any]:
    picked = [scene.pick(np.asarray(y, float)) for y in states]
    return {"phi": [p.tolist() for p, _ in picked], "alpha_rate": [a.tolist() for _, a in picked]}


def prepare_reference(job: dict[str, Any]):
    """In extended or quadruple precision: a solution to compare with."""
    number = {"extended": np.longdouble, "quadruple": hy.real128}[job["precision"]]
    scene = read_scene(job["scene"], number=number)
    made = [hy.taylor_adaptive(expressions(scene, s), np.zeros(2 * scene.n_dof, dtype=number), time=number(s.start),
                               tol=number(job["rtol"]), fp_type=number, compact_mode=True) for s in scene.segments]

    def run():
        states = []
        start = time.perf_counter()
        state = np.zeros(2 * scene.n_dof, dtype=number)
        for segment, ta in zip(scene.segments, made, strict=True):
            ta.time = number(segment.start)
            ta.state[:] = state
            for t in [t for t in job["probe_times"] if segment.start < t < segment.end] + [segment.end]:
                ta.propagate_until(number(t))
                if t in job["probe_times"]:
                    states.append(np.array([float(x) for x in ta.state]))
            state = ta.state.copy()
        return time.perf_counter() - start, result(scene, states)

    return run


def prepare_batch(job: dict[str, Any]):
    """Eight scenes whose hinges are `hinge_factors` times as stiff, in the lanes of one integrator."""
    factors = job["hinge_factors"]
    scene, ta = batch_integrator(job["scene"], max(job["rtol"], 2.3e-16))
    if len(scene.segments) > 1 or len(factors) % LANES:
        raise ValueError("a batch has one segment of loads and full lanes")

    def run():
        states = []
        start = time.perf_counter()
        for first in range(0, len(factors), LANES):
            ta.set_time(0.0)
            ta.state[:] = 0.0
            ta.pars[0, :] = factors[first:first + LANES]
            ta.propagate_until(scene.segments[0].end)
            states.append(ta.state.copy())
        seconds = time.perf_counter() - start
        return seconds, result(scene, list(np.concatenate([s.T for s in states])))

    return run


@functools.lru_cache(maxsize=16)
def batch_integrator(path: str, tol: float) -> tuple[Scene, Any]:
    scene = read_scene(path)
    system = expressions(scene, scene.segments[0], hinge_factor=hy.par[0])
    return scene, hy.taylor_adaptive_batch(system, np.zeros((2 * scene.n_dof, LANES)), pars=np.ones((1, LANES)), tol=tol,
                                           compact_mode=False, **OPTIONS)
