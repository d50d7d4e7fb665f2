"""What the program does with its arguments: commands, messages, exit codes, files.

RODYN=path  the program under test; otherwise bin/rodyn.
"""

import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

import h5py
import numpy as np
import pytest
import result_files
import xarray

ROOT = pathlib.Path(__file__).resolve().parents[2]
RODYN = os.environ.get("RODYN", str(ROOT / "bin" / "rodyn"))

SPACECRAFT = "&spacecraft mass = 122.5, inertia = 10, hinge_x = 0.35, hinge_y = 0.35 /\n"
FIXED = "&spacecraft motion = 'fixed', hinge_x = 0.35 /\n"
CHAIN = """&chain n_rods = 3, length = 1.5, 1.4, 1.3, mass_per_length = 1.7, bending_stiffness = 1.37e4,
   node_mass = 0.5, hinge_stiffness = 6000, 2*4000 /
"""
DAMPED = CHAIN.replace(" /\n", ", hinge_damping = 0.02 /\n")
KINKED = CHAIN.replace(" /\n", ", kink = 0, 0.05, 0 /\n")
ONE_ROD = "&chain n_rods = 1, length = 1.5, mass_per_length = 1.7, bending_stiffness = 1.37e4, hinge_stiffness = 6000 /\n"
TIMES = "&case title = 'A test', t_end = 0.05, n_outputs = 5 /\n"
MOMENT = "&load component = 'M', value = 1500, t_end = 0.02 /\n"
FORCE = "&load target = 'node', node = 2, component = 'Y', law = 'sine_squared', value = 50, rate = 40 /\n"
LUMPED = "&model inertia = 'lumped', bending = 'rigid' /\n"
QUASISTATIC = "&model inertia = 'lumped', bending = 'quasistatic' /\n"
PAPER = "&model formulation = 'paper' /\n"
NO_LEDGER = "&output ledger = .false. /\n"

#: One scene of every kind.
SCENES = {
    "flexible": TIMES + SPACECRAFT + DAMPED + MOMENT + FORCE,
    "one rod": TIMES + SPACECRAFT + ONE_ROD + MOMENT,
    "one rigid rod, fixed": TIMES + FIXED + ONE_ROD + "&model bending = 'rigid' /\n&initial phi_rate = 1 /\n",
    "rigid": TIMES + SPACECRAFT + KINKED + "&model bending = 'rigid' /\n" + MOMENT,
    "lumped": TIMES + SPACECRAFT + CHAIN + LUMPED + MOMENT,
    "quasistatic": TIMES + SPACECRAFT + DAMPED + QUASISTATIC + MOMENT,
    "quasistatic, exact, bdf": TIMES + SPACECRAFT + DAMPED + QUASISTATIC.replace(" /", ", dampers = 'exact' /") + MOMENT
    + "&solver rtol = 1e-5, atol = 1e-7 /\n",
    "fixed": TIMES + FIXED + KINKED + FORCE,
    "paper, bdf, assembled": TIMES + SPACECRAFT + CHAIN + MOMENT + "&solver method = 'bdf', rtol = 1e-6, atol = 1e-8 /\n"
    + "&model formulation = 'paper', kernel = 'assembled' /\n",
    "adams": TIMES + SPACECRAFT + CHAIN + MOMENT + "&solver method = 'adams', order = 8, max_step = 1e-3 /\n",
    "erk, fixed step": TIMES + SPACECRAFT + CHAIN + MOMENT + "&solver method = 'erk', order = 6, fixed_step = 2e-4 /\n",
    "no ledger": TIMES + SPACECRAFT + CHAIN + MOMENT + NO_LEDGER,
    "no loads, uncompressed": TIMES + SPACECRAFT + CHAIN + "&output compression = 0 /\n&initial phi = 0.1, 0.2, 0.3 /\n",
}

#: What `auto` takes for them, where it is not dop853.
AUTO = dict.fromkeys(["flexible", "one rod", "one rigid rod, fixed", "fixed", "no ledger", "no loads, uncompressed"], "gauss")

ROD_STATES = {"phi": "rad", "alpha": "rad", "beta": "rad", "phi_rate": "rad s-1", "alpha_rate": "rad s-1",
              "beta_rate": "rad s-1"}
SCALAR_STATES = {"velocity_x": "m s-1", "velocity_y": "m s-1", "omega": "rad s-1", "displacement_x": "m",
                 "displacement_y": "m", "rotation": "rad"}
LEDGER = {"energy_kinetic": "J", "energy_elastic": "J", "energy_dissipated": "J", "work_external": "J",
          "energy_residual": "J", "momentum_x": "kg m s-1", "momentum_y": "kg m s-1", "angular_momentum": "kg m2 s-1"}
ROOT_TEXTS = ["title", "status", "program_version", "git_commit", "compiler", "compiler_options", "sundials_version",
              "hdf5_version", "hostname", "created", "input", "resolved_input", "notes", "warnings"]
SOLVER_NUMBERS = ["rtol", "atol", "n_steps", "n_rhs", "n_jac", "wall_seconds", "max_step", "fixed_step", "last_step",
                  "n_error_test_failures", "n_nonlinear_failures", "n_restarts", "order"]


def rodyn(*arguments, cwd=None, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run([RODYN, *map(str, arguments)], cwd=cwd, capture_output=True, text=True, timeout=120, **options)


def write_case(directory: pathlib.Path, text: str, name: str = "case.nml") -> pathlib.Path:
    path = directory / name
    path.write_text(text)
    return path


def run_scene(directory: pathlib.Path, text: str, name: str = "case") -> pathlib.Path:
    case = write_case(directory, text, f"{name}.nml")
    result = rodyn("run", case, cwd=directory)
    assert result.returncode == 0, result.stderr
    return directory / f"{name}.h5"


def files(directory: pathlib.Path) -> list[str]:
    return sorted(path.name for path in directory.iterdir())


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Run files of all scenes, and what was printed."""
    directory = tmp_path_factory.mktemp("scenes")
    found = {}
    for number, (name, text) in enumerate(SCENES.items()):
        case = write_case(directory, text, f"{number}.nml")
        result = rodyn("run", case, "--output", directory / f"{number}.h5")
        assert result.returncode == 0, (name, result.stderr)
        assert result.stderr == "", name
        found[name] = directory / f"{number}.h5", result.stdout
    return found


# Commands and usage


def test_version_names_the_program_and_its_commit():
    result = rodyn("--version")
    assert result.returncode == 0 and result.stderr == ""
    assert re.fullmatch(r"rodyn \d+\.\d+\.\d+ \(\S+\)\n", result.stdout)


def test_help_is_printed_by_the_program_and_by_every_command(tmp_path):
    result = rodyn("--help")
    assert result.returncode == 0 and result.stderr == ""
    commands = re.findall(r"^  rodyn (\w+)", result.stdout, re.MULTILINE)
    assert {"run", "check", "defaults"} <= set(commands)
    for command in commands:
        for option in ("--help", "-h"):
            result = rodyn(command, option, cwd=tmp_path)
            assert result.returncode == 0 and result.stderr == "", command
            assert result.stdout.startswith(f"rodyn {command}"), command
    assert files(tmp_path) == []


@pytest.mark.parametrize(("arguments", "message"), [
    ([], "rodyn run CASE.nml"),
    (["integrate"], "unknown command 'integrate'"),
    (["Run"], "unknown command 'Run'"),
    (["--quiet"], "unknown command '--quiet'"),
    (["run"], "no file given"),
    (["check"], "no file given"),
    (["run", "--force"], "no file given"),
    (["run", "case.nml", "--overwrite"], "unknown option '--overwrite'"),
    (["run", "case.nml", "-x"], "unknown option '-x'"),
    (["check", "case.nml", "--force"], "unknown option '--force'"),
    (["check", "case.nml", "--output", "x.h5"], "unknown option '--output'"),
    (["run", "case.nml", "other.nml"], "one file at a time; unexpected argument 'other.nml'"),
    (["check", "case.nml", "other.nml"], "one file at a time; unexpected argument 'other.nml'"),
    (["run", "case.nml", "--output"], "--output needs a file name"),
    (["run", "case.nml", "--output="], "the name of the output file is empty"),
    (["run", "case.nml", "--output", ""], "the name of the output file is empty"),
    (["defaults", "walk"], "'walk' is not one of"),
    (["defaults", "run", "walk"], "unexpected argument 'walk'"),
    (["run", "missing.nml"], "missing.nml: cannot be read (No such file or directory)"),
    (["check", "missing.nml"], "missing.nml: cannot be read (No such file or directory)"),
    (["run", "directory"], "directory: cannot be read (Is a directory)"),
    (["check", "directory"], "directory: cannot be read (Is a directory)"),
    (["run", ""], "the path of the input file is empty"),
    (["run", "case.nml", "--output", "directory"], "directory: is a directory"),
    (["run", "case.nml", "--output", "nowhere/x.h5"], "the directory 'nowhere' does not exist"),
    (["run", "case.nml", "--output", "case.nml/x.h5"], "'case.nml' is not a directory"),
])
def test_wrong_usage_is_told_and_leaves_nothing(tmp_path, arguments, message):
    write_case(tmp_path, SCENES["one rod"])
    (tmp_path / "directory").mkdir()
    result = rodyn(*arguments, cwd=tmp_path)
    assert result.returncode == 2
    assert message in result.stderr
    assert result.stdout == ""
    assert files(tmp_path) == ["case.nml", "directory"] and files(tmp_path / "directory") == []


def test_defaults_are_a_case_that_is_valid_and_runs(tmp_path):
    defaults = rodyn("defaults")
    assert defaults.returncode == 0 and defaults.stderr == ""
    assert defaults.stdout == rodyn("defaults", "run").stdout
    case = write_case(tmp_path, defaults.stdout, "x.nml")
    check = rodyn("check", case)
    assert (check.returncode, check.stdout, check.stderr) == (0, f"{case}: valid\n", "")
    result = rodyn("run", "x.nml", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert files(tmp_path) == ["x.h5", "x.nml"]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
@pytest.mark.parametrize("arguments", [["defaults"], ["--version"], ["--help"], ["run", "--help"]])
def test_output_that_cannot_be_written_is_a_failure(arguments):
    with open("/dev/full", "w") as full:
        result = subprocess.run([RODYN, *arguments], stdout=full, stderr=subprocess.PIPE, text=True)
    assert result.returncode == 1
    assert result.stderr == "rodyn: standard output cannot be written: No space left on device\n"


# Faults of a case


BAD_CASE = """&case t_end = -1, n_outputs = 1.5 /
&spacecraft mass = 122,5, inertia = 10 /
&chain n_rods = 3, length = 1.5, 1.5, -1.5, mass_per_length = NaN, bending_stiffness = 1e4, 1e4,
   hinge_stifness = 6000, hinge_stiffness = 4000 /
&model bending = 'elastic' /
&solver rtol = 0 /
&load target = 'node', node = 4, component = 'X', value = 1 /
&forces /
"""


@pytest.mark.parametrize("command", ["run", "check"])
def test_all_faults_of_a_case_come_at_once(tmp_path, command):
    write_case(tmp_path, BAD_CASE, "bad.nml")
    result = rodyn(command, "bad.nml", cwd=tmp_path)
    assert result.returncode == 2
    assert result.stdout == ""
    assert files(tmp_path) == ["bad.nml"]
    lines = result.stderr.splitlines()
    for line in lines:
        assert re.match(r"bad\.nml:\d+: &\w+", line), line
    faults = {tuple(re.match(r"bad\.nml:(\d+): &(\w+) ?(\w*)", line).groups()) for line in lines}
    assert {("1", "case", "t_end"), ("1", "case", "n_outputs"), ("3", "chain", "length"), ("3", "chain", "mass_per_length"),
            ("3", "chain", "bending_stiffness"), ("4", "chain", "hinge_stifness"), ("5", "model", "bending"),
            ("6", "solver", "rtol"), ("7", "load", "node"), ("8", "forces", "")} <= faults
    assert any(fault[:2] == ("2", "spacecraft") for fault in faults)
    assert "bad.nml:3: &chain length(3) = -1.5: must be positive [m]" in lines
    assert "hinge_stiffness" in next(line for line in lines if "hinge_stifness" in line)  # the nearest name
    numbers = [int(line.split(":")[1]) for line in lines]
    assert numbers == sorted(numbers)


@pytest.mark.parametrize(("text", "fault"), [
    (TIMES + SPACECRAFT + CHAIN.replace("mass_per_length = 1.7", "mass_per_length = 1.7, 0, 1.7"),
     "&chain mass_per_length = 1.7, 0, 1.7: must be positive when bending = 'dynamic', but is 0 for rod 2"),
    (TIMES + SPACECRAFT + CHAIN.replace("mass_per_length = 1.7", "mass_per_length = 1.7, 0, 0").replace("0.5", "2*1, 0")
     + LUMPED, "&chain node_mass = 2*1, 0: rod 3 and its outer node are both without mass"),
    (TIMES + SPACECRAFT + CHAIN + "&model gauss_points = 1 /", "&model gauss_points = 1: must be at least 4"),
    (TIMES + SPACECRAFT + CHAIN + "&solver order = 5 /", "&solver order = 5: needs a named method"),
    (TIMES + SPACECRAFT + CHAIN + "&solver method = 'bdf', order = 6 /", "&solver order = 6: must lie in 0..5"),
    (TIMES + SPACECRAFT + CHAIN + "&solver method = 'erk', order = 9 /", "&solver order = 9: must be 0 or lie in 2..8"),
    (TIMES + SPACECRAFT + CHAIN + "&solver method = 'dop853', order = 5 /", "&solver order = 5: must be 0 or 8"),
    ("&case n_outputs = 2147483647 /\n" + SPACECRAFT + CHAIN, "&case n_outputs = 2147483647: must lie in 1..100000000"),
])
def test_what_a_run_would_refuse_is_found_by_check(tmp_path, text, fault):
    case = write_case(tmp_path, text)
    for command in ("check", "run"):
        result = rodyn(command, case.name, cwd=tmp_path)
        assert result.returncode == 2
        assert len(result.stderr.splitlines()) == 1
        assert re.match(r"case\.nml:\d+: ", result.stderr) and fault in result.stderr
    assert files(tmp_path) == ["case.nml"]


def test_steps_beyond_the_stability_limit_are_refused_with_the_limit_unless_allowed(tmp_path):
    steps = TIMES + SPACECRAFT + CHAIN + MOMENT + "&solver method = 'erk', order = 4, fixed_step = %s%s /\n"
    case = write_case(tmp_path, steps % ("5e-3", ""))
    for command in ("check", "run"):
        result = rodyn(command, case.name, cwd=tmp_path)
        assert result.returncode == 2
        limit, frequency = re.match(r"case\.nml: &solver fixed_step = 0\.005: method = 'erk' is unstable in this scene with steps above "
                                    r"(\S+) s \(vibration of (\S+) rad/s\)", result.stderr).groups()
    assert files(tmp_path) == ["case.nml"]
    assert float(limit) * float(frequency) == pytest.approx(np.sqrt(8), rel=0.02)
    assert rodyn("run", write_case(tmp_path, steps % (limit, "")).name, cwd=tmp_path).returncode == 0
    allowed = rodyn("run", write_case(tmp_path, steps % ("5e-3", ", allow_unstable = .true.")).name, "--force", cwd=tmp_path)
    assert allowed.returncode in (0, 1) and "unstable" not in allowed.stderr


def test_a_rod_that_bends_too_far_ends_with_a_warning(tmp_path):
    bent = TIMES + SPACECRAFT + CHAIN + "&initial alpha = 0, %s, beta = 0, -%s /\n&model deflection_limit = 0.05 /\n"
    for slope, warned in (("0.1, 0", False), ("0.3, 0", True)):
        case = write_case(tmp_path, bent % (slope, slope))
        result = rodyn("run", case.name, "--force", cwd=tmp_path)
        assert result.returncode == 0
        assert ("\nwarning rod 2 bends by" in result.stdout) is warned
        run = result_files.read(tmp_path / "case.h5")
        assert ("rod 2 bends by" in run.attrs["warnings"]) is warned
        assert run.attrs["status"] == "done"


@pytest.mark.parametrize("text", [
    TIMES + SPACECRAFT + CHAIN.replace("mass_per_length = 1.7", "mass_per_length = 0") + LUMPED,
    TIMES + SPACECRAFT + CHAIN.replace("mass_per_length = 1.7", "mass_per_length = 0, 0, 1").replace("0.5", "1, 0, 0") + LUMPED,
    TIMES + SPACECRAFT + CHAIN.replace("node_mass = 0.5", "node_mass = 0") + "&model bending = 'rigid' /\n",
])
def test_masses_that_suffice_are_accepted(tmp_path, text):
    run_scene(tmp_path, text)


# Input from standard input and from pipes


@pytest.fixture
def piped(tmp_path):
    """Run the program with an input that can be read once: standard input as '-' or by its name, or a fifo."""

    def run(kind: str, text: str, command: str, *options: str) -> subprocess.CompletedProcess[str]:
        if kind != "pipe":
            return rodyn(command, kind, *options, cwd=tmp_path, input=text)
        os.mkfifo(tmp_path / "pipe")
        writer = threading.Thread(target=lambda: (tmp_path / "pipe").write_text(text), daemon=True)
        writer.start()
        result = rodyn(command, "pipe", *options, cwd=tmp_path)
        writer.join(timeout=5)
        (tmp_path / "pipe").unlink()
        return result

    return run


@pytest.mark.parametrize("kind", ["-", "/dev/stdin", "pipe"])
def test_any_input_that_can_be_read_is_read(piped, tmp_path, kind):
    long = "".join(f"! a comment that no buffer of a pipe holds whole, line {i}\n" for i in range(5000))
    text = long + SCENES["one rod"]
    name = "standard input" if kind == "-" else kind
    assert (lambda r: (r.returncode, r.stdout))(piped(kind, text, "check")) == (0, f"{name}: valid\n")
    bad = piped(kind, long + "&case t_end = -1 /\n", "check")
    assert bad.returncode == 2 and f"{name}:5001: &case t_end = -1: must be positive [s]\n" in bad.stderr
    for command in ("run", "modes"):
        assert piped(kind, text, command, "--output", f"{command}.h5").returncode == 0
        with h5py.File(tmp_path / f"{command}.h5") as file:
            assert file.attrs["input"].decode() == text
    (tmp_path / "base.nml").write_text(SCENES["one rod"])
    sweep = "&sweep base = 'base.nml' /\n&axis key = 'load.value', values = 1, 2 /\n"
    assert piped(kind, sweep, "sweep", "--output", "sweep").returncode == 0
    assert (tmp_path / "sweep" / "sweep.h5").exists()
    (tmp_path / "s.nml").write_text(sweep.replace("base.nml", "pipe" if kind == "pipe" else "/dev/stdin"))
    if kind != "pipe":
        assert rodyn("check", "s.nml", cwd=tmp_path, input=SCENES["one rod"]).returncode == 0


@pytest.mark.parametrize("kind", ["-", "/dev/stdin", "pipe"])
@pytest.mark.parametrize("command", ["run", "modes", "sweep"])
def test_an_input_without_a_name_gives_the_result_none(piped, tmp_path, kind, command):
    result = piped(kind, SCENES["one rod"], command)
    assert result.returncode == 2 and f"rodyn {command}: the input is a stream without a name" in result.stderr
    assert "--output" in result.stderr
    assert files(tmp_path) == []


def test_a_case_from_standard_input_may_name_its_result(piped, tmp_path):
    assert piped("-", SCENES["one rod"] + "&output file = 'mine.h5' /\n", "run").returncode == 0
    assert files(tmp_path) == ["mine.h5"]


def test_an_endless_or_binary_stream_is_refused(tmp_path):
    result = rodyn("check", "/dev/zero", cwd=tmp_path)
    assert result.returncode == 2 and result.stderr == "/dev/zero: cannot be read (more than 256 MB)\n"
    path = run_scene(tmp_path, SCENES["one rod"])
    result = subprocess.run([RODYN, "check", "-"], stdin=path.open("rb"), capture_output=True, text=True)
    assert result.returncode == 2
    assert result.stderr == "standard input: an HDF5 file cannot be read from a pipe; give its name\n"


# Several processes started together


LAUNCHERS = [{"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "%d"}, {"PMI_SIZE": "2", "PMI_RANK": "%d"},
             {"SLURM_STEP_NUM_TASKS": "2", "SLURM_NTASKS": "2", "SLURM_PROCID": "%d"}]


def as_rank(launcher: dict[str, str], rank: int) -> dict[str, str]:
    return os.environ | {name: value.replace("%d", str(rank)) for name, value in launcher.items()}


@pytest.mark.parametrize("launcher", LAUNCHERS, ids=lambda launcher: next(iter(launcher)))
def test_one_process_computes_a_case_and_one_speaks(tmp_path, launcher):
    write_case(tmp_path, SCENES["one rod"])
    for rank in (0, 1):
        for command in ("run", "modes"):
            result = rodyn(command, "case.nml", cwd=tmp_path, env=as_rank(launcher, rank))
            assert (result.returncode, result.stdout) == (2, "")
            assert result.stderr.startswith(f"rodyn {command}: 2 processes were started together") if rank == 0 else not result.stderr
        for arguments in (["check", "case.nml"], ["defaults"], ["--version"], ["run", "--help"], ["sweep", "--help"]):
            result = rodyn(*arguments, cwd=tmp_path, env=as_rank(launcher, rank))
            assert (result.returncode, result.stderr) == (0, "")
            assert bool(result.stdout) is (rank == 0), arguments
    assert files(tmp_path) == ["case.nml"]


@pytest.mark.parametrize("launcher", LAUNCHERS, ids=lambda launcher: next(iter(launcher)))
def test_a_script_that_was_started_several_times_knows_what_it_does(tmp_path, launcher):
    """As in `mpirun -n 2 script` with a case for each rank, or a shell in a job of several tasks."""
    write_case(tmp_path, SCENES["one rod"])
    for rank in (0, 1):
        done = subprocess.run(["sh", "-c", f"{RODYN} run case.nml --output {rank}.h5; exit $?"], cwd=tmp_path,
                              env=as_rank(launcher, rank), capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    assert files(tmp_path) == ["0.h5", "1.h5", "case.nml"]


@pytest.mark.parametrize("launcher", LAUNCHERS, ids=lambda launcher: next(iter(launcher)))
def test_what_only_wraps_a_command_is_seen_through(tmp_path, launcher):
    """As `mpirun -n 2 timeout 60 rodyn run case.nml`; but not where the wrapper goes to a directory of its own first."""
    write_case(tmp_path, SCENES["one rod"])
    for rank in (0, 1):
        env = as_rank(launcher, rank) | {"PWD": str(tmp_path)}
        for wrapper in (["timeout", "60"], ["nice"], ["sh", "-c", '"$@"; exit $?', "sh"], ["timeout", "60", "timeout", "60"]):
            done = subprocess.run([*wrapper, RODYN, "run", "case.nml"], cwd=tmp_path, env=env, capture_output=True, text=True)
            assert done.returncode == 2 and (rank > 0) == (done.stderr == ""), (wrapper, done.stderr)
        (tmp_path / str(rank)).mkdir()
        write_case(tmp_path / str(rank), SCENES["one rod"])
        done = subprocess.run(["sh", "-c", f'cd {rank}; "$@"; exit $?', "sh", RODYN, "run", "case.nml"], cwd=tmp_path, env=env,
                              capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        done = subprocess.run(["bash", "-c", f"{RODYN} run case.nml --output {rank}.h5"], cwd=tmp_path, env=env,
                              capture_output=True, text=True)  # bash becomes the program
        assert done.returncode == 0, done.stderr
    assert files(tmp_path) == ["0", "0.h5", "1", "1.h5", "case.nml"]


def test_a_job_of_several_tasks_is_no_reason_to_refuse(tmp_path):
    """A job script or shell of Slurm is one process, whatever the tasks of the job."""
    write_case(tmp_path, SCENES["one rod"])
    job = os.environ | {"SLURM_NTASKS": "8", "SLURM_PROCID": "0", "SLURM_JOB_ID": "1", "SLURM_NPROCS": "8"}
    assert rodyn("run", "case.nml", cwd=tmp_path, env=job).returncode == 0


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="no mpirun")
def test_mpirun_does_not_run_a_case_twice(tmp_path):
    write_case(tmp_path, SCENES["one rod"])
    root = os.environ | {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    for command, code, words in (("run", 2, "2 processes were started together"), ("check", 0, "case.nml: valid")):
        result = subprocess.run(["mpirun", "--oversubscribe", "-n", "2", RODYN, command, "case.nml"], cwd=tmp_path, env=root,
                                capture_output=True, text=True)
        assert result.returncode == code and (result.stdout + result.stderr).count(words) == 1
    assert files(tmp_path) == ["case.nml"]
    mpirun = ["mpirun", "--oversubscribe", "-n", "2"]
    done = subprocess.run([*mpirun, "timeout", "60", RODYN, "run", "case.nml"], cwd=tmp_path, env=root, capture_output=True, text=True)
    assert done.returncode == 2 and done.stderr.count("2 processes were started together") == 1
    assert files(tmp_path) == ["case.nml"]
    done = subprocess.run([*mpirun, "sh", "-c", f"{RODYN} run case.nml --output $OMPI_COMM_WORLD_RANK.h5"], cwd=tmp_path, env=root,
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    each = [["-n", "1", RODYN, "run", "case.nml", "--output", f"{name}.h5"] for name in "ab"]
    done = subprocess.run(["mpirun", "--oversubscribe", *each[0], ":", *each[1]], cwd=tmp_path, env=root, capture_output=True,
                          text=True)
    assert done.returncode == 0, done.stderr
    assert files(tmp_path) == ["0.h5", "1.h5", "a.h5", "b.h5", "case.nml"]


# What is allowed but hardly meant


@pytest.mark.parametrize(("group", "why"), [
    ("&load law = 'table', times = 0, 0.01, values = 5, 5, t_start = 0.02, t_end = 0.03 /", "it begins at t = 0.02 s, and ends at 0.01 s"),
    ("&load value = 5, t_start = -2, t_end = -1 /", "it ends at t = -1 s, and the case begins at 0 s"),
    ("&load law = 'table', times = -2, -1, values = 5, 5 /", "it ends at t = -1 s, and the case begins at 0 s"),
    ("&load law = 'table', times = 0.03, 0.04, values = 5, 5, t_end = 0.02 /", "it begins at t = 0.03 s, and ends at 0.02 s"),
    ("&load law = 'table', times = 0, 0.05, 1, values = 0, 0, 5 /", "its values are 0 as long as it acts"),
    ("&load law = 'sine_squared', value = 5, rate = 0 /", "its rate is 0"),
    ("&load value = 5, t_start = 0.01, t_end = 0.01 /", "it begins at t = 0.01 s, and ends at 0.01 s"),
    ("&load law = 'table', times = 0, 0.03, 1, values = 0, 0, 5 /", None),
    ("&load law = 'table', times = -2, -1, values = 5, 5, after = 'hold' /", None),
    ("&kink_program hinge = 0, law = 'sine', value = 0.1, rate = 0 /", "its rate is 0"),
    ("&kink_program hinge = 0, law = 'table', times = 0.05, 1, values = 0, 1 /", "it begins at t = 0.05 s, and the case ends at 0.05 s"),
    ("&kink_program hinge = 0, law = 'ramp', t_start = 0.01, t_end = 0.01, value = 0.1 /", None),
    ("&hinge hinge = 0, held = .true., release_time = 0.05 /",
     "release_time = 0.05 s is not before the end of the case, 0.05 s")])
def test_what_never_acts_is_noted_whatever_the_cause(tmp_path, group, why):
    write_case(tmp_path, TIMES + SPACECRAFT + CHAIN + group + "\n")
    result = rodyn("check", "case.nml", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert [line.rpartition(": ")[2] for line in result.stdout.splitlines()[1:]] == ([why] if why else [])


def test_loads_on_a_fixed_spacecraft_are_noted(tmp_path):
    write_case(tmp_path, TIMES + "&spacecraft motion = 'fixed' /\n" + CHAIN + "&load component = 'X', value = 5 /\n")
    assert "note    &load, number 1, never acts: the spacecraft is fixed" in rodyn("check", "case.nml", cwd=tmp_path).stdout


def test_a_load_after_the_end_is_noted_with_and_without_an_end_of_its_own(tmp_path):
    for end in ("", ", t_end = 4"):
        for law in ("'constant'", "'smooth_step'"):
            write_case(tmp_path, TIMES + SPACECRAFT + CHAIN + f"&load law = {law}, value = 5, t_start = 3{end} /\n")
            result = rodyn("check", "case.nml", cwd=tmp_path)
            assert result.stdout.splitlines()[1:] == [
                "note    &load, number 1, never acts: it begins at t = 3 s, and the case ends at 0.05 s"], result.stderr
    assert rodyn("run", "case.nml", cwd=tmp_path).returncode == 0
    with h5py.File(tmp_path / "case.h5") as file:
        (tmp_path / "again.nml").write_bytes(file.attrs["resolved_input"])
    assert rodyn("check", "again.nml", cwd=tmp_path).returncode == 0


def test_what_waits_for_a_held_hinge_is_noted(tmp_path):
    hinges = "".join(f"&hinge hinge = {h}, held = .true., latch_angle = 0.1, release_after = {a} /\n" for h, a in ((1, 0), (2, 1)))
    for release, count in (("", 2), (", release_time = 0.01", 0)):
        write_case(tmp_path, TIMES + SPACECRAFT + CHAIN + hinges + f"&hinge hinge = 0, held = .true., latch_angle = 0{release} /\n")
        notes = rodyn("check", "case.nml", cwd=tmp_path).stdout.splitlines()[1:]
        assert notes == [f"note    &hinge, hinge {h + 1}, is never released: hinge {h} is held and so cannot latch" for h in range(count)]


def test_a_program_is_linked_with_an_existing_build(tmp_path):
    if not (ROOT / "build/stage-release/lib/librodyn.a").exists():
        pytest.skip("no build beside the program")
    source = ROOT / "test/library_example/app/main.f90"
    subprocess.run([ROOT / "tools/link", source, "-o", "example"], cwd=tmp_path, check=True)
    subprocess.run([tmp_path / "example", "one.h5"], cwd=tmp_path, check=True)
    assert {path.name for path in tmp_path.iterdir()} == {"example", "one.h5"}
    with h5py.File(tmp_path / "one.h5") as file:
        assert file["phi"][-1, 0] != 0


def test_a_loss_of_rounding_is_none(tmp_path):
    """The face of a damped stop, met again long after, has -2e-21 J to give back, in a run of 100 J."""
    write_case(tmp_path, """&case t_end = 2, n_outputs = 10 /
        &spacecraft motion = 'fixed' /
        &chain n_rods = 3, length = 1.2, mass_per_length = 1.7, node_mass = 1.6, hinge_stiffness = 13 /
        &model bending = 'rigid' /
        &initial phi = 1.2, -1.2, 1.2 /
        &hinge hinge = 0, rest_angle = -0.2, lower_stop = 0, stop_stiffness = 630, stop_damping = 13 /
        &hinge hinge = 1, rest_angle = 0.2, upper_stop = 0, stop_stiffness = 1800, stop_damping = 71 /
        &hinge hinge = 2, rest_angle = -0.2, lower_stop = 0, stop_stiffness = 4800, stop_damping = 3.7 /
        """)
    result = rodyn("run", "case.nml", cwd=tmp_path)
    printed = [float(line.split(", ")[-1].split()[0]) for line in result.stdout.splitlines() if line.startswith("event ")]
    lost = result_files.read(tmp_path / "case.h5", "events").energy_lost.values
    tiny = np.abs(lost) < 1e-15
    assert np.any(lost[tiny] < 0) and not np.any(np.array(printed)[tiny])
    np.testing.assert_allclose(np.array(printed)[~tiny], lost[~tiny], rtol=1e-3)


def test_one_more_rod_is_singular(tmp_path):
    write_case(tmp_path, "&case n_outputs = 300, t_end = 0.5 /\n" + SPACECRAFT
               + "&chain n_rods = 2, length = 1.5, mass_per_length = 1.7, bending_stiffness = 1e4, hinge_stiffness = 4000 /\n"
               + "&initial phi = 0.1 /\n")
    result = rodyn("run", "case.nml", cwd=tmp_path)
    advice = "divide it into two rods with held hinges between them (&hinge hinge = ..., held = .true.), and one more rod likewise\n"
    assert advice in result.stdout, result.stdout


def test_what_hardly_can_be_meant_is_noted(tmp_path):
    text = (TIMES + SPACECRAFT + CHAIN + "&load component = 'M', value = 5, t_start = 2, t_end = 3 /\n&load component = 'X' , value = 0 /\n"
            + "&load component = 'Y', law = 'table', times = 0, 1, values = 0, 0 /\n" + MOMENT
            + "&initial phi = 0.1, 45, -90, rotation = 7.1 /\n&hinge hinge = 1, held = .true., release_time = 5 /\n")
    notes = ["&load, number 1, never acts: it begins at t = 2 s, and the case ends at 0.05 s",
             "&load, number 2, never acts: its value is 0", "&load, number 3, never acts: its values are 0 as long as it acts",
             "&hinge, hinge 1, is never released: release_time = 5 s is not before the end of the case, 0.05 s",
             "&initial phi = 45 rad is 7.161972 turns; if degrees were meant, write 0.785398"]
    case = write_case(tmp_path, text)
    check = rodyn("check", case.name, cwd=tmp_path)
    assert (check.returncode, check.stdout.splitlines()) == (0, ["case.nml: valid", *(f"note    {note}" for note in notes)])
    result = rodyn("run", case.name, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert [line[8:] for line in result.stdout.splitlines() if line.startswith("note ")][:5] == notes
    with h5py.File(tmp_path / "case.h5") as file:
        assert file.attrs["notes"].decode().splitlines()[:5] == notes
    modes = rodyn("modes", case.name, cwd=tmp_path)
    assert modes.returncode == 0, modes.stderr
    with h5py.File(tmp_path / "case_modes.h5") as file:
        assert file.attrs["notes"].decode().splitlines()[:1] == notes[4:]  # nothing acts there


def test_numbers_in_messages_are_whole(tmp_path):
    """Exponents of three digits keep their E, numbers below 1 their zero."""
    write_case(tmp_path, (TIMES + SPACECRAFT + CHAIN + MOMENT).replace("0.05", "1e-300").replace("t_end = 0.02", "t_end = 1e-301"))
    out = rodyn("run", "case.nml", cwd=tmp_path).stdout
    assert "t = 1E-300 s" in out and not re.search(r"\d[-+]\d{3}\b", out), out
    (tmp_path / "s.nml").write_text("&sweep base = 'base.nml' /\n&axis key = 'solver.rtol', values = 1e-6, 1e-7 /\n")
    write_case(tmp_path, SCENES["one rod"], "base.nml")
    out = rodyn("sweep", "s.nml", cwd=tmp_path).stdout
    assert re.search(r"^cost    \d+\.\d+ s of integration in \d+\.\d+ s on 1 process$", out, re.MULTILINE), out


# Names of results


def test_the_result_is_named_after_the_case_and_stands_in_the_working_directory(tmp_path):
    (tmp_path / "cases.d").mkdir()
    (tmp_path / "work").mkdir()
    for name, expected in [("a.nml", "a.h5"), ("b.c.nml", "b.c.h5"), ("plain", "plain.h5"), (".hidden", ".hidden.h5")]:
        case = write_case(tmp_path / "cases.d", SCENES["one rod"], name)
        result = rodyn("run", case, cwd=tmp_path / "work")
        assert result.returncode == 0, result.stderr
        assert result.stdout.splitlines()[-1] == f"file    {expected}"
        assert expected in files(tmp_path / "work")
    assert len(files(tmp_path / "work")) == 4 and len(files(tmp_path / "cases.d")) == 4


@pytest.mark.parametrize("option", [["--output", "x y.h5"], ["--output=x y.h5"], ["-o", "x y.h5"]])
def test_output_names_the_result(tmp_path, option):
    write_case(tmp_path, SCENES["one rod"])
    for arguments in (["run", "case.nml", *option], ["run", *option, "case.nml", "--force"]):
        assert rodyn(*arguments, cwd=tmp_path).returncode == 0
        assert files(tmp_path) == ["case.nml", "x y.h5"]


def test_the_case_may_name_its_result_and_the_option_wins(tmp_path):
    write_case(tmp_path, SCENES["one rod"] + "&output file = 'mine.h5' /\n")
    assert rodyn("run", "case.nml", cwd=tmp_path).returncode == 0
    assert files(tmp_path) == ["case.nml", "mine.h5"]
    assert rodyn("run", "case.nml", "--output", "other.h5", cwd=tmp_path).returncode == 0
    assert files(tmp_path) == ["case.nml", "mine.h5", "other.h5"]


def test_an_existing_result_is_replaced_by_force_only(tmp_path):
    write_case(tmp_path, SCENES["one rod"])
    (tmp_path / "case.h5").write_text("precious")
    result = rodyn("run", "case.nml", cwd=tmp_path)
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr == "case.h5: exists already; --force replaces it\n"
    assert (tmp_path / "case.h5").read_text() == "precious"
    assert rodyn("run", "case.nml", "--force", cwd=tmp_path).returncode == 0
    assert h5py.is_hdf5(tmp_path / "case.h5")
    assert files(tmp_path) == ["case.h5", "case.nml"]


def test_a_failed_run_replaces_none_but_a_failed_one(tmp_path):
    good = SCENES["one rod"]
    bad = good + "&solver method = 'dop853', max_steps = 3 /\n"
    write_case(tmp_path, good)
    assert rodyn("run", "case.nml", cwd=tmp_path).returncode == 0
    before = (tmp_path / "case.h5").read_bytes()
    for steps in ("3", "4"):
        write_case(tmp_path, bad.replace("max_steps = 3", f"max_steps = {steps}"))
        result = rodyn("run", "case.nml", "--force", cwd=tmp_path)
        assert result.returncode == 1 and "rows until then are in case.h5.failed" in result.stderr, result.stderr
        assert result.stdout.splitlines()[-1] == "file    case.h5.failed"
        assert files(tmp_path) == ["case.h5", "case.h5.failed", "case.nml"]
        assert (tmp_path / "case.h5").read_bytes() == before
        with h5py.File(tmp_path / "case.h5.failed") as run:
            assert run.attrs["status"] == b"failed" and f"max_steps = {steps}".encode() in run.attrs["input"]
    (tmp_path / "case.h5.failed").rename(tmp_path / "case.h5")
    write_case(tmp_path, bad)
    assert rodyn("run", "case.nml", "--force", cwd=tmp_path).returncode == 1
    assert files(tmp_path) == ["case.h5", "case.nml"]
    write_case(tmp_path, good)
    assert rodyn("run", "case.nml", "--force", cwd=tmp_path).returncode == 0
    with h5py.File(tmp_path / "case.h5") as run:
        assert run.attrs["status"] == b"done"
    assert files(tmp_path) == ["case.h5", "case.nml"]


def test_a_result_never_replaces_its_case(tmp_path):
    case = write_case(tmp_path, SCENES["one rod"], "case.h5")
    (tmp_path / "link").symlink_to("case.h5")
    for arguments in (["case.h5"], ["case.h5", "--output", "./case.h5"], ["link", "--output", "case.h5"]):
        result = rodyn("run", *arguments, "--force", cwd=tmp_path)
        assert result.returncode == 2
        assert "is the case itself" in result.stderr
        assert case.read_text() == SCENES["one rod"]


# What is printed


def test_quiet_prints_nothing_but_errors(tmp_path):
    write_case(tmp_path, SCENES["quasistatic"])
    for command in ("run", "check"):
        result = rodyn(command, "case.nml", "--quiet", cwd=tmp_path)
        assert (result.returncode, result.stdout, result.stderr) == (0, "", "")
    assert files(tmp_path) == ["case.h5", "case.nml"]
    result = rodyn("run", "case.nml", "--quiet", cwd=tmp_path)
    assert (result.returncode, result.stdout) == (2, "") and "exists already" in result.stderr


def printed(text: str) -> dict[str, str]:
    """Lines by their first word."""
    return {line[:8].strip(): line[8:] for line in text.splitlines()}


@pytest.mark.parametrize(("scene", "uses", "skips"), [
    ("flexible", "free spacecraft, dynamic bending, rod inertia, inextensible rods, second-order inertia, dampers, 2 loads, "
                 "loads on nodes, ledger",
     "kinks"),
    ("one rod", "free spacecraft, dynamic bending, rod inertia, inextensible rods, second-order inertia, 1 load, ledger",
     "dampers, kinks, loads on nodes, loads after t = 0.02 s"),
    ("lumped", "free spacecraft, 1 load, ledger",
     "dynamic bending, rod inertia, second-order inertia, dampers, kinks, loads on nodes, loads after t = 0.02 s"),
    ("quasistatic", "free spacecraft, quasistatic bending, dampers, 1 load, ledger",
     "dynamic bending, rod inertia, second-order inertia, kinks, loads on nodes, loads after t = 0.02 s"),
    ("fixed", "dynamic bending, rod inertia, inextensible rods, second-order inertia, kinks, 1 load, loads on nodes, ledger",
     "free spacecraft, dampers"),
    ("no ledger", "free spacecraft, dynamic bending, rod inertia, inextensible rods, second-order inertia, 1 load",
     "dampers, kinks, loads on nodes, loads after t = 0.02 s, ledger"),
    ("no loads, uncompressed", "free spacecraft, dynamic bending, rod inertia, inextensible rods, second-order inertia, ledger",
     "dampers, kinks, loads"),
])
def test_a_run_says_what_it_uses_and_what_it_skips(results, scene, uses, skips):
    lines = printed(results[scene][1])
    assert lines["uses"] == uses
    assert lines["skips"] == skips
    assert lines["done"].startswith("t = 0.05 s, ")
    assert ("ledger" in lines) == (scene != "no ledger")


@pytest.mark.parametrize(("scene", "sizes", "method"), [
    ("flexible", "3 rods (3 distinct kinds), 24 states; recursive kernel, O(n)", r"gauss: auto: frequencies .* rad/s, dampers"),
    ("one rod", "1 rod (1 distinct kind), 12 states; recursive kernel, O(n)", r"gauss: auto: frequencies .* about \d+ steps"),
    ("one rigid rod, fixed", "1 rod (1 distinct kind), 2 states; recursive kernel, O(n)", r"gauss: auto: "),
    ("paper, bdf, assembled", "3 rods (3 distinct kinds), 24 states; assembled kernel, O(n^3)", "bdf: chosen by the case"),
    ("adams", "3 rods (3 distinct kinds), 24 states; recursive kernel, O(n)", "adams: chosen by the case"),
])
def test_a_run_says_how_large_it_is_and_which_method_it_takes(results, scene, sizes, method):
    lines = printed(results[scene][1])
    assert lines["scene"] == sizes
    assert re.match(method, lines["method"])


def test_strong_dampers_call_for_an_implicit_method(tmp_path):
    damped = CHAIN.replace(" /\n", ", hinge_damping = 5e4 /\n")
    lines = printed(rodyn("run", write_case(tmp_path, TIMES + SPACECRAFT + damped + MOMENT), cwd=tmp_path).stdout)
    assert re.match(r"gauss: auto: .*: collocation, order 16, about \d+ steps", lines["method"])
    stiff = damped.replace("bending_stiffness = 1.37e4", "bending_stiffness = 1e9") + "&solver rtol = 1e-3, atol = 1e-5 /\n"
    lines = printed(rodyn("run", write_case(tmp_path, TIMES + SPACECRAFT + stiff + MOMENT, "stiff.nml"), cwd=tmp_path).stdout)
    assert re.match(r"bdf: auto: .*: stiff, implicit", lines["method"])


def test_the_formulation_of_the_article_is_noted_where_it_matters(results, tmp_path):
    words = "formulation 'paper' has no exact energy"
    path, text = results["paper, bdf, assembled"]
    assert f"note    {words}" in text
    assert "note    method 'bdf': its errors add up" in text
    assert words in result_files.read(path).attrs["notes"]
    for scene in ("flexible", "lumped", "no ledger"):
        path, text = results[scene]
        assert "note" not in printed(text)
        assert result_files.read(path).attrs["notes"] == ""
    # Without deflections or without energies there is nothing to note.
    for number, text in enumerate([CHAIN + "&model formulation = 'paper', bending = 'rigid' /\n", CHAIN + PAPER + NO_LEDGER]):
        case = write_case(tmp_path, TIMES + SPACECRAFT + text, f"{number}.nml")
        assert "note" not in printed(rodyn("run", case, cwd=tmp_path).stdout)


def test_condensed_rods_keep_their_chords_unless_arcs_are_asked_for(tmp_path):
    condensed = TIMES + SPACECRAFT + CHAIN + "&model bending = 'quasistatic'{} /\n"
    result = rodyn("run", write_case(tmp_path, condensed.format("")), cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    with h5py.File(tmp_path / "case.h5") as file:
        assert "formulation = 'consistent'" in file.attrs["resolved_input"].decode()
    result = rodyn("check", write_case(tmp_path, condensed.format(", formulation = 'inextensible'"), "arcs.nml"), cwd=tmp_path)
    assert result.returncode == 2 and "take 'consistent'" in result.stderr


def test_what_quasistatic_bending_leaves_out_is_noted(results, tmp_path):
    # One rod on a fixed spacecraft: w^2 = k/(m l^2), 1/k = 1/C + l/(3 EI).
    length, mass, stiffness, bending, damping = 1.5, 2.0, 6000.0, 1.37e4, 3.0
    chain = (f"&chain n_rods = 1, length = {length}, mass_per_length = 0, node_mass = {mass}, hinge_stiffness = {stiffness}, "
             f"bending_stiffness = {bending}, hinge_damping = %s /\n")
    frequency = np.sqrt(1/(1/stiffness + length/(3*bending))/(mass*length**2))
    case = write_case(tmp_path, TIMES + FIXED + chain % damping + QUASISTATIC + "&initial phi = 0.1 /\n")
    note = printed(rodyn("run", case, cwd=tmp_path).stdout)["note"]
    value, hinge, w = re.fullmatch(r"quasistatic bending neglects terms \(D w/C\)\^2 of the dampers: "
                                   r"up to (\S+) \(hinge (\d+), w = (\S+) rad/s\); dampers = 'exact' keeps them", note).groups()
    assert float(value) == pytest.approx((damping*frequency/stiffness)**2, rel=0.05)
    assert float(w) == pytest.approx(frequency, rel=0.005)
    assert hinge == "0"
    with h5py.File(tmp_path / "case.h5") as file:
        assert file.attrs["notes"].decode() == note
        assert file.attrs.get_id("notes").get_type().is_variable_str() is False
    assert "note" in printed(results["quasistatic"][1])
    case = write_case(tmp_path, TIMES + FIXED + chain % 1e-3 + QUASISTATIC, "weak.nml")  # below 1e-9
    assert "note" not in printed(rodyn("run", case, cwd=tmp_path).stdout)
    exact = QUASISTATIC.replace(" /", ", dampers = 'exact' /")
    case = write_case(tmp_path, TIMES + FIXED + chain % damping + exact, "exact.nml")
    assert "note" not in printed(rodyn("run", case, cwd=tmp_path).stdout)
    loose = CHAIN.replace("2*4000 /", "0, 4000, hinge_damping = 0, 1, 1 /")
    case = write_case(tmp_path, TIMES + SPACECRAFT + loose + QUASISTATIC, "loose.nml")
    result = rodyn("run", case, cwd=tmp_path)
    assert result.returncode == 0
    assert "without bound at hinge 1, which has a damper but no spring" in printed(result.stdout)["note"]


# Runs that fail


def rows_until_failure(path: pathlib.Path, n_intervals: int, t_end: float) -> xarray.Dataset:
    """The readable file of a failed run: all rows that were reached, all finite."""
    run = result_files.read(path)
    assert run.attrs["status"] == "failed"
    assert run.attrs["message"]
    assert 1 <= run.sizes["time"] <= n_intervals
    np.testing.assert_allclose(run.time, np.arange(run.sizes["time"])*t_end/n_intervals, rtol=1e-14)
    assert run.attrs["t_reached"] == run.time[-1]
    for name in run.data_vars:
        assert np.all(np.isfinite(run[name])), name
    return run


@pytest.mark.parametrize(("method", "steps"), [("adams", 60), ("bdf", 60), ("erk", 60), ("dop853", 60), ("gauss", 15)])
def test_too_many_steps_end_a_run(tmp_path, method, steps):
    text = "&case t_end = 0.05, n_outputs = 50 /\n" + SPACECRAFT + CHAIN + MOMENT
    whole = run_scene(tmp_path, text + f"&solver method = '{method}' /\n", "whole")
    write_case(tmp_path, text + f"&solver method = '{method}', max_steps = {steps} /\n")
    result = rodyn("run", "case.nml", cwd=tmp_path)
    assert result.returncode == 1
    match = re.fullmatch(rf"max_steps = {steps} reached at t = (\S+) s \(rows until then are in case\.h5\)\n", result.stderr)
    assert match, result.stderr
    lines = printed(result.stdout)
    assert "done" not in lines and lines["failed"].startswith(f"t = {match[1]} s, {steps} steps")
    run = rows_until_failure(tmp_path / "case.h5", 50, 0.05)
    t_last = float(match[1])
    assert run.attrs["t_reached"] <= t_last < run.attrs["t_reached"] + 0.001 + 1e-12
    assert f"max_steps = {steps} reached at t = {match[1]} s" in run.attrs["message"]
    assert files(tmp_path) == ["case.h5", "case.nml", "whole.h5", "whole.nml"]
    with h5py.File(tmp_path / "case.h5") as failed, h5py.File(whole) as good:
        assert failed["solver"].attrs["n_steps"] == steps
        n = failed["time"].size
        for name in (*ROD_STATES, *SCALAR_STATES):
            assert failed[name][:].tobytes() == good[name][:n].tobytes(), name


def soft_case(method: str, kernel: str) -> str:
    """Absurdly soft rods: in `paper` the mass matrix loses definiteness as they bend."""
    return ("&case t_end = 0.1, n_outputs = 100 /\n" + SPACECRAFT + CHAIN.replace("1.37e4", "1")
            + "&load component = 'M', value = 1.5e5 /\n"
            + f"&model formulation = 'paper', kernel = '{kernel}' /\n&solver method = '{method}' /\n")


@pytest.mark.parametrize("method", ["auto", "adams", "bdf", "erk", "dop853", "gauss"])
def test_a_mass_matrix_that_loses_definiteness_ends_a_run(tmp_path, method):
    reached = []
    for kernel in ("recursive", "assembled"):
        case = write_case(tmp_path, soft_case(method, kernel), f"{kernel}.nml")
        result = rodyn("run", case.name, cwd=tmp_path)
        assert result.returncode == 1
        assert len(result.stderr.splitlines()) == 1, result.stderr  # no backtrace, nothing from the libraries
        match = re.match(r"(CVode|ERKStepEvolve|dop853|gauss) at t = (\S+) s: ", result.stderr)
        assert match, result.stderr
        assert f"(rows until then are in {kernel}.h5)" in result.stderr
        run = rows_until_failure(tmp_path / f"{kernel}.h5", 100, 0.1)
        assert run.sizes["time"] > 10
        assert run.attrs["t_reached"] <= float(match[2]) < run.attrs["t_reached"] + 0.001
        reached.append(float(match[2]))
    assert reached[0] == pytest.approx(reached[1], abs=1e-6)  # both kernels notice it, at the same time
    assert files(tmp_path) == ["assembled.h5", "assembled.nml", "recursive.h5", "recursive.nml"]


@pytest.mark.parametrize("method", ["auto", "adams", "bdf", "erk", "dop853", "gauss"])
def test_a_start_without_a_definite_mass_matrix_fails_with_its_first_row(tmp_path, method):
    text = TIMES + SPACECRAFT + CHAIN + PAPER + f"&initial alpha = 3*20, beta = 3*-20 /\n&solver method = '{method}' /\n"
    write_case(tmp_path, text)
    result = rodyn("run", "case.nml", cwd=tmp_path)
    assert result.returncode == 1
    assert len(result.stderr.splitlines()) == 1 and "at t = 0 s" in result.stderr, result.stderr
    assert rows_until_failure(tmp_path / "case.h5", 5, 0.05).sizes["time"] == 1


@pytest.mark.parametrize("method", ["auto", "adams", "bdf", "erk", "dop853", "gauss"])
def test_a_state_that_becomes_infinite_ends_a_run(tmp_path, method):
    text = ("&case t_end = 1, n_outputs = 100 /\n" + SPACECRAFT + CHAIN
            + "&load component = 'X', law = 'table', times = 0, 0.105, 0.11, 1, values = 0, 0, 1e308, 1e308 /\n"
            + "&load component = 'Y', law = 'table', times = 0, 0.105, 0.11, 1, values = 0, 0, 1e308, 1e308 /\n"
            + f"&solver method = '{method}', max_steps = 100000 /\n")
    write_case(tmp_path, text)
    result = rodyn("run", "case.nml", cwd=tmp_path)
    assert result.returncode == 1
    assert len(result.stderr.splitlines()) == 1 and " at t = 0.1" in result.stderr, result.stderr
    run = rows_until_failure(tmp_path / "case.h5", 100, 1.0)
    assert run.sizes["time"] >= 11


# Run files of every kind of scene


@pytest.mark.parametrize("scene", SCENES)
def test_every_scene_gives_all_states_with_units(results, scene):
    with result_files.read(results[scene][0]) as run:
        n = 1 if scene.startswith("one") else 3
        assert dict(run.sizes) == {"time": 6, "rod": n, "hinge": n, "node": n + 1}
        assert run.rod.values.tolist() == list(range(1, n + 1))
        assert run.hinge.values.tolist() == list(range(n))
        assert run.node.values.tolist() == list(range(n + 1))
        np.testing.assert_allclose(run.time, np.linspace(0, 0.05, 6), rtol=1e-15)
        assert run.time.units == "s"
        expected = {k: (("time", "rod"), u) for k, u in ROD_STATES.items()}
        expected |= {k: (("time",), u) for k, u in SCALAR_STATES.items()}
        if scene != "no ledger":
            expected |= {k: (("time",), u) for k, u in LEDGER.items()}
        assert set(run.data_vars) == set(expected)
        for name, (dims, units) in expected.items():
            assert (run[name].dims, run[name].units) == (dims, units), name
            assert run[name].long_name and run[name].dtype == np.float64, name
            assert np.all(np.isfinite(run[name])), name
        slaved = {"quasistatic", "quasistatic, exact, bdf"}
        rigid = {"one rigid rod, fixed", "rigid", "lumped"}
        for name in ("alpha", "beta", "alpha_rate", "beta_rate"):
            assert bool(np.any(run[name])) == (scene not in rigid), name
        if scene in slaved:  # EI/l (4 alpha + 2 beta) = -T_0, and no moment at the tip
            np.testing.assert_allclose(run.alpha[:, -1], -2*run.beta[:, -1], rtol=1e-10)
        for name in SCALAR_STATES:
            if "fixed" in scene and "step" not in scene:
                assert not np.any(run[name]), name
        assert np.any(run.phi[-1])
        if scene != "no ledger" and "paper" not in scene:
            scale = float((run.energy_kinetic + run.energy_elastic).max())
            assert float(abs(run.energy_residual).max()) < 1e-5*scale


@pytest.mark.parametrize("scene", SCENES)
def test_every_run_file_says_how_it_came_about(results, scene):
    path, _ = results[scene]
    with h5py.File(path) as file:
        for name in ROOT_TEXTS:
            attribute = file.attrs.get_id(name)
            assert attribute.shape == () and not attribute.get_type().is_variable_str(), name
        assert file.attrs["title"].decode() == "A test"
        assert file.attrs["status"].decode() == "done"
        assert "message" not in file.attrs
        assert file.attrs["input"].decode() == SCENES[scene]
        assert file.attrs["t_reached"] == file["time"][-1] == 0.05
        solver = file["solver"].attrs
        for name in SOLVER_NUMBERS:
            assert np.isscalar(solver[name]) and np.isfinite(solver[name]), name
        method = next((m for m in ("bdf", "adams", "erk") if m in scene), None) or AUTO.get(scene, "dop853")
        assert solver["method"].decode() == method
        assert solver["kernel"].decode() == ("assembled" if "assembled" in scene else "recursive")
        assert solver["reason"]
        assert solver["n_rhs"] >= solver["n_steps"] > 0
        assert (solver["n_jac"] > 0) == (method in ("bdf", "gauss"))
        switches = 1 if MOMENT in SCENES[scene] else 0
        assert solver["n_restarts"] == switches


@pytest.mark.parametrize("scene", SCENES)
def test_the_resolved_input_gives_the_same_run(results, scene, tmp_path):
    path, _ = results[scene]
    with h5py.File(path) as file:
        text = file.attrs["resolved_input"].decode()
    again = run_scene(tmp_path, text, "again")
    with h5py.File(path) as first, h5py.File(again) as second:
        assert second.attrs["resolved_input"].decode() == text
        assert set(first) == set(second)
        for name, item in first.items():
            if isinstance(item, h5py.Dataset):
                assert item[:].tobytes() == second[name][:].tobytes(), name


def test_a_run_with_a_ledger_makes_the_same_steps_as_one_without(tmp_path):
    for method in ("adams", "bdf", "erk", "dop853", "gauss"):
        text = SCENES["flexible"] + f"&solver method = '{method}' /\n"
        with_ledger = run_scene(tmp_path, text, f"{method}1")
        without = run_scene(tmp_path, text + NO_LEDGER, f"{method}2")
        with h5py.File(with_ledger) as first, h5py.File(without) as second:
            for name in (*ROD_STATES, *SCALAR_STATES):
                assert first[name][:].tobytes() == second[name][:].tobytes(), (method, name)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGUSR1", "SIGUSR2", "SIGHUP", "SIGXCPU", "SIGINT"])
def test_a_signal_stops_a_run_that_can_be_made_again(tmp_path: pathlib.Path, name: str) -> None:
    """Exit 75, rows until then beside the place of the result, and the same command works again."""
    case = tmp_path / "long.nml"
    text = (ROOT / "cases" / "table1.nml").read_text()
    case.write_text(text.replace("t_end = 30 ", "t_end = 10000 "))
    command = [str(RODYN), "run", str(case), "--output", str(tmp_path / "long.h5")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                          preexec_fn=lambda: signal.signal(getattr(signal, name), signal.SIG_DFL)) as process:
        wait_for_start(tmp_path)
        process.send_signal(getattr(signal, name))
        start = time.monotonic()
        errors = process.communicate(timeout=30)[1]
    assert process.returncode == 75, errors
    assert time.monotonic() - start < 5.0
    assert "stopped" in errors
    assert [path.name for path in tmp_path.glob("long.h5*")] == ["long.h5.stopped"]
    with h5py.File(tmp_path / "long.h5.stopped") as rows:
        assert rows.attrs["status"] == b"stopped"
        assert rows["time"].size > 0
    case.write_text(text.replace("t_end = 30 ", "t_end = 0.1 "))
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_of_two_stops_the_more_rows_stay(tmp_path):
    """A second, earlier stop costs nothing, a later one is kept; rows of another case stay where they are."""
    text = SCENES["flexible"].replace("t_end = 0.05, n_outputs = 5", "t_end = 1000, n_outputs = 10000000")

    def stop(seconds: float, name: str = "case.h5.stopped") -> float:
        with subprocess.Popen([RODYN, "run", "case.nml", "--quiet"], cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
            wait_for_start(tmp_path)
            time.sleep(seconds)
            process.terminate()
            errors = process.communicate(timeout=30)[1]
        assert process.returncode == 75 and f"in {name}" in errors, errors
        with h5py.File(tmp_path / name) as rows:
            assert rows.attrs["t_reached"] == rows["time"][-1]
            return rows.attrs["t_reached"]

    write_case(tmp_path, text)
    first = stop(0.2)
    before = (tmp_path / "case.h5.stopped").read_bytes()
    assert stop(0.0) == first and (tmp_path / "case.h5.stopped").read_bytes() == before
    assert stop(1.0) > first
    assert files(tmp_path) == ["case.h5.stopped", "case.nml"]
    longest = (tmp_path / "case.h5.stopped").read_bytes()
    write_case(tmp_path, text.replace("1500", "1501"))
    assert stop(0.2, "case.h5.stopped-1") <= stop(1.0, "case.h5.stopped-1")
    assert files(tmp_path) == ["case.h5.stopped", "case.h5.stopped-1", "case.nml"]
    assert (tmp_path / "case.h5.stopped").read_bytes() == longest


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can work as somebody else")
def test_rows_of_a_stopped_run_do_not_depend_on_a_file_of_somebody_else():
    """In a directory such as /tmp nobody may rename what another user has stopped."""
    with tempfile.TemporaryDirectory() as name:
        place = pathlib.Path(name)
        place.chmod(0o1777)
        shutil.copy(RODYN, place / "rodyn")
        write_case(place, SCENES["flexible"].replace("t_end = 0.05, n_outputs = 5", "t_end = 1000, n_outputs = 10000000"))
        (place / "case.h5.stopped").write_text("of another user")
        with subprocess.Popen([place / "rodyn", "run", "case.nml", "--quiet"], cwd=place, stderr=subprocess.PIPE, text=True,
                              user=65534) as process:
            wait_for_start(place)
            process.terminate()
            errors = process.communicate(timeout=30)[1]
        assert process.returncode == 75 and "case.h5.stopped-1" in errors, errors
        with h5py.File(place / "case.h5.stopped-1") as rows:
            assert rows.attrs["status"] == b"stopped" and rows["time"][-1] == rows.attrs["t_reached"]


def test_a_run_can_be_looked_at_while_it_grows(tmp_path):
    """By xarray and by the scripts, under its temporary name; and kill -9 leaves the rows."""
    write_case(tmp_path, SCENES["flexible"].replace("t_end = 0.05, n_outputs = 5", "t_end = 10000, n_outputs = 100000"))
    with subprocess.Popen([RODYN, "run", "case.nml", "--quiet"], cwd=tmp_path) as process:
        path = tmp_path / f"case.h5.partial-{process.pid}"
        sizes = [1]
        end = time.monotonic() + 60
        while len(sizes) < 3 and time.monotonic() < end:
            time.sleep(0.05)
            try:
                run = result_files.read(path)  # xarray leaves a file open that is being written, and HDF5 then never looks at it again
            except (OSError, KeyError, RuntimeError):  # not there yet, or being written just now
                continue
            if not (np.all(np.isfinite(run.phi)) and np.all(np.diff(run.time) > 0)):
                continue  # likewise: its last rows are not there yet
            if run.sizes["time"] > sizes[-1] and run.attrs["status"] == "running":
                sizes.append(run.sizes["time"])
        process.kill()  # long before it writes again
    assert len(sizes) == 3, sizes
    with xarray.open_dataset(path) as run:
        assert run.sizes["time"] == sizes[-1] and np.all(np.isfinite(run.load().energy_residual))
        assert run.attrs["status"] == "running"
    drawn = subprocess.run([sys.executable, ROOT / "postproc" / "histories.py", path, "-q", "omega", "-o", tmp_path / "omega.png"],
                           capture_output=True, text=True)
    assert drawn.returncode == 0, drawn.stderr


def test_a_directory_that_is_removed_under_way_is_made_again(tmp_path):
    write_case(tmp_path, (ROOT / "cases" / "table1.nml").read_text().replace("t_end = 30 ", "t_end = 60 "))
    (tmp_path / "out").mkdir()
    with subprocess.Popen([RODYN, "run", "case.nml", "--output", "out/x.h5", "--quiet"], cwd=tmp_path) as process:
        wait_for_start(tmp_path / "out")
        shutil.rmtree(tmp_path / "out")
        assert process.wait(60) == 0
    assert files(tmp_path / "out") == ["x.h5"]
    with h5py.File(tmp_path / "out" / "x.h5") as run:
        assert run.attrs["status"] == b"done" and run["time"][-1] == 60


def wait_for_start(directory: pathlib.Path) -> None:
    """Until a run has begun its file."""
    end = time.monotonic() + 30.0
    while not list(directory.glob("*.partial-*")) and time.monotonic() < end:
        time.sleep(0.02)
    time.sleep(0.1)


def test_a_signal_that_is_ignored_stays_so(tmp_path):
    """As SIGHUP is under nohup."""
    write_case(tmp_path, (ROOT / "cases" / "table1.nml").read_text())
    with subprocess.Popen([RODYN, "run", "case.nml", "--output", "case.h5"], cwd=tmp_path, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN)) as process:
        wait_for_start(tmp_path)
        process.send_signal(signal.SIGHUP)
        errors = process.communicate(timeout=60)[1]
    assert process.returncode == 0, errors
    assert files(tmp_path) == ["case.h5", "case.nml"]


@pytest.mark.parametrize("command", ["run", "modes", "sweep"])
def test_a_reader_who_leaves_does_not_end_a_command(tmp_path, command):
    """As in `rodyn run case.nml | head -1`, and with standard error into the same pipe."""
    write_case(tmp_path, SCENES["flexible"])
    (tmp_path / "s.nml").write_text("&sweep base = 'case.nml' /\n&axis key = 'case.t_end', values = 0.01, 0.02 /\n")
    for number, also in enumerate(({}, {"stderr": subprocess.STDOUT})):
        read, write = os.pipe()
        os.close(read)
        done = subprocess.run([RODYN, command, "s.nml" if command == "sweep" else "case.nml", "--output", f"out{number}"],
                              cwd=tmp_path, stdout=write, timeout=60, **also)
        os.close(write)
        assert done.returncode == 0
        assert (tmp_path / f"out{number}").exists()


def test_the_number_of_threads_does_not_change_a_run(tmp_path):
    """LAPACK in several threads rounds otherwise."""
    case = ROOT / "bench" / "work_precision" / "table1.nml"
    phi = []
    for threads in ("1", "2"):
        result = rodyn("run", case, "--output", f"{threads}.h5", cwd=tmp_path, env=os.environ | {"OPENBLAS_NUM_THREADS": threads})
        assert result.returncode == 0, result.stderr
        with h5py.File(tmp_path / f"{threads}.h5") as run:
            phi.append(run["phi"][:])
    assert np.array_equal(*phi)
