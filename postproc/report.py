#!/usr/bin/env python3
"""Make one self-contained HTML page of a run or a sweep: pictures, tables, input, versions. It needs no network.

    postproc/report.py results/example.h5           -> results/example-report.html
    postproc/report.py results/example.h5 --animation
"""

from __future__ import annotations

import argparse
import base64
import html
import pathlib
import sys
import tempfile
from collections.abc import Iterable, Sequence
from typing import Any

import animate
import command
import numpy as np
from figures import Picture, pictures
from natural_frequencies import natural_frequencies
from rodyn_data import (
    VERSION_ATTRIBUTES,
    DataError,
    Run,
    Sweep,
    distinct,
    is_sweep,
    open_run,
    open_sweep,
)
from spectrum import MANY_RODS

CSS = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1b1b1b; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; margin-bottom: .2rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; border-bottom: 1px solid #ccc; }
table { border-collapse: collapse; margin: .6rem 0; font-size: 13px; } caption { text-align: left; font-weight: 600; white-space: nowrap; }
th, td { padding: .2rem .7rem .2rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid #e4e4e4; }
th.n, td.n { text-align: right; font-variant-numeric: tabular-nums; } td { overflow-wrap: anywhere; } td:first-child { overflow-wrap: normal; }
figure { margin: 1.2rem 0; } figure img { max-width: 100%; width: 50rem; height: auto; }
figure img[src^="data:image/gif"] { width: auto; }
figcaption { font-size: 13px; color: #444; }
pre { background: #f6f6f6; padding: .8rem; overflow-x: auto; font-size: 12px; line-height: 1.4; }
.failed { background: #fbe9e7; border-left: 4px solid #b2182b; padding: .5rem .8rem; } .done { color: #444; }
@media print { body { max-width: none; } details { display: block; } }
"""
MIME = {".svg": "image/svg+xml", ".png": "image/png", ".gif": "image/gif"}
MOST_FAILURES = 200
SOLVER_WORDS = {
    "reason": "why this method", "n_steps": "steps", "n_rhs": "right-hand-side evaluations", "n_jac": "Jacobians",
    "wall_seconds": "wall time, s",
}


def plot(file: str | pathlib.Path, out: str | pathlib.Path, animation: bool = False) -> list[pathlib.Path]:
    """Write the page."""
    out = pathlib.Path(out)
    if is_sweep(file):
        with open_sweep(file) as sweep:
            title, sections = sweep.title, sweep_sections(sweep, file)
    else:
        with open_run(file) as run:
            title, sections = run.title, run_sections(run, file, animation)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(page(title, sections), encoding="utf-8")
    return [out]


def page(title: str, sections: Iterable[str]) -> str:
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'\">\n"
        f"<title>{html.escape(title)}</title>\n<style>{CSS}</style>\n</head>\n<body>\n<h1>{html.escape(title)}</h1>\n"
        + "\n".join(sections) + "\n</body>\n</html>\n"
    )


def run_sections(run: Run, file: str | pathlib.Path, animation: bool) -> list[str]:
    sections = [run_status(run), table("Scene and solver", run_facts(run)), "<h2>Pictures</h2>"]
    sections += [figure_of(picture) for picture in pictures(file)]
    if animation:
        with tempfile.TemporaryDirectory() as directory:
            path = pathlib.Path(directory) / "motion.gif"
            animate.plot(file, path)
            sections.append(figure(path, "Motion in the inertial frame; the line is the path of the outermost node."))
    sections += ["<h2>Numbers</h2>", ranges(run), frequencies(run)]
    return [*sections, *inputs(run.attributes()), versions(run.attributes())]


def run_status(run: Run) -> str:
    time, wanted = run.time, run.number("case", "t_end")
    if run.status == "done":
        return f'<p class="done">Done: {time.size} rows, {time[0]:g} to {time[-1]:g} s.</p>'
    reason = run.attribute("message") or run.attribute("reason") or run.solver().get("message") or ""
    until = f"It reached t = {time[-1]:g} s" + (f" of {wanted:g} s." if wanted else ".")
    return f'<p class="failed"><strong>This run is not complete: {html.escape(run.status)}.</strong> {until} {html.escape(str(reason))}</p>'


def run_facts(run: Run) -> list[tuple[str, str]]:
    model, solver = run.group("model"), run.solver()
    facts = [("rods", str(run.n_rods)), ("spacecraft", str(run.group("spacecraft").get("motion", "free")))]
    facts += [(name, str(model[name])) for name in ("formulation", "inertia", "bending", "kernel") if name in model]
    for name in ("method", "reason", "rtol", "atol", "n_steps", "n_rhs", "n_jac", "wall_seconds"):
        if name in solver:
            facts.append((SOLVER_WORDS.get(name, name), number(solver[name]) if isinstance(solver[name], float) else str(solver[name])))
    return facts


def ranges(run: Run) -> str:
    names = run.numbers() + [f"phi({k})" for k in sorted({1, run.n_rods})]
    rows = []
    for name in names:
        q = run.quantity(name)
        if np.any(q.values):
            rows.append([q.meaning, q.unit, *(number(v) for v in (q.values.min(), q.values.max(), q.values[-1]))])
    return grid("Ranges (quantities that stay zero are left out)", ["quantity", "unit", "least", "largest", "at the end"], rows, 2)


def frequencies(run: Run) -> str:
    if run.n_rods > MANY_RODS:
        return ""
    found = natural_frequencies(run)
    rows = [[str(i + 1), f"{w:.6g}", f"{w / (2 * np.pi):.6g}"] for i, w in enumerate(found[:40])]
    more = f"; the lowest 40 of {found.size}" if found.size > 40 else ""
    return grid(f"Natural frequencies, at rest in the initial shape{more}", ["mode", "rad/s", "Hz"], rows, 1)


def sweep_sections(sweep: Sweep, file: str | pathlib.Path) -> list[str]:
    counts = {s: sweep.status.count(s) for s in dict.fromkeys(sweep.status)}
    summary = f"{sweep.n_cases} cases: " + ", ".join(f"{n} {s or 'without status'}" for s, n in counts.items()) + "."
    failures = np.flatnonzero(sweep.failed)
    sections = [f'<p class="{"failed" if failures.size else "done"}">{html.escape(summary)}</p>']
    axes = [[name, str(len(distinct(v))), span(v)] for name, v in sweep.axes.items()]
    sections.append(grid("Axes", ["axis", "values", "from, to"], axes, 3))
    if failures.size:
        messages = sweep.messages()
        rows = [[str(i), *(shown(v[i]) for v in sweep.axes.values()), messages[i]] for i in failures[:MOST_FAILURES]]
        more = f"; the first {MOST_FAILURES} of {failures.size}" if failures.size > MOST_FAILURES else ""
        sections.append(grid(f"Failed cases{more}", ["case", *sweep.axes, "message"], rows, 99))
    sections += ["<h2>Pictures</h2>", *(figure_of(picture) for picture in pictures(file))]
    return [*sections, *inputs(sweep.attributes()), versions(sweep.attributes())]


def span(values: np.ndarray) -> str:
    found = distinct(values)
    if values.dtype.kind in "fiu":
        return f"{found[0]:g} to {found[-1]:g}" if found else ""
    return ", ".join(found)


def shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float | np.floating) else str(value)


def number(value: float) -> str:
    return f"{value:.6g}".replace("-", "−")


def figure_of(picture: Picture) -> str:
    """Drawn as SVG; what cannot be drawn is said instead."""
    with tempfile.TemporaryDirectory() as directory:
        path = pathlib.Path(directory) / f"{picture.name}.svg"
        try:
            picture.plot(path)
        except DataError as error:
            return f"<p>{html.escape(picture.caption)} Not drawn: {html.escape(str(error))}</p>"
        return figure(path, picture.caption)


def figure(path: pathlib.Path, caption: str) -> str:
    data = base64.b64encode(path.read_bytes()).decode()
    text = html.escape(caption)
    return f'<figure><img alt="{text}" src="data:{MIME[path.suffix]};base64,{data}"><figcaption>{text}</figcaption></figure>'


def table(caption: str, facts: Sequence[tuple[str, str]]) -> str:
    return grid(caption, [], [list(fact) for fact in facts], 99)


def grid(caption: str, head: Sequence[str], rows: Sequence[Sequence[str]], numbers_from: int) -> str:
    """A table; columns from `numbers_from` on are numbers."""
    cells = "".join(
        "<tr>" + "".join(f'<td{" class=n" if i >= numbers_from else ""}>{html.escape(c)}</td>' for i, c in enumerate(row)) + "</tr>\n"
        for row in rows
    )
    heads = "".join(f'<th{" class=n" if i >= numbers_from else ""}>{html.escape(c)}</th>' for i, c in enumerate(head))
    top = f"<thead><tr>{heads}</tr></thead>" if head else ""
    return f"<table><caption>{html.escape(caption)}</caption>{top}<tbody>{cells}</tbody></table>"


def inputs(attributes: dict[str, Any]) -> list[str]:
    """Every text that looks like a namelist, whatever its name: input, resolved input, the base of a sweep."""
    found = [(name, text) for name, text in attributes.items() if isinstance(text, str) and ("input" in name or "base" in name)]
    parts = ["<h2>Input</h2>"] if found else []
    for name, text in sorted(found):
        opened = " open" if name == "input" else ""
        parts.append(f"<details{opened}><summary>{html.escape(name.replace('_', ' '))}</summary><pre>{html.escape(str(text))}</pre></details>")
    return parts


def versions(attributes: dict[str, Any]) -> str:
    facts = [(name.replace("_", " "), str(attributes[name])) for name in VERSION_ATTRIBUTES if name in attributes]
    return "<h2>Versions</h2>" + table("Program, compiler, libraries", facts) if facts else ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument("file", type=pathlib.Path, help="run or sweep file")
    parser.add_argument("-o", "--out", type=pathlib.Path, help="page (default: FILE-report.html)")
    parser.add_argument("--animation", action="store_true", help="with the motion as a GIF")
    arguments = parser.parse_args()
    file = arguments.file
    out = arguments.out or (file / "report.html" if file.is_dir() else file.with_name(f"{file.stem}-report.html"))
    return command.finish(lambda: plot(file, out, arguments.animation))


if __name__ == "__main__":
    sys.exit(main())
