"""The program under limits of time and memory, and what is wrong with the way it ended."""

from __future__ import annotations

import os
import pathlib
import re
import resource
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from support import RODYN

MEMORY = int(os.environ.get("RODYN_MEMORY") or 4 << 30)  # address space [bytes]; -1: no limit, which the sanitizers need
FILES = 1 << 30         # of a file [bytes]
LONGEST = 2.0           # processor time of a command [s]
HANGS = 60.0            # wall time, on a machine that others use, too [s]
STOPPED = 75

#: What must never be seen: a run-time library or a signal speaks in place of the program.
CRASH = re.compile(r"backtrace|runtime error|error termination|program received signal|segmentation|core dumped|hdf5-diag|"
                   r"error allocating|corrupted|free\(\)|sanitizer|at line \d+ of file|mpi_abort", re.IGNORECASE)


@dataclass
class Ending:
    code: int          # negative: a signal
    stdout: str
    stderr: str
    seconds: float     # processor time
    stopped: bool      # SIGTERM was sent
    hung: bool


def run(arguments: list[str], directory: pathlib.Path, stop_after: float | None = None, memory: int = MEMORY) -> Ending:
    """`rodyn ARGUMENTS`; SIGTERM after so many seconds."""
    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        resource.setrlimit(resource.RLIMIT_FSIZE, (FILES, FILES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (20, 20))

    out, err = directory / ".stdout", directory / ".stderr"
    with open(out, "wb") as stdout, open(err, "wb") as stderr:
        process = subprocess.Popen([RODYN, *arguments], cwd=directory, stdin=subprocess.DEVNULL, stdout=stdout, stderr=stderr,
                                   preexec_fn=limit, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"})
        sent = {"stop": False, "kill": False}

        def send(name: str, number: int) -> None:
            sent[name] = True
            os.kill(process.pid, number)  # not send_signal, which would reap the process

        timers = [threading.Timer(HANGS, send, ("kill", signal.SIGKILL))]
        if stop_after is not None:
            timers.append(threading.Timer(stop_after, send, ("stop", signal.SIGTERM)))
        for timer in timers:
            timer.start()
        _, status, usage = os.wait4(process.pid, 0)
        for timer in timers:
            timer.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
    texts = [path.read_text(errors="replace") for path in (out, err)]
    out.unlink()
    err.unlink()
    return Ending(process.returncode, *texts, usage.ru_utime + usage.ru_stime, sent["stop"], sent["kill"])


def fault(ending: Ending, codes: set[int]) -> str:
    """What is wrong with an ending; empty if nothing."""
    if ending.hung:
        return f"hangs: not ended after {HANGS:.0f} s"
    if ending.code < 0:
        return f"ended by {signal.Signals(-ending.code).name}"
    found = CRASH.search(ending.stderr)
    if found:
        return f"crash: {found[0]!r} on standard error"
    if "\ufffd" in ending.stderr:
        return "a message that is not UTF-8"
    if ending.code not in codes:
        return f"exit code {ending.code}"
    if ending.code == STOPPED and not ending.stopped:
        return "exit code 75 without a signal"
    if ending.seconds > LONGEST:
        return f"took {ending.seconds:.1f} s"
    if ending.code != 0 and not ending.stderr.strip():
        return f"exit code {ending.code} without a message"
    return ""
