"""Do two builds agree? Every scene by both, at tight tolerances: the largest difference of any state, relative to its kind.

    python bench/stability/levels.py PROGRAM OTHER   (tools/sanitize levels: -O0 and -O3)

Adaptive methods may take other steps when a rounding error tips a decision, so they agree to their tolerance, not to rounding.
With exact dampers the slopes are states that decay within microseconds, and their rates are the states times 2e6 1/s: what is
1e-13 rad of a slope is 2e-7 rad/s of its rate. Those rates are not judged.
"""

from __future__ import annotations

import argparse
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from run_files import largest_difference
from scenes import scenes

LARGEST = 1e-9


def main(programs: list[str]) -> int:
    bad = 0
    with tempfile.TemporaryDirectory() as place:
        directory = pathlib.Path(place)
        for name, text in scenes(rtol=1e-12, atol=1e-14).items():
            (directory / "case.nml").write_text(text)
            results = [directory / f"{i}.h5" for i in range(2)]
            for program, result in zip(programs, results, strict=True):
                subprocess.run([program, "run", directory / "case.nml", "--output", result, "--force", "--quiet"], check=True)
            without = {"alpha_rate", "beta_rate"} if name.startswith("exact dampers") else set()
            difference, where = largest_difference(*results, without)
            bad += difference > LARGEST
            print(f"{name:28s} {difference:8.1e} {where}{'  TOO LARGE' if difference > LARGEST else ''}")
    print(f"{bad} scenes differ by more than {LARGEST:g}")
    return int(bad > 0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs=2, metavar="PROGRAM")
    sys.exit(main(parser.parse_args().programs))
