#!/usr/bin/env python3
"""Write the article's three tables with ours beside the printed numbers, as Markdown and LaTeX.

    postproc/tables.py results/table1.h5 results/table3 --out results/tables

Runs of the table-1 scene give tables 1 and 2, as far as they reach; so does a sweep of it with probe times, as a range over
its cases. A sweep over the mass ratio and the inertia gives table 3.
"""

from __future__ import annotations

import argparse
import pathlib
import sys
from collections.abc import Sequence
from typing import NamedTuple

import command
import numpy as np
from article import TABLE_1, TABLE_2, TABLE_3, TABLE_3_AXIS, TABLE_3_QUANTITIES, TABLE_3_TIME, Printed, slipped_displacement
from exact_lumped import kinds
from rodyn_data import DataError, Run, Sweep, is_sweep, open_run, open_sweep, split_name, symbol_text

MISSING = "–"
TABLE_3_NOTE = (r"The article's $EI$ is a misprint, its $u_x$ solves $\dot{u} = V_x - \omega u$ and stands under that, and its lumped rows "
                "have the inner half of rod 1 in the spacecraft without a lever: docs/studies.md.")


class Table(NamedTuple):
    """Cells are text; `$...$` is mathematics in Markdown and LaTeX alike."""

    title: str
    head: list[str]
    rows: list[list[str]]
    note: str = ""


class Written(NamedTuple):
    tables: list[Table]
    saved: list[pathlib.Path]


def plot(files: str | pathlib.Path | Sequence[str | pathlib.Path], out: str | pathlib.Path) -> Written:
    """Write OUT.md and OUT.tex (or just the one that OUT names)."""
    found = tables([files] if isinstance(files, str | pathlib.Path) else files)
    out = pathlib.Path(out)
    writers = {".md": markdown, ".tex": latex}
    paths = [out] if out.suffix in writers else [out.with_name(out.name + suffix) for suffix in writers]
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n\n".join(writers[path.suffix](table) for table in found) + "\n", encoding="utf-8")
    return Written(found, paths)


def tables(files: Sequence[str | pathlib.Path]) -> list[Table]:
    """All tables that the files have numbers for, in the article's order."""
    ours: dict[tuple[str, float], list[float]] = {}
    third: list[Table] = []
    for file in files:
        if not is_sweep(file):
            with open_run(file) as run:
                collect_run(run, ours)
            continue
        with open_sweep(file) as sweep:
            if TABLE_3_AXIS in sweep.axes:
                third.append(table_3(sweep))
            else:
                collect_sweep(sweep, ours)
    result = [
        time_table(title, printed, ours)
        for title, printed in (("Table 1. State after one second", TABLE_1), ("Table 2. State after long times", TABLE_2))
        if any((p.quantity, p.time) in ours for p in printed)
    ]
    if not result + third:
        times = ", ".join(f"{t:g}" for t in sorted({p.time for p in TABLE_1 + TABLE_2}))
        raise DataError(f"{', '.join(map(str, files))}: nothing for the article's tables: no row at t = {times} s of a chain of four "
                        f"rods, no sweep over {TABLE_3_AXIS}")
    return result + third


def collect_run(run: Run, ours: dict[tuple[str, float], list[float]]) -> None:
    """Numbers of a run at the times of tables 1 and 2."""
    time = run.time
    for printed in TABLE_1 + TABLE_2:
        row = int(np.argmin(np.abs(time - printed.time)))
        if abs(time[row] - printed.time) <= 1e-9 * printed.time and run.n_rods >= 4:
            ours.setdefault((printed.quantity, printed.time), []).append(float(run.quantity(printed.quantity).values[row]))


def collect_sweep(sweep: Sweep, ours: dict[tuple[str, float], list[float]]) -> None:
    for printed in TABLE_1 + TABLE_2:
        if np.any(np.abs(sweep.probe_times - printed.time) <= 1e-9 * printed.time):
            values = sweep.quantity(printed.quantity, printed.time).values
            ours.setdefault((printed.quantity, printed.time), []).extend(values[np.isfinite(values)].tolist())


def time_table(title: str, printed: Sequence[Printed], ours: dict[tuple[str, float], list[float]]) -> Table:
    """Ours with the digits of the article's and two more, the reference, the article's range."""
    head = ["quantity", "$t$, s", "Rodyn", "reference", "article", "Rodyn − reference", "article − reference"]
    rows = []
    for p in printed:
        values = ours.get((p.quantity, p.time), [])
        name, rod = split_name(p.quantity)
        unit = "rad/s" if name.endswith("rate") else "rad"
        reference = float(p.reference)
        mine = farthest(values, reference)
        theirs = farthest([float(p.low), float(p.high)], reference)
        article = p.low if p.low == p.high else f"{p.low} … {p.high}"
        rows.append([
            f"{symbol_text(name, rod)}, {unit}", f"{p.time:g}", value_range(values, decimals(p.reference)), p.reference, article,
            MISSING if mine is None else scientific(mine - reference), scientific(theirs - reference),
        ])
    return Table(title, head, rows)


def farthest(values: Sequence[float], reference: float) -> float | None:
    return max(values, key=lambda v: abs(v - reference)) if values else None


def table_3(sweep: Sweep) -> Table:
    """Exact, lumped and their difference for each ratio; printed numbers below ours, their u_x under the equation that it follows."""
    quantities = [sweep.quantity(name, TABLE_3_TIME) for name, _ in TABLE_3_QUANTITIES]
    factors = [180.0 / np.pi if unit == "deg" else 1.0 for _, unit in TABLE_3_QUANTITIES]
    head = [TABLE_3_AXIS.replace("_", " "), "source", "inertia"]
    head += [f"{q.symbol}, {'°' if unit == 'deg' else unit}" for q, (_, unit) in zip(quantities, TABLE_3_QUANTITIES, strict=True)]
    head.append(r"$u$ of $\dot{u} = V_x - \omega u$, m")
    columns = [q.values * factor for q, factor in zip(quantities, factors, strict=True)] + [slipped_displacement(sweep)]
    ratios = sweep.axis(TABLE_3_AXIS).astype(float)
    chosen = {kind: sweep.chosen(place) for kind, place in kinds(sweep).items()}
    rows = []
    for ratio in sorted({*ratios, *map(float, TABLE_3)}):
        cases = {kind: np.flatnonzero(np.isclose(ratios, ratio) & some) for kind, some in chosen.items()}
        if all(found.size for found in cases.values()):
            rows += block(f"{ratio:g}", "Rodyn", {kind: [column[found[0]] for column in columns] for kind, found in cases.items()})
        if ratio in TABLE_3:
            rows += block(f"{ratio:g}", "article", dict(zip(("exact", "lumped"), map(under_its_equation, TABLE_3[int(ratio)]), strict=True)))
    return Table(f"Table 3. Exact and lumped inertia at t = {TABLE_3_TIME:g} s", head, rows, TABLE_3_NOTE)


def under_its_equation(line: Sequence[str]) -> list[float]:
    """A printed row with its u_x in the last column."""
    *angles, displacement, rotation = map(float, line)
    return [*angles, np.nan, rotation, displacement]


def block(ratio: str, source: str, lines: dict[str, list[float]]) -> list[list[str]]:
    difference = [a - b for a, b in zip(lines["exact"], lines["lumped"], strict=True)]
    return [[ratio, source, name, *(fixed(v, 3, MISSING if np.isfinite(values).any() else "failed") for v in values)]
            for name, values in (*lines.items(), ("exact − lumped", difference))]


def fixed(value: float, digits: int, missing: str = "failed") -> str:
    return minus(f"{value:.{digits}f}") if np.isfinite(value) else missing


def minus(text: str) -> str:
    return text.replace("-", "−")


def decimals(text: str) -> int:
    return len(text.partition(".")[2])


def value_range(values: Sequence[float], digits: int) -> str:
    if not values:
        return MISSING
    low, high = fixed(min(values), digits), fixed(max(values), digits)
    return low if low == high else f"{low} … {high}"


def scientific(value: float) -> str:
    if not value:
        return "0"
    digits, exponent = f"{value:.1e}".split("e")
    return f"${digits} \\cdot 10^{{{int(exponent)}}}$"


def markdown(table: Table) -> str:
    lines = [f"**{table.title}**", "", "| " + " | ".join(table.head) + " |", "|---|" + "---:|" * (len(table.head) - 1)]
    lines += ["| " + " | ".join(cell if "$" in cell else minus(cell) for cell in row) + " |" for row in table.rows]
    return "\n".join([*lines, "", table.note] if table.note else lines)


def latex(table: Table) -> str:
    """With booktabs."""
    lines = [
        "% needs \\usepackage{booktabs}", "\\begin{table}", "\\centering", f"\\caption{{{tex(table.title)}}}",
        f"\\begin{{tabular}}{{l{'r' * (len(table.head) - 1)}}}", "\\toprule", " & ".join(map(tex, table.head)) + " \\\\", "\\midrule",
    ]
    lines += [" & ".join(map(tex, row)) + " \\\\" for row in table.rows]
    note = ["", f"\\medskip\\small {tex(table.note)}"] if table.note else []
    return "\n".join([*lines, "\\bottomrule", "\\end{tabular}", *note, "\\end{table}"])


def tex(cell: str) -> str:
    """Signs that LaTeX wants otherwise, outside of mathematics."""
    replaced = {"−": "$-$", "–": "--", "…": "\\dots{}", "°": "$^\\circ$", "%": "\\%", "_": "\\_", "&": "\\&"}
    parts = cell.split("$")
    for i in range(0, len(parts), 2):
        number = parts[i].strip()
        if number[:1] in "-−" and number[1:2].isdigit():
            parts[i] = parts[i].replace("-", "−")
        for old, new in replaced.items():
            parts[i] = parts[i].replace(old, new)
    return "$".join(parts)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument("files", nargs="+", type=pathlib.Path, help="run and sweep files")
    parser.add_argument("-o", "--out", type=pathlib.Path, default=pathlib.Path("tables"), help=".md or .tex; without a suffix both")
    arguments = parser.parse_args()
    return command.finish(lambda: plot(arguments.files, arguments.out))


if __name__ == "__main__":
    sys.exit(main())
