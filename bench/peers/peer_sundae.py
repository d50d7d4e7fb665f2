"""scikit-sundae: SUNDIALS' CVODE under Python, with the right-hand side compiled by numba.

It calls Python functions only, and Newton's iteration is the only one it offers, also for Adams; its Jacobians are differences.
"""

from __future__ import annotations

import functools
import time
from typing import Any

import numpy as np
import sksundae
from model import read_scene
from right_hand_side import compiled
from sksundae.cvode import CVODE

MOST_RODS = 40
METHODS = {"sundae Adams": "Adams", "sundae BDF": "BDF"}


def version() -> str:
    return f"scikit-sundae {sksundae.__version__}, SUNDIALS {sksundae.SUNDIALS_VERSION}"


def lines(scene: str) -> list[dict[str, Any]]:
    return [{"method": m} for m in METHODS] if read_scene(scene).n <= MOST_RODS else []


@functools.lru_cache(maxsize=16)
def functions(path: str):
    scene = read_scene(path)
    made = [compiled(scene, segment) for segment in scene.segments]
    for rates in made:  # compiled for the arrays that come from CVODE
        CVODE(rates, rtol=1e-3, atol=1e-3).solve(np.array([0.0, 1e-9]), np.zeros(2 * scene.n_dof))
    return scene, made


def prepare(job: dict[str, Any]):
    scene, made = functions(job["scene"])
    probes = np.array(job["probe_times"])

    def run():
        y, states, n_rhs, seconds = np.zeros(2 * scene.n_dof), [], 0, 0.0
        for segment, rates in zip(scene.segments, made, strict=True):
            at = np.append(probes[(probes > segment.start) & (probes < segment.end)], segment.end)
            start = time.perf_counter()
            solver = CVODE(rates, method=METHODS[job["method"]], rtol=job["rtol"], atol=job["atol"], max_num_steps=100000000)
            solution = solver.solve(np.insert(at, 0, segment.start), y)
            seconds += time.perf_counter() - start
            if not solution.success:
                raise RuntimeError(solution.message)
            y = solution.y[-1]
            n_rhs += solution.nfev
            states += [solution.y[j + 1] for j, t in enumerate(at) if t in probes]
        picked = [scene.pick(state) for state in states]
        return seconds, {"n_rhs": int(n_rhs), "phi": [p.tolist() for p, _ in picked], "alpha_rate": [a.tolist() for _, a in picked]}

    return run
