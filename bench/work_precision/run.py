#!/usr/bin/env python3
"""Work against precision: Rodyn's integrators and, where installed, its peers, in one run and in turns.

    bench/work_precision/run.py --quick               table 1 and the rigid scene: two minutes
    bench/work_precision/run.py                       all scenes and methods: at most half an hour
    bench/work_precision/run.py --scenes table1 chain_64 --methods dop853 heyoka --out results/few

Writes OUT.h5 (docs/postproc.md, section 'Benchmark files'), OUT.md with tables, and pictures. Peers come from bench/peers/.venv
(bench/peers/setup); one that is absent is named in the table. Every computation has a budget of time: what would exceed it is
left out, and the file says why. The first run makes the reference solutions too (half an hour more, most of it chain_1024); they
are kept in `references` beside OUT, and made anew when a scene changes.
"""

from __future__ import annotations

import argparse
import contextlib
import datetime
import hashlib
import itertools
import json
import math
import os
import pathlib
import platform
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import h5py
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1] / "postproc"), str(HERE.parent / "wide"), str(HERE.parent)]
from namelist import read_namelist  # noqa: E402
from precisions import DIGITS, exact, wide_program  # noqa: E402
from support import ROOT, benchmark  # noqa: E402

SCENES = ["table1", "table1_30s", "example", "beam", "stiff", "damped", "lumped", "rigid", "chain_16", "chain_64", "chain_256",
          "chain_1024"]
QUICK_SCENES = ["table1", "rigid"]
TOLERANCES = [10.0**-k for k in range(4, 13)]
QUICK_TOLERANCES = [10.0**-k for k in (4, 6, 8, 10, 12)]
ATOL = 0.01  # times rtol
ERK_ORDERS = range(2, 9)
FIXED_ORDERS = {"erk": (4, 8)}  # with fixed steps; other methods: their own order, if they know fixed steps
FIXED_HALVINGS = 8
PEERS = ["heyoka", "scipy", "sundae", "exudyn"]
PROBES = np.array([0.25, 0.5, 0.75, 1.0])
TARGETS = [1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9]
START_UP = 240.0  # seconds a peer may take to compile
AGREEMENT = 1e-9  # rad: what a peer must reach at its tightest to count as solving the same equations
DOCUMENT = ROOT / "docs" / "work_precision.md"
DOCUMENTED = ["table1", "rigid"]  # scenes whose pictures are in it
BEGIN, END = "<!-- written by bench/work_precision/run.py --docs -->\n", "<!-- end of what it writes -->\n"
#: Scenes that bench/stability/quad_reference.f90 knows and can afford: its steps between two probe times.
QUAD_STEPS = {"table1": 400, "rigid": 40}
HEYOKA = {"quadruple": 1e-20, "extended": 1e-19}  # tolerances of references
NO_SOLUTION = 10.0  # an error of phi beyond it is none


class Line(NamedTuple):
    """One line of the diagram: a method of one program."""

    name: str
    worker: str  # 'rodyn' or the name of a peer
    method: str
    order: int = 0
    fixed: bool = False


class Worker:
    """A process that answers jobs, a line each. One that does not answer in time is ended and started anew."""

    def __init__(self, name: str, command: list[str]) -> None:
        self.name, self.command = name, command
        self.process: subprocess.Popen[str] | None = None
        self.answers: queue.Queue[str] = queue.Queue()

    def ask(self, job: dict[str, Any], patience: float) -> dict[str, Any]:
        if self.process is None or self.process.poll() is not None:
            self.start()
        assert self.process is not None and self.process.stdin is not None
        try:
            self.process.stdin.write(self.text(job) + "\n")
            self.process.stdin.flush()
            answer = json.loads(self.answers.get(timeout=patience))
        except queue.Empty:
            self.stop()
            return {"status": "failed", "message": f"no answer within {patience:.0f} s"}
        except (BrokenPipeError, json.JSONDecodeError) as error:
            self.stop()
            return {"status": "failed", "message": f"the worker died: {error}"}
        return answer

    def text(self, job: dict[str, Any]) -> str:
        return job_namelist(job) if self.name in ("rodyn", *DIGITS) else json.dumps(job)

    def start(self) -> None:
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        self.answers = queue.Queue()
        self.process = subprocess.Popen(self.command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                                        text=True, env=environment)
        threading.Thread(target=self.listen, args=(self.process, self.answers), daemon=True).start()

    @staticmethod
    def listen(process: subprocess.Popen[str], answers: queue.Queue[str]) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            answers.put(line)
        answers.put("")  # the end: no JSON

    def stop(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None


def job_namelist(job: dict[str, Any]) -> str:
    def text(value: Any) -> str:
        if isinstance(value, str):
            return f"'{value}'"
        return ", ".join(repr(float(v)) for v in value) if isinstance(value, list) else repr(value)

    known = ("scene", "method", "order", "repeats", "rtol", "atol", "fixed_step", "budget", "hinge_factor", "probe_times")
    return "&job " + ", ".join(f"{key} = {text(value)}" for key, value in job.items() if key in known) + " /"


class Computation:
    """A line at one tolerance (or step), and what came of it."""

    def __init__(self, line: Line, job: dict[str, Any]) -> None:
        self.line, self.job = line, job
        self.seconds: list[float] = []
        self.n_rhs = -1
        self.error_phi = self.error_alpha_rate = math.nan
        self.message = ""

    @property
    def best(self) -> float:
        return min(self.seconds, default=math.nan)


class Benchmark:
    def __init__(self, arguments: argparse.Namespace) -> None:
        self.quick = arguments.quick
        self.references = arguments.out.parent / "references"
        self.rounds = arguments.rounds or (5 if self.quick else 7)
        self.minutes = arguments.minutes or (4.0 if self.quick else 25.0)
        self.deadline = math.inf
        self.wanted = arguments.methods
        self.scenes = arguments.scenes or (QUICK_SCENES if self.quick else SCENES)
        share = 60.0 * self.minutes / len(self.scenes)
        self.budget = arguments.budget or min(6.0, max(0.5, share / 40))  # lines that are hopeless must leave time for the others
        self.tolerances = QUICK_TOLERANCES if self.quick else TOLERANCES
        python = ROOT / "bench" / "peers" / ".venv" / "bin" / "python"
        self.workers = {"rodyn": Worker("rodyn", [benchmark("work_precision")])}
        self.peers: dict[str, str] = {}  # version, or why it is absent
        self.results: dict[str, list[Computation]] = {}
        self.attributes: dict[str, dict[str, Any]] = {}
        self.figures: list[str] = []
        for peer in [] if arguments.no_peers else [*PEERS, "pinocchio"]:
            worker = Worker(peer, [str(python), str(ROOT / "bench" / "peers" / "worker.py"), peer])
            if not python.is_file():
                self.peers[peer] = "absent: run bench/peers/setup"
                continue
            answer = worker.ask({"method": "names", "scene": scene_path("rigid")}, START_UP)
            self.peers[peer] = answer["version"] if answer["status"] == "done" else f"absent: {answer['message']}"
            if answer["status"] == "done":
                self.workers[peer] = worker
        for peer, state in self.peers.items():
            say(f"{peer}: {state}")
        self.names = self.workers["rodyn"].ask({"method": "names"}, 20.0)

    # --- Lines and computations

    def lines(self, scene: str) -> list[Line]:
        found = []
        for method in self.names["names"]:
            if method == "erk":
                found += [Line(f"erk {order}", "rodyn", "erk", order) for order in ERK_ORDERS if not self.quick or order in (4, 5, 8)]
            else:
                found.append(Line(method, "rodyn", method))
        found += [Line(f"{method} {order} fixed" if order else f"{method} fixed", "rodyn", method, order, True)
                  for method in self.names["names"] for order in FIXED_ORDERS.get(method, (0,)) if not (self.quick and order)]
        for peer in PEERS:
            if peer in self.workers:
                answer = self.workers[peer].ask({"method": "names", "scene": scene_path(scene)}, START_UP)
                for line in answer.get("lines", []):
                    prefix = {"scipy": "SciPy ", "sundae": "scikit-", "exudyn": "", "heyoka": ""}[peer]
                    found.append(Line(prefix + line["method"], peer, line["method"], 0, line.get("fixed", False)))
        return [line for line in found if not self.wanted or any(w in line.name for w in self.wanted)]

    def run(self, save: Callable[[], None]) -> None:
        """References first: they are not bounded by the minutes, and are kept."""
        for scene in self.scenes:
            start = time.monotonic()
            _, said = self.reference(self.base_job(scene))
            say(f"{scene}: {said['reference']} and {said['reference_check']} agree to {said['agreement_phi']:.1e} rad" +
                (f", {said['agreement_alpha_rate']:.1e} rad/s" if "agreement_alpha_rate" in said else "") +
                f" ({time.monotonic() - start:.0f} s)")
        for worker in self.workers.values():
            worker.stop()  # what is timed begins with fresh processes
        self.deadline = time.monotonic() + 60.0 * self.minutes
        for scene in self.scenes:
            self.run_scene(scene)
            save()
        self.compare()
        save()

    def base_job(self, scene: str) -> dict[str, Any]:
        t_end = read_namelist((HERE / f"{scene}.nml").read_text())["case"][0]["t_end"]
        return {"scene": scene_path(scene), "probe_times": [float(t) for t in PROBES * t_end], "budget": self.budget}

    def run_scene(self, scene: str) -> None:
        start = time.monotonic()
        base = self.base_job(scene)
        t_end = base["probe_times"][-1]
        share = (self.deadline - start) / (len(self.scenes) - len(self.results))
        end = start + share
        reference, agreement = self.reference(base)
        computations = self.explore(self.lines(scene), base, t_end, reference, end - 0.25 * share)
        self.repeat(computations, end)
        title = read_namelist((HERE / f"{scene}.nml").read_text())["case"][0]["title"]
        self.attributes[scene] = {"title": title, "t_end": float(t_end), **agreement}
        self.results[scene] = computations
        say(f"{scene}: {sum(bool(c.seconds) for c in computations)} of {len(computations)} computations, {time.monotonic() - start:.0f} s")

    def reference(self, base: dict[str, Any]) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Of the candidates the first two that are to be had: the reference, and what shows how far it is to be trusted. All
        compute in more than double precision. They are kept beside the results, by the text of the scene and their names."""
        text, stem = pathlib.Path(base["scene"]).read_text(), pathlib.Path(base["scene"]).stem
        n = read_namelist(text)["chain"][0]["n_rods"]
        precision = "quadruple" if n <= 16 and stem not in ("stiff", "damped") else "extended"
        candidates = [(f"heyoka in {precision} precision", "heyoka",
                       {"method": "reference", "rtol": HEYOKA[precision], "precision": precision}),
                      ("other equations, extrapolated in quadruple precision", "other", {}),
                      ("dop853 in extended precision", "extended", {"method": "dop853", "rtol": 1e-18, "atol": 1e-18}),
                      ("Gragg's extrapolation in quadruple precision", "quadruple", {"method": "gragg", "rtol": 1e-17, "atol": 1e-19})]
        able = {*self.workers, *DIGITS, *(["other"] if stem in QUAD_STEPS else [])}
        candidates = [candidate for candidate in candidates if candidate[1] in able]
        key = hashlib.sha256(json.dumps([text, base["probe_times"], candidates]).encode()).hexdigest()[:16]
        kept = self.references / f"{stem}-{key}.json"
        if kept.is_file():
            known = json.loads(kept.read_text())
            return {k: np.array(v) for k, v in known["reference"].items()}, known["said"]
        self.references.mkdir(parents=True, exist_ok=True)
        found: dict[str, dict[str, np.ndarray]] = {}
        for name, worker, job in candidates:
            answer = self.solution(worker, base | job | {"budget": 3000.0, "repeats": 1})
            if answer is not None:
                found[name] = answer
            if len(found) == 2:
                break
        else:
            raise SystemExit(f"no two references for {base['scene']}")
        (name, best), (check, other) = found.items()
        said = {"reference": name, "reference_check": check} | {
            f"agreement_{key}": float(np.abs(best[key] - other[key]).max()) for key in best if best[key].size}
        kept.write_text(json.dumps({"reference": {k: v.tolist() for k, v in best.items()}, "said": said}))
        return best, said

    def solution(self, worker: str, job: dict[str, Any]) -> dict[str, np.ndarray] | None:
        """phi and alpha' (probe, rod), if this worker finds them."""
        if worker == "other":
            return quad_reference(job, QUAD_STEPS[pathlib.Path(job["scene"]).stem])
        if worker in DIGITS:
            scene = pathlib.Path(job["scene"])
            job = job | {"scene": str(self.references / f"{scene.stem}-exact.nml")}
            pathlib.Path(job["scene"]).write_text(exact(scene.read_text()))
            if worker not in self.workers:
                self.workers[worker] = Worker(worker, [wide_program(worker, ROOT / "bench/work_precision.f90", ROOT / "bench/stability")])
        answer = self.workers[worker].ask(job, 3600.0)
        return {key: np.array(answer[key]) for key in ("phi", "alpha_rate")} if answer["status"] == "done" else None

    def explore(self, lines: list[Line], base: dict[str, Any], t_end: float, reference: dict[str, np.ndarray], end: float) -> list[Computation]:
        """Every line from loose to tight, all lines abreast, each until its next computation is expected to exceed the budget."""
        rows: dict[Line, list[Computation]] = {}
        for line in lines:
            if line.fixed:
                # What the iteration of `gauss` may leave falls as its error does; the others read no tolerance.
                jobs = [{"rtol": tol, "atol": ATOL * tol, "fixed_step": t_end / n}
                        for n, tol in ((n, max(1e-13, 1e-3 / 256**k)) for k, n in enumerate(self.step_counts(line, base)))]
            else:
                jobs = [{"rtol": tol, "atol": ATOL * tol} for tol in self.tolerances]
            rows[line] = [Computation(line, base | job | {"method": line.method, "order": line.order}) for job in jobs]
        for k in range(max(len(row) for row in rows.values())):
            for line, row in rows.items():
                if k < len(row):
                    self.explore_one(line, row, k, reference, end)
        known = [row for line, row in rows.items() if not (line.fixed and row[0].message.startswith("fixed_step"))]
        return [c for row in known for c in row]

    def explore_one(self, line: Line, row: list[Computation], k: int, reference: dict[str, np.ndarray], end: float) -> None:
        made = row[k]
        times = [c.seconds[0] for c in row[:k] if c.seconds]
        expected = times[-1] ** 2 / times[-2] if len(times) > 1 else times[-1] if times else 0.0
        if k > 0 and row[k - 1].message.startswith(("left out", "stopped", "no answer", "fixed_step", "the worker died")):
            made.message = "left out: the one before took too long"
        elif expected > self.budget:
            made.message = f"left out: expected to take {expected:.0f} s"
        elif time.monotonic() > end:
            made.message = "left out: the time of the scene is used up"
        if made.message:
            return
        patience = self.budget + 10.0 + (START_UP if line.worker != "rodyn" else 0.0)
        answer = self.workers[line.worker].ask(made.job | {"repeats": 1}, patience)
        if answer["status"] == "done":
            self.take(made, answer, reference)
        else:
            made.message = answer["message"]

    def step_counts(self, line: Line, base: dict[str, Any]) -> list[int]:
        """Numbers of fixed steps from what the same method takes at a loose tolerance, each sqrt(2) times the one before: errors fall by 16
        and more at high orders, and what is interpolated between them should not decide a ratio. Steps end at the probe times."""
        first = 125
        if line.worker == "rodyn":
            job = base | {"method": line.method, "order": line.order, "rtol": 1e-3, "atol": 1e-5, "repeats": 1}
            first = self.workers["rodyn"].ask(job, self.budget + 10.0).get("n_steps", 500)
        probes = len(base["probe_times"])
        return [probes * round(first / probes * 2 ** (k / 2)) for k in range(9 if self.quick else 2 * FIXED_HALVINGS - 1)]

    @staticmethod
    def take(made: Computation, answer: dict[str, Any], reference: dict[str, np.ndarray]) -> None:
        made.n_rhs = answer.get("n_rhs", -1)
        error = np.abs(np.array(answer["phi"]) - reference["phi"]).max()
        if not error < NO_SOLUTION:
            made.message = "failed: no solution"
            return
        made.seconds.append(answer["seconds"])
        made.error_phi = error
        if reference["alpha_rate"].size:
            made.error_alpha_rate = np.abs(np.array(answer["alpha_rate"]) - reference["alpha_rate"]).max()

    def repeat(self, computations: list[Computation], end: float) -> None:
        """All in turns, round by round. The first run of each was a warm-up; it stays where none follows."""
        done = [c for c in computations if c.seconds]
        for c in done:
            c.seconds = [c.seconds[0]]
        for round_number in range(self.rounds):
            for c in done:
                if time.monotonic() > end or c.best > 0.5 * self.budget or (round_number > 1 and c.best > 0.5):
                    continue
                answer = self.workers[c.line.worker].ask(c.job | {"repeats": repeats_of(c.best)}, self.budget + START_UP)
                if answer["status"] == "done":
                    c.seconds.append(answer["seconds"])
        for c in done:
            if len(c.seconds) > 1:
                c.seconds = c.seconds[1:]

    # --- Figures of merit

    def compare(self) -> None:
        for worker in PEERS:
            found = [(c.error_phi, c.line.name, scene) for scene in ("table1", "rigid") for c in self.results.get(scene, [])
                     if c.line.worker == worker and math.isfinite(c.error_phi)]
            if found:
                error, line, scene = min(found)
                self.figures.append(f"{line} agrees with the reference to {error:.0e} rad at its tightest ({scene})" +
                                    ("" if error < AGREEMENT else ": tighter tolerances were left out, or its equations differ"))
        for scene, key, unit in (("table1", "error_alpha_rate", "rad/s"), ("rigid", "error_phi", "rad")):
            if scene not in self.results:
                continue
            table = time_table(self.results[scene], key)
            rodyn = [best_of(table, "rodyn", i) for i in range(len(TARGETS))]
            for worker, name in (("heyoka", "heyoka"), ("scipy", "SciPy+numba"), ("sundae", "scikit-sundae"), ("exudyn", "Exudyn")):
                ratios = [best_of(table, worker, i)[0] / rodyn[i][0] for i in range(len(TARGETS))]
                if np.isfinite(ratios).any():
                    text = ", ".join(f"{r:.2f}" if r < 10 else f"{r:.0f}" for r in ratios if np.isfinite(r))
                    where = [t for t, r in zip(TARGETS, ratios, strict=True) if np.isfinite(r)]
                    self.figures.append(f"{name}/rodyn best, {scene}, at errors of {key.removeprefix('error_')} from {where[0]:.0e} to "
                                        f"{where[-1]:.0e} {unit}: {text} (geometric mean {geometric_mean(ratios):.2f})")
            adaptive = {line: times for line, times in table.items() if not line.fixed}
            heyoka = {line: times for line, times in table.items() if line.worker == "heyoka"}
            for name, shown in (("rodyn best", table), ("rodyn best adaptive", adaptive), ("heyoka", heyoka)):
                worker = "heyoka" if name == "heyoka" else "rodyn"
                best = [(target, *best_of(shown, worker, i)) for i, target in enumerate(TARGETS)]
                text = ", ".join(f"{1e3 * seconds:.3g} ms ({line})" if worker == "rodyn" else f"{1e3 * seconds:.3g} ms"
                                 for _, seconds, line in best if np.isfinite(seconds))
                if text:
                    self.figures.append(f"{name}, {scene}: {text}")
        with contextlib.suppress(KeyError):
            self.compare_ensembles()
        with contextlib.suppress(KeyError):
            self.compare_right_hand_sides()

    def compare_ensembles(self) -> None:
        """Eight variants of table 1, hinges 0.5 to 2 times as stiff: on one core, in heyoka's lanes and one after the other here."""
        factors = [float(f) for f in np.geomspace(0.5, 2.0, 8)]
        base = {"scene": scene_path("table1"), "probe_times": [1.0], "budget": 60.0}
        heyoka = self.workers["heyoka"]
        rodyn = self.workers["rodyn"]
        exact = heyoka.ask(base | {"method": "batch", "rtol": 1e-16, "hinge_factors": factors, "repeats": 1}, START_UP)
        if exact["status"] != "done":
            self.figures.append(f"heyoka batch: {exact['message']}")
            return
        truth = np.array(exact["alpha_rate"])
        curves: dict[str, list[tuple[float, float]]] = {}
        variants = [(m, {"method": m, "rtol": tol, "atol": ATOL * tol}) for m in self.names["names"] if m not in ("adams", "bdf")
                    for tol in self.tolerances]
        variants += [(f"{m} fixed", {"method": m, "fixed_step": 1.0 / steps}) for m in self.names["names"] if m not in ("adams", "bdf", "erk")
                     for steps in (100, 200, 350, 500, 700, 1000, 1400, 2000, 2800, 4000)]
        jobs: dict[tuple[str, str], list[float]] = {}
        errors: dict[tuple[str, str], float] = {}
        for _ in range(3):
            for tol in self.tolerances:
                answer = heyoka.ask(base | {"method": "batch", "rtol": tol, "hinge_factors": factors, "repeats": 5}, START_UP)
                if answer["status"] == "done":
                    jobs.setdefault(("heyoka batch", str(tol)), []).append(answer["seconds"])
                    errors["heyoka batch", str(tol)] = np.abs(np.array(answer["alpha_rate"]) - truth).max()
            for name, job in variants:
                answers = [rodyn.ask(base | job | {"hinge_factor": f, "repeats": 1}, 60.0) for f in factors]
                if all(a["status"] == "done" for a in answers):  # as much time to find a quiet moment as the batch has
                    repeats = repeats_of(sum(a["seconds"] for a in answers) / len(factors))
                    answers = [rodyn.ask(base | job | {"hinge_factor": f, "repeats": repeats}, 60.0) for f in factors]
                if all(a["status"] == "done" for a in answers):
                    key = name, str(job.get("fixed_step", job.get("rtol")))
                    jobs.setdefault(key, []).append(sum(a["seconds"] for a in answers))
                    errors[key] = max(np.abs(np.array(a["alpha_rate"][-1]) - t).max() for a, t in zip(answers, truth, strict=True))
        for (name, tol), seconds in jobs.items():
            curves.setdefault(name, []).append((errors[name, tol], min(seconds)))
        for target in (1e-4, 1e-6, 1e-8):
            times = {name: time_at([e for e, _ in points], [s for _, s in points], target) for name, points in curves.items()}
            batch = times.pop("heyoka batch", math.nan)
            best = min(((t, name) for name, t in times.items() if np.isfinite(t)), default=(math.nan, "none"))
            self.figures.append(f"heyoka batch cases per second per core, table1 varied, error of alpha_rate {target:.0e} rad/s: "
                                f"{8 / batch:.0f}; "
                                f"rodyn {8 / best[0]:.0f} ({best[1]})")

    def compare_right_hand_sides(self) -> None:
        """Pinocchio's articulated-body algorithm against the right-hand side of rigid rods, n = 4 to 256, in motion."""
        worker = self.workers["pinocchio"]
        text = (HERE / "rigid.nml").read_text()
        with tempfile.TemporaryDirectory() as folder:
            for n in (4, 16, 64, 256):
                phi = [0.1 * math.sin(0.7 * k) for k in range(1, n + 1)]
                rate = [0.1 * math.cos(0.7 * k) for k in range(1, n + 1)]
                changed = text.replace("n_rods = 4", f"n_rods = {n}").replace("6000, 4000, 4000, 4000", f"6000, {n - 1}*4000")
                changed = changed.replace("0.02, 0.01, 0.01, 0.01", f"0.02, {n - 1}*0.01")
                changed += "&initial phi = " + ",\n".join(map(repr, phi)) + "\n phi_rate = " + ",\n".join(map(repr, rate)) + " /\n"
                path = pathlib.Path(folder) / f"rigid_{n}.nml"
                path.write_text(changed)
                job = {"method": "rhs", "scene": str(path), "repeats": 7}
                ours, theirs = [], []
                for _ in range(3):
                    ours.append(self.workers["rodyn"].ask(job, 60.0))
                    theirs.append(worker.ask(job | {"phi": phi, "phi_rate": rate, "repeats": 1}, 60.0))
                if any(a["status"] != "done" for a in ours + theirs):
                    self.figures.append(f"Pinocchio, n = {n}: {[a.get('message') for a in theirs]}")
                    continue
                a, b = (min(x["seconds"] for x in answers) / n * 1e9 for answers in (ours, theirs))
                difference = np.abs(np.array(ours[0]["rates"]) - theirs[0]["rates"]).max() / np.abs(ours[0]["rates"]).max()
                self.figures.append(f"Pinocchio ABA per rod / rodyn rigid right-hand side per rod, n = {n}: {b:.0f} ns / {a:.1f} ns = "
                                    f"{b / a:.1f} (accelerations agree to {difference:.0e})")

    # --- Results

    def write(self, out: pathlib.Path, command: str) -> None:
        out.parent.mkdir(parents=True, exist_ok=True)
        with h5py.File(out.with_suffix(".h5"), "w") as file:
            file.attrs.update({"title": "Work against precision", "command": command, "machine": machine(), "program_version": commit(),
                               "compiler": self.names["compiler"], "compiler_options": self.names["compiler_options"],
                               "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
                               "figures": "\n".join(self.figures)})
            for peer, state in self.peers.items():
                file.attrs[f"peer_{peer}"] = state
            for scene, found in self.results.items():
                group = file.create_group(scene)
                group.attrs.update(self.attributes[scene])
                text = h5py.string_dtype()
                for name, values, meaning in (
                        ("method", [c.line.name for c in found], "method"),
                        ("program", [c.line.worker for c in found], "'rodyn', or the peer"),
                        ("message", [c.message for c in found], "why a computation was left out or failed")):
                    group.create_dataset(name, data=values, dtype=text).attrs["long_name"] = meaning
                numbers = [("rtol", [math.nan if c.line.fixed else c.job["rtol"] for c in found], "1", "relative tolerance; NaN: fixed steps"),
                           ("fixed_step", [c.job.get("fixed_step", 0.0) for c in found], "s", "fixed step; 0: adaptive"),
                           ("seconds", [c.best for c in found], "s", "wall time, the least of all rounds"),
                           ("seconds_median", [float(np.median(c.seconds)) if c.seconds else math.nan for c in found], "s",
                            "median of the rounds"),
                           ("error_phi", [c.error_phi for c in found], "rad", "largest error of the chord angles at the probe times")]
                if "agreement_alpha_rate" in self.attributes[scene]:
                    numbers.append(("error_alpha_rate", [c.error_alpha_rate for c in found], "rad/s", "largest error of the slope rates"))
                for name, values, unit, meaning in numbers:
                    data = group.create_dataset(name, data=np.array(values, float))
                    data.attrs.update({"units": unit, "long_name": meaning})
                data = group.create_dataset("n_rhs", data=np.array([c.n_rhs for c in found], int))
                data.attrs.update({"units": "1", "long_name": "evaluations of the right-hand side; -1: unknown"})
        out.with_suffix(".md").write_text(self.report(command))

    def report(self, command: str) -> str:
        peers = "; ".join(f"{state}" if not state.startswith("absent") else f"{peer} {state}" for peer, state in self.peers.items())
        text = [f"Machine: {machine()}. Rodyn {commit()}; {self.names['compiler']}, flags `{plain_flags(self.names['compiler_options'])}`.",
                f"Peers: {peers or 'none'}.", "", "```", command, "```", "", "#### Figures", ""]
        text += [f"- {figure}" for figure in self.figures]
        text += ["", "#### Time at equal error", "",
                 "Milliseconds of wall time, least of all rounds, interpolated between computations in log-log;",
                 "an empty place: no computation on both sides of that error, or none within the budget.", ""]
        for scene, found in self.results.items():
            said = self.attributes[scene]
            key = "error_alpha_rate" if "agreement_alpha_rate" in said else "error_phi"
            name, unit = ("alpha'", "rad/s") if key == "error_alpha_rate" else ("phi", "rad")
            text += [f"**{said['title']}** (`{scene}`): error of {name} [{unit}]; reference {said['reference']}, checked by "
                     f"{said['reference_check']}, which agree to {said['agreement_phi']:.0e} rad" +
                     (f" and {said['agreement_alpha_rate']:.0e} rad/s" if key == "error_alpha_rate" else ""), "",
                     "| method | " + " | ".join(f"{t:.0e}" for t in TARGETS) + " |", "|---|" + "---:|" * len(TARGETS)]
            trusted = said[f"agreement_{key.removeprefix('error_')}"]
            for line, times in time_table(found, key).items():
                cells = ["" if not np.isfinite(s) or t < trusted else f"{1e3 * s:.3g}" for s, t in zip(times, TARGETS, strict=True)]
                if any(cells):
                    text.append(f"| {line.name} | " + " | ".join(cells) + " |")
            lost: dict[str, str] = {}  # the first message of each method
            for c in sorted(found, key=lambda c: (c.line.name, c.message)):
                if c.message and not c.message.startswith(("left out", "stopped")):
                    lost.setdefault(c.line.name, c.message)
            failed = [f"{name} ({message.removeprefix('failed: ')})" for name, message in lost.items()]
            text += ["", f"Failed: {'; '.join(failed)}."] if failed else []
            text.append("")
        return "\n".join(text) + "\n"


def time_table(found: list[Computation], key: str) -> dict[Line, list[float]]:
    lines: dict[Line, list[Computation]] = {}
    for c in found:
        lines.setdefault(c.line, []).append(c)
    return {line: [time_at([getattr(c, key) for c in cs], [c.best for c in cs], target) for target in TARGETS] for line, cs in lines.items()}


def best_of(table: dict[Line, list[float]], worker: str, i: int) -> tuple[float, str]:
    found = [(times[i], line.name) for line, times in table.items() if line.worker == worker and np.isfinite(times[i])]
    return min(found, default=(math.nan, "none"))


def time_at(errors: list[float], seconds: list[float], target: float) -> float:
    """Least time at which the error is `target`, between neighbouring computations in log-log; NaN outside."""
    known = [(math.log(e), math.log(s)) for e, s in zip(errors, seconds, strict=True) if e > 0 and s > 0 and math.isfinite(e * s)]
    wanted, best = math.log(target), math.inf
    for (e0, s0), (e1, s1) in itertools.pairwise(known):
        if min(e0, e1) <= wanted <= max(e0, e1):
            weight = (wanted - e0) / (e1 - e0) if e1 != e0 else 0.0
            best = min(best, s0 + weight * (s1 - s0))
    if known and wanted > max(e for e, _ in known):  # more exact than asked for, at the loosest setting
        best = min(best, *(s for _, s in known))
    return math.exp(best) if math.isfinite(best) else math.nan


def repeats_of(seconds: float) -> int:
    """How often a run of that length follows itself: 20 ms, in which a shared machine may have a quiet moment."""
    return max(1, min(20, int(0.02 / seconds)))


def geometric_mean(values: list[float]) -> float:
    known = [v for v in values if math.isfinite(v)]
    return math.exp(sum(map(math.log, known)) / len(known))


def scene_path(scene: str) -> str:
    return str(HERE / f"{scene}.nml")


def quad_reference(base: dict[str, Any], steps: int) -> dict[str, np.ndarray]:
    """phi and alpha' (probe, rod) by inertial coordinates, Jacobians at Gauss points and an extrapolated midpoint rule."""
    command = [benchmark("stability"), "reference", base["scene"], str(steps), *map(repr, base["probe_times"])]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    values = np.array([[float(word) for word in line.split()] for line in text.splitlines()])
    n = read_namelist(pathlib.Path(base["scene"]).read_text())["chain"][0]["n_rods"]
    return {"phi": values[:, :n], "alpha_rate": values[:, n:]}


def machine() -> str:
    with contextlib.suppress(OSError):
        for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return f"{line.split(':')[1].strip()}, {os.cpu_count()} cores, {platform.system()}"
    return platform.platform()


def commit() -> str:
    return subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()


def plain_flags(options: str) -> str:
    return " ".join(word for word in options.split() if word.startswith(("-O", "-march", "-f", "-m")) and "intrinsic" not in word)


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def draw(out: pathlib.Path) -> None:
    sys.path.insert(0, str(ROOT / "postproc"))
    import work_precision

    for scene in work_precision.scene_names(out.with_suffix(".h5")):
        work_precision.plot(out.with_suffix(".h5"), out.parent / f"{out.name}-{scene}", [scene])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two scenes, fewer tolerances")
    parser.add_argument("--scenes", nargs="+", default=[], choices=SCENES, metavar="SCENE", help=f"of {', '.join(SCENES)}")
    parser.add_argument("--methods", nargs="+", default=[], help="only lines whose names contain one of these")
    parser.add_argument("--no-peers", action="store_true")
    parser.add_argument("--budget", type=float, default=0.0,
                        help="seconds that one computation may take; default: 1/40 of a scene's time, at most 6")
    parser.add_argument("--minutes", type=float, default=0.0, help="that the computations may take, besides references and ensembles")
    parser.add_argument("--rounds", type=int, default=0)
    parser.add_argument("--docs", action="store_true", help="put tables and pictures into docs/work_precision.md")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "results" / "work_precision", help="OUT.h5, OUT.md, OUT-SCENE.png")
    arguments = parser.parse_args()
    command = " ".join(["bench/work_precision/run.py", *sys.argv[1:]])
    for stop in (signal.SIGTERM, signal.SIGINT):
        signal.signal(stop, lambda number, _: sys.exit(128 + number))  # the workers are ended below
    benchmark = Benchmark(arguments)
    try:
        benchmark.run(lambda: benchmark.write(arguments.out, command))
    finally:
        for worker in benchmark.workers.values():
            worker.stop()
    draw(arguments.out)
    if arguments.docs:
        head, _, old = DOCUMENT.read_text().partition(BEGIN)
        DOCUMENT.write_text(head + BEGIN + arguments.out.with_suffix(".md").read_text() + END + old.partition(END)[2])
        for scene in set(DOCUMENTED) & set(benchmark.results):
            shutil.copy(arguments.out.parent / f"{arguments.out.name}-{scene}.png", ROOT / "docs" / "pictures" / f"work-precision-{scene}.png")
    print(arguments.out.with_suffix(".md").read_text())
    return 0


if __name__ == "__main__":
    sys.exit(main())
