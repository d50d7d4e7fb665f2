"""The quick part of bench/work_precision/beams.py: its file, its table and its picture; nothing is timed."""

import pathlib
import subprocess
import sys

import h5py
import numpy as np
import pytest
import work_precision
from rodyn_data import read_benchmark

ROOT = pathlib.Path(__file__).resolve().parents[2]
MODELS = ("consistent, 2", "inextensible, 2", "condensed")


pytestmark = pytest.mark.long  # all of them look at what takes twelve seconds to compute


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("beams") / "quick"
    command = [sys.executable, ROOT / "bench/work_precision/beams.py", "--quick", "--rounds", "1", "--models", *MODELS, "--out", out]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    return out


def test_each_chain_has_a_setting_whose_error_is_a_fifth_of_its_own(made):
    # By the equations of docs/model.md in plain Python (consistent, condensed), and of docs/validation.md's spin-up.
    known = {("condensed", 1): 1.841e-2, ("condensed", 2): 5.59e-3,
             ("inextensible, 2 shapes", 1): 1.25e-3, ("inextensible, 2 shapes", 2): 1.8e-4}
    with h5py.File(made.with_suffix(".h5")) as file:
        (scene,) = file.values()
        assert scene.attrs["agreement"] < 1e-4
        rows = [dict(zip(scene, values, strict=True)) for values in zip(*(scene[name][()] for name in scene), strict=True)]
    chosen = {(row["model"].decode(), row["rods"]): row for row in rows if row["chosen"]}
    assert len(chosen) == 2 * len(MODELS)
    for chain, row in chosen.items():
        assert row["error_model"] == pytest.approx(known.get(chain, row["error_model"]), rel=0.05)
        assert row["error_integration"] <= 0.2 * row["error_model"]
        assert abs(row["error_beam"] - row["error_model"]) <= row["error_integration"] * (1.0 + 1e-9)
        assert row["n_rhs"] > 0 and 0.0 < row["seconds"] <= row["seconds_median"]


def test_the_picture_has_a_line_per_model_and_a_point_per_number_of_rods(made):
    assert made.with_suffix(".png").is_file()
    (scene,) = read_benchmark(made.with_suffix(".h5"))
    (axes,) = work_precision.draw([scene]).axes
    assert [text.get_text() for text in axes.texts] == ["1", "2"] * len(MODELS)
    for line in axes.lines:
        mine = scene.line == line.get_label()
        order = np.argsort(scene.rods[mine])
        assert line.get_xdata().tolist() == scene.errors["error_beam"][1][mine][order].tolist()
        assert line.get_ydata().tolist() == scene.seconds[mine][order].tolist()


def test_the_table_names_the_fastest_chain_within_each_error(made):
    lines = made.with_suffix(".md").read_text(encoding="utf-8").splitlines()
    cells = {line.split("|")[1].strip(): [cell.strip() for cell in line.split("|")[2:-1]] for line in lines if line.startswith("| ")}
    assert "condensed" not in cells
    assert [cell.split(", ")[1:] for cell in cells["inextensible, 2 shapes"]] == [["1"], ["2"], ["2"], []]
