"""SciPy's solve_ivp with a right-hand side compiled by numba: DOP853 and Radau."""

from __future__ import annotations

import functools
import time
from typing import Any

import numpy as np
import scipy
from model import read_scene
from right_hand_side import compiled
from scipy.integrate import solve_ivp

MOST_RODS = 256
MOST_RODS_IMPLICIT = 40


def version() -> str:
    import numba
    return f"scipy {scipy.__version__}, numba {numba.__version__}"


def lines(scene: str) -> list[dict[str, Any]]:
    n = read_scene(scene).n
    return [{"method": "DOP853"}] * (n <= MOST_RODS) + [{"method": "Radau"}] * (n <= MOST_RODS_IMPLICIT)


@functools.lru_cache(maxsize=16)
def functions(path: str):
    from numba import njit
    scene = read_scene(path)
    made = []
    for segment in scene.segments:
        evaluate = compiled(scene, segment)

        @njit
        def rates(t, y, evaluate=evaluate):
            ydot = np.empty_like(y)
            evaluate(t, y, ydot)
            return ydot

        rates(0.0, np.zeros(2 * scene.n_dof))
        made.append(rates)
    return scene, made


def prepare(job: dict[str, Any]):
    scene, made = functions(job["scene"])
    probes = np.array(job["probe_times"])

    def run():
        start = time.perf_counter()
        y, states, n_rhs = np.zeros(2 * scene.n_dof), [], 0
        for segment, rates in zip(scene.segments, made, strict=True):
            at = np.append(probes[(probes > segment.start) & (probes < segment.end)], segment.end)
            solution = solve_ivp(rates, (segment.start, segment.end), y, method=job["method"], rtol=job["rtol"], atol=job["atol"],
                                 t_eval=at)
            if not solution.success:
                raise RuntimeError(solution.message)
            y = solution.y[:, -1]
            n_rhs += solution.nfev
            states += [solution.y[:, j] for j, t in enumerate(at) if t in probes]
        seconds = time.perf_counter() - start
        picked = [scene.pick(state) for state in states]
        return seconds, {"n_rhs": n_rhs, "phi": [p.tolist() for p, _ in picked], "alpha_rate": [a.tolist() for _, a in picked]}

    return run
