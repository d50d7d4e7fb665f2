"""The folders of src/rodyn are layers: nothing uses what stands above it (tools/layers.py, docs/developers.md)."""

import graphlib
import pathlib
import re
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import layers  # noqa: E402


def test_no_folder_uses_what_stands_beside_or_above_it():
    assert layers.faults() == []


def test_folders_use_each_other_one_way_only():
    uses = {}
    for _, folder, _, other in layers.read_uses():
        uses.setdefault(folder, set()).update({other} - {folder})
    graphlib.TopologicalSorter(uses).prepare()  # raises CycleError


def test_all_uses_are_seen():
    """As many as a plain look for words finds."""
    lines = [line.split() for path in (ROOT / "src" / "rodyn").rglob("*.f90") for line in path.read_text().splitlines()]
    plain = [words for words in lines if words[:1] == ["use"] and words[1].startswith("rodyn")]
    assert len(layers.read_uses()) == len(plain) > 800


def test_the_library_of_integrators_knows_no_scene():
    assert layers.may_use("integration") == {"base", "ode"} and layers.may_use("ode") == {"base"}
    assert layers.may_use("simulation") == {"base", "case", "scene", "ode", "input", "dynamics", "integration"}


@pytest.mark.parametrize(("path", "line", "words"), [
    ("scene/a.f90", "   use rodyn_run_file, only: run_file", "scene may not use rodyn_run_file of output"),
    ("integration/a.f90", "   USE :: rodyn_scene", "integration may not use rodyn_scene of scene"),
    ("dynamics/a.f90", "use rodyn_integrator", "dynamics may not use rodyn_integrator of integration"),
    ("ode/a.f90", "submodule (rodyn_scene) rodyn_a", "ode may not use rodyn_scene of scene"),
    ("base/a.f90", "   use, non_intrinsic :: rodyn_b", "base may not use rodyn_b of no folder"),
    ("case/a.f90", "   use rodyn", "case may not use rodyn of no folder"),
])
def test_what_breaks_the_order_is_named(small_tree, path, line, words):
    (small_tree / path).write_text(f"!> A module.\n{line}\n")
    assert layers.faults(small_tree.parents[1]) == [f"src/rodyn/{path}:2: {words}"]


@pytest.mark.parametrize("folder", ["extras", ".", "scene/inner"])
def test_a_folder_without_a_layer_is_named(small_tree, folder):
    (small_tree / folder).mkdir(exist_ok=True)
    (small_tree / folder / "a.f90").write_text("module rodyn_a\nend module rodyn_a\n")
    assert layers.faults(small_tree.parents[1]) == [f"src/rodyn/{folder}: a folder without a layer (ORDER in tools/layers.py)"]


@pytest.fixture
def small_tree(tmp_path):
    """Sources with one module in each folder, in order."""
    modules = {folder: f"rodyn_{folder}" for row in layers.ORDER for folder in row}
    for folder, module in (modules | {"output": "rodyn_run_file", "integration": "rodyn_integrator"}).items():
        (tmp_path / "src" / "rodyn" / folder).mkdir(parents=True)
        (tmp_path / "src" / "rodyn" / folder / "its.f90").write_text(f"module {module}\nend module {module}\n")
    assert layers.faults(tmp_path) == []
    return tmp_path / "src" / "rodyn"


def test_the_guide_has_the_layers_of_the_code():
    text = layers.GUIDE.read_text()
    assert text.split(layers.BEGIN)[1].split(layers.END)[0] == layers.section(), "run tools/layers.py --write"


def test_the_guide_names_files_and_procedures_that_exist():
    text = layers.GUIDE.read_text()
    for path in re.findall(r"`(?!build/)((?:\w+/)+\w+\.\w+)`", text):
        assert (ROOT / path).exists() or (ROOT / "src" / "rodyn" / path).exists(), path
    sources = "\n".join(path.read_text() for path in (ROOT / "src").rglob("*.f90"))
    for name in re.findall(r"`(\w+)`", text.split(layers.END)[1]):
        assert any(name in row for row in layers.ORDER) or re.search(rf"\b{name}\b", sources), name
