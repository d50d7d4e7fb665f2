"""What the tests of postproc/ share: the scripts on the path, fresh runs of every kind of scene, synthetic sweeps."""

import pathlib
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "postproc"))
sys.path.insert(1, str(ROOT / "bench" / "stability"))

import result_files  # noqa: E402


@pytest.fixture(scope="session")
def runs(tmp_path_factory) -> dict[str, pathlib.Path]:
    """Run files by kind of scene, made by the program under test."""
    return result_files.make_runs(tmp_path_factory.mktemp("runs"))


@pytest.fixture(scope="session")
def sweeps(tmp_path_factory) -> dict[str, pathlib.Path]:
    """Sweep files with numbers that the tests know."""
    return result_files.make_sweeps(tmp_path_factory.mktemp("sweeps"))
