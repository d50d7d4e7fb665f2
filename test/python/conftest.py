"""What the tests of postproc/ share: the scripts on the path, fresh runs of every kind of scene, synthetic sweeps."""

import pathlib
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "postproc"))
sys.path.insert(1, str(ROOT / "bench" / "stability"))

import result_files  # noqa: E402


def pytest_addoption(parser):
    parser.addoption("--all", action="store_true", help="also the tests that take long")


def pytest_configure(config):
    config.addinivalue_line("markers", "long: takes many seconds, runs with --all only")


def pytest_collection_modifyitems(config, items):
    long = [item for item in items if item.get_closest_marker("long")]
    if long and not config.getoption("--all"):
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if item not in long]


@pytest.fixture(scope="session")
def runs(tmp_path_factory) -> dict[str, pathlib.Path]:
    """Run files by kind of scene, made by the program under test."""
    return result_files.make_runs(tmp_path_factory.mktemp("runs"))


@pytest.fixture(scope="session")
def sweeps(tmp_path_factory) -> dict[str, pathlib.Path]:
    """Sweep files with numbers that the tests know."""
    return result_files.make_sweeps(tmp_path_factory.mktemp("sweeps"))
