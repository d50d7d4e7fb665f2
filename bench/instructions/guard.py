"""Count the instructions of right-hand sides and short runs, and compare them with the recorded ones.

    python bench/instructions/guard.py            exit 1 if anything takes over 1 % more than recorded
    python bench/instructions/guard.py --record   write the counts of this compiler into counts.json

Instructions do not depend on what else the machine does, so a slow-down of 1 % shows in review where time would not. Those of
runs are for a right-hand side: the number of steps follows from rounding, too (by some percent).
They are counted by valgrind's callgrind (Debian: package valgrind), which knows no AVX-512: the program is built for
x86-64-v3. Counts belong to a compiler version; one that is not in counts.json is only reported, with exit 3, and so is that
valgrind is missing.
"""

import argparse
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from support import ROOT, benchmark

COUNTS = pathlib.Path(__file__).with_name("counts.json")
TOLERANCE = 1.01
KINDS = {  # kind: two numbers of calls whose difference is counted
    "rhs": (1000, 3000),
    "rhs_inextensible": (1000, 3000),
    "rhs_rigid": (1000, 3000),
    "rhs_lumped": (1000, 3000),
    "rhs_condensed": (1000, 3000),
    "lanes": (1000, 3000),
    "lanes_inextensible": (1000, 3000),
    "run_dop853": (1, 3),
    "run_gauss": (1, 3),
    "run_adams": (1, 3),
    "run_bdf": (1, 3),
}


def command_output(*command: str, **environment: str) -> str:
    """Standard output and error of a command in the project's directory."""
    done = subprocess.run(
        command, cwd=ROOT, env=os.environ | environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    if done.returncode:
        sys.exit(f"{' '.join(command)}\n{done.stdout}")
    return done.stdout


def build() -> str:
    """Build the benchmark for x86-64-v3; return its path."""
    march = {"RODYN_MARCH": "x86-64-v3"}
    same = command_output("tools/flags", "release", **march) == command_output("tools/flags", "release")
    stage = "release" if same else "guard"
    return benchmark("instructions", RODYN_STAGE=stage, **march)


def instructions(program: str, kind: str, times: int) -> tuple[int, int]:
    """Instructions of a whole process, and the right-hand sides of its runs; where it makes none, the calls."""
    text = command_output(
        "valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", program, kind, str(times), OPENBLAS_NUM_THREADS="1"
    )
    calls = re.search(r"^(\d+) right-hand sides", text, re.MULTILINE)
    return int(re.search(r"Collected : (\d+)", text)[1]), int(calls[1]) if calls else times


def count(program: str, kind: str) -> float:
    """Instructions of one call; of runs those for a right-hand side, since the number of steps follows from rounding, too."""
    (few, few_calls), (many, many_calls) = (instructions(program, kind, times) for times in KINDS[kind])
    return (many - few) / (many_calls - few_calls)


def main() -> int:
    """Count, compare or record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", action="store_true", help="write counts.json instead of comparing")
    record = parser.parse_args().record
    if not shutil.which("valgrind"):
        print("valgrind is not installed")
        return 3
    compiler = command_output("gfortran", "-dumpfullversion").strip()
    recorded = json.loads(COUNTS.read_text()) if COUNTS.exists() else {}
    known = recorded.get(f"gfortran {compiler}", {})
    program = build()
    counts = {kind: round(count(program, kind)) for kind in KINDS}
    slower = []
    for kind, found in counts.items():
        change = f"{100 * (found / known[kind] - 1):+.1f} %" if kind in known else "not recorded"
        print(f"{kind:12} {found:10d} instructions  {change}")
        if kind in known and found > TOLERANCE * known[kind]:
            slower.append(kind)
    if record:
        recorded[f"gfortran {compiler}"] = counts
        COUNTS.write_text(json.dumps(recorded, indent=1) + "\n")
        return 0
    if slower:
        print(f"more than 1 % above counts.json: {', '.join(slower)}")
        return 1
    if any(kind not in known for kind in KINDS):
        print(f"no counts are recorded for gfortran {compiler}")
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(main())
