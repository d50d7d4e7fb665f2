#!/usr/bin/env python3
"""Times a peer for bench/work_precision/run.py: reads jobs from standard input, a line of JSON each, and answers likewise.

    {"method": "names", "scene": "table1.nml"}            -> {"status": "done", "lines": [...], "version": "..."}
    {"method": "DOP853", "scene": "table1.nml", "rtol": 1e-8, "atol": 1e-10, "probe_times": [0.5, 1.0], "repeats": 3}
                                                          -> {"status": "done", "seconds": ..., "n_rhs": ..., "phi": [[...], ...]}

Start-up and compilation are left out of the time: what was compiled is kept, and the first run is not timed.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
import time
import types
from collections.abc import Callable
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

Answer = dict[str, Any]


class TookTooLongError(Exception):
    """The budget of a computation is used up."""


def main(name: str) -> None:
    answers = os.fdopen(os.dup(1), "w")  # libraries may print what they like
    os.dup2(2, 1)
    signal.signal(signal.SIGALRM, stop)
    peer = None
    for line in sys.stdin:
        job = json.loads(line)
        try:
            peer = peer or __import__(f"peer_{name}")
            answer = {"lines": peer.lines(job["scene"]), "version": peer.version()} if job["method"] == "names" else time_job(peer, job)
            answer = {"status": "done"} | answer
        except TookTooLongError:
            answer = {"status": "failed", "message": "stopped: took too long"}
        except Exception as error:  # whatever a peer raises is its answer
            answer = {"status": "failed", "message": f"{type(error).__name__}: {error}"[:500]}
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
        print(json.dumps(answer), file=answers, flush=True)


def stop(*_: object) -> None:
    raise TookTooLongError


def time_job(peer: types.ModuleType, job: Answer) -> Answer:
    """`peer.prepare(job)` returns a function that integrates once and gives (seconds, result)."""
    run: Callable[[], tuple[float, Answer]] = peer.prepare(job)
    signal.setitimer(signal.ITIMER_REAL, job.get("budget", 60.0))
    start = time.perf_counter()
    first, result = run()
    seconds = [first] if time.perf_counter() - start > 1.0 else []  # compilation is done before that
    with contextlib.suppress(TookTooLongError):
        while len(seconds) < job.get("repeats", 1):
            seconds.append(run()[0])
    return result | {"seconds": min(seconds or [first])}


if __name__ == "__main__":
    main(sys.argv[1])
