#!/usr/bin/env python3
"""Validation: the program against published numbers and closed forms, with few and with many rods.

    bench/validation/run.py                    all benchmarks (two minutes on one core), docs/validation.md and its picture
    bench/validation/run.py blade elastica     some of them, by their case files; printed only
    bench/validation/run.py --docs             write the document from what results/validation holds

Elastic rods are computed with each formulation of `MODELS` in benchmarks.py that the program knows.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import re
import sys
import time
from collections.abc import Iterator, Sequence
from typing import Any

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parents[1] / "postproc")]
import numpy as np  # noqa: E402
from benchmarks import BENCHMARKS, RIGID, Benchmark, Program, Quantity, Scene  # noqa: E402
from support import ROOT  # noqa: E402

RESULTS = ROOT / "results" / "validation"
DOCUMENT = ROOT / "docs" / "validation.md"
PICTURE = ROOT / "docs" / "pictures" / "validation"
BEGIN, END = "<!-- made by bench/validation/run.py -->\n", "<!-- end of what it makes -->\n"
ROUNDING = 1e-9  # below it errors show no order
#: Panels of the picture: title, case file, quantity.
PANELS = [("blade, $\\Omega = 6$", "blade", "Omega = 6, hub radius 0"), ("Euler column", "column", "load on the tip"),
          ("flutter of a free beam", "thrust", "flutter load"), ("elastica, $P = 5$", "elastica", "P = 5: w"),
          ("spin-up, tip at 10 s", "spin_up", "deflection at 10 s"), ("flying beam, $y$ at 8 s", "flying_beam", "y"),
          ("hub and boom", "boom", "M0 = 10, J0 = 2, r = 0.3"), ("wedge, $\\omega_1$", "tapered", "wedge: omega_1")]

Results = dict[str, dict[str, list[list[float]]]]  # key of a benchmark: model: (rods, quantity)


def key(benchmark: Benchmark) -> str:
    return f"{benchmark.case}: {benchmark.quantities[0].name}"


def models_of(benchmark: Benchmark, program: Program) -> list[str]:
    return program.models if benchmark.elastic else [RIGID]


def compute(benchmark: Benchmark, program: Program, rods: Sequence[int] = ()) -> dict[str, list[list[float]]]:
    """What the program gives, over model, number of rods and quantity."""
    return {model: [[float(value) for value in benchmark.measure(program, Scene(benchmark.case, n, model, benchmark.numbers))]
                    for n in rods or benchmark.rods] for model in models_of(benchmark, program)}


def errors(quantity: Quantity, values: Sequence[float]) -> np.ndarray:
    """Relative to the reference, or to the scale of the quantity, with signs."""
    return (np.array(values) - quantity.reference) / abs(quantity.scale or quantity.reference)


def order(quantity: Quantity, rods: Sequence[int], wrong: np.ndarray) -> float:
    """Between the last two numbers of rods whose errors stand well above rounding and what the digits of the reference leave open."""
    floor = max(ROUNDING, 20.0 * quantity.floor / abs(quantity.scale or quantity.reference))
    seen = [i for i in range(len(rods)) if np.abs(wrong[i]) > floor]
    if len(seen) < 2 or seen[-1] != seen[-2] + 1:
        return np.nan
    i, j = seen[-2:]
    return float(np.log(abs(wrong[i] / wrong[j])) / np.log(rods[j] / rods[i]))


def header(case: str) -> tuple[str, str]:
    """Title and text of a case file, from its first comment."""
    lines = [line[1:].strip() for line in re.match(r"(!.*\n)+", (HERE / f"{case}.nml").read_text())[0].splitlines()]
    return lines[0], "\n".join(lines[2:])


def short(value: float) -> str:
    if not np.isfinite(value):
        return "–"
    return "0" if value == 0.0 else re.sub(r"e([+-])0?", r"e\1", f"{value:+.1e}").replace("e+0", "").replace("-", "−")


def number(value: float, digits: int = 8) -> str:
    return "–" if not np.isfinite(value) else f"{value:.{digits}g}".replace("-", "−")


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def convergence_rows(benchmark: Benchmark, found: dict[str, list[list[float]]]) -> Iterator[list[str]]:
    """One for each quantity and model: its errors over the number of rods, the order seen, and the value with most rods."""
    for i, quantity in enumerate(benchmark.quantities):
        for model, values in found.items():
            column = [row[i] for row in values]
            wrong = errors(quantity, column)
            seen = order(quantity, benchmark.rods, wrong)
            first = [quantity.name, number(quantity.reference)] if model == next(iter(found)) else ["", ""]
            yield [*first, *([f"`{model}`"] if benchmark.elastic else []), *map(short, wrong), "–" if np.isnan(seen) else f"{seen:.1f}",
                   number(column[-1])]


def section(case: str, results: Results) -> str:
    """Title, text and table of the benchmarks of one case file."""
    family = [benchmark for benchmark in BENCHMARKS if benchmark.case == case]
    title, text = header(case)
    parts = [f"### {title}\n\n{text}\n\n`bench/validation/{case}.nml`"]
    rods = family[0].rods
    if family[0].exact:
        several = len(rods) > 1
        rows = [[quantity.name, *([str(n)] if several else []), number(quantity.reference, 13), number(value, 13),
                 short(errors(quantity, [value])[0])]
                for benchmark in family for n, values in zip(benchmark.rods, results[key(benchmark)][RIGID], strict=True)
                for quantity, value in zip(benchmark.quantities, values, strict=True)]
        parts.append(table(["", *(["rods"] if several else []), "reference", "Rodyn", "difference"], rows))
    else:
        head = ["", "reference", *(["formulation"] if family[0].elastic else []), *(f"n = {n}" for n in rods), "order",
                f"Rodyn, n = {rods[-1]}"]
        parts.append(table(head, [row for benchmark in family for row in convergence_rows(benchmark, results[key(benchmark)])]))
    return "\n\n".join(parts) + "\n\n"


def write_document(results: Results) -> None:
    """Put the sections between the marks, and draw the picture."""
    before, _, rest = DOCUMENT.read_text(encoding="utf-8").partition(BEGIN)
    cases = list(dict.fromkeys(benchmark.case for benchmark in BENCHMARKS))
    exact = {benchmark.case for benchmark in BENCHMARKS if benchmark.exact}
    parts = ["## Rods against beams and strings\n\n", *(section(case, results) for case in cases if case not in exact),
             "## Scenes that are exact\n\n", *(section(case, results) for case in cases if case in exact)]
    DOCUMENT.write_text(before + BEGIN + "\n" + "".join(parts) + END + rest.partition(END)[2], encoding="utf-8")
    draw(results)


def draw(results: Results) -> None:
    """Errors over the number of rods."""
    import style
    from matplotlib.ticker import NullLocator

    figure, panels = style.new_figure(2, 4, height=4.6)
    for axes, (title, case, name) in zip(panels.flat, PANELS, strict=True):
        benchmark, i = next((b, i) for b in BENCHMARKS if b.case == case for i, q in enumerate(b.quantities) if q.name == name)
        for line, (model, values) in enumerate(results[key(benchmark)].items()):
            wrong = np.abs(errors(benchmark.quantities[i], [row[i] for row in values]))
            axes.loglog(benchmark.rods, wrong, label=model, **style.mark_style(line))
        low, high = axes.get_ylim()
        axes.set_ylim(low / 1.5, high * 1.5)
        axes.set_xlim(benchmark.rods[0] / 1.2, benchmark.rods[-1] * 1.2)
        axes.set_xticks(benchmark.rods, [str(n) for n in benchmark.rods])
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_title(title, loc="left")
    for axes in panels[1]:
        axes.set_xlabel("rods")
    for axes in panels[:, 0]:
        axes.set_ylabel("relative error")
    style.legend_below(figure, panels.flat)
    style.save(figure, PICTURE.with_suffix(".png"))


def report(benchmark: Benchmark, found: dict[str, list[list[float]]], seconds: float) -> None:
    print(f"{benchmark.case} ({seconds:.1f} s)")
    for row in convergence_rows(benchmark, found):
        print("   " + "  ".join(f"{cell:>10}" for cell in row), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=", ".join(dict.fromkeys(b.case for b in BENCHMARKS)))
    parser.add_argument("--docs", action="store_true", help="compute nothing")
    arguments = parser.parse_args()
    if unknown := set(arguments.cases) - {benchmark.case for benchmark in BENCHMARKS}:
        parser.error(f"no case is called {', '.join(sorted(unknown))}")
    kept = RESULTS / "validation.json"
    results: dict[str, Any] = json.loads(kept.read_text()) if kept.exists() else {}
    program = Program(RESULTS)
    for benchmark in [] if arguments.docs else BENCHMARKS:
        if arguments.cases and benchmark.case not in arguments.cases:
            continue
        start = time.monotonic()
        results[key(benchmark)] = compute(benchmark, program)
        report(benchmark, results[key(benchmark)], time.monotonic() - start)
        kept.write_text(json.dumps(results))
    if not arguments.cases:
        write_document(results)


if __name__ == "__main__":
    main()
