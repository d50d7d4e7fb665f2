"""What benchmarks and campaigns have in common: where the project and the program are, compiled benchmarks, runs of single cases."""

from __future__ import annotations

import os
import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[1]
RODYN = os.environ.get("RODYN", str(ROOT / "bin" / "rodyn"))


def benchmark(name: str, **environment: str) -> str:
    """Path of a compiled benchmark."""
    done = subprocess.run([ROOT / "tools/bench", "--path", name], capture_output=True, text=True, check=False, env=os.environ | environment)
    if done.returncode:
        raise SystemExit(f"{name} could not be built:\n{done.stderr[-2000:]}")
    return done.stdout.split()[-1]


def run_case(program: str, case: str, result: pathlib.Path) -> str:
    """Run a case into a run file; what went wrong, or nothing."""
    source = result.with_suffix(".nml")
    source.write_text(case)
    command = [program, "run", str(source), "--output", str(result), "--force", "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stderr.strip() or f"exit code {done.returncode}" if done.returncode else ""


def solver(method: str, rtol: float) -> str:
    """A method with the tolerances of most comparisons."""
    return f"&solver method = '{method}', rtol = {rtol}, atol = {0.01 * rtol} /\n"
