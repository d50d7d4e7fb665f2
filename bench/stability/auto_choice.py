#!/usr/bin/env python3
"""`auto` against the methods by name on ordinary scenes (`ordinary_scenes.py`): processor time of whole runs, start-up apart.

    bench/stability/auto_choice.py [--seeds 1 8] [--program bin/rodyn] [FAMILY ...]

One line for each scene where `auto` fails or takes more than 1.5 times the best method; at the end how many take more than 2.5 times.
A method is stopped once it is behind `auto`.
"""

from __future__ import annotations

import argparse
import math
import pathlib
import resource
import subprocess
import tempfile

import ordinary_scenes

METHODS = ("dop853", "gauss", "bdf", "erk", "adams")
LIMIT = 10.0  # s, of a run by auto
LEAST = 0.006  # s, below which a run is not told from start-up


def run(program: str, text: str, seconds: float) -> float:
    """Processor time of a run in the user's code [s]; infinite if it fails or takes longer than `seconds`, in whole ones."""
    limit = max(1, math.ceil(seconds))
    with tempfile.TemporaryDirectory() as folder:
        case = pathlib.Path(folder) / "case.nml"
        case.write_text(text)
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        done = subprocess.run([program, "run", case, "--output", case.with_suffix(".h5"), "--quiet"], capture_output=True,
                              preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1)))
        spent = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    return spent if done.returncode == 0 else math.inf


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("families", nargs="*", default=list(ordinary_scenes.FAMILIES))
    parser.add_argument("--seeds", nargs=2, type=int, default=(1, 8))
    parser.add_argument("--program", default="bin/rodyn")
    arguments = parser.parse_args()
    scenes = failed = slow = 0
    for family in arguments.families:
        for seed in range(arguments.seeds[0], arguments.seeds[1] + 1):
            groups = ordinary_scenes.groups_of(family, seed)
            start_up = run(arguments.program, "&case t_end = 1e-9, n_outputs = 1 /\n&chain n_rods = 1, length = 1, mass_per_length = 1, "
                           "bending_stiffness = 1 /\n&spacecraft mass = 1, inertia = 1 /\n", 1.0)
            auto = run(arguments.program, ordinary_scenes.text_of(groups), LIMIT)
            times = {m: run(arguments.program, ordinary_scenes.text_of(groups, method=m), min(auto, LIMIT)) for m in METHODS}
            best = min(times, key=times.get)
            ratio = max(auto - start_up, LEAST) / max(times[best] - start_up, LEAST)
            scenes += 1
            failed += math.isinf(auto)
            slow += ratio > 2.5
            if math.isinf(auto) or ratio > 1.5:
                print(f"{family} {seed}: auto {auto:.3f} s, {best} {times[best]:.3f} s, ratio {ratio:.2f}", flush=True)
    print(f"{scenes} scenes: {failed} failed, {slow} above 2.5")


if __name__ == "__main__":
    main()
