"""postproc/table1.py prints what is in a run file, and says why when it cannot.

RODYN=path  the program under test; otherwise bin/rodyn.
"""

import os
import pathlib
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
RODYN = os.environ.get("RODYN", str(ROOT / "bin" / "rodyn"))
CASE = (ROOT / "cases" / "table1.nml").read_text()


def run_case(directory: pathlib.Path, *changes: tuple[str, str]) -> pathlib.Path:
    text = CASE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    case = directory / "case.nml"
    case.write_text(text)
    path = directory / "case.h5"
    subprocess.run([RODYN, "run", str(case), "--output", str(path)], check=True, capture_output=True)
    return path


def table(*arguments: str) -> subprocess.CompletedProcess[str]:
    program = [sys.executable, str(ROOT / "postproc" / "table1.py")]
    return subprocess.run([*program, *arguments], capture_output=True, text=True)


@pytest.fixture(scope="module")
def two_seconds(tmp_path_factory) -> pathlib.Path:
    return run_case(tmp_path_factory.mktemp("two"), ("t_end = 30 ", "t_end = 2 "), ("n_outputs = 3000", "n_outputs = 2"))


def test_rows_that_exist_are_compared(two_seconds):
    result = table(str(two_seconds), "--check")
    assert result.returncode == 0, result.stdout + result.stderr
    times = [line.split()[0] for line in result.stdout.splitlines() if line.split()[0] != "t,"]
    assert times == ["1", "2", "1", "2"]
    assert "0.39531 to 0.39535" in result.stdout


def test_another_scene_does_not_agree(tmp_path):
    path = run_case(tmp_path, ("t_end = 30 ", "t_end = 1 "), ("n_outputs = 3000", "n_outputs = 1"), ("'paper'", "'consistent'"))
    result = table(str(path), "--check")
    assert result.returncode == 1
    assert result.stdout.count("more than") == 2
    assert table(str(path)).returncode == 0


def test_a_run_without_these_times_is_told(tmp_path):
    path = run_case(tmp_path, ("t_end = 30 ", "t_end = 0.5 "), ("n_outputs = 3000", "n_outputs = 2"))
    result = table(str(path))
    assert result.returncode == 2 and result.stdout == ""
    assert "no row at t = 1, 2, 30" in result.stderr and "3 rows, 0 to 0.5 s" in result.stderr


def test_a_file_that_is_no_run_is_told(tmp_path):
    path = tmp_path / "text.h5"
    path.write_text("not HDF5")
    result = table(str(path))
    assert result.returncode == 2
    assert result.stderr.startswith(f"{path}: ") and len(result.stderr.splitlines()) == 1
