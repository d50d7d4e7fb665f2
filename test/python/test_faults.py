"""What breaks programs: damaged input, awkward paths, files that are not what they seem, signals, full disks. And that a
result can be made again, from its input and from its file alone. The campaigns behind these samples are in bench/stability.
"""

import os
import pathlib
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import h5py
import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "bench" / "stability"))

import faults  # noqa: E402
import fuzz  # noqa: E402
import program  # noqa: E402
from mutants import BASE, MOMENT, SWEEPS  # noqa: E402
from run_files import OF_THE_HOUR, contents, differences  # noqa: E402
from scenes import CHAIN, SPACECRAFT, scenes  # noqa: E402

RODYN = program.RODYN
CASE = "&case title = 'Once', t_end = 0.05, n_outputs = 20 /\n" + SPACECRAFT + CHAIN + MOMENT
SCENES = scenes()


def rodyn(*arguments, cwd=None, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run([RODYN, *map(str, arguments)], cwd=cwd, capture_output=True, text=True, timeout=120, **options)


def refused(result: subprocess.CompletedProcess[str], *words: str) -> None:
    assert result.returncode == 2, result.stderr
    assert result.stdout == "" and not program.CRASH.search(result.stderr), result.stderr
    for word in words:
        assert word in result.stderr, result.stderr


@pytest.fixture
def place(tmp_path):
    (tmp_path / "case.nml").write_text(CASE)
    return tmp_path


# Damaged namelists


@pytest.mark.long
def test_damaged_namelists_neither_crash_nor_hang_nor_slip_through(tmp_path):
    told = []
    outcomes = fuzz.campaign(5, list(range(300)), 2, tmp_path, reduce=False, tell=told.append)
    assert all(" 0 faults" in line for line in told), told
    ends = {end for outcome in outcomes for end in outcome.ends}
    assert {"check 0", "check 2", "run 0", "sweep 0"} <= ends  # neither all refused nor all accepted


# Loads and initial values out of all proportion


@pytest.mark.parametrize("value", ["1e300", "1.7e308", "1e200", "1e100", "1e30"])
@pytest.mark.parametrize("method", ["auto", "adams", "bdf", "erk", "dop853", "gauss"])
def test_a_hopeless_load_fails_fast(place, value, method):
    (place / "case.nml").write_text(CASE.replace("1500", value).replace("t_end = 0.02", "t_end = 1")
                                    + f"&solver method = '{method}' /\n")
    ending = program.run(["run", "case.nml"], place)
    assert program.fault(ending, {1}) == "", ending.stderr
    assert len(ending.stderr.splitlines()) == 1
    with h5py.File(place / "case.h5") as file:
        assert file.attrs["status"] == b"failed"
        assert all(np.all(np.isfinite(data[()])) for data in file.values() if isinstance(data, h5py.Dataset))


@pytest.mark.parametrize("lanes", [".true.", ".false."])
def test_a_hopeless_case_of_a_sweep_fails_fast_and_alone(place, lanes):
    (place / "base.nml").write_text(CASE + "&solver method = 'dop853' /\n")
    (place / "s.nml").write_text(f"&sweep base = 'base.nml', lanes = {lanes} /\n&axis key = 'load.value', values = 1, 1e300, 2, "
                                 "1e308, 3, 1e30, 4, 5, 1e100 /\n")
    ending = program.run(["sweep", "s.nml"], place)
    assert program.fault(ending, {1}) == "", ending.stderr
    with h5py.File(place / "s" / "sweep.h5") as file:
        failed = np.array([0, 1, 0, 1, 0, 1, 0, 0, 1], bool)
        assert np.array_equal(file["status"][()] == b"failed", failed)
        assert np.array_equal(np.isnan(file["final_phi"][:, 0]), failed)
        assert all(b"at t = " in m for m in file["message"][failed])


# From rest, where powers are rounding alone: friction and a moment; a kink that begins to move.
FROM_REST = {
    "friction": "&case t_end = 20, n_outputs = 100 /\n&spacecraft mass = 120, inertia = 300, hinge_x = 0.6 /\n"
                "&chain n_rods = 2, length = 1.2, 2, mass_per_length = 0.76, node_mass = 0.24, hinge_stiffness = 100, 12 /\n"
                "&model bending = 'rigid' /\n&hinge hinge = 0, friction_moment = 0.34, friction_velocity = 0.1 /\n"
                "&load component = 'M', t_start = 2.96, t_end = 8.97, value = 16 /\n",
    "kink": "&case t_end = 0.31, n_outputs = 1 /\n&spacecraft mass = 82, inertia = 310, hinge_x = 0.2 /\n"
            "&chain n_rods = 2, length = 2, mass_per_length = 2, bending_stiffness = 390, hinge_stiffness = 380 /\n"
            "&kink_program hinge = 0, law = 'table', times = 0.3, 0.9, 1.5, values = 0, 0.21, 0.3 /\n",
}


@pytest.mark.parametrize("scene", FROM_REST)
@pytest.mark.parametrize("method", ["adams", "bdf", "erk", "dop853"])
def test_energies_of_a_chain_at_rest_are_no_endless_work(tmp_path, method, scene):
    (tmp_path / "case.nml").write_text(FROM_REST[scene] + f"&solver method = '{method}' /\n")
    ending = program.run(["run", "case.nml"], tmp_path)
    assert program.fault(ending, {0}) == "" and ending.seconds < 5.0, ending.stderr


def test_more_fixed_steps_than_permitted_are_refused(place):
    (place / "case.nml").write_text(CASE + "&solver method = 'dop853', fixed_step = 1e-300 /\n")
    refused(rodyn("check", "case.nml", cwd=place), "fixed_step = 1e-300: would take more than max_steps")


# Sizes


def test_what_does_not_fit_into_memory_is_refused(place):
    big = CASE.replace("n_rods = 3", "n_rods = 30000").replace("1.5, 1.4, 1.3", "1.5").replace("6000, 2*4000", "6000").replace(
        "kink = 0, 0.05, 0", "kink = 0")
    (place / "big.nml").write_text(big + "&model kernel = 'assembled' /\n")
    assert rodyn("check", "big.nml", cwd=place).returncode == 0
    refused(rodyn("run", "big.nml", cwd=place), "n_rods = 30000, kernel = 'assembled'", "GB of memory")
    assert not list(place.glob("*.h5*"))
    (place / "base.nml").write_text(BASE.replace("n_outputs = 5", "n_outputs = 100000000"))
    (place / "s.nml").write_text("&sweep base = 'base.nml', keep_series = .true. /\n&axis key = 'case.t_end', values = 1, 2 /\n")
    ending = program.run(["sweep", "s.nml"], place)
    assert program.fault(ending, {2}) == "" and "of memory" in ending.stderr, ending.stderr
    assert not (place / "s").exists()


def test_what_does_not_fit_onto_the_disk_is_refused(place):
    (place / "case.nml").write_text(BASE.replace("n_rods = 2", "n_rods = 1000000").replace("n_outputs = 5", "n_outputs = 1000000"))
    refused(rodyn("run", "case.nml", cwd=place), "GB")


# Paths


@pytest.fixture
def for_anyone():
    """A directory that an unprivileged user can reach, and what makes this process one (root may read and write anything)."""
    directory = pathlib.Path(tempfile.mkdtemp(dir="/tmp"))
    directory.chmod(0o777)
    (directory / "case.nml").write_text(CASE)
    yield directory, {"user": 65534, "group": 65534, "extra_groups": []} if os.geteuid() == 0 else {}
    for path in [directory, *directory.rglob("*")]:
        path.chmod(0o777)
    shutil.rmtree(directory)


def reachable(user: dict) -> str:
    """The program, where that user can execute it."""
    if not user:
        return RODYN
    target = pathlib.Path(tempfile.mkdtemp(dir="/tmp"))
    target.chmod(0o755)
    shutil.copy(RODYN, target / "rodyn")
    return str(target / "rodyn")


def test_files_and_directories_without_permission(for_anyone):
    directory, user = for_anyone
    executable = reachable(user)

    def run(*arguments):
        return subprocess.run([executable, *arguments], cwd=directory, capture_output=True, text=True, **user)

    secret = directory / "secret.nml"
    secret.write_text(CASE)
    secret.chmod(0)
    for command in ("run", "check", "sweep"):
        refused(run(command, "secret.nml"), "secret.nml: cannot be read (Permission denied)")
    (directory / "locked").mkdir()
    (directory / "locked").chmod(0o555)
    refused(run("run", "case.nml", "--output", "locked/x.h5"), "no permission to write in the directory 'locked'")
    result = run("sweep", "case.nml", "--output", "locked/x")
    refused(result)
    assert list((directory / "locked").iterdir()) == []
    assert run("run", "case.nml").returncode == 0
    (directory / "case.h5").chmod(0)
    refused(run("run", "case.h5"), "case.h5: cannot be read (Permission denied)")
    refused(run("run", "case.nml"), "exists already")
    if user:
        shutil.rmtree(pathlib.Path(executable).parent)


@pytest.mark.parametrize("name", ["/dev/null", "/dev/full", "pipe"])
def test_a_device_is_no_place_for_a_result(place, name):
    os.mkfifo(place / "pipe")
    for force in ([], ["--force"]):
        refused(rodyn("run", "case.nml", "--output", name, *force, cwd=place), "is a device or a pipe")
    assert pathlib.Path(place / name).is_char_device() or pathlib.Path(place / name).is_fifo()


@pytest.mark.parametrize("name", ["Ж ж", "名前", "é\u0301", "a b'c\"d", "a\nb", "%s%n", "$HOME", "*", "-", "🚀" * 40])
def test_names_in_any_script(place, name):
    here = place / name
    here.mkdir()
    (here / f"{name}.nml").write_text(CASE)
    # A leading '-' is an option, so the path goes with its directory.
    result = rodyn("run", f"./{name}/{name}.nml", "--output", f"./{name}/{name}.h5", cwd=place)
    assert result.returncode == 0, result.stderr
    assert sorted(p.name for p in here.iterdir()) == sorted([f"{name}.h5", f"{name}.nml"])
    result = rodyn("run", f"./{name}/{name}.h5", "--output", "again.h5", cwd=place)
    assert result.returncode == 0, result.stderr
    assert differences(here / f"{name}.h5", place / "again.h5") <= OF_THE_HOUR


def test_names_that_are_not_utf8(place):
    name = os.fsdecode(b"\xff\xfe")
    (place / f"{name}.nml").write_text(CASE)
    result = subprocess.run([RODYN, "run", f"{name}.nml"], cwd=place, capture_output=True)
    assert result.returncode == 0, result.stderr
    assert (place / f"{name}.h5").exists()


def test_messages_are_utf8_whatever_they_name(place):
    (place / "sweep.nml").write_bytes(b"&sweep base = '\xff\xc3.nml' /\n&axis key = 'case.t_end', values = 1 /\n")
    for arguments in (["check", "sweep.nml"], ["run", os.fsdecode(b"\xfe\xd0\xb6")]):
        result = subprocess.run([RODYN, *arguments], cwd=place, capture_output=True)
        assert result.returncode == 2
        assert "cannot be read" in result.stderr.decode() and b"?" in result.stderr


def test_paths_of_four_thousand_characters(place):
    part = "d" * 200
    deep = place
    descriptor = os.open(place, os.O_RDONLY)
    while len(str(deep)) < 3600:
        os.mkdir(part, dir_fd=descriptor)
        descriptor, old = os.open(part, os.O_RDONLY, dir_fd=descriptor), descriptor
        os.close(old)
        deep = deep / part
    os.close(descriptor)
    (deep / "case.nml").write_text(CASE)
    output = str(deep / ("r" * 200 + ".h5"))
    assert 3800 < len(output) < 4070
    assert rodyn("run", deep / "case.nml", "--output", output).returncode == 0
    assert rodyn("run", output, "--output", place / "again.h5").returncode == 0
    assert differences(pathlib.Path(output), place / "again.h5") <= OF_THE_HOUR
    for path in (str(deep / ("x" * 300)), "x" * 4000, "x" * 100_000):
        refused(rodyn("check", path), "File name too long")
        refused(rodyn("run", deep / "case.nml", "--output", path))
    shutil.rmtree(place / part)


def test_a_name_that_leaves_no_room_for_the_temporary_one(place):
    refused(rodyn("run", "case.nml", "--output", "x" * 250 + ".h5", cwd=place), "too long")
    assert [p.name for p in place.iterdir()] == ["case.nml"]


def test_input_from_odd_places(place):
    refused(rodyn("run", "/dev/null", cwd=place))
    refused(rodyn("check", "/", cwd=place), "Is a directory")
    refused(rodyn("check", "case.nml/", cwd=place), "Not a directory")
    (place / "loop").symlink_to("loop")
    refused(rodyn("check", "loop", cwd=place), "symbolic links")
    (place / "dangling").symlink_to("nothing")
    refused(rodyn("check", "dangling", cwd=place), "No such file")
    (place / "empty.nml").write_text("")
    refused(rodyn("check", "empty.nml", cwd=place), "empty.nml:")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_a_run_whose_words_cannot_be_written_still_has_its_result(place):
    with open("/dev/full", "w") as full:
        result = subprocess.run([RODYN, "run", "case.nml"], cwd=place, stdout=full, stderr=subprocess.PIPE, text=True)
    assert (result.returncode, result.stderr) == (0, "")
    with h5py.File(place / "case.h5") as file:
        assert file.attrs["status"] == b"done"


# Results as input


@pytest.mark.parametrize("scene", [name for number, name in enumerate(SCENES) if number % 3 == 0 or "fixed" in name])
def test_a_run_repeats_and_is_made_again_from_its_file_alone(tmp_path, scene):
    (tmp_path / "case.nml").write_text(SCENES[scene])
    assert rodyn("run", "case.nml", cwd=tmp_path).returncode == 0
    assert rodyn("run", "case.nml", "--output", "second.h5", cwd=tmp_path).returncode == 0
    (tmp_path / "case.nml").unlink()
    assert rodyn("run", "case.h5", cwd=tmp_path).returncode == 0
    assert rodyn("run", "case-again.h5", "--output", "third.h5", cwd=tmp_path).returncode == 0
    first = tmp_path / "case.h5"
    assert len(contents(first)) > 80
    for other in ("second.h5", "case-again.h5", "third.h5"):
        assert differences(first, tmp_path / other) <= OF_THE_HOUR, other


def test_a_repeated_run_has_the_same_bytes_but_for_the_hour(place):
    for name in ("a.h5", "b.h5"):
        assert rodyn("run", "case.nml", "--output", name, cwd=place).returncode == 0
    a, b = (np.frombuffer((place / name).read_bytes(), np.uint8) for name in ("a.h5", "b.h5"))
    assert a.size == b.size
    differing = np.flatnonzero(a != b)
    # created (20 bytes), wall_seconds (8) and the checksums (4 each) of the blocks they are in.
    assert differing.size <= 60


def test_a_result_is_run_again_beside_itself(place):
    (place / "case.nml").write_text(CASE + "&output file = 'mine.h5' /\n")
    assert rodyn("run", "case.nml", cwd=place).returncode == 0
    before = (place / "mine.h5").read_bytes()
    result = rodyn("run", "mine.h5", cwd=place)
    assert result.returncode == 0 and result.stdout.splitlines()[-1] == "file    mine-again.h5"
    refused(rodyn("run", "mine.h5", cwd=place), "mine-again.h5: exists already")
    refused(rodyn("run", "mine.h5", "--output", "mine.h5", "--force", cwd=place), "is the case itself")
    result = rodyn("check", "mine.h5", cwd=place)
    assert (result.returncode, result.stdout) == (0, "mine.h5: valid\n")
    assert (place / "mine.h5").read_bytes() == before


def test_a_failed_run_is_made_again_too(place):
    (place / "case.nml").write_text(CASE + "&solver method = 'dop853', max_steps = 20 /\n")
    assert rodyn("run", "case.nml", cwd=place).returncode == 1
    assert rodyn("run", "case.h5", cwd=place).returncode == 1
    assert differences(place / "case.h5", place / "case-again.h5") <= OF_THE_HOUR


@pytest.mark.parametrize("number", range(len(SWEEPS)))
def test_a_sweep_is_made_again_from_its_file_alone(tmp_path, request, number):
    (tmp_path / "base.nml").write_text(BASE)
    stiff = "" if request.config.getoption("--all") else ", 1e8, 1e9, 1e10"  # which take long
    (tmp_path / "s.nml").write_text(SWEEPS[number].replace(stiff, ""))
    assert rodyn("sweep", "s.nml", cwd=tmp_path).returncode == 0
    for name in ("base.nml", "s.nml"):
        (tmp_path / name).unlink()
    shutil.move(tmp_path / "s" / "sweep.h5", tmp_path / "sweep.h5")
    assert rodyn("check", "sweep.h5", cwd=tmp_path).returncode == 0
    refused(rodyn("run", "sweep.h5", cwd=tmp_path), "sweep.h5: is a sweep; rodyn sweep computes it")
    assert rodyn("sweep", "sweep.h5", cwd=tmp_path).returncode == 0
    assert differences(tmp_path / "sweep.h5", tmp_path / "sweep-again" / "sweep.h5") <= {"wall_seconds"}


def test_a_run_is_no_sweep_and_says_so(place):
    assert rodyn("run", "case.nml", cwd=place).returncode == 0
    refused(rodyn("sweep", "case.h5", cwd=place), "&sweep")


def test_faults_of_a_stored_input_are_told_with_their_line(place):
    with h5py.File(place / "x.h5", "w") as file:
        file.attrs["input"] = np.bytes_("&case t_end = 1 /\n&chain n_rods = 0 /")
    for command in ("run", "check"):
        refused(rodyn(command, "x.h5", cwd=place), "x.h5@input:2: &chain n_rods = 0: must lie in")


def strange(path: pathlib.Path, kind: str) -> None:
    """HDF5 files that are no results."""
    with h5py.File(path, "w") as file:
        match kind:
            case "nothing":
                pass
            case "a data set of that name":
                file["input"] = np.arange(3)
            case "a number":
                file.attrs["input"] = 1.5
            case "an array of texts":
                file.attrs["input"] = np.array([b"&case /", b"&case /"] * 1000)
            case "a text of any length":
                file.attrs["input"] = CASE
            case "an empty text":
                file.attrs["input"] = np.bytes_("")
            case "no space":
                file.attrs["input"] = h5py.Empty("S10")
            case "a compound":
                file.attrs["input"] = np.zeros(1, [("a", "i4"), ("b", "S5")])[0]
            case "binary":
                file.attrs["input"] = np.void(bytes(range(256)))
            case "a number as base":
                file.attrs["input"] = np.bytes_(SWEEPS[0])
                file.attrs["base_input"] = 1
            case "another sweep":
                file.attrs["input"] = np.bytes_("&sweep base = 'x' /")
                file.attrs["base_input"] = np.bytes_("nothing")


@pytest.mark.parametrize("kind", ["nothing", "a data set of that name", "a number", "an array of texts", "a text of any length",
                                  "an empty text", "no space", "a compound", "binary", "a number as base", "another sweep"])
def test_hdf5_files_of_something_else_are_refused(tmp_path, kind):
    strange(tmp_path / "x.h5", kind)
    for command in ("run", "check", "sweep"):
        refused(rodyn(command, "x.h5", cwd=tmp_path), "x.h5")
        assert [p.name for p in tmp_path.iterdir()] == ["x.h5"]


@pytest.mark.parametrize("content", [b"", b"\x89HDF", b"\x89HDF\r\n\x1a\n", b"\x89HDF\r\n\x1a\n" + b"\0" * 5000, b"x" * 5000,
                                     bytes(range(256)) * 20, b"CDF\x01" + b"\0" * 100])
def test_files_that_are_not_hdf5_are_refused(tmp_path, content):
    (tmp_path / "x.h5").write_bytes(content)
    for command in ("run", "check", "sweep"):
        refused(rodyn(command, "x.h5", cwd=tmp_path), "x.h5")


def test_truncated_and_damaged_results_are_refused_or_run(place, request):
    assert rodyn("run", "case.nml", cwd=place).returncode == 0
    whole = (place / "case.h5").read_bytes()
    rng = random.Random(1)
    trials = 120 if request.config.getoption("--all") else 50
    for trial in range(trials):
        if trial < trials // 2:
            damaged = whole[:rng.randrange(len(whole))]
        else:
            damaged = bytearray(whole)
            for _ in range(rng.choice([1, 4, 64])):
                damaged[rng.randrange(min(len(whole), rng.choice([100, 3000, len(whole)])))] ^= 1 << rng.randrange(8)
        (place / "x.h5").write_bytes(damaged)
        ending = program.run(["run", "x.h5", "--output", "y.h5", "--force", "--quiet"], place)
        assert program.fault(ending, {2} if trial < trials // 2 else {0, 2}) == "", (trial, ending.stderr)
        if ending.code == 0:  # the damage was elsewhere
            assert contents(place / "y.h5")["/@input"] == contents(place / "case.h5")["/@input"]


# Faults from outside; the campaign is bench/stability/faults.py


def test_no_signal_and_no_full_disk_leaves_a_file_that_looks_complete(tmp_path, request):
    text = faults.CASE.replace("t_end = 3", "t_end = 0.5")
    trials = faults.Trials(RODYN, tmp_path, text)
    size = trials.whole.stat().st_size
    rng = random.Random(2)
    for _ in range(8 if request.config.getoption("--all") else 4):
        assert trials.signalled(signal.SIGKILL, rng.uniform(0, trials.seconds)) == ""
        assert trials.signalled(signal.SIGTERM, rng.uniform(0, trials.seconds)) == ""
        assert trials.limited(rng.randrange(1, size)) == ""
        if faults.may_mount():
            assert trials.full(faults.DISK_SIZE, rng.uniform(0, trials.seconds)) == ""
            assert trials.full(rng.randrange(4096, size), trials.seconds) == ""


def test_too_little_address_space_is_told_not_suffered(place):
    """Whatever the limit: a command ends by itself, and a run never with a file that is not complete. (Threads of OpenBLAS, made
    when it is loaded, would wait for memory for ever, and the end of the program for them.)"""
    (place / "s.nml").write_text("&sweep base = 'case.nml' /\n&axis key = 'case.t_end', values = 0.01, 0.02 /\n")
    for megabytes in (20, 60, *range(80, 260, 20), 400):
        limit = megabytes << 20

        def limited(*arguments, limit=limit):
            return rodyn(*arguments, cwd=place, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)))

        for arguments in (["--version"], ["check", "case.nml"]):  # below 100 MB the libraries cannot be loaded
            result = limited(*arguments)
            assert result.returncode in ([127] if megabytes < 80 else [0] if megabytes >= 110 else [0, 127])
            assert result.returncode == 0 or result.stderr
        for arguments in (["modes", "case.nml", "--output", "modes.h5", "--force"], ["sweep", "s.nml", "--force"]):
            result = limited(*arguments)
            assert result.returncode == 0 or result.stderr
        result = limited("run", "case.nml", "--force")
        assert result.returncode != 0 or (place / "case.h5").exists()
        if (place / "case.h5").exists():
            with h5py.File(place / "case.h5") as file:
                assert file.attrs["status"] == b"done" and file["time"].size == 21


def test_one_thread_whatever_the_environment_says(place):
    (place / "case.nml").write_text(CASE.replace("t_end = 0.05", "t_end = 1000"))
    with subprocess.Popen([RODYN, "run", "case.nml", "--quiet"], cwd=place, stderr=subprocess.PIPE,
                          env=os.environ | {"OPENBLAS_NUM_THREADS": "4"}) as process:
        while not list(place.glob("*.partial-*")) and process.poll() is None:
            time.sleep(0.01)
        status = pathlib.Path(f"/proc/{process.pid}/status").read_text()
        process.terminate()
        process.communicate()
    assert "\nThreads:\t1\n" in status
    assert f"Cpus_allowed:\t{re.search('Cpus_allowed:.(.*)', pathlib.Path('/proc/self/status').read_text())[1]}\n" in status


@pytest.mark.parametrize("hard", [True, False])
def test_a_small_stack_is_told_or_raised(place, hard):
    kilobytes = 64 << 10
    limits = (kilobytes, kilobytes if hard else resource.RLIM_INFINITY)
    result = rodyn("run", "case.nml", cwd=place, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_STACK, limits))
    if hard:
        refused(result, "the stack is limited to 65.5 kB", "ulimit -s")
    else:
        assert result.returncode == 0, result.stderr


#: A file system without locks, as NFS and Lustre may be.
NO_LOCKS = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdlib.h>
int flock(int descriptor, int operation) { errno = atoi(getenv("LOCK_ERRNO")); return -1; }
int fcntl(int descriptor, int command, ...) {
   va_list rest; va_start(rest, command); void *argument = va_arg(rest, void *); va_end(rest);
   if (command == F_GETLK || command == F_SETLK || command == F_SETLKW) { errno = atoi(getenv("LOCK_ERRNO")); return -1; }
   return ((int (*)(int, int, ...))dlsym(RTLD_NEXT, "fcntl"))(descriptor, command, argument);
}
int fcntl64(int descriptor, int command, ...) {
   va_list rest; va_start(rest, command); void *argument = va_arg(rest, void *); va_end(rest);
   return fcntl(descriptor, command, argument);
}
"""


@pytest.fixture(scope="module")
def no_locks(tmp_path_factory) -> dict[str, str]:
    """An environment whose file systems have no locks."""
    place = tmp_path_factory.mktemp("no_locks")
    (place / "no_locks.c").write_text(NO_LOCKS)
    subprocess.run(["gcc", "-shared", "-fPIC", "-o", "no_locks.so", "no_locks.c", "-ldl"], cwd=place, check=True)
    return os.environ | {"LD_PRELOAD": str(place / "no_locks.so")}


@pytest.mark.parametrize(("number", "name"), [(37, "No locks available"), (38, "Function not implemented"),
                                          (95, "Operation not supported")])
def test_file_systems_without_locks(place, no_locks, number, name):
    env = no_locks | {"LOCK_ERRNO": str(number)}
    (place / "s.nml").write_text("&sweep base = 'case.nml' /\n&axis key = 'case.t_end', values = 0.01, 0.02 /\n")
    for arguments in (["run", "case.nml"], ["run", "case.h5"], ["modes", "case.nml"], ["check", "case.h5"]):
        result = rodyn(*arguments, cwd=place, env=env)
        assert result.returncode == 0, result.stderr
    result = rodyn("run", "case.nml", "--output", "x.h5", cwd=place, env=env | {"HDF5_USE_FILE_LOCKING": "TRUE"})
    assert result.returncode == 1 and name in result.stderr and "HDF5_USE_FILE_LOCKING=FALSE" in result.stderr, result.stderr
    assert not list(place.glob("x.h5*"))
    refused(rodyn("sweep", "s.nml", cwd=place, env=env), name, "no locks", "HDF5_USE_FILE_LOCKING=FALSE")
    off = env | {"HDF5_USE_FILE_LOCKING": "FALSE"}
    refused(rodyn("sweep", "s.nml", "--shard", "1/2", cwd=place, env=off), "shards need a file system with locks")
    result = rodyn("sweep", "s.nml", cwd=place, env=off)
    assert result.returncode == 0, result.stderr


# Where a result cannot go


#: A file system that cannot set bytes aside and has a quota that a write meets, as NFS may.
QUOTA = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdlib.h>
#include <unistd.h>
int fallocate(int descriptor, int mode, off_t offset, off_t bytes) { errno = EOPNOTSUPP; return -1; }
ssize_t pwrite(int descriptor, const void *data, size_t bytes, off_t offset) {
   if (offset + (off_t)bytes > atol(getenv("QUOTA"))) { errno = EDQUOT; return -1; }
   return ((ssize_t (*)(int, const void *, size_t, off_t))dlsym(RTLD_NEXT, "pwrite"))(descriptor, data, bytes, offset);
}
ssize_t pwrite64(int descriptor, const void *data, size_t bytes, off_t offset) { return pwrite(descriptor, data, bytes, offset); }
"""


def test_a_quota_that_only_a_write_meets_leaves_the_rows_before_it(tmp_path):
    (tmp_path / "quota.c").write_text(QUOTA)
    subprocess.run(["gcc", "-shared", "-fPIC", "-o", "quota.so", "quota.c", "-ldl"], cwd=tmp_path, check=True)
    (tmp_path / "case.nml").write_text(faults.CASE.replace("t_end = 3, n_outputs = 6000", "t_end = 0.3, n_outputs = 6000"))
    assert rodyn("run", "case.nml", "--output", "whole.h5", cwd=tmp_path).returncode == 0
    rows = []
    for quota in (20_000, 400_000, 800_000, 4_000_000):
        env = os.environ | {"LD_PRELOAD": str(tmp_path / "quota.so"), "QUOTA": str(quota)}
        result = rodyn("run", "case.nml", "--output", f"{quota}.h5", cwd=tmp_path, env=env)
        if quota == 4_000_000:
            assert result.returncode == 0, result.stderr
            continue
        assert result.returncode == 1 and "Disk quota exceeded" in result.stderr, result.stderr
        assert [path.name for path in tmp_path.glob(f"{quota}*")] == ([f"{quota}.h5"] if quota > 20_000 else [])
        if quota > 20_000:
            assert f"rows until then are in {quota}.h5" in result.stderr
            with h5py.File(tmp_path / f"{quota}.h5") as part, h5py.File(tmp_path / "whole.h5") as whole:
                rows.append(part["time"].size)
                assert part.attrs["status"] == b"failed" and np.array_equal(part["phi"], whole["phi"][:rows[-1]])
    assert 0 < rows[0] < rows[1] < 6001
    assert differences(tmp_path / "whole.h5", tmp_path / "4000000.h5") <= OF_THE_HOUR


def begun(directory: pathlib.Path, process: subprocess.Popen) -> None:
    """Until a run has written to its file; that it could not be made would be another fault."""
    while not any(path.stat().st_size for path in directory.glob("*.partial-*")) and process.poll() is None:
        time.sleep(0.01)
    time.sleep(0.05)


def test_a_directory_that_cannot_be_made_again_costs_no_result(tmp_path):
    (tmp_path / "case.nml").write_text(faults.CASE.replace("t_end = 3", "t_end = 6"))
    (tmp_path / "out").mkdir()
    (tmp_path / "elsewhere").mkdir()
    with subprocess.Popen([RODYN, "run", "case.nml", "--output", "out/x.h5", "--quiet"], cwd=tmp_path, stderr=subprocess.PIPE,
                          text=True, env=os.environ | {"TMPDIR": str(tmp_path / "elsewhere")}) as process:
        begun(tmp_path / "out", process)
        shutil.rmtree(tmp_path / "out")
        (tmp_path / "out").write_text("in the way")
        errors = process.communicate(timeout=60)[1]
    assert process.returncode == 1
    [path] = (tmp_path / "elsewhere").iterdir()
    assert errors.startswith("out/x.h5: its directory was removed and cannot be recreated: Not a directory")
    assert errors.endswith(f"the result is '{path}'\n")
    with h5py.File(path) as run:
        assert run.attrs["status"] == b"done" and run["time"][-1] == 6


def test_a_directory_that_becomes_read_only_costs_no_result(for_anyone):
    directory, user = for_anyone
    executable = reachable(user)
    (directory / "case.nml").write_text(faults.CASE.replace("t_end = 3", "t_end = 6"))
    for stop in (False, True):
        out = directory / f"out-{stop}"
        out.mkdir()
        out.chmod(0o777)
        with subprocess.Popen([executable, "run", "case.nml", "--output", f"{out.name}/x.h5", "--quiet"], cwd=directory,
                              stderr=subprocess.PIPE, text=True, **user) as process:
            begun(out, process)
            out.chmod(0o555)
            if stop:
                time.sleep(0.1)
                process.terminate()
            errors = process.communicate(timeout=60)[1]
        [path] = out.iterdir()
        assert process.returncode == 1 and f"the result is '{out.name}/{path.name}'" in errors, errors
        with h5py.File(path) as run:
            assert run.attrs["status"] == (b"stopped" if stop else b"done") and run["time"].size > 0
    if user:
        shutil.rmtree(pathlib.Path(executable).parent)


def test_a_sweep_says_that_its_directory_was_removed(place):
    (place / "base.nml").write_text(CASE.replace("t_end = 0.05", "t_end = 20"))
    (place / "s.nml").write_text("&sweep base = 'base.nml' /\n&axis key = 'case.t_end', start = 20, stop = 21, count = 9 /\n")
    with subprocess.Popen([RODYN, "sweep", "s.nml", "--quiet"], cwd=place, stderr=subprocess.PIPE, text=True) as process:
        while not list(place.glob("s/shards/*")) and process.poll() is None:
            time.sleep(0.01)
        shutil.rmtree(place / "s")
        errors = process.communicate(timeout=100)[1]
    assert process.returncode == 1 and errors == "s: was removed, and all results with it\n", errors
