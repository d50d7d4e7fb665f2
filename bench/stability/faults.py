"""Break it from outside: kill -9, SIGTERM, limits of file size and full disks at random instants of single runs.

    python bench/stability/faults.py [PROGRAM] [--trials 100]

The full disks are file systems in memory, each mounted for one run in name spaces of its own (unshare; no privilege is needed
where the system lets users have these, and where it does not, that part says so and is left out).

Whatever happens, no file may look complete and be none: FILE.h5 is there only with all rows and status 'done' (and then is the
same as that of an undisturbed run), FILE.h5.stopped only after SIGTERM, with a readable beginning of the same rows.
"""

from __future__ import annotations

import argparse
import pathlib
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time

import h5py
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import program
from run_files import OF_THE_HOUR, differences
from scenes import CHAIN, MOMENT, SPACECRAFT

#: About a third of a second, a megabyte in several blocks.
CASE = ("&case title = 'Disturbed', t_end = 3, n_outputs = 6000 /\n" + SPACECRAFT + CHAIN + MOMENT
        + "&solver method = 'dop853', rtol = 1e-10, atol = 1e-12 /\n")


#: Mount a disk of $1 bytes, let the program $2 write onto it, fill it after $3 seconds, and bring out what was left on it.
DISK = """
mkdir disk && mount -t tmpfs -o size="$1" none disk || exit 99
"$2" run case.nml --output disk/out.h5 --quiet &
sleep "$3"; cat /dev/zero > disk/filler 2>/dev/null
wait $!; code=$?
rm disk/filler; cp -a disk/. .; umount disk; rmdir disk
exit $code
"""
NAMESPACE = ["unshare", "--user", "--map-root-user", "--mount"]
DISK_SIZE = 16 << 20


def may_mount() -> bool:
    """May we have disks of our own?"""
    try:
        done = subprocess.run([*NAMESPACE, "mount", "-t", "tmpfs", "none", "/mnt"], capture_output=True)
    except OSError:
        return False
    return done.returncode == 0


class Trials:
    """An undisturbed run, and disturbed ones beside it."""

    def __init__(self, rodyn: str, directory: pathlib.Path, text: str = CASE):
        self.rodyn, self.directory = rodyn, directory
        (directory / "case.nml").write_text(text)
        self.whole = directory / "whole.h5"
        start = time.time()
        subprocess.run([rodyn, "run", "case.nml", "--output", "whole.h5", "--quiet"], cwd=directory, check=True)
        self.seconds = time.time() - start

    def start(self, **options) -> subprocess.Popen:
        return subprocess.Popen([self.rodyn, "run", "case.nml", "--output", "out.h5", "--quiet"], cwd=self.directory,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)

    def signalled(self, number: int, delay: float) -> str:
        """What is wrong after a signal; empty if nothing."""
        process = self.start()
        time.sleep(delay)
        process.send_signal(number)
        _, said = process.communicate()
        allowed = {0, -9} if number == signal.SIGKILL else {0, 75, -15}  # before the program looks out for it, SIGTERM kills
        return self.verdict(process.returncode, said, allowed)

    def limited(self, limit: int) -> str:
        """What is wrong after a run that may write so many bytes."""
        def apply() -> None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        process = self.start(preexec_fn=apply)
        _, said = process.communicate()
        return self.verdict(process.returncode, said, {0, 1})

    def full(self, size: int, delay: float) -> str:
        """What is wrong after a run onto a disk of so many bytes, that somebody else fills up after a while."""
        done = subprocess.run([*NAMESPACE, "sh", "-c", DISK, "sh", str(size), self.rodyn, str(delay)], cwd=self.directory,
                              capture_output=True, text=True)
        if done.returncode == 1 and "No space left on device" not in done.stderr:
            return f"not told of the disk: {done.stderr}"
        return self.verdict(done.returncode, done.stderr, {0, 1, 2})

    def verdict(self, code: int, said: str, allowed: set[int]) -> str:
        left = {p.name for p in self.directory.iterdir()} - {"case.nml", "whole.h5"}
        wrong = ""
        if code not in allowed or program.CRASH.search(said):
            wrong = f"exit code {code}: {said}"
        elif code not in (0, 1) and "out.h5" in left and differences(self.whole, self.directory / "out.h5") - OF_THE_HOUR:
            wrong = f"a result that is not complete, exit code {code}"
        elif code == 0 and (left != {"out.h5"} or differences(self.whole, self.directory / "out.h5") - OF_THE_HOUR):
            wrong = f"not the result of an undisturbed run; files {left}"
        elif code == 1 and left == {"out.h5"}:
            wrong = self.part("out.h5", b"failed")
        elif code in (1, 2) and left:
            wrong = f"failed to write, and left {left}"
        elif code in (1, 2) and not said.strip():
            wrong = f"exit code {code} without a message"
        elif code == 75:
            wrong = self.stopped(left)
        elif code < 0 and any(not name.startswith("out.h5.partial-") for name in left - {"out.h5"}):
            wrong = f"killed, and left {left}"
        for name in left:
            (self.directory / name).unlink()
        return wrong

    def stopped(self, left: set[str]) -> str:
        return self.part("out.h5.stopped", b"stopped") if left == {"out.h5.stopped"} else f"stopped, and left {left}"

    def part(self, name: str, status: bytes) -> str:
        """What is wrong with a file that shall have the first rows of the undisturbed run."""
        with h5py.File(self.directory / name) as part, h5py.File(self.whole) as whole:
            n = part["time"].size
            if part.attrs["status"] != status or not 0 < n < whole["time"].size or part.attrs["t_reached"] != part["time"][-1]:
                return f"{name} with status {part.attrs['status']} and {n} rows"
            if any(not np.array_equal(part[name][()], whole[name][:n]) for name in ("time", "phi", "alpha_rate", "energy_residual")):
                return f"{name} with other rows"
        return ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", nargs="?", default=program.RODYN)
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = random.Random(options.seed)
    bad = 0
    with tempfile.TemporaryDirectory() as place:
        trials = Trials(str(pathlib.Path(options.program).resolve()), pathlib.Path(place))
        size = trials.whole.stat().st_size
        print(f"undisturbed: {trials.seconds:.2f} s, {size} bytes")
        for name, number in (("kill -9", signal.SIGKILL), ("SIGTERM", signal.SIGTERM)):
            wrong = [w for _ in range(options.trials) if (w := trials.signalled(number, rng.uniform(0, 1.1 * trials.seconds)))]
            bad += len(wrong)
            print(f"{name:10s} {options.trials} times: {len(wrong)} faults", *wrong, sep="\n   ")
        wrong = [w for _ in range(options.trials) if (w := trials.limited(rng.randrange(1, int(1.05 * size))))]
        bad += len(wrong)
        print(f"size limit {options.trials} times: {len(wrong)} faults", *wrong, sep="\n   ")
        if not may_mount():
            print("full disk  left out: this system does not permit mounts")
            return int(bad > 0)
        # Half of them too small from the beginning, half filled up under way.
        places = [(rng.randrange(4096, int(1.05 * size)), 0.0) if i % 2 else (DISK_SIZE, rng.uniform(0, 1.1 * trials.seconds))
                  for i in range(options.trials)]
        wrong = [w for place in places if (w := trials.full(*place))]
        bad += len(wrong)
        print(f"full disk  {options.trials} times: {len(wrong)} faults", *wrong, sep="\n   ")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
