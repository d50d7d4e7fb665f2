"""Compile the library with a second compiler, and run its tests of physics: tools/sanitize flang.

    python bench/stability/second_compiler.py [COMPILER]     (default: flang-new-19)

Module files are each compiler's own, and those of HDF5, SUNDIALS and MPI on a Debian system are gfortran's. So everything that needs
none of these three is compiled, which is the physics with its own integrators, the reading of namelists, and their tests.
"""

from __future__ import annotations

import argparse
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = ROOT / "build" / "second-compiler"
INTRINSIC = {"iso_c_binding", "iso_fortran_env", "ieee_arithmetic", "ieee_exceptions"}
FLAGS = ["-O2", "-module-dir", str(BUILD)]


def modules() -> dict[str, tuple[pathlib.Path, set[str]]]:
    """Name of each module -> its file, what it uses."""
    found = {}
    for path in sorted([*(ROOT / "src").rglob("*.[fF]90"), *(ROOT / "test").glob("*.f90")]):  # test/library_example is a project of its own
        text = path.read_text()
        name = re.search(r"^module (\w+)", text, re.MULTILINE)
        if name:
            found[name[1]] = path, set(re.findall(r"^\s*use(?:, intrinsic ::)? (\w+)", text, re.MULTILINE)) - INTRINSIC
    return found


def in_order(found: dict[str, tuple[pathlib.Path, set[str]]]) -> tuple[list[str], list[str]]:
    """Modules that need no foreign ones, each after those it uses; and the others."""
    order: list[str] = []
    foreign: list[str] = []

    def visit(name: str) -> bool:
        if name in order:
            return True
        if name not in found or name in foreign:
            return False
        if not all([visit(used) for used in sorted(found[name][1])]):  # noqa: C419 (all are to be visited)
            foreign.append(name)
            return False
        order.append(name)
        return True

    for name in sorted(found):
        visit(name)
    return order, foreign


def compile_module(compiler: str, name: str, path: pathlib.Path) -> bool:
    target = BUILD / f"{name}.o"
    if target.exists() and target.stat().st_mtime > path.stat().st_mtime:
        return True
    done = subprocess.run([compiler, *FLAGS, "-c", path, "-o", target], capture_output=True, text=True)
    if done.returncode == 0:
        return True
    print(f"{path.relative_to(ROOT)}:\n{done.stdout}{done.stderr[:3000]}")
    return False


def quadmath_directory() -> pathlib.Path:
    found = subprocess.run(["gcc", "-print-file-name=libquadmath.so"], capture_output=True, text=True, check=True)
    return pathlib.Path(found.stdout.strip()).parent


def main(compiler: str) -> int:
    BUILD.mkdir(parents=True, exist_ok=True)
    found = modules()
    order, foreign = in_order(found)
    refused = [name for name in order if not compile_module(compiler, name, found[name][0])]
    library = [name for name in order if name.startswith("rodyn")]
    print(f"{len(library)} modules of the library compile; {len([n for n in foreign if n.startswith('rodyn')])} need foreign modules; "
          f"{len(refused)} are refused: {', '.join(refused)}")
    suites = [(name.removeprefix("test_"), name) for name in order
              if name.startswith("test_") and f"collect_{name.removeprefix('test_')}" in found[name][0].read_text()]
    main_file = BUILD / "tester.f90"
    main_file.write_text("program tester\n   use test_testing, only: run_suite, suite_tally, unittest\n"
                         + "".join(f"   use {name}, only: collect_{suite}\n" for suite, name in suites)
                         + "   implicit none\n   type(suite_tally) :: tally\n   type(unittest), allocatable :: suite(:)\n"
                         + "".join(f"   call collect_{suite}(suite)\n   call run_suite('{suite}', suite, tally, '')\n" for suite, _ in suites)
                         + "   print '(i0, a, i0, a)', tally%passed, ' passed, ', tally%failed, ' failed'\nend program tester\n")
    objects = [BUILD / f"{name}.o" for name in order if name not in refused]
    shim = BUILD / "quad_math.o"
    subprocess.run(["gcc", "-O2", "-c", pathlib.Path(__file__).with_name("quad_math.c"), "-o", shim], check=True)
    done = subprocess.run([compiler, *FLAGS, main_file, *objects, shim, "-o", BUILD / "tester", "-llapack", "-lblas",
                           f"-L{quadmath_directory()}", "-lquadmath"])
    if done.returncode != 0 or refused:
        return 1
    return subprocess.run([BUILD / "tester"]).returncode


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("compiler", nargs="?", default="flang-new-19")
    sys.exit(main(parser.parse_args().compiler))
