#!/usr/bin/env python3
"""Run time against the error to the beam: several models of a rod, rods cut into 1 to 32, each with the integrator that gets there first.

    bench/work_precision/beams.py                        all scenes, half an hour
    bench/work_precision/beams.py --quick                the spin-up with one and two rods: seconds
    bench/work_precision/beams.py --scenes spin_up --rods 1 2 --models condensed --out results/few
    bench/work_precision/beams.py --docs                 and put tables and picture into docs/work_precision.md

Writes OUT.h5 (docs/postproc.md, section 'Benchmark files'), OUT.md and OUT.png. The beam is what chains tend to that are cut ever finer,
found by two models. The accurate motion of each chain comes first, then every method with ever finer steps or tolerances until its own
error is a fifth of that of the chain. Solutions are kept in `references` beside OUT.
"""

from __future__ import annotations

import argparse
import dataclasses
import datetime
import hashlib
import itertools
import json
import math
import pathlib
import shutil
import signal
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parents[1] / "postproc")]
import h5py  # noqa: E402
import numpy as np  # noqa: E402
import work_precision  # noqa: E402
from run import Worker, commit, machine, plain_flags, repeats_of, say  # noqa: E402
from support import ROOT, benchmark  # noqa: E402

sys.path.append(str(HERE.parent / "validation"))  # which has a `run` of its own
from benchmarks import PINNED, Scene, held, listed  # noqa: E402

ARC, CHORD, THREE = "formulation = 'inextensible'", "formulation = 'consistent'", ", bending_shapes = 3, gauss_points = 6"
#: Names of the lines and keys of &model.
MODELS = {"consistent, 2 shapes": CHORD, "consistent, 3 shapes": CHORD + THREE, "inextensible, 2 shapes": ARC,
          "inextensible, 3 shapes": ARC + THREE, "condensed": CHORD + ", bending = 'quasistatic'",
          "lumped": CHORD + ", bending = 'quasistatic', inertia = 'lumped'", "paper": "formulation = 'paper'"}
RODS = (1, 2, 3, 4, 6, 8, 16, 32)
QUICK_SCENES, QUICK_RODS, QUICK_REFERENCE = ("spin_up",), (1, 2), (2, 4, 8)
ALONE = {"paper": (1,)}  # numbers of rods of interest
#: Ways to the beam: orders of the errors that are extrapolated away.
WAYS = {"inextensible, 3 shapes": (4, 6), "consistent, 3 shapes": (2, 4)}
BASE = ("consistent, 2 shapes", 8)  # what ratios are to
TARGETS = (5e-3, 1e-3, 3e-4, 1e-4)
SHARE = 0.2  # of the error of the chain, which the integrator's may be
TRUSTED = 3.0  # times what is known of the beam: smaller errors of a chain are not drawn
STEPS = [4 * round(2 * 2 ** (k / 2)) for k in range(14)]  # between 0 and t_end
TOLERANCES = [10.0**-k for k in range(1, 9)]
ITERATION = (1e-2, 1e-3, 1e-4)  # rtol of `gauss` with fixed steps: what its iteration may leave
ACCURATE = 1e-8  # rtol
MOST_UNKNOWNS = 200  # explicit steps, which alone are left beyond, take minutes
PROBES = np.array([0.25, 0.5, 0.75, 1.0])
DOCUMENT = ROOT / "docs" / "work_precision.md"
BEGIN, END = "<!-- written by bench/work_precision/beams.py --docs -->\n", "<!-- end of what beams.py writes -->\n"

Answer = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Beam:
    """A scene of beams, and the one number that is looked at."""

    title: str
    label: str
    template: str  # of bench/validation, or a path
    numbers: dict[str, Any]
    t_end: float
    quantity: Callable[[np.ndarray, np.ndarray], np.ndarray]  # of nodes and spacecraft at the probe times
    reference: tuple[int, ...]  # rods cut into
    beams: int = 1

    def text(self, rods: int, model: str) -> str:
        return Scene(self.template, rods * self.beams, "", self.numbers).text(model=MODELS[model])

    def unknowns(self, rods: int, model: str) -> int:
        shapes = 0 if "quasistatic" in MODELS[model] else 3 if THREE in MODELS[model] else 2
        return 3 + (1 + shapes) * rods * self.beams


def inner(first: float, others: float) -> Callable[[int], str]:
    """Values of hinges at the inner ends of four rods in n pieces."""
    return lambda n: listed([first if k == 0 else others if k % (n // 4) == 0 else 0.0 for k in range(n)])


def last_angle(node: np.ndarray, spacecraft: np.ndarray) -> np.ndarray:
    """phi_4: the chord of the last of four rods."""
    return np.angle(node[:, -1] - node[:, 3 * node.shape[1] // 4 - 1])


def deflection(node: np.ndarray, spacecraft: np.ndarray) -> np.ndarray:
    """Of the tip, over the length of 10 m."""
    return node[:, -1].imag / 10.0


def place(node: np.ndarray, spacecraft: np.ndarray) -> np.ndarray:
    """Of the tip in fixed axes, over the length of 10 m."""
    return (node[:, -1] + spacecraft[:, 0] + 1j * spacecraft[:, 1]) * np.exp(1j * spacecraft[:, 2]) / 10.0


SCENES = {
    "table1": Beam("Table 1, 1 s", r"error of $\varphi_4$ [rad]", str(HERE / "table1_cut"),
                   {"total": 6.0, "springs": inner(6000.0, 4000.0), "dampers": inner(0.02, 0.01),
                    "nodes": lambda n: listed([0.0 if (k + 1) % (n // 4) else 0.5 for k in range(n)]),
                    "clamped": lambda n: held([k for k in range(n) if k % (n // 4)])}, 1.0, last_angle, (2, 4, 8), 4),
    "spin_up": Beam("Spin-up, 20 s", "error of tip deflection / length", "spin_up", {"total": 10.0}, 20.0, deflection, (8, 16, 32)),
    "flying_beam": Beam("Flying beam, 8 s", "error of tip place / length", "flying_beam", PINNED | {"total": 10.0}, 8.0, place,
                        (8, 16, 32)),
}


class Setting:
    """A method at one tolerance or step, for one chain, and what came of it."""

    def __init__(self, model: str, rods: int, method: str, job: dict[str, Any]):
        self.model, self.rods, self.method, self.job = model, rods, method, job
        self.seconds: list[float] = []
        self.n_rhs = -1
        self.values = np.array([math.nan])
        self.error_model = self.error_integration = self.error_beam = math.nan
        self.chosen = False
        self.message = ""

    @property
    def best(self) -> float:
        return min(self.seconds, default=math.nan)


class Benchmark:
    def __init__(self, arguments: argparse.Namespace):
        self.out, self.budget, self.rounds = arguments.out, arguments.budget, arguments.rounds
        self.quick = arguments.quick
        self.models = [name for name in MODELS if not arguments.models or any(word in name for word in arguments.models)]
        self.rods = arguments.rods or (QUICK_RODS if self.quick else RODS)
        self.scenes = {name: SCENES[name] for name in arguments.scenes or (QUICK_SCENES if self.quick else SCENES)}
        self.kept = self.out.parent / "references"
        self.kept.mkdir(parents=True, exist_ok=True)
        self.worker = Worker("rodyn", [benchmark("work_precision")])
        self.names = self.worker.ask({"method": "names"}, 20.0)
        self.results: dict[str, list[Setting]] = {}
        self.reached: dict[str, dict[str, Any]] = {}

    # --- Solutions

    def ask(self, scene: str, rods: int, model: str, job: dict[str, Any], budget: float) -> Answer:
        beam = self.scenes[scene]
        case = self.kept / f"{scene}-{rods}.nml"
        case.write_text(beam.text(rods, model))
        given = {"scene": str(case), "probe_times": [float(t) for t in PROBES * beam.t_end], "budget": budget, "repeats": 1}
        answer = self.worker.ask(given | job, budget + 10.0)
        if answer["status"] == "done":
            answer["values"] = self.values(beam, answer)
            if not np.isfinite(answer["values"]).all():
                return {"status": "failed", "message": "not finite"}
        return answer

    @staticmethod
    def values(beam: Beam, answer: Answer) -> np.ndarray:
        node = np.array(answer["node"], float)
        return beam.quantity(node[:, ::2] + 1j * node[:, 1::2], np.array(answer["spacecraft"], float))

    def accurate(self, scene: str, rods: int, model: str, budget: float) -> np.ndarray | str:
        """The motion of a chain itself at the probe times, kept from run to run; or why there is none."""
        text = self.scenes[scene].text(rods, model)
        key = hashlib.sha256(json.dumps([text, PROBES.tolist(), ACCURATE]).encode()).hexdigest()[:16]
        kept = self.kept / f"{scene}-{key}.json"
        if not kept.is_file():
            for method in ("gauss", "dop853"):
                answer = self.ask(scene, rods, model, {"method": method, "rtol": ACCURATE, "atol": 0.01 * ACCURATE}, budget)
                if answer["status"] == "done":
                    break
            else:
                return answer["message"]
            kept.write_text(json.dumps([answer["values"].real.tolist(), answer["values"].imag.tolist()]))
        real, imaginary = np.array(json.loads(kept.read_text()))
        return real + 1j * imaginary

    def beam(self, scene: str) -> np.ndarray:
        """What two models tend to, at the probe times; their difference is how far it is known."""
        found = {}
        rods_of_reference = QUICK_REFERENCE if self.quick else self.scenes[scene].reference
        for model, orders in WAYS.items():
            chains = [self.accurate(scene, rods, model, 600.0) for rods in rods_of_reference]
            if any(isinstance(chain, str) for chain in chains):
                raise SystemExit(f"no reference for {scene}: {chains}")
            found[model] = extrapolate(chains, orders)
        best, other = found.values()
        known = float(np.abs(best - other).max())
        self.reached[scene] = {"agreement": known, "reference": ", ".join(f"{x:.9g}" for x in np.where(best.imag == 0.0, best.real, best)),
                               "reference_models": " and ".join(found), "reference_rods": ", ".join(map(str, rods_of_reference))}
        say(f"{scene}: {' and '.join(found)} tend to the same within {known:.1e}")
        return best

    # --- Settings

    def run(self) -> None:
        for scene in self.scenes:
            beam = self.beam(scene)
            self.results[scene] = [setting for model in self.models for rods in self.rods if rods in ALONE.get(model, RODS)
                                   for setting in self.chain(scene, rods, model, beam)]
        for _ in range(self.rounds):
            for scene, found in self.results.items():
                for setting in found:
                    self.repeat(scene, setting)
        for scene, found in self.results.items():
            for _, chain in itertools.groupby(found, key=lambda s: (s.model, s.rods)):
                choose([s for s in chain if s.seconds], self.reached[scene]["agreement"])

    def chain(self, scene: str, rods: int, model: str, beam: np.ndarray) -> list[Setting]:
        """The settings of one chain that are the fastest, or nearly, for its own error or for a target."""
        if self.scenes[scene].unknowns(rods, model) > MOST_UNKNOWNS:
            return [failed(model, rods, f"more than {MOST_UNKNOWNS} unknowns, beyond which `gauss` treats nothing implicitly")]
        truth = self.accurate(scene, rods, model, 20.0 * self.budget)
        if isinstance(truth, str):
            return [failed(model, rods, truth)]
        error = float(np.abs(truth - beam).max())
        limit = SHARE * max(error, TRUSTED * self.reached[scene]["agreement"])
        found: list[Setting] = []
        for line in lines(self.scenes[scene].t_end):
            found += self.explore(scene, [Setting(model, rods, *one) for one in line], truth, beam, limit, found)
        for setting in found:
            setting.error_model = error
        kept = finalists(found, limit)
        say(f"{scene}, {model}, {rods}: error {error:.1e}, {len(kept)} of {len(found)} settings, " +
            (f"{1e3 * min(s.best for s in kept):.3g} ms" if kept else "none fits"))
        return kept or [failed(model, rods, "no setting within the budget of time")]

    def explore(self, scene: str, line: Iterable[Setting], truth: np.ndarray, beam: np.ndarray, limit: float,
                known: list[Setting]) -> list[Setting]:
        """Ever finer settings of one method, until two in a row are fine enough or take too long. The error of each is the larger of its
        own and the next one's, so that none is right by chance."""
        done: list[Setting] = []
        fits = [s.best for s in known if s.error_integration <= limit]
        for setting in line:
            answer = self.ask(scene, setting.rods, setting.model, setting.job, self.budget)
            if answer["status"] != "done":
                if answer["message"].startswith("stopped"):
                    break
                continue
            setting.seconds, setting.n_rhs, setting.values = [answer["seconds"]], answer["n_rhs"], answer["values"]
            self.repeat(scene, setting)
            done.append(setting)
            own = [float(np.abs(s.values - truth).max()) for s in done[-2:]]
            if (max(own) <= limit and len(own) == 2) or setting.best > 4.0 * min(fits, default=math.inf):
                break
        for this, finer in itertools.pairwise(done):
            this.error_integration = max(float(np.abs(s.values - truth).max()) for s in (this, finer))
            this.error_beam = max(float(np.abs(s.values - beam).max()) for s in (this, finer))
        return done[:-1]

    def repeat(self, scene: str, setting: Setting) -> None:
        if not setting.seconds or (setting.best > 2.0 and len(setting.seconds) > 2):
            return
        answer = self.ask(scene, setting.rods, setting.model, setting.job | {"repeats": repeats_of(setting.best)}, self.budget)
        if answer["status"] == "done":
            setting.seconds.append(answer["seconds"])

    # --- Results

    def write(self, command: str) -> None:
        with h5py.File(self.out.with_suffix(".h5"), "w", track_order=True) as file:
            file.attrs.update({"title": "Run time against the error to the beam", "command": command, "machine": machine(),
                               "program_version": commit(), "compiler": self.names["compiler"],
                               "compiler_options": self.names["compiler_options"],
                               "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")})
            for scene, found in self.results.items():
                group = file.create_group(scene)
                group.attrs.update({"title": self.scenes[scene].title, "error_label": self.scenes[scene].label} | self.reached[scene])
                write_columns(group, found)
        self.out.with_suffix(".md").write_text(self.report(command))

    def report(self, command: str) -> str:
        text = [f"Machine: {machine()}. Rodyn {commit()}; {self.names['compiler']}, flags `{plain_flags(self.names['compiler_options'])}`.", "",
                "```", command, "```", ""]
        for scene, found in self.results.items():
            text += [f"**{self.scenes[scene].title}** (`{scene}`); the beam is known to {self.reached[scene]['agreement']:.0e}.", "",
                     *table(found, self.models), ""]
        return "\n".join(text) + "\n"


def extrapolate(chains: Sequence[np.ndarray], orders: Sequence[int]) -> np.ndarray:
    """Limit of chains that are cut twice as fine each time."""
    for order in orders[: len(chains) - 1]:
        chains = [fine + (fine - coarse) / (2.0**order - 1.0) for coarse, fine in itertools.pairwise(chains)]
    return chains[-1]


def lines(t_end: float) -> Iterable[list[tuple[str, dict[str, Any]]]]:
    """Methods, each from coarse to fine."""
    for rtol in ITERATION:
        yield [("gauss fixed", tolerances("gauss", rtol) | {"fixed_step": t_end / n}) for n in STEPS]
    for method in ("gauss", "dop853"):
        yield [(method, tolerances(method, rtol)) for rtol in TOLERANCES]
    yield [("dop853 fixed", tolerances("dop853", TOLERANCES[0]) | {"fixed_step": t_end / n}) for n in [n * 2**k for k in (0, 7) for n in STEPS]]


def tolerances(method: str, rtol: float) -> dict[str, Any]:
    return {"method": method, "rtol": rtol, "atol": 0.01 * rtol}


def failed(model: str, rods: int, message: str) -> Setting:
    setting = Setting(model, rods, "", {})
    setting.message = message
    return setting


def finalists(found: list[Setting], limit: float) -> list[Setting]:
    """Those that may be the fastest for the chain's own error or for a target: within a third of it."""
    kept: list[Setting] = []
    for fits in ([s for s in found if s.error_integration <= limit], *([s for s in found if s.error_beam <= target] for target in TARGETS)):
        least = min((s.best for s in fits), default=0.0)
        kept += [s for s in fits if s.best < 1.33 * least and s not in kept]
    return kept


def choose(chain: list[Setting], agreement: float) -> None:
    """Mark the fastest one of a chain whose own error is small beside the chain's, if that stands above what is known of the beam."""
    fine = [s for s in chain if s.error_integration <= SHARE * s.error_model and s.error_model > TRUSTED * agreement]
    if fine:
        min(fine, key=lambda s: s.best).chosen = True


def fastest(found: list[Setting], target: float, model: str, rods: int | None = None) -> Setting | None:
    """The one that comes within the target first."""
    return min((s for s in found if s.model == model and rods in (None, s.rods) and s.error_beam <= target), key=lambda s: s.best, default=None)


def table(found: list[Setting], models: Sequence[str]) -> list[str]:
    """Milliseconds to each target, rods, and how many times as fast as `BASE`."""
    text = ["| model | " + " | ".join(f"{t:.0e}" for t in TARGETS) + " |", "|---|" + "---:|" * len(TARGETS)]
    base = [fastest(found, target, *BASE) for target in TARGETS]
    rows = [(f"{BASE[0]}, {BASE[1]} rods", base)] + [(model, [fastest(found, target, model) for target in TARGETS]) for model in models]
    for name, row in rows:
        if any(row):
            text.append(f"| {name} | " + " | ".join(cell(setting, other) for setting, other in zip(row, base, strict=True)) + " |")
    return text


def cell(setting: Setting | None, base: Setting | None) -> str:
    if setting is None:
        return ""
    return f"{1e3 * setting.best:.3g} ms, {setting.rods}" + (f", {base.best / setting.best:.3g}x" if base else "")


def write_columns(group: h5py.Group, found: list[Setting]) -> None:
    for name, values, meaning in (("model", [s.model for s in found], "model of a rod"), ("method", [s.method for s in found], "method"),
                                  ("message", [s.message for s in found], "why there is no computation")):
        group.create_dataset(name, data=values, dtype=h5py.string_dtype()).attrs["long_name"] = meaning
    columns = [("rods", [s.rods for s in found], "1", "rods that each beam is cut into"),
               ("rtol", [s.job.get("rtol", math.nan) for s in found], "1", "relative tolerance; with fixed steps that of the iteration"),
               ("fixed_step", [s.job.get("fixed_step", 0.0) for s in found], "s", "fixed step; 0: adaptive"),
               ("seconds", [s.best for s in found], "s", "wall time, the least of all rounds"),
               ("seconds_median", [float(np.median(s.seconds)) if s.seconds else math.nan for s in found], "s", "median of the rounds"),
               ("n_rhs", [s.n_rhs for s in found], "1", "evaluations of the right-hand side"),
               ("error_beam", [s.error_beam for s in found], "1", "largest difference from the beam at the probe times"),
               ("error_model", [s.error_model for s in found], "1", "of it, by the chain alone"),
               ("error_integration", [s.error_integration for s in found], "1", "of it, by the integrator alone"),
               ("chosen", [s.chosen for s in found], "1", "the fastest whose integrator's error is a fifth of the chain's")]
    for name, values, unit, meaning in columns:
        group.create_dataset(name, data=np.array(values)).attrs.update({"units": unit, "long_name": meaning})


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one scene, few rods, a reference of fewer rods")
    parser.add_argument("--scenes", nargs="+", default=[], choices=SCENES, metavar="SCENE", help=f"of {', '.join(SCENES)}")
    parser.add_argument("--models", nargs="+", default=[], help=f"only those whose names contain one of these: {'; '.join(MODELS)}")
    parser.add_argument("--rods", nargs="+", type=int, default=[], help="that each beam is cut into")
    parser.add_argument("--budget", type=float, default=5.0, help="seconds that one computation may take; accurate ones: 20 times as many")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--docs", action="store_true", help="put tables and picture into docs/work_precision.md")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "results" / "beams", help="OUT.h5, OUT.md, OUT.png")
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))  # the worker is ended below
    made = Benchmark(arguments)
    try:
        made.run()
    finally:
        made.worker.stop()
    made.write(" ".join(["bench/work_precision/beams.py", *sys.argv[1:]]))
    work_precision.plot(arguments.out.with_suffix(".h5"), arguments.out)
    text = arguments.out.with_suffix(".md").read_text()
    if arguments.docs:
        head, _, old = DOCUMENT.read_text().partition(BEGIN)
        DOCUMENT.write_text(head + BEGIN + text + END + old.partition(END)[2])
        shutil.copy(arguments.out.with_suffix(".png"), ROOT / "docs" / "pictures" / "beams.png")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
