#!/usr/bin/env python3
"""Axial force and the number of rods: what the warning of `axial_error_limit` rests on (docs/stability.md, "Validity").

    bench/validation/axial_limit.py            prints the table there; half a minute on one core

Each beam is cut into as many rods as bring P = max |N| l^2/(pi^2 EI) below the limit of its kinematics at `axial_error_limit = 0.01`; for each
the errors of what `benchmarks.py` measures.
"""

from __future__ import annotations

import math
import pathlib
import sys
from collections.abc import Sequence

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]
import benchmarks  # noqa: E402
import run  # noqa: E402

#: Kinematics: keys of &model, and P at which bending may be 1 % off.
KINDS = {"chord": ("formulation = 'consistent'", 0.12 / math.pi**2), "arc": ("formulation = 'inextensible'", 0.25),
         "arc, three shapes": ("formulation = 'inextensible', bending_shapes = 3, gauss_points = 8", 1.0)}


def force(benchmark: benchmarks.Benchmark) -> float:
    """Largest axial force of a blade that turns, or of a beam under the load at which it fails; length, mass and EI are 1."""
    if benchmark.case == "blade":
        return benchmark.numbers["omega"] ** 2 * (0.5 + benchmark.numbers["radius"])
    return benchmark.quantities[0].reference


def rods(share: float, limit: float) -> int:
    """To cut a beam into that has this P as one rod."""
    return math.ceil(math.sqrt(share / limit))


def rows(program: benchmarks.Program, cases: Sequence[str] = ("blade", "column", "thrust")) -> list[list[str]]:
    table: list[list[str]] = []
    for benchmark in benchmarks.BENCHMARKS:
        if benchmark.case not in cases:
            continue
        share = force(benchmark) / math.pi**2
        table += [[f"{benchmark.case}: {quantity.name}", f"{share:.2f}"] for quantity in benchmark.quantities]
        for kind, (keys, limit) in KINDS.items():
            benchmarks.MODELS[kind] = keys
            n = rods(share, limit)
            values = benchmark.measure(program, benchmarks.Scene(benchmark.case, n, kind, benchmark.numbers))
            for row, quantity, value in zip(table[-len(benchmark.quantities):], benchmark.quantities, values, strict=True):
                row += [str(n), run.short(run.errors(quantity, [value])[0])]
    return table


def main() -> None:
    head = ["", "P of one rod", *(text for kind in KINDS for text in (f"{kind}: rods", "error"))]
    print(run.table(head, rows(benchmarks.Program(run.RESULTS))))


if __name__ == "__main__":
    main()
