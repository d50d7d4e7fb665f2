"""What the calls of the package `rodyn` take beside the integration, and how long the identification of its notebook takes.

    PYTHONPATH=postproc python bench/python_calls.py
"""

from __future__ import annotations

import json
import pathlib
import time
from collections.abc import Callable

import rodyn

ROOT = pathlib.Path(__file__).resolve().parents[1]
REPEATS = 200


def beside_integration(call: Callable[[], None], case: rodyn.Case) -> tuple[float, float]:
    """The least time of a call less that of its run, by the clock of the run, and the least of the run [ms]."""
    calls, runs = [], []
    for _ in range(REPEATS):
        began = time.perf_counter()
        call()
        calls.append(time.perf_counter() - began)
        runs.append(float(case.run().solver_wall_seconds))
    return 1e3 * (min(calls) - min(runs)), 1e3 * min(runs)


def main() -> None:
    """The scene of table 1 for a second, 101 rows, ledger included."""
    case = rodyn.Case(ROOT / "cases" / "table1.nml")
    case["case.t_end"], case["case.n_outputs"], case["solver.rtol"], case["solver.atol"] = 1.0, 100, 1e-6, 1e-8

    def set_and(call: Callable[[], object]) -> Callable[[], None]:
        def both() -> None:
            case["chain.hinge_stiffness"] = [6e3] + 3 * [4e3]
            call()
        return both

    for name, call in {"set a key, arrays()": set_and(case.arrays), "set a key, run()": set_and(case.run)}.items():
        rest, run = beside_integration(call, case)
        print(f"{name:22} {rest:6.2f} ms beside {run:.2f} ms of the run")
    cells = json.loads((ROOT / "docs" / "notebooks" / "identification.ipynb").read_text())["cells"]
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    exec(compile(code.replace("../../cases", str(ROOT / "cases")), "identification", "exec"), {})


if __name__ == "__main__":
    main()
