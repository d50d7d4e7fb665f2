#!/usr/bin/env python3
"""Events of stops, freeplay and friction: as many by every method.

    bench/stability/event_counts.py                   300 scenes, half of them flexible
    bench/stability/event_counts.py --only 17 18      some of them

Each scene is run by `dop853`, `erk`, `bdf` and `adams` at default tolerances, and by `dop853` at rtol = 1e-12. Where two runs by
`dop853` itself, at these tolerances or from a start 1e-8 rad away, disagree, a contact is grazed and the number says nothing.
"""

from __future__ import annotations

import argparse
import pathlib
import sys
import tempfile

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from support import RODYN, run_case, solver

COUNT, SEED = 300, 6
METHODS = ("dop853", "erk", "bdf", "adams")


def scene(number: int, shift: float = 0.0) -> str:
    """The case without its solver. Each has its own random numbers, so that it can be run alone."""
    rng = np.random.default_rng([SEED, number])
    n = int(rng.integers(1, 4))
    flexible = number % 2 == 1
    angle = rng.choice([0.4, 0.8, 1.2])
    text = [f"&case t_end = {4 if flexible else 10}, n_outputs = 50 /",
            "&spacecraft motion = 'fixed' /" if rng.random() < 0.5 else "&spacecraft mass = 200, inertia = 80, hinge_x = 0.5 /",
            f"&chain n_rods = {n}, length = {rng.uniform(0.5, 2):.2g}, mass_per_length = {rng.uniform(0.5, 3):.2g}, "
            f"node_mass = {rng.uniform(0, 3):.2g}, bending_stiffness = {rng.uniform(200, 3000):.2g}, "
            f"hinge_stiffness = {rng.uniform(5, 60):.2g}, hinge_damping = {rng.choice([0.0, 0.1, 1.0])} /",
            "&model /" if flexible else "&model bending = 'rigid' /",
            "&initial phi = " + ", ".join(f"{angle * (-1) ** k + shift:.12g}" for k in range(n)) + " /",
            "&output ledger = .false. /"]
    for hinge in range(n):
        side = (-1) ** hinge
        keys = [f"rest_angle = {-0.2 * side}"]
        if rng.random() < 0.8:
            keys.append(f"{'lower' if side > 0 else 'upper'}_stop = 0, stop_stiffness = {np.exp(rng.uniform(5, 8.5)):.2g}, "
                        f"stop_damping = {rng.choice([0.0, rng.uniform(1, 80)]):.2g}")
        if rng.random() < 0.4:
            keys.append(f"friction_moment = {rng.uniform(0.5, 6):.2g}, friction_velocity = 0.01")
        if rng.random() < 0.4:
            keys.append("freeplay = 0.01")
        text.append(f"&hinge hinge = {hinge}, " + ", ".join(keys) + " /")
    return "\n".join(text) + "\n"


def events(folder: pathlib.Path, program: str, case: str, method: str, rtol: float = 1e-8) -> list[tuple[int, str]] | str:
    """(hinge, kind) of all events of each hinge in their order, or what went wrong."""
    import xarray

    result = folder / "scene.h5"
    trouble = run_case(program, case + solver(method, rtol), result)
    if trouble:
        return trouble
    with xarray.open_dataset(result, group="events") as data:
        kinds = [kind.decode() if isinstance(kind, bytes) else str(kind) for kind in data.kind.values]
        return sorted(zip(data.hinge.values.tolist(), kinds, strict=True), key=lambda event: event[0])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", type=int, nargs="+", help="numbers of scenes, from 0 on")
    parser.add_argument("--program", default=RODYN)
    options = parser.parse_args()
    numbers = options.only or range(COUNT)
    total = grazing = different = failed = 0
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for number in numbers:
            exact = events(folder, options.program, scene(number), "dop853", 1e-12)
            found = {method: events(folder, options.program, scene(number), method) for method in METHODS}
            total += len(exact)
            failed += sum(isinstance(some, str) for some in found.values())
            if all(some == exact for some in found.values()):
                continue
            near = [events(folder, options.program, scene(number, shift), "dop853", 1e-12) for shift in (1e-8, -1e-8, 1e-7)]
            if any(other != exact for other in [found["dop853"], *near]) and not any(isinstance(some, str) for some in found.values()):
                grazing += 1
                continue
            different += 1
            print(f"{number}: dop853 at 1e-12 {len(exact)}; " + ", ".join(
                f"{method} {some if isinstance(some, str) else len(some)}" for method, some in found.items()), flush=True)
    print(f"{len(numbers)} scenes (seed {SEED}), {total} events; {failed} runs failed, {different} scenes differ between methods, "
          f"{grazing} graze a contact")
    return int(different > 0)


if __name__ == "__main__":
    sys.exit(main())
