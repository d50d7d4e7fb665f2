#!/usr/bin/env python3
"""The numerical half of the stability campaign: measure, and write the tables and the picture of docs/stability.md.

    bench/stability/run.py                      all parts, about twenty minutes of one core
    bench/stability/run.py limits orders        some of them
    bench/stability/run.py --docs               write the document from what results/stability holds

Parts: limits, orders, tolerances, samples, configurations, extremes, drift, article. What each prints is kept in
results/stability/PART.txt; the document has a mark for each table, and the text around them is written by hand.
"""

from __future__ import annotations

import argparse
import pathlib
import subprocess
import sys
import time

import numpy as np

BENCH = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(BENCH), str(BENCH / "wide"), str(BENCH.parent / "postproc")]
from precisions import wide_program  # noqa: E402
from support import ROOT, benchmark  # noqa: E402

RESULTS = ROOT / "results" / "stability"
DOCUMENT = ROOT / "docs" / "stability.md"
PICTURE = ROOT / "docs" / "pictures" / "energy-drift"
QUAD_ORDERS = ROOT / "bench" / "stability" / "quad_orders" / "quad_orders.f90"

ROD = [*(("1e6", method) for method in ("gauss:fixed", "gauss:1e-8", "dop853:1e-8", "erk8:1e-8", "adams:1e-8", "bdf:1e-8")),
       *(("1e5", f"erk{order}:1e-8") for order in (7, 6, 5)), ("3e4", "erk4:1e-8"), ("1e4", "erk3:1e-6"), ("1e4", "erk2:1e-5")]
FLEXIBLE = [("1e6", "gauss:fixed"), ("3e4", "gauss:1e-8")]
RIGID = [("1e5", "gauss:fixed"), ("1e5", "gauss:1e-10"), ("1e5", "dop853:1e-10"), ("3e4", "erk8:1e-10"), ("3e3", "erk4:1e-8"),
         ("3e4", "adams:1e-8"), ("1e4", "bdf:1e-8")]
PARTS = ["limits", "orders", "tolerances", "samples", "configurations", "extremes", "drift", "article"]


def measure(part: str) -> None:
    """Run a part and keep what it prints."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    if part == "article":
        text = article_runs()
    elif part == "drift":
        program = benchmark("stability")
        jobs = [(scene, *job) for scene, some in (("rod", ROD), ("rigid", RIGID), ("flexible", FLEXIBLE)) for job in some]
        text = "".join(f"# {scene}\n" + output_of([program, "drift", scene, *job]) for scene, *job in jobs)
    else:
        text = output_of([benchmark("stability"), part])
    if part == "orders":
        program = wide_program("quadruple", QUAD_ORDERS, QUAD_ORDERS.parent)
        (RESULTS / "orders_quad.txt").write_text(output_of([program], output_of([benchmark("stability"), "tableaux"])))
    (RESULTS / f"{part}.txt").write_text(text)


def output_of(command: list[str], given: str | None = None) -> str:
    return subprocess.run(["nice", *command], input=given, capture_output=True, text=True, check=True).stdout


def article_runs() -> str:
    """The article's scene to 480 s by several methods, and to 1e5 s."""
    import xarray

    base = (ROOT / "cases/table1.nml").read_text()
    lines = []
    for method, rtol, t_end, n in [("gauss", 1e-12, 480, 480), ("dop853", 1e-13, 480, 480), ("gauss", 1e-6, 1e5, 1000),
                                     ("dop853", 1e-6, 1e5, 1000)]:
        text = base.replace("t_end = 30 ", f"t_end = {t_end:g} ").replace("n_outputs = 3000", f"n_outputs = {n}")
        text = text.replace("rtol = 1e-12", f"rtol = {rtol:g}").replace("atol = 1e-13", f"atol = {0.01 * rtol:g}")
        text = text.replace("method = 'auto'", f"method = '{method}'")
        case, result = RESULTS / "article.nml", RESULTS / f"article_{method}_{t_end:g}.h5"
        case.write_text(text)
        output_of([str(ROOT / "bin/rodyn"), "run", str(case), "--output", str(result), "--force", "--quiet"])
        lines.append(article_line(method, rtol, xarray.open_dataset(result),
                                  xarray.open_dataset(result, group="solver").attrs))
    return "".join(lines)


def article_line(method: str, rtol: float, run, solver) -> str:
    """phi_4 at the article's times and at the end, and the change of linear momentum after the loads, of its size."""
    t = run.time.values
    values = [run.phi.values[abs(t - when) < 1e-9, 3] for when in (1, 30, 60, 120, 240, 480)]
    momentum = np.hypot(run.momentum_x.values[t >= 1] - run.momentum_x.values[t >= 1][0],
                        run.momentum_y.values[t >= 1] - run.momentum_y.values[t >= 1][0]).max()
    size = np.hypot(run.momentum_x.values[-1], run.momentum_y.values[-1])
    return "\t".join([method, f"{rtol:g}", f"{t[-1]:g}", *(f"{v[0]:.12f}" if v.size else "–" for v in values), f"{momentum / size:.1e}",
                      f"{abs(run.alpha_rate.values[-1]).max():.1e}", str(solver["n_steps"]),
                      f"{solver['wall_seconds']:.0f}", str(run.attrs["status"])]) + "\n"


def rows(part: str) -> list[list[str]]:
    return [line.split("\t") for line in (RESULTS / f"{part}.txt").read_text().splitlines() if line.strip()]


def table(head: list[str], body: list[list[str]]) -> str:
    """A table in Markdown; columns after the first are set to the right."""
    lines = ["| " + " | ".join(head) + " |", "|---" + "|---:" * (len(head) - 1) + "|"]
    return "\n".join(lines + ["| " + " | ".join(cell.strip() for cell in row) + " |" for row in body])


def short(text: str) -> str:
    """2.77E-003 as 2.8e-3."""
    value = float(text)
    if value == 0:
        return "0"
    return "–" if not np.isfinite(value) or abs(value) > 1e300 else f"{value:.1e}".replace("e-0", "e-").replace("e+0", "e").replace("e+", "e")


def named(method: str, order: str) -> str:
    return f"`{method}` {order}" if order not in ("0", "") else f"`{method}`"


def limits_table() -> str:
    head = ["method", "10³ radians", "10⁶ radians", "10⁹ radians", "real axis"]
    return table(head, [[named(*row[:2]), *(f"{float(v):.3f}" for v in row[2:])] for row in rows("limits")])


def orders_table() -> str:
    body = [[named(*row[:2]), "rod", f"{float(row[2]):g}", f"{float(row[3]):.2f}", f"{float(row[4]):.2f}", f"{float(row[5]):.2f}",
             ", ".join(map(short, row[6:]))] for row in rows("orders")]
    return table(["method", "motion", "halvings", "slope", "foretold", "first h ω", "errors"], body + quad_rows())


def quad_rows() -> list[list[str]]:
    """In quadruple precision; of the ellipse the first step is h omega, omega being 1, the polynomials have no frequency."""
    body = []
    for method, order, problem, step, *errors in rows("orders_quad"):
        slope = -np.polyfit(np.arange(len(errors)), np.log2([float(e) for e in errors]), 1)[0]
        body.append([f"{named(method, order)}, real128", problem, str(len(errors) - 1), f"{slope:.2f}", "–",
                     f"{float(step):.2f}" if problem == "ellipse" else "–", ", ".join(map(short, errors))])
    return body


def tolerances_table() -> str:
    body = []
    for row in rows("tolerances"):
        errors = np.array([float(v) for v in row[2:11]])
        rtol = 10.0 ** -np.arange(4, 13)
        good = np.isfinite(errors)
        exponent = np.polyfit(np.log(rtol[good]), np.log(errors[good]), 1)[0]
        constant = np.exp(np.mean(np.log(errors[good] / rtol[good])))
        spread = np.log10(errors[good] / rtol[good])
        body.append([named(*row[:2]) + (f" ({row[11].strip()})" if row[0] == "auto" else ""), f"{exponent:.2f}", f"{constant:.2g}",
                     f"{10 ** spread.min():.1g} to {10 ** spread.max():.1g}", str(good.sum() - 1)])
    return table(["method", "exponent", "error/rtol, mean", "range", "decades"], body)


def configurations_table() -> str:
    return table(["configuration", "n", "condition of M", "scaled", "recursive", "assembled"],
                 [[row[0], row[1], *map(short, row[2:])] for row in rows("configurations") if row[1].strip().isdigit()])


def samples_table() -> str:
    return table(["case", "method", "error of phi, rad", "quadruple precision, two step sizes"],
                 [[row[0], f"`{row[1]}`", short(row[3]), short(row[4])] for row in rows("samples")])


def extremes_table() -> str:
    """A line for each family: how many ended how, and the worst of each measure over those that are done."""
    families: dict[str, list[list[str]]] = {}
    for row in rows("extremes"):
        if len(row) > 10:
            families.setdefault(row[0], []).append(row)
    body = []
    for name, cases in families.items():
        done = [row for row in cases if row[2] == "done"]
        worst = [max(float(row[i]) for row in done) for i in (4, 5, 6, 7)]
        body.append([name, str(len(cases)), *(str(sum(row[2] == status for row in cases)) for status in ("done", "slow", "refused", "failed")),
                     *(short(str(value)) if value >= 0.0 else "–" for value in worst)])  # the other kernel may have run out of time
    return table(["family", "cases", "done", "time up", "refused", "failed", "energy", "momentum", "angular", "other kernel, rad"], body)


def article_table() -> str:
    return table(["method", "rtol", "t_end, s", "1", "30", "60", "120", "240", "480", "momentum",
                  "largest alpha' at end", "steps", "wall s", "status"],
                 [[f"`{row[0]}`", *row[1:]] for row in rows("article")])


def drift_runs() -> list[tuple[str, str, str, np.ndarray]]:
    """(scene, method, status, (periods, error))."""
    found, scene = [], "rigid"
    for line in (RESULTS / "drift.txt").read_text().splitlines():
        if line.startswith("#"):
            scene = line[2:]
        elif not line.startswith("\t"):
            word, status = line.split("\t")[:2]
            found.append((scene, word, status, []))
        else:
            found[-1][3].append([float(v) for v in line.split("\t")[1:]])
    return [(scene, word, status, np.array(points).T) for scene, word, status, points in found if points]


def growth(periods: np.ndarray, error: np.ndarray) -> float:
    """Exponent of the largest error so far against time, over all but the first decade."""
    envelope = np.maximum.accumulate(abs(error))
    keep = (periods >= 10) & (envelope > 0)
    return float(np.polyfit(np.log(periods[keep]), np.log(envelope[keep]), 1)[0])


def drift_table() -> str:
    body = []
    for scene, word, status, (periods, error) in drift_runs():
        method, _, control = word.partition(":")
        body.append([scene, f"`{method}`", control, f"{periods[-1]:.0e}".replace("e+0", "e"), short(str(abs(error).max())),
                     f"{growth(periods, error):.2f}", status])
    return table(["scene", "method", "rtol", "periods", "largest energy error", "exponent of growth", "status"], body)


def draw_drift() -> None:
    import style

    figure, panels = style.new_figure(1, 3, height=3.3, sharey=True)
    titles = {"rod": "one rigid rod", "rigid": "two rigid rods", "flexible": "one rod that bends"}
    labels: list[str] = []  # one line style for a method in all panels
    for axes, wanted in zip(panels[0], titles, strict=True):
        for _, word, _, (periods, error) in (run for run in drift_runs() if run[0] == wanted):
            label = word.replace(":", ", ") if word.endswith("fixed") else word.partition(":")[0]
            if label not in labels:
                labels.append(label)
            axes.loglog(periods, np.maximum.accumulate(abs(error)), label=label, **style.line_style(labels.index(label)))
        for power, at in ((1.0, 2e-13), (0.5, 2e-15)):
            x = np.array([1.0, 1e6])
            axes.loglog(x, at * x**power, color=style.GREY, linewidth=0.8)
            axes.annotate("$t$" if power == 1.0 else r"$\sqrt{t}$", (x[-1], at * x[-1] ** power), color=style.GREY, fontsize=8)
        axes.set_xlabel("periods of the lowest mode")
        axes.set_title(titles[wanted], loc="left")
    panels[0, 0].set_ylabel("largest energy error so far / energy")
    style.legend_below(figure, panels[0])
    style.save(figure, PICTURE.with_suffix(".png"))


def write_document() -> None:
    """Put each table between its marks."""
    text = DOCUMENT.read_text()
    for part, make in {"limits": limits_table, "orders": orders_table, "tolerances": tolerances_table, "samples": samples_table,
                       "configurations": configurations_table, "extremes": extremes_table, "drift": drift_table,
                       "article": article_table}.items():
        if not (RESULTS / f"{part}.txt").exists():
            continue
        begin, end = f"<!-- {part} -->\n", "<!-- end -->"
        before, _, rest = text.partition(begin)
        _, _, after = rest.partition(end)
        text = before + begin + make() + "\n" + end + after
    DOCUMENT.write_text(text)
    if (RESULTS / "drift.txt").exists():
        draw_drift()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--docs", action="store_true", help="measure nothing")
    arguments = parser.parse_args()
    if unknown := set(arguments.parts) - set(PARTS):
        parser.error(f"no part is called {', '.join(sorted(unknown))}")
    for part in [] if arguments.docs else arguments.parts or PARTS:
        start = time.time()
        measure(part)
        print(f"{part:15s} {time.time() - start:6.0f} s", flush=True)
    write_document()


if __name__ == "__main__":
    main()
