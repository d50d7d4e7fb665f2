"""Trials of sweeps that take minutes: kills, damage, full disks, memory, ranks, overhead.

    python bench/sweeps/campaign.py [TRIAL ...]      (all trials without names)

Prints one line per finding; exits with 1 if one of them is not what docs/sweeps.md claims. RODYN names another program
than bin/rodyn. Everything is written into one new directory (in TMPDIR), which alone is removed at the end.
"""

import argparse
import contextlib
import os
import pathlib
import random
import re
import resource
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time

import h5py

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
from support import RODYN  # noqa: E402

ENVIRONMENT = os.environ | {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}


class Scratch:
    """The one directory in which this script writes; sweeps are its children, each with a plain name."""

    def __init__(self, root: str) -> None:
        self.root = pathlib.Path(root).resolve()

    def path(self, name: str) -> pathlib.Path:
        """A child that does not exist: whatever had its name is removed."""
        if not re.fullmatch(r"[a-z0-9-]+", name):
            raise ValueError(f"no name for a directory of trials: {name!r}")
        path = self.root / name
        if path.exists():
            self.remove(path)
        return path

    def remove(self, path: pathlib.Path) -> None:
        """Remove a child, and nothing that is not one."""
        if path.parent != self.root or path.is_symlink():
            raise ValueError(f"{path} is not a directory of these trials")
        shutil.rmtree(path)


class Campaign:
    """The trials."""

    def __init__(self, scratch: Scratch) -> None:
        self.scratch = scratch
        self.faults = 0
        self.wanted: dict = {}

    def tell(self, good: bool, text: str) -> None:
        self.faults += not good
        print(f"{'ok  ' if good else 'BAD '} {text}", flush=True)

    def run(self, sweep: str, directory: pathlib.Path, *options: str, ranks: int = 1, code: int = 0):
        result = subprocess.run(command(sweep, directory, *options, ranks=ranks), capture_output=True, text=True,
                                env=ENVIRONMENT)
        if result.returncode != code:
            self.tell(False, f"{sweep} {options}: exit {result.returncode}\n{result.stderr}")
        return result

    def reference(self) -> dict:
        if not self.wanted:
            directory = self.scratch.path("reference")
            self.run("fast500.nml", directory)
            self.wanted = content(directory)
        return self.wanted

    def same(self) -> None:
        wanted = self.reference()
        directory = self.scratch.path("two-ranks")
        self.run("fast500.nml", directory, ranks=2)
        self.tell(content(directory) == wanted, "2 ranks: merged data byte-equal to one process")
        directory = self.scratch.path("shards")
        shards = [subprocess.Popen(command("fast500.nml", directory, "--shard", f"{i}/4", "--quiet")) for i in range(1, 5)]
        codes = [shard.wait() for shard in shards]
        self.tell(codes == [0] * 4 and content(directory) == wanted, "4 shards at once: byte-equal")

    def signals(self) -> None:
        wanted = self.reference()
        for name in ("SIGTERM", "SIGUSR1"):
            directory = self.scratch.path(name.lower())
            process = subprocess.Popen(command("fast500.nml", directory, "--quiet"), stderr=subprocess.PIPE)
            time.sleep(0.2)
            process.send_signal(getattr(signal, name))
            start = time.monotonic()
            process.communicate()
            after = time.monotonic() - start
            self.run("fast500.nml", directory)
            self.tell(process.returncode == 75 and after < 5 and content(directory) == wanted,
                      f"{name}: exit {process.returncode} after {after:.2f} s, resumed: byte-equal")

    def kills(self, times: int = 50) -> None:
        """kill -9 at random times, started again each time, to the end; then anew until all kills are used up."""
        wanted = self.reference()
        random.seed(1)
        directory = self.scratch.path("kills")
        equal, killed, resumed_at, again = [], 0, [], 0
        there: set[tuple[int, bytes]] = set()  # results that killed processes left behind

        def ended() -> None:
            nonlocal again
            again += integrated_again(directory, there)
            equal.append(content(directory) == wanted)
            there.clear()

        while killed < times:
            process = subprocess.Popen(command("fast500.nml", directory, "--quiet"), stderr=subprocess.DEVNULL)
            time.sleep(random.uniform(0.0, 0.8))
            if process.poll() is None:
                process.kill()
                killed += 1
                process.wait()
                there.update(results(directory))
                resumed_at.append(len(there))
                continue
            ended()
            self.scratch.remove(directory)
        self.run("fast500.nml", directory)
        ended()
        self.tell(all(equal) and again == 0,
                  f"kill -9 at {killed} random times in {len(equal)} sweeps of 500 cases (in {sum(n > 0 for n in resumed_at)} "
                  f"of them with results on the disk, {sum(resumed_at) // killed} on average), "
                  f"each resumed to its end: {sum(equal)} byte-equal, "
                  f"no case missing or doubled; {again} finished cases were integrated again")

    def rank_kills(self, times: int = 10) -> None:
        wanted = self.reference()
        random.seed(3)
        directory = self.scratch.path("rank-kills")
        slowest, codes, killed, equal, again = 0.0, set(), 0, [], 0
        there: set[tuple[int, bytes]] = set()
        while killed < times:
            process = subprocess.Popen(command("fast500.nml", directory, "--quiet", ranks=2), env=ENVIRONMENT,
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            while process.poll() is None and not (directory / "plan.txt").exists():
                time.sleep(0.01)
            time.sleep(random.uniform(0.1, 0.6))
            ranks = subprocess.run(["pgrep", "-P", str(process.pid)], capture_output=True, text=True).stdout.split()
            start = time.monotonic()
            if process.poll() is None and len(ranks) == 2:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(int(ranks[killed % 2]), signal.SIGKILL)
                    killed += 1
            code = process.wait()
            slowest = max(slowest, time.monotonic() - start)
            codes.add(code)
            there.update(results(directory))
            if (directory / "sweep.h5").exists():
                again += integrated_again(directory, there)
                there.clear()
                equal.append(content(directory) == wanted)
                self.scratch.remove(directory)
        self.run("fast500.nml", directory, ranks=2)
        again += integrated_again(directory, there)
        equal.append(content(directory) == wanted)
        self.tell(slowest < 60 and all(equal) and again == 0, f"one of two ranks killed, {killed} times: each job ended within {slowest:.1f} s "
                  f"(exit codes {sorted(codes)}), {len(equal)} sweeps resumed to their ends: {sum(equal)} byte-equal; "
                  f"{again} finished cases were integrated again")

    def damage(self, kind: str, times: int) -> None:
        """Damage to sealed shards. What is lost is at most what was damaged, and nothing else is integrated again."""
        wanted = self.reference()
        random.seed(2)
        directory = self.scratch.path(kind)
        self.run("fast500.nml", directory)
        noticed = redone = integrated = 0
        for _ in range(times):
            before = set(results(directory))
            shard = random.choice(sorted((directory / "shards").glob("*.shard")))
            hurt(shard, kind)
            result = self.run("fast500.nml", directory)
            noticed += f"shard {shard.name}: " in result.stderr and "set aside" in result.stderr
            after = results(directory)
            redone += content(directory) == wanted and len(after) == 500
            integrated += len(set(after) - before)
        self.tell(noticed == redone == times and (kind == "truncation" or integrated <= times),
                  f"{kind}, {times} times: {noticed} noticed, {redone} mended to byte-equal data; {integrated} cases integrated again in "
                  f"all")

    def truncation(self) -> None:
        self.damage("truncation", 20)

    def bits(self) -> None:
        self.damage("flipped-bit", 100)

    def open_shards(self, times: int = 20) -> None:
        """Damage to the open shard of a killed process."""
        wanted = self.reference()
        random.seed(4)
        noticed = redone = lost = 0
        for i in range(times):
            directory = self.scratch.path("open")
            process = subprocess.Popen(command("fast500.nml", directory, "--quiet"), stderr=subprocess.DEVNULL)
            while process.poll() is None and len(results(directory)) < 100:
                time.sleep(0.002)
            process.kill()
            process.wait()
            before = set(results(directory))
            (shard,) = directory.glob("shards/*.open")
            hurt(shard, ("truncation", "flipped-bit")[i % 2])
            result = self.run("fast500.nml", directory)
            noticed += f"shard {shard.name}: " in result.stderr and "set aside" in result.stderr
            after = results(directory)
            redone += content(directory) == wanted and len(after) == 500
            lost += len(before - set(after)) if i % 2 else 0
        self.tell(noticed == redone == times and lost <= times // 2,
                  f"open shard of a killed process cut or with a flipped bit, {times} times: {noticed} noticed, {redone} resumed to "
                  f"byte-equal data, no case missing or doubled; {lost} results lost by {times // 2} flipped bits")

    def result(self, times: int = 20) -> None:
        """Damage to sweep.h5."""
        wanted = self.reference()
        random.seed(5)
        directory = self.scratch.path("result")
        self.run("fast500.nml", directory)
        before = set(results(directory))
        noticed = merged = 0
        for i in range(times):
            data = (directory / "sweep.h5").read_bytes()
            hurt(directory / "sweep.h5", ("truncation", "flipped-bit")[i % 2])
            damaged = (directory / "sweep.h5").read_bytes()
            result = self.run("fast500.nml", directory)
            noticed += "merged again" in result.stderr and damaged != data
            merged += content(directory) == wanted and (directory / f"sweep-{i + 1}.h5").read_bytes() == damaged
        self.tell(noticed == merged == times and set(results(directory)) == before,
                  f"sweep.h5 cut or with a flipped bit, {times} times: {noticed} noticed, {merged} merged again to byte-equal data, the "
                  f"damaged ones kept")

    def disk(self) -> None:
        """A small file system where one can be mounted (as root), and a limit on the size of files."""
        wanted = self.reference()
        directory = self.scratch.path("disk")
        directory.mkdir()
        options = ["mount", "-t", "tmpfs", "-o", "size=192k", "tmpfs", str(directory)]
        if subprocess.run(options, capture_output=True).returncode == 0:
            try:
                result = self.run("fast500.nml", directory / "sweep", code=1)
                self.tell("No space left on device" in result.stderr and "run again" in result.stderr,
                          f"full disk: exit {result.returncode}, {last_line(result.stderr)}")
                subprocess.run(["mount", "-o", "remount,size=64m", str(directory)], check=True)
                self.run("fast500.nml", directory / "sweep")
                self.tell(content(directory / "sweep") == wanted, "more room, same command: resumed, byte-equal")
            finally:
                subprocess.run(["umount", str(directory)], check=True)
        directory = self.scratch.path("limit")
        result = subprocess.run(command("fast500.nml", directory, "--quiet"), capture_output=True, text=True,
                                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (60000, 60000)))
        self.tell(result.returncode == 1 and "File too large" in result.stderr,
                  f"file-size limit: exit {result.returncode}, {last_line(result.stderr)}")
        self.run("fast500.nml", directory)
        self.tell(content(directory) == wanted, "without the limit: resumed, byte-equal")

    def memory(self) -> None:
        directory = self.scratch.path("memory")
        process = subprocess.Popen(command("fast10000.nml", directory, "--quiet"))
        sizes = []
        while process.poll() is None:
            time.sleep(0.1)
            found = re.search(r"VmRSS:\s+(\d+)", pathlib.Path(f"/proc/{process.pid}/status").read_text())
            if found and list((directory / "shards").glob("*.shard*")):
                sizes.append((int(found[1]), (directory / "sweep.h5.partial").exists()))
        working = [size for size, merging in sizes if not merging]
        first, last = working[len(working) // 20], working[-2]
        self.tell(last - first < 1024, f"10,000 cases: resident {first} kB after 5 % of the time, {last} kB before the merge: "
                  f"growth {last - first} kB; with the merge {max(size for size, _ in sizes)} kB")

    def seconds(self, sweep: str, ranks: int = 1) -> tuple[float, float]:
        """Wall time of the whole command, and the integration in it."""
        directory = self.scratch.path("timing")
        start = time.monotonic()
        result = self.run(sweep, directory, ranks=ranks)
        wall = time.monotonic() - start
        return wall, float(re.search(r"cost +([0-9.]+) s of integration", result.stdout)[1])

    def overhead(self) -> None:
        wall, integration = min((self.seconds("table3_2000.nml") for _ in range(2)), key=lambda pair: pair[0] / pair[1])
        share = 100 * (wall / integration - 1)
        self.tell(share <= 3, f"2,000 cases of table 3: {wall:.2f} s for {integration:.2f} s of integration, overhead {share:.2f} %")

    def speedup(self) -> None:
        """By the program's own clock, which leaves out the start of mpirun (half a second); medians of pairs in turns."""
        for sweep in ("table3_2000.nml", "unequal.nml"):
            pairs = [(self.elapsed(sweep), self.elapsed(sweep, ranks=2)) for _ in range(5)]
            ratio = statistics.median(one / two for one, two in pairs)
            one, two = min(pair[0] for pair in pairs), min(pair[1] for pair in pairs)
            self.tell(ratio >= 1.9, f"{sweep}: one process {one:.2f} s, 2 ranks {two:.2f} s: {ratio:.2f} times as fast")

    def elapsed(self, sweep: str, ranks: int = 1) -> float:
        """Time from the first case to the last, as the program tells it."""
        result = self.run(sweep, self.scratch.path("timing"), ranks=ranks)
        return float(re.search(r"s of integration in ([0-9.]+) s", result.stdout)[1])


def command(sweep: str, directory: pathlib.Path, *options: str, ranks: int = 1) -> list[str]:
    launcher = ["mpirun", "--oversubscribe", "-n", str(ranks)] if ranks > 1 else []
    return [*launcher, RODYN, "sweep", str(HERE / sweep), "--output", str(directory), *options]


def integrated_again(directory: pathlib.Path, there: set[tuple[int, bytes]]) -> int:
    """Of a sweep of 500 cases that has ended: results that were there before but are not any more, and second ones."""
    found = results(directory)
    return len(there - set(found)) + len(found) - 500


def hurt(path: pathlib.Path, kind: str) -> None:
    """Cut a file somewhere, or flip one bit of it."""
    data = bytearray(path.read_bytes())
    if kind == "truncation":
        data = data[: random.randrange(0, len(data), 2) | 1]  # odd, as between two records there would be nothing to notice
    else:
        place = random.randrange(8 * len(data))
        data[place // 8] ^= 1 << place % 8
    path.write_bytes(data)


def last_line(text: str) -> str:
    return text.strip().splitlines()[-1]


def content(directory: pathlib.Path) -> dict:
    """Every data set but wall_seconds, as bytes, and the attributes."""
    found = {}
    with h5py.File(directory / "sweep.h5") as file:

        def take(name, item):
            if isinstance(item, h5py.Dataset) and name != "wall_seconds":
                values = item[()]
                data = tuple(values.ravel()) if item.dtype == object else values.tobytes()
                found[name] = (str(item.dtype), item.shape, data)

        file.visititems(take)
        found["attributes"] = {name: str(value) for name, value in file.attrs.items()}
    return found


def records(shard: pathlib.Path) -> list[tuple[int, bytes]]:
    """The whole records of a shard, sealed or open: case, and all bytes (wall times among them, so no two runs have the same)."""
    data = shard.read_bytes()
    found = []
    at = 3 * 8
    while at + 8 <= len(data):
        end = at + 8 * int.from_bytes(data[at : at + 8], "little")
        if end == at or end > len(data):  # trailer, or torn
            break
        found.append((int.from_bytes(data[at + 8 : at + 16], "little"), data[at:end]))
        at = end
    return found


def results(directory: pathlib.Path) -> list[tuple[int, bytes]]:
    """All results that are in a directory. One that is being sealed by a living process may be left out."""
    found = []
    for shard in sorted(directory.glob("shards/*.shard")) + sorted(directory.glob("shards/*.open")):
        with contextlib.suppress(FileNotFoundError):
            found += records(shard)
    return found


TRIALS = ("same", "signals", "kills", "rank_kills", "truncation", "bits", "open_shards", "result", "disk", "memory", "overhead", "speedup")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trials", nargs="*", metavar="TRIAL", help=", ".join(TRIALS))
    names = parser.parse_args().trials or TRIALS
    if unknown := set(names) - set(TRIALS):
        parser.error(f"unknown: {', '.join(sorted(unknown))}; there are {', '.join(TRIALS)}")
    with tempfile.TemporaryDirectory(prefix="rodyn-sweeps-") as root:
        campaign = Campaign(Scratch(root))
        for name in names:
            getattr(campaign, name)()
    print(f"{campaign.faults} findings are not as they should be")
    return min(campaign.faults, 1)


if __name__ == "__main__":
    sys.exit(main())
