#!/usr/bin/env python3
"""Ordinary scenes by the program and by an independent formulation: what fails, what is off, what is slow.

    bench/stability/campaign.py --count 20                          twenty scenes of every family, from seed 1
    bench/stability/campaign.py --family slews --seed 17            one scene again, every variant, its namelist kept and shown
    bench/stability/campaign.py --count 2 --sweeps                  and sweeps of unequal and failing cases against each case alone
    bench/stability/campaign.py --docs                              write the table of docs/stability.md from the last campaign

A scene is a function of its family and seed (`ordinary_scenes.py`); the reference is `multipliers.py`. Each scene runs with default
settings, and with a choice of variants that follows from its seed (all with --thorough or one seed): `auto` at another rtol of
1e-3 to 1e-10 (atol = rtol/100), one method at another rtol, all methods at the default one, the assembled kernel, 1 and 1,000
outputs. What is wrong is one of:

- fails: a run does not end with 0 (that `gauss` refuses what it cannot integrate is not counted), or takes more than `LONGEST` s;
- off: phi further than 100 (rtol times its largest value + atol) from the reference, at ten times of the run;
- events: kinds of events of a hinge in another order than the reference's;
- ledger: energies, work or dissipation further than 1,000 rtol of the energies from the reference's own, or such a residual;
- slow: `auto` takes more than 2.5 times the user time of the quickest method within the bound.

Some motions are sensitive: from the time where a neighbour, whose angles start 1e-9 rad apart, is more than 100 times as far away,
nothing is compared, and events after it are not counted. Where events of a run differ, neighbours as far apart as the bound of that
run are asked, too: what differs between these is not determined by the tolerance.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import pathlib
import pickle
import resource
import subprocess
import sys
import time
from collections import Counter, defaultdict
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import h5py
import numpy as np

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[i]) for i in (0, 1)]
import multipliers  # noqa: E402
from ordinary_scenes import FAMILIES, Group, Typist, groups_of, text_of  # noqa: E402
from support import RODYN, ROOT  # noqa: E402

RESULTS = ROOT / "results" / "stability" / "campaign.jsonl"
DOCUMENT, MARK = ROOT / "docs" / "stability.md", "<!-- campaign -->\n"
KEPT = ROOT / "build" / "campaign"
CACHE = KEPT / "references"
METHODS = ("dop853", "erk", "adams", "bdf", "gauss")
LONGEST = 20.0      # processor time of a run [s]
FACTOR = 100.0      # of the tolerances: what an error may be
ENERGY = 1000.0     # of rtol times the energies
SLOWEST = 2.5
LEAST = 0.05        # user time that is not judged [s]
SHIFT = 1e-9        # of the neighbour [rad]
ENERGIES = ("energy_kinetic", "energy_elastic", "energy_dissipated", "work_external")


def variants(family: str, seed: int, thorough: bool) -> dict[str, dict]:
    """Keys of &solver, &model and &case for each run of a scene."""
    t = Typist(f"variants of {family}", seed)
    named = t.one_of(*METHODS)
    rtols = [10.0 ** -t.whole(3, 10) for _ in range(2)]
    chosen: dict[str, dict] = {"default": {}}
    if thorough:
        for k in range(3, 11):
            chosen[f"auto 1e-{k}"] = {"rtol": 10.0**-k, "atol": 10.0 ** -(k + 2)}
    else:
        chosen[f"auto {rtols[0]:.0e}"] = {"rtol": rtols[0], "atol": rtols[0] / 100}
    if t.chance(0.4) or thorough:
        chosen |= {method: {"method": method} for method in METHODS}
    else:
        chosen[f"{named} {rtols[1]:.0e}"] = {"method": named, "rtol": rtols[1], "atol": rtols[1] / 100}
    if t.chance(0.3) or thorough:
        chosen["assembled"] = {"kernel": "assembled"}
    if t.chance(0.3) or thorough:
        chosen["1 output"] = {"n_outputs": 1}
    if t.chance(0.3) or thorough:
        chosen["1000 outputs"] = {"n_outputs": 1000}
    return chosen


def text_with(groups: list[Group], keys: dict) -> str:
    """The namelist with other keys."""
    changed = [(name, given | {k: v for k, v in keys.items() if (name, k) in (("case", "n_outputs"), ("model", "kernel"))})
               for name, given in groups]
    return text_of(changed, **{k: v for k, v in keys.items() if k in ("method", "rtol", "atol")})


class Run:
    """One run of the program."""

    def __init__(self, text: str, place: pathlib.Path) -> None:
        case, result = place / "case.nml", place / "case.h5"
        case.write_text(text)
        result.unlink(missing_ok=True)
        limit = partial(resource.setrlimit, resource.RLIMIT_CPU, (int(LONGEST), int(LONGEST) + 5))
        with open(place / "err", "w+") as err:
            process = subprocess.Popen([RODYN, "run", str(case), "--output", str(result), "--force", "--quiet"], stdout=subprocess.DEVNULL,
                                       stderr=err, preexec_fn=limit, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"})
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            err.seek(0)
            said = err.read().strip().splitlines()
        self.code, self.seconds, self.said = process.returncode, usage.ru_utime, said[-1] if said else ""
        if self.code:
            return
        with h5py.File(result) as file:
            self.time = file["time"][:]
            self.states = {name: file[name][:] for name in ("phi", *ENERGIES, "energy_residual")}
            self.method = word(file["solver"].attrs["method"])
            self.n_rhs = int(file["solver"].attrs["n_rhs"])
            self.integration = float(file["solver"].attrs.get("integration_seconds", np.nan))
            self.events = []
            if "events" in file:
                events = file["events"]
                self.events = [(float(t), int(hinge), word(kind)) for t, hinge, kind in
                               zip(events["time"][:], events["hinge"][:], events["kind"][:], strict=True)]


def word(text: bytes | str) -> str:
    return (text.decode() if isinstance(text, bytes) else str(text)).strip()


# -------------------------------------------------------------------- comparison

def motion_of(groups: list[Group], shift: float = 0.0) -> multipliers.Motion:
    """The reference, from build/campaign if it was computed there by the same sources."""
    key = hashlib.sha256((multipliers.version() + text_of(groups) + repr(shift)).encode()).hexdigest()[:24]
    path = CACHE / key
    if not path.is_file():
        CACHE.mkdir(parents=True, exist_ok=True)
        made = CACHE / f".{key}.{os.getpid()}"
        made.write_bytes(pickle.dumps(multipliers.reference(groups, shift=shift)))
        made.replace(path)
    return pickle.loads(path.read_bytes())


class Reference:
    """The independent motion, and until when it can be compared with."""

    def __init__(self, groups: list[Group]) -> None:
        self.groups = groups
        self.motion = motion_of(groups)
        self.t_end = dict(groups)["case"]["t_end"]
        self.rows = len(self.motion.time)
        self.scale = float(abs(self.motion.states["phi"]).max()) if self.rows else 0.0
        self.energy = float(sum(abs(self.motion.states[name]).max() for name in ENERGIES)) if self.rows else 0.0
        self._sensitive: float | None = None

    def undetermined_from(self, bound: float) -> float:
        """The time of the first event that differs between neighbours so far apart [rad]; twice the end: none."""
        return min(first_difference(motion_of(self.groups, shift).events, self.motion.events, self.t_end) for shift in (bound, -bound))

    def sensitive_from(self) -> float:
        """The time where a neighbour is too far away; twice the end: never."""
        if self._sensitive is None:
            self._sensitive = 2.0 * self.t_end
            neighbour = motion_of(self.groups, SHIFT)
            m = min(len(neighbour.time), self.rows)
            apart = abs(neighbour.states["phi"][:m] - self.motion.states["phi"][:m]).max(axis=1)
            far = np.flatnonzero(apart > FACTOR * SHIFT)
            if far.size:
                self._sensitive = float(self.motion.time[max(far[0] - 1, 0)])
            self._sensitive = min(self._sensitive, first_difference(neighbour.events, self.motion.events, self.t_end))
        return self._sensitive


def by_hinge(events: list[tuple[float, int, str]]) -> dict[int, list[tuple[float, str]]]:
    found = defaultdict(list)
    for t, hinge, kind in sorted(events):
        if t > 0.0:
            found[hinge].append((t, kind))
    return found


def first_difference(events, others, t_end: float) -> float:
    """The time of the first event of a hinge that differs in kind, or is missing; twice the end: none."""
    first, a, b = 2.0 * t_end, by_hinge(events), by_hinge(others)
    for hinge in a.keys() | b.keys():
        for i in range(max(len(a[hinge]), len(b[hinge]))):
            here = [x[hinge][i] for x in (a, b) if i < len(x[hinge])]
            if len(here) < 2 or here[0][1] != here[1][1]:
                first = min(first, *(t for t, _ in here))
                break
    return first


def judged(run: Run, keys: dict, reference: Reference) -> dict:
    """Errors of a run over what they may be."""
    rtol, atol = keys.get("rtol", 1e-8), keys.get("atol", 1e-10)
    stride = (len(run.time) - 1) / 10
    rows = np.arange(reference.rows)
    here = (rows * stride).round().astype(int)
    if stride < 1:
        rows, here = rows[[0, -1]], np.array([0, len(run.time) - 1])
        if reference.rows < 11:
            return {}
    bound = rtol * reference.scale + atol
    phi = abs(run.states["phi"][here] - reference.motion.states["phi"][rows]).max(axis=1) / bound
    energy = np.max([abs(run.states[name][here] - reference.motion.states[name][rows]) for name in ENERGIES], axis=0)
    residual = abs(run.states["energy_residual"][here])
    energy = np.maximum(energy, residual) / (rtol * max(reference.energy, 1e-30) + 1e-12)
    until, keep = 2.0 * reference.t_end, np.ones(len(rows), bool)
    differ = first_difference(run.events, reference.motion.events, reference.t_end)
    if reference.motion.trouble:  # it ended before its time
        differ = differ if differ < reference.motion.time[-1] else 2.0 * reference.t_end
    wrong = phi.max() > FACTOR or energy.max() > ENERGY or differ <= reference.t_end
    if wrong:
        until = reference.sensitive_from()
        if differ <= min(until * 0.999999, reference.t_end):
            undetermined = reference.undetermined_from(FACTOR * float(f"{bound:.3g}"))
            differ = differ if differ < 0.999 * undetermined else 2.0 * reference.t_end
        keep = reference.motion.time[rows] <= until
    return {"phi": float(phi[keep].max()), "energy": float(energy[keep].max()),
            "events": bool(differ <= min(until * 0.999999, reference.t_end)),
            "until": until if until <= reference.t_end else None, "differ": differ if differ <= reference.t_end else None}


def examine(family: str, seed: int, thorough: bool = False) -> dict:
    """Everything about one scene."""
    place = KEPT / f"{family}_{seed}"
    place.mkdir(parents=True, exist_ok=True)
    groups = groups_of(family, seed)
    started = time.process_time()
    reference = Reference(groups)
    found: dict = {"family": family, "seed": seed, "reference": reference.motion.trouble, "jumps": reference.motion.jumps,
                   "n_events": len(reference.motion.events), "runs": {}, "faults": []}
    runs = {}
    for name, keys in variants(family, seed, thorough).items():
        run = runs[name] = Run(text_with(groups, keys), place)
        refuses = keys.get("method") == "gauss" and "cannot integrate this system" in run.said
        entry: dict = {"code": run.code, "seconds": round(run.seconds, 3)}
        if run.code:
            entry["said"] = run.said
            if not refuses:
                found["faults"].append(f"{name}: fails: {run.code} {run.said}")
        else:
            entry |= {"method": run.method, "n_rhs": run.n_rhs, "n_events": len(run.events)}
            if reference.rows:
                entry |= judged(run, keys, reference)
                if entry.get("phi", 0.0) > FACTOR:
                    found["faults"].append(f"{name}: off: {entry['phi']:.0f} times the tolerance ({run.method})")
                elif entry.get("events"):
                    found["faults"].append(f"{name}: events: other than the reference's at t = {entry['differ']:.6g} s ({run.method})")
                if entry.get("phi", 0.0) <= FACTOR and entry.get("energy", 0.0) > ENERGY:
                    found["faults"].append(f"{name}: ledger: {entry['energy']:.0f} times the tolerance ({run.method})")
        found["runs"][name] = entry
    found["faults"] += slowness(found)
    found["sensitive"] = any(entry.get("until") is not None for entry in found["runs"].values())
    found["processor_seconds"] = round(time.process_time() - started, 2)
    if found["faults"]:
        (place / "case.nml").write_text(f"! {family} {seed}\n" + text_of(groups))
        (place / "faults.txt").write_text("\n".join(found["faults"]) + "\n")
    else:
        for path in place.iterdir():
            path.unlink()
        place.rmdir()
    return found


def slowness(found: dict) -> list[str]:
    """`auto` against the quickest method that keeps within the bound, all at default tolerances."""
    runs = found["runs"]
    if not all(method in runs for method in METHODS) or runs["default"]["code"]:
        return []
    good = {name: runs[name] for name in METHODS if runs[name]["code"] == 0 and runs[name].get("phi", 0.0) <= FACTOR}
    if not good:
        return []
    best = min(good, key=lambda name: good[name]["seconds"])
    ratio = (runs["default"]["seconds"] + LEAST) / (good[best]["seconds"] + LEAST)
    found["slow"], found["best"] = round(ratio, 2), best
    if ratio <= SLOWEST:
        return []
    return [f"default: slow: auto ({runs['default']['method']}) {runs['default']['seconds']:.2f} s, {best} {good[best]['seconds']:.2f} s"]


# -------------------------------------------------------------------- sweeps

def sweep_faults(family: str, seed: int) -> list[str]:
    """A sweep of very unequal cases, some of which fail, against each case with none but itself: the same bytes."""
    place = KEPT / f"sweep_{family}_{seed}"
    place.mkdir(parents=True, exist_ok=True)
    groups = groups_of(family, seed)
    t_end = dict(groups)["case"]["t_end"]
    times = [round(t_end * x, 6) for x in (0.05, 1.0, 0.3, 2.0, 0.1, 0.05, 1.0, 0.5, 0.2, 1.0)]
    (place / "base.nml").write_text(text_of(groups, method="dop853", max_steps=1500))
    factors = [1.0, 0.5, 2.0, 1.0, 30.0, 1.5, 0.01, 3.0, 1.0, 100.0]
    given = dict(groups)["chain"]["hinge_stiffness"]
    first = given[0] if isinstance(given, list) else given
    stiffness = [float(f"{first * factor:.4g}") for factor in factors]

    def sweep(name: str, cases: list[int]) -> dict[str, np.ndarray]:
        rows = ", ".join(repr(times[i]) for i in cases), ", ".join(repr(stiffness[i]) for i in cases)
        (place / f"{name}.nml").write_text(f"&sweep base = 'base.nml', combine = 'zip', probe_times = {times[0]!r} /\n"
                                           f"&axis key = 'case.t_end', values = {rows[0]} /\n"
                                           f"&axis key = 'chain.hinge_stiffness(0)', values = {rows[1]} /\n")
        done = subprocess.run([RODYN, "sweep", str(place / f"{name}.nml"), "--output", str(place / name), "--force", "--quiet"],
                              capture_output=True, text=True, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"})
        with h5py.File(place / name / "sweep.h5") as file:
            names = ("phi", "phi_rate", "status", "message", "t_reached", "n_rhs")
            return {key: file[key][:] for key in names} | {"code": np.array([done.returncode] * len(cases))}

    faults = []
    together = sweep("together", list(range(len(times))))
    for i in range(len(times)):
        alone = sweep(f"alone_{i}", [i] * 4)  # lanes need four like cases
        faults += [
            f"sweep {family} {seed}, case {i + 1}: {key} differs: {alone[key][0]} alone, {together[key][i]} together"
            for key in alone.keys() - {"code"}
            if np.asarray(alone[key][0]).tobytes() != np.asarray(together[key][i]).tobytes()
        ]
    return faults


# -------------------------------------------------------------------- what the tests compare with

def stored(job: tuple[str, int]) -> dict:
    """phi in the middle and at the end, and the events of each hinge, of what is not sensitive."""
    family, seed = job
    groups = groups_of(family, seed)
    reference = Reference(groups)
    until = reference.sensitive_from()
    motion = reference.motion
    rows = [i for i in (5, 10) if i < reference.rows and motion.time[i] <= until]
    return {"family": family, "seed": seed, "scale": float(f"{reference.scale:.6g}"), "rows": rows,
            "phi": [[float(f"{x:.12g}") for x in motion.states["phi"][i]] for i in rows],
            "events": {hinge: [kind for t, kind in events if t < until * 0.999999] for hinge, events in by_hinge(motion.events).items()},
            "whole": not motion.trouble and until > reference.t_end}


# -------------------------------------------------------------------- table

def table(results: list[dict]) -> str:
    """A line for each family."""
    head = ["family", "scenes", "runs", "events", "sensitive", "fail", "off", "events differ", "ledger", "slow", "worst error",
            "of `auto`", "slowest `auto`"]
    lines = ["| " + " | ".join(head) + " |", "|---" + "|---:" * (len(head) - 1) + "|"]
    families = [name for name in FAMILIES if any(r["family"] == name for r in results)]
    for family in [*families, "all"]:
        mine = [r for r in results if family in (r["family"], "all")]
        runs = [(name, run) for r in mine for name, run in r["runs"].items() if run["code"] == 0 and "phi" in run]
        automatic = [run["phi"] for name, run in runs if name.split()[0] not in METHODS]
        counts = Counter(fault.split(": ")[1] for r in mine for fault in r["faults"])
        lines.append("| " + " | ".join(
            [family, str(len(mine)), str(sum(len(r["runs"]) for r in mine)), str(sum(r["n_events"] for r in mine)),
             str(sum(r["sensitive"] for r in mine)), *(str(counts[kind]) for kind in ("fails", "off", "events", "ledger", "slow")),
             f"{max((run['phi'] for _, run in runs), default=0.0):.3g}", f"{max(automatic, default=0.0):.3g}",
             f"{max((r['slow'] for r in mine if 'slow' in r), default=0.0):.2f}"]) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--family", choices=FAMILIES)
    parser.add_argument("--seed", type=int, default=1, help="the first seed; without --count the only one, with every variant")
    parser.add_argument("--count", type=int, default=0, help="scenes of each family")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--thorough", action="store_true", help="every variant of every scene")
    parser.add_argument("--sweeps", action="store_true", help="sweeps as well")
    parser.add_argument("--seconds", type=float, default=1e9, help="begin no scene after so long")
    parser.add_argument("--store", type=pathlib.Path, help="write the reference of these scenes to a file, for the tests")
    parser.add_argument("--docs", action="store_true", help="write the table into the document, compute nothing")
    arguments = parser.parse_args()
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    if arguments.docs:
        write_document()
        return
    multipliers.program()
    families = [arguments.family] if arguments.family else list(FAMILIES)
    seeds = range(arguments.seed, arguments.seed + max(arguments.count, 1))
    thorough = arguments.thorough or arguments.count == 0
    results, started = [], time.time()
    jobs = [(family, seed) for seed in seeds for family in families]
    if arguments.store:
        with ProcessPoolExecutor(arguments.jobs) as pool:
            lines = [json.dumps(found) for found in pool.map(stored, jobs)]
        arguments.store.write_text("[\n" + ",\n".join(lines) + "\n]\n")
        return
    with ProcessPoolExecutor(arguments.jobs) as pool, open(RESULTS, "w") as kept:
        for found in pool.map(partial(bounded, started + arguments.seconds, thorough), jobs):
            if found is None:
                continue
            results.append(found)
            kept.write(json.dumps(found) + "\n")
            kept.flush()
            for fault in found["faults"]:
                print(f"{found['family']} {found['seed']}: {fault}", flush=True)
    if arguments.sweeps:
        for family, seed in jobs:
            print(*sweep_faults(family, seed), sep="\n", flush=True)
    print(table(results))
    print(summary(results), f"{time.time() - started:.0f} s")


def summary(results: list[dict]) -> str:
    """What was computed, in a line."""
    seeds = [r["seed"] for r in results]
    return (f"{len(results)} scenes of {len({r['family'] for r in results})} families, seeds {min(seeds)} to {max(seeds)}; "
            f"{sum(len(r['runs']) for r in results)} runs, {sum(r['n_events'] for r in results)} events; "
            f"{sum(bool(r['faults']) for r in results)} scenes with faults.")


def write_document() -> None:
    """Put the table and its summary between their marks."""
    results = [json.loads(line) for line in RESULTS.read_text().splitlines()]
    before, _, rest = DOCUMENT.read_text().partition(MARK)
    _, _, after = rest.partition("<!-- end -->")
    DOCUMENT.write_text(f"{before}{MARK}{table(results)}\n\n{summary(results)}\n<!-- end -->{after}")


def bounded(until: float, thorough: bool, job: tuple[str, int]) -> dict | None:
    return examine(*job, thorough) if time.time() < until else None


if __name__ == "__main__":
    main()
