"""One run of every kind under valgrind: invalid reads and writes, uninitialised values, leaks.

    python bench/stability/valgrind_runs.py PROGRAM    (a build without AVX-512: tools/sanitize valgrind)
"""

from __future__ import annotations

import argparse
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
from mutants import BASE, SWEEPS  # noqa: E402
from scenes import scenes  # noqa: E402

VALGRIND = ["valgrind", "--error-exitcode=99", "--leak-check=full", "--show-leak-kinds=definite,indirect,possible",
            "--errors-for-leak-kinds=definite,indirect,possible", "--num-callers=20", f"--suppressions={HERE / 'valgrind.supp'}"]


def commands(directory: pathlib.Path):
    """Name, arguments, exit codes that are right."""
    for number, (name, text) in enumerate(scenes().items()):
        (directory / f"{number}.nml").write_text(text)
        yield name, ["run", f"{number}.nml"], 0
    (directory / "base.nml").write_text(BASE)
    for number, text in enumerate(SWEEPS):
        adapted = text
        for quick, slow in (("case_seconds = 0.5", "case_seconds = 500"), (", 1e5, 1e6, 1e7, 1e8, 1e9, 1e10", "")):
            adapted = adapted.replace(quick, slow)
        (directory / f"sweep{number}.nml").write_text(adapted)
        yield f"sweep {number}", ["sweep", f"sweep{number}.nml"], 0
        yield f"sweep {number} again", ["sweep", f"sweep{number}.nml"], 0
    yield "dry run", ["sweep", "sweep0.nml", "--dry-run"], 0
    yield "run a result again", ["run", "0.h5"], 0
    yield "check", ["check", "0.nml"], 0
    yield "check a sweep", ["check", "sweep1.nml"], 0
    yield "defaults", ["defaults"], 0
    (directory / "bad.nml").write_text("&case t_end = -1, x = 'a' /\n&chain n_rods = 2, length = 1, 2, 3 / &load node = 9 /")
    yield "refused", ["run", "bad.nml"], 2
    (directory / "fails.nml").write_text(scenes()["consistent, dop853"].replace("rtol", "max_steps = 20, rtol"))
    yield "fails", ["run", "fails.nml"], 1
    (directory / "cut.h5").write_bytes((directory / "0.h5").read_bytes()[:5000])
    yield "truncated result", ["run", "cut.h5"], 2


def main(program: str) -> int:
    bad = 0
    program = str(pathlib.Path(program).resolve())
    with tempfile.TemporaryDirectory() as place:
        directory = pathlib.Path(place)
        for name, arguments, code in commands(directory):
            done = subprocess.run([*VALGRIND, program, *arguments], cwd=directory, capture_output=True, text=True)
            found = re.search(r"ERROR SUMMARY: (\d+) errors", done.stderr)
            good = done.returncode == code and found and found[1] == "0"
            bad += not good
            print(f"{name:28s} {'clean' if good else 'exit code ' + str(done.returncode)}", flush=True)
            if not good:
                print(done.stderr)
    print(f"{bad} runs with findings")
    return int(bad > 0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    sys.exit(main(parser.parse_args().program))
