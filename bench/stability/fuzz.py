"""Break it by its input: damaged namelists for `rodyn check`, `run` and `sweep`.

    tools/fuzz                       10,000 mutants, two at a time
    tools/fuzz --mutants 300 --seed 5 --jobs 1
    tools/fuzz --only 1234           one of them again, with what the program said

Each mutant is checked. Where `check` finds nothing, the mutant is run (a case) or computed (a sweep), with SIGTERM after half
a second: a mutant may well ask for a million years. What must hold:

- no signal, no hang, no word of a run-time library, no command above 2 s of processor time;
- `check` ends with 0 or 2; what it accepts ends with 0, 1 (the integration failed: one line says where) or 75 (SIGTERM), and with 2
  only for lack of memory or disk; 2 comes with a message and without a file;
  (SIGTERM while the input is still read ends the program at once; then no file may be there);
- a result holds the input as it was, a resolved input of finite numbers that `check` accepts, and finite states.

A mutant that breaks one of these is made smaller as long as it does so, and kept in build/fuzz.
"""

from __future__ import annotations

import argparse
import collections
import multiprocessing
import os
import pathlib
import re
import shutil
import signal
import sys
import tempfile
import time
from dataclasses import dataclass, field

import h5py
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import program
from mutants import mutant, pieces
from support import ROOT

STOP_AFTER = 0.5  # [s]
MOST_REDUCTIONS = 400
LONGEST_REDUCTION = 60.0  # [s]
SHORT = re.compile(r"needs about .* (memory|disk)")


@dataclass
class Outcome:
    number: int
    kind: str                       # of mutation
    fault: str = ""                 # what broke; empty: nothing
    ends: list[str] = field(default_factory=list)  # 'check 2', 'run 0', ...
    seconds: float = 0.0            # of the longest command
    said: str = ""


def examine(base: bytes | None, text: bytes, directory: pathlib.Path, outcome: Outcome) -> None:
    """Do everything with one mutant."""
    name = "case.nml" if base is None else "sweep.nml"
    (directory / name).write_bytes(text)
    if base is not None:
        (directory / "base.nml").write_bytes(base)
    here = set(files(directory))

    def step(arguments: list[str], codes: set[int], stop_after: float | None = None) -> program.Ending:
        ending = program.run(arguments, directory, stop_after)
        outcome.ends.append(f"{arguments[0]} {ending.code}")
        outcome.seconds = max(outcome.seconds, ending.seconds)
        outcome.said += f"$ rodyn {' '.join(arguments)}\n{ending.stdout}{ending.stderr}exit code {ending.code}\n"
        cut_off = ending.stopped and ending.code == -signal.SIGTERM and set(files(directory)) == here
        wrong = "" if cut_off else program.fault(ending, codes)
        if not wrong and ending.code == 2:
            if set(files(directory)) != here:
                wrong = "refused, but wrote files"
            elif ending.stdout:
                wrong = "refused, but printed results"
        if wrong:
            outcome.fault = f"{arguments[0]}: {wrong}"
        return ending

    checked = step(["check", name], {0, 2})
    if outcome.fault or checked.code == 2:
        return
    if base is None:
        ending = step(["run", name, "--output", "out.h5"], {0, 1, 2, 75}, STOP_AFTER)
        if not outcome.fault and ending.code >= 0:
            outcome.fault = case_fault(ending, text, directory)
    else:
        ending = step(["sweep", name, "--output", "out"], {0, 1, 2, 75}, STOP_AFTER)
        if not outcome.fault and ending.code >= 0:
            outcome.fault = sweep_fault(ending, text, base, directory)
    if outcome.fault or not (directory / "resolved.nml").exists():
        return
    here = set(files(directory))
    again = step(["check", "resolved.nml"], {0, 2})
    if not outcome.fault and again.code != 0:
        outcome.fault = "check refuses the resolved input"


def files(directory: pathlib.Path) -> list[str]:
    return sorted(path.name for path in directory.iterdir())


def case_fault(ending: program.Ending, text: bytes, directory: pathlib.Path) -> str:
    if ending.code == 2:
        return "" if SHORT.search(ending.stderr) else "run refuses what check accepts"
    if ending.code == 1 and not (directory / "out.h5").exists():
        return "failed without a file"
    if ending.code == 1 and len(ending.stderr.splitlines()) != 1:
        return "failed with more or less than one line"
    path = directory / ("out.h5.stopped" if ending.code == 75 else "out.h5")
    if ending.code == 75 and not path.exists():
        return "stopped without a file"
    with h5py.File(path) as file:
        wanted = {0: "done", 1: "failed", 75: "stopped"}[ending.code]
        if file.attrs["status"].decode() != wanted:
            return f"status {file.attrs['status']!r} with exit code {ending.code}"
        if not same_text(file, "input", text):
            return "the input in the file is not the input"
        resolved = attribute(file, "resolved_input")
        if bad_number(resolved):
            return f"resolved input with {bad_number(resolved)}"
        for name, data in file.items():
            if isinstance(data, h5py.Dataset) and not np.all(np.isfinite(data[()])):
                return f"{name} is not finite in a file of status {wanted}"
        (directory / "resolved.nml").write_bytes(resolved)
    return ""


def sweep_fault(ending: program.Ending, text: bytes, base: bytes, directory: pathlib.Path) -> str:
    if ending.code == 2:
        return "" if SHORT.search(ending.stderr) else "sweep refuses what check accepts"
    path = directory / "out" / "sweep.h5"
    if ending.code == 75:
        return "stopped, but complete" if path.exists() else ""
    if not path.exists():
        return "no sweep.h5"
    with h5py.File(path) as file:
        if not same_text(file, "input", text) or not same_text(file, "base_input", base):
            return "the input in the file is not the input"
        resolved = attribute(file, "resolved_base")
        if bad_number(resolved):
            return f"resolved base with {bad_number(resolved)}"
        done = file["status"][()] == b"done"
        if done.all() != (ending.code == 0):
            return f"exit code {ending.code} with {done.sum()} of {done.size} cases done"
        # Chains of other lengths end in NaN; the spacecraft has no length.
        for name in ("final_rotation", "final_omega", "final_velocity_x"):
            if not np.array_equal(np.isfinite(file[name][()]), done):
                return f"{name} is not finite exactly where cases are done"
        for name in file:
            if name.startswith("param_") and file[name].dtype.kind == "f" and not np.all(np.isfinite(file[name][()])):
                return f"{name} is not finite"
        (directory / "resolved.nml").write_bytes(resolved)
    return ""


def attribute(file: h5py.File, name: str) -> bytes:
    return bytes(file.attrs[name])


def same_text(file: h5py.File, name: str, text: bytes) -> bool:
    return attribute(file, name).rstrip(b"\0") == text.rstrip(b"\0")


def bad_number(text: bytes) -> str:
    """A value that is no finite number, or nothing."""
    code = re.sub(rb"'[^']*'|!.*", b"T", text)
    found = re.search(rb"(?i)(?<![\w.])[-+]?(nan|inf\w*)|\*{3,}|=\s*[,/\n]", code)
    if found:
        return found[0].decode()
    for number in re.findall(rb"(?<![\w.*])[-+]?\d[\d.]*[eEdD][-+]?\d+", code):
        if not np.isfinite(float(number.lower().replace(b"d", b"e"))):
            return number.decode()
    return ""


def try_mutant(base: bytes | None, text: bytes, outcome: Outcome) -> None:
    directory = pathlib.Path(tempfile.mkdtemp(prefix="fuzz-"))
    try:
        examine(base, text, directory, outcome)
    finally:
        shutil.rmtree(directory, ignore_errors=True)


def one(job: tuple[int, int]) -> Outcome:
    seed, number = job
    base, text, kind = mutant(seed, number)
    outcome = Outcome(number, kind)
    try_mutant(base, text, outcome)
    if outcome.fault:
        outcome.said = ""
        try_mutant(base, text, outcome)  # again: what does not repeat is the machine's fault, or worse
        if not outcome.fault:
            outcome.fault = "does not repeat"
    return outcome


def smaller(base: bytes | None, text: bytes, fault: str) -> bytes:
    """Leave out lines, then pieces, as long as the same thing breaks."""
    trials, last = 0, time.time() + LONGEST_REDUCTION
    for cut in (lambda t: t.splitlines(keepends=True), pieces):
        parts = cut(text)
        size = max(1, len(parts) // 2)
        while size >= 1 and trials < MOST_REDUCTIONS and time.time() < last:
            i = 0
            while i < len(parts) and trials < MOST_REDUCTIONS and time.time() < last:
                shorter = parts[:i] + parts[i + size:]
                outcome = Outcome(0, "")
                trials += 1
                try_mutant(base, b"".join(shorter), outcome)
                if same_fault(outcome.fault, fault):
                    parts = shorter
                else:
                    i += size
            size //= 2
        text = b"".join(parts)
    return text


def same_fault(a: str, b: str) -> bool:
    return bool(a) and re.sub(r"[\d.]+", "N", a) == re.sub(r"[\d.]+", "N", b)


def keep(directory: pathlib.Path, seed: int, outcome: Outcome, reduce: bool) -> pathlib.Path:
    """Write down a mutant that broke something."""
    base, text, _ = mutant(seed, outcome.number)
    place = directory / f"{seed}-{outcome.number}"
    place.mkdir(parents=True, exist_ok=True)
    name = "case.nml" if base is None else "sweep.nml"
    (place / f"whole-{name}").write_bytes(text)
    (place / name).write_bytes(smaller(base, text, outcome.fault) if reduce else text)
    if base is not None:
        (place / "base.nml").write_bytes(base)
    (place / "said.txt").write_text(f"{outcome.fault}\n{outcome.said}")
    return place


def campaign(seed: int, numbers: list[int], jobs: int, directory: pathlib.Path, reduce: bool = True, tell=print) -> list[Outcome]:
    """All mutants; returns what became of them."""
    start = time.time()
    outcomes = []
    shown: collections.Counter[str] = collections.Counter()
    with multiprocessing.Pool(jobs) as pool:
        for outcome in pool.imap_unordered(one, [(seed, n) for n in numbers], chunksize=4):
            outcomes.append(outcome)
            if outcome.fault:
                like = re.sub(r"[\d.]+", "N", outcome.fault)
                shown[like] += 1
                place = keep(directory, seed, outcome, reduce and shown[like] <= 3)
                tell(f"mutant {outcome.number} ({outcome.kind}): {outcome.fault}: {place}")
            if len(outcomes) % 100 == 0:
                tell(f"{len(outcomes)} mutants, {sum(bool(o.fault) for o in outcomes)} faults, {time.time() - start:.0f} s")
    return outcomes


def summary(outcomes: list[Outcome]) -> str:
    """What was tried and how it ended."""
    ends: collections.Counter[str] = collections.Counter(end for o in outcomes for end in o.ends)
    kinds: collections.Counter[str] = collections.Counter(o.kind for o in outcomes)
    lines = ["mutants  " + ", ".join(f"{n} of {kind}" for kind, n in sorted(kinds.items())),
             "endings  " + ", ".join(f"{end}: {n}" for end, n in sorted(ends.items())),
             f"longest  {max((o.seconds for o in outcomes), default=0.0):.2f} s of processor time",
             f"faults   {sum(bool(o.fault) for o in outcomes)} of {len(outcomes)}"]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutants", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    parser.add_argument("--seed", type=int, default=20170707)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", type=int, help="this one, with all that is said")
    parser.add_argument("--keep", type=pathlib.Path, default=ROOT / "build" / "fuzz", help="where what breaks is kept")
    options = parser.parse_args()
    if options.only is not None:
        outcome = one((options.seed, options.only))
        place = keep(options.keep, options.seed, outcome, reduce=False)
        print(outcome.said or "nothing was said", outcome.fault or "nothing broke", place, sep="\n")
        return int(bool(outcome.fault))
    os.nice(10)
    outcomes = campaign(options.seed, list(range(options.first, options.first + options.mutants)), options.jobs, options.keep)
    print(summary(outcomes))
    return int(any(o.fault for o in outcomes))


if __name__ == "__main__":
    sys.exit(main())
