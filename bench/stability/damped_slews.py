#!/usr/bin/env python3
"""Slews of chains with dampers of any strength: long steps of collocation with many outputs in each.

    bench/stability/damped_slews.py                   320 slews by `gauss`, against `dop853` at rtol = 1e-12
    bench/stability/damped_slews.py --only 17 18      some of them
    bench/stability/damped_slews.py --quick           without the reference: do they run to their end?

A spacecraft with 2 to 6 rods turns by a moment that acts for a second, then swings for the rest of 100 s, of which 500 states
are written. Printed are the slews that fail, those whose phi is off by more than 100 rtol, and the largest errors.
"""

from __future__ import annotations

import argparse
import pathlib
import sys
import tempfile

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from support import RODYN, run_case, solver

COUNT, SEED = 320, 17
RTOL = 1e-8


def slew(number: int) -> str:
    """The case without its solver. Each has its own random numbers, so that it can be run alone."""
    rng = np.random.default_rng([SEED, number])
    stiffness, damping = (np.exp(rng.uniform(*np.log(ends))) for ends in ((50.0, 3000.0), (0.5, 50.0)))
    return f"""&case t_end = 100, n_outputs = 500 /
&spacecraft mass = 300, inertia = 120, hinge_x = 0.7 /
&chain n_rods = {rng.integers(2, 7)}, length = 2, mass_per_length = 0.8, bending_stiffness = {rng.choice([300, 1000, 3000])},
   hinge_stiffness = {stiffness:.4g}, hinge_damping = {damping:.4g} /
&load component = 'M', t_end = 1, value = 10 /
&output ledger = .false. /
"""


def run(folder: pathlib.Path, program: str, name: str, case: str, method: str, rtol: float) -> tuple[np.ndarray | None, str]:
    """phi at all outputs, or what went wrong."""
    import xarray

    result = folder / f"{name}.h5"
    trouble = run_case(program, case + solver(method, rtol), result)
    if trouble:
        return None, trouble
    with xarray.open_dataset(result) as data:
        return data.phi.values, ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", type=int, nargs="+", help="numbers of slews, from 0 on")
    parser.add_argument("--quick", action="store_true", help="no reference")
    parser.add_argument("--program", default=RODYN)
    options = parser.parse_args()
    numbers = options.only or range(COUNT)
    errors, failed = [], 0
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for number in numbers:
            phi, trouble = run(folder, options.program, "slew", slew(number), "gauss", RTOL)
            if phi is None:
                failed += 1
                print(f"{number}: {trouble}")
            elif not options.quick:
                exact, trouble = run(folder, options.program, "exact", slew(number), "dop853", 1e-12)
                errors.append(abs(phi - exact).max() / RTOL)
                if errors[-1] > 100.0:
                    print(f"{number}: phi is off by {errors[-1]:.0f} rtol")
    print(f"{len(numbers)} slews (seed {SEED}), {failed} failed")
    if errors:
        print(f"largest error of phi: {max(errors):.2g} rtol, median {np.median(errors):.2g} rtol")
    return int(failed > 0 or max(errors, default=0.0) > 100.0)


if __name__ == "__main__":
    sys.exit(main())
