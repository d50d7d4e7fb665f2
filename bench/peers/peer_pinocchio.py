"""Pinocchio's articulated-body algorithm on a scene of rigid rods, timed by a small C++ program (pinocchio_aba.cpp)."""

from __future__ import annotations

import pathlib
import subprocess
from typing import Any

import numpy as np
from model import LENGTH, M0, MU, read_scene

TIMER = pathlib.Path(__file__).resolve().parent / ".venv" / "pinocchio_aba"


def version() -> str:
    import pinocchio
    return f"Pinocchio {pinocchio.__version__}"


def lines(scene: str) -> list[dict[str, Any]]:
    return []  # no integrator


def prepare(job: dict[str, Any]):
    if not TIMER.is_file():
        raise FileNotFoundError("pinocchio_aba was not compiled, see bench/peers/setup")
    scene = read_scene(job["scene"])
    numbers = [scene.n, *scene.body[:4], *scene.segments[0].base]
    for row, c, d, angle, rate in zip(scene.rods, scene.stiffness, scene.damping, job["phi"], job["phi_rate"], strict=True):
        rod, node, length = row[M0], row[MU], row[LENGTH]
        centre = (rod * length / 2 + node * length) / (rod + node)
        inertia = rod * length**2 / 12 + rod * (centre - length / 2) ** 2 + node * (length - centre) ** 2
        numbers += [length, rod + node, centre, inertia, c, d, angle, rate]
    text = " ".join(repr(float(x)) if i else str(x) for i, x in enumerate(numbers))

    def run():
        out = np.array(subprocess.run([TIMER], input=text, capture_output=True, text=True, check=True).stdout.split(), float)
        return out[0], {"rates": out[1:].tolist()}

    return run
