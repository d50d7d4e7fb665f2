"""The independent formulation of bench/stability/multipliers: free bodies, multipliers at the joints, a rule of its own.

`reference(groups)` runs the scene of `ordinary_scenes.groups_of` and returns its rows and events. It shares nothing with the
program: coordinates, element integrals, laws of hinges, impacts and integration are written anew from docs/.
"""

from __future__ import annotations

import hashlib
import itertools
import os
import pathlib
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from ordinary_scenes import Group

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SOURCES = [HERE / "multipliers" / f"{name}.f90"
           for name in ("scene_data", "joint_laws", "body_equations", "chain_motion", "chain_with_multipliers")]
NONE = 1e300
KINDS = ("released", "latched", "in_freeplay", "out_of_freeplay", "at_lower_stop", "off_lower_stop", "at_upper_stop", "off_upper_stop",
         "slides", "sticks")


@dataclass
class Motion:
    """Rows over time and events; `trouble` says why a run ended before its time."""
    time: np.ndarray
    states: dict[str, np.ndarray]
    events: list[tuple[float, int, str]]
    trouble: str = ""
    jumps: int = 0       # latches that joints have jumped over
    drift: float = 0.0   # largest gap of a joint [m], [rad]
    seconds: float = 0.0


def program() -> pathlib.Path:
    """The compiled reference, made anew if a source is younger."""
    place = pathlib.Path(os.environ.get("RODYN_MULTIPLIERS", ROOT / "build" / "multipliers"))
    place.mkdir(parents=True, exist_ok=True)
    path = place / "chain_with_multipliers"
    if not path.is_file() or path.stat().st_mtime < max(source.stat().st_mtime for source in SOURCES):
        made = place / f".made.{os.getpid()}"
        subprocess.run(["gfortran", "-O3", f"-J{place}", "-o", made, *SOURCES], check=True, capture_output=True)
        made.replace(path)
    return path


def version() -> str:
    """A word that changes with the sources."""
    return hashlib.sha256(b"".join(source.read_bytes() for source in [*SOURCES, pathlib.Path(__file__)])).hexdigest()


def reference(groups: Sequence[Group], n_outputs: int = 10, tolerance: float = 1e-11, seconds: float = 20.0, shift: float = 0.0) -> Motion:
    """The motion of a scene; `shift` moves the chord angles at the start [rad], to see how sensitive it is."""
    done = subprocess.run([program()], input=as_numbers(groups, n_outputs, tolerance, seconds, shift), capture_output=True, text=True)
    if done.returncode != 0:
        return Motion(np.zeros(0), {}, [], f"reference ended with {done.returncode}: {done.stderr[-300:]}")
    return motion_of(done.stdout, dict(groups)["chain"]["n_rods"])


def motion_of(text: str, n: int) -> Motion:
    rows, events, trouble, jumps, drift = [], [], "cut off", 0, 0.0
    for line in text.splitlines():
        word, *values = line.split()
        if word == "row":
            rows.append([float(v) for v in values])
        elif word == "event":
            events.append((float(values[0]), int(values[1]), KINDS[int(values[2]) - 1]))
        elif word == "end":
            trouble, jumps, drift = " ".join(values[4:]), int(values[3]), float(values[2])
    a = np.array(rows)
    names = [("phi", n), ("phi_rate", n), ("alpha", n), ("beta", n), ("base", 3), ("base_rate", 3), ("energy_kinetic", 1),
             ("energy_elastic", 1),
             ("energy_dissipated", 1), ("work_external", 1)]
    states, at = {}, 1
    for name, width in names:
        states[name] = a[:, at:at + width] if width > 1 or name in ("phi", "phi_rate", "alpha", "beta") else a[:, at]
        at += width
    return Motion(a[:, 0], states, events, trouble, jumps, drift)


def as_numbers(groups: Sequence[Group], n_outputs: int, tolerance: float, seconds: float, shift: float) -> str:
    """A scene as scene_data.f90 reads it."""
    given = {name: keys for name, keys in groups if name in ("case", "spacecraft", "chain", "model", "initial")}
    case, craft, chain, model, initial = (given.get(name, {}) for name in ("case", "spacecraft", "chain", "model", "initial"))
    n, t_end = chain["n_rods"], case["t_end"]
    free = craft.get("motion", "free") == "free"
    bending = {"rigid": 0, "dynamic": 1, "quasistatic": 3 if model.get("dampers") == "exact" else 2}[model.get("bending", "dynamic")]

    def spread(keys: dict, key: str) -> list[float]:
        value = keys.get(key, 0.0)
        return list(value) if isinstance(value, list) else [value] * n

    lines = [f"{n} {int(free)} {bending} {int(model.get('inertia') == 'lumped')} {model.get('bending_shapes', 2)}",
             f"{t_end!r} {n_outputs} {tolerance!r} {seconds!r}",
             " ".join(repr(float(craft.get(key, 0.0))) for key in ("mass", "inertia", "hinge_x", "hinge_y"))]
    columns = [spread(chain, key) for key in ("length", "mass_per_length", "bending_stiffness", "node_mass", "hinge_stiffness",
                                              "hinge_damping", "kink")]
    columns += [spread(initial, key) for key in ("phi", "alpha", "beta", "bubble", "phi_rate", "alpha_rate", "beta_rate", "bubble_rate")]
    columns[7] = [phi + shift * (1.0 + 0.37 * k) for k, phi in enumerate(columns[7])]
    lines += [" ".join(repr(float(x)) for x in row) for row in zip(*columns, strict=True)]
    base = ("displacement_x", "displacement_y", "rotation", "velocity_x", "velocity_y", "omega")
    lines.append(" ".join(repr(float(initial.get(key, 0.0))) for key in base))
    for k in range(1, n + 1):
        lines += pieces(k, [keys for name, keys in groups if name == "rod_profile"])
    loads = [keys for name, keys in groups if name == "load"]
    lines += [str(len(loads)), *(line for keys in loads for line in load_lines(keys, t_end))]
    kinks = [keys for name, keys in groups if name == "kink_program"]
    lines += [str(len(kinks)), *(line for keys in kinks for line in kink_lines(keys, t_end))]
    hinges = [keys for name, keys in groups if name == "hinge"]
    lines += [str(len(hinges)), *map(hinge_line, hinges)]
    return "\n".join(lines) + "\n"


def pieces(rod: int, profiles: list[dict]) -> list[str]:
    """Breaks of a rod, and parabolas in s/l of the factors on mass and stiffness between them."""
    found = {}
    for keys in profiles:
        if keys.get("first_rod", 1) <= rod <= keys.get("last_rod", 10**9):
            found[keys["quantity"]] = keys
    breaks = sorted({0.0, 1.0, *(x for keys in found.values() for x in keys.get("positions", []))})
    lines = [str(len(breaks) - 1), " ".join(map(repr, breaks))]
    for low, high in itertools.pairwise(breaks):
        numbers = []
        for quantity in ("mass_per_length", "bending_stiffness"):
            keys = found.get(quantity, {"polynomial": [1.0]})
            if "polynomial" in keys:
                c = list(keys["polynomial"])
            else:
                x, y = keys["positions"], keys["values"]
                i = next(i for i in range(len(x) - 1) if x[i] <= low and high <= x[i + 1] and x[i] < x[i + 1])
                slope = (y[i + 1] - y[i]) / (x[i + 1] - x[i])
                c = [y[i] - slope * x[i], slope]
            numbers += [*c, 0.0, 0.0, 0.0][:3]
        lines.append(" ".join(map(repr, numbers)))
    return lines


def law_lines(first: list, times: list[float], values: list[float]) -> list[str]:
    head = " ".join(map(repr, [*first, len(times)]))
    return [head, " ".join(map(repr, [*times, *values]))] if times else [head]


def load_lines(keys: dict, t_end: float) -> list[str]:
    law = {"constant": 1, "sine_squared": 2, "smooth_step": 3, "table": 4}[keys.get("law", "constant")]
    begin, end = float(keys.get("t_start", 0.0)), float(keys.get("t_end", t_end))
    return law_lines([keys.get("node", 0), "XYM".index(keys.get("component", "M")) + 1, law, begin, end, float(keys.get("value", 0.0)),
                      float(keys.get("rate", 0.0)), float(keys.get("rise_time", end - begin))], keys.get("times", []), keys.get("values", []))


def kink_lines(keys: dict, t_end: float) -> list[str]:
    law = {"ramp": 1, "smooth_step": 2, "sine": 3, "table": 4}[keys.get("law", "smooth_step")]
    begin, end = float(keys.get("t_start", -NONE if law == 4 else 0.0)), float(keys.get("t_end", NONE if law == 4 else t_end))
    return law_lines([keys["hinge"], 0, law, begin, end, float(keys.get("value", 0.0)), float(keys.get("rate", 0.0)), 0.0],
                     keys.get("times", []), keys.get("values", []))


def hinge_line(keys: dict) -> str:
    numbers = [keys["hinge"], int(keys.get("held", False)), float(keys.get("release_time", NONE)), keys.get("release_after", -1)]
    defaults = {"rest_angle": 0.0, "freeplay": 0.0, "freeplay_stiffness": 0.0, "lower_stop": NONE, "upper_stop": NONE, "stop_stiffness": 0.0,
                "stop_damping": 0.0, "latch_angle": NONE, "lock_stiffness": 0.0, "lock_damping": 0.0, "friction_moment": 0.0,
                "friction_velocity": 1.0}
    return " ".join(map(repr, numbers + [float(keys.get(key, default)) for key, default in defaults.items()]))
