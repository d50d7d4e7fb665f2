"""Warnings on axial force: given where benchmarks are more than 1 % off, gone once a beam is cut as they say; in runs, modes and sweeps."""

import os
import pathlib
import re
import subprocess
import sys

import h5py
import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
RODYN = os.environ.get("RODYN", str(ROOT / "bin" / "rodyn"))
sys.path.insert(0, str(ROOT / "bench" / "validation"))

import axial_limit  # noqa: E402
import benchmarks  # noqa: E402
import run  # noqa: E402

WARNING = re.compile(r"the axial force in rod (\d+) is (\S+) of its Euler load pi\^2 EI/l\^2 \((\S+) N of (\w+) at t = (\S+) s\); "
                     r"above (\S+) bending .*; divide it into (\d+) rods "
                     r"with held hinges between them \(&hinge hinge = \.\.\., held = \.true\.\)"
                     r"(?:, or take formulation = 'inextensible' with dynamic bending(?:, which needs (\d+))?)?")


def rodyn(directory: pathlib.Path, command: str, text: str, *options: str) -> str:
    """The warnings in the file, which are those on the terminal, too."""
    (directory / "case.nml").write_text(text)
    done = subprocess.run([RODYN, command, "case.nml", *options, "--output", "case.h5", "--force"], cwd=directory, capture_output=True,
                          text=True, check=False)
    assert done.returncode == 0, done.stderr
    with h5py.File(directory / "case.h5") as file:
        warnings = file.attrs["warnings"].decode()
    assert warnings in done.stdout
    return warnings


def two_digits(value: float) -> float:
    return float(f"{value:.1e}")


@pytest.mark.parametrize("kind", axial_limit.KINDS)
@pytest.mark.parametrize("omega", [2, 6])
def test_a_blade_cut_as_the_warning_says_has_none_and_is_right_to_one_per_cent(tmp_path, omega, kind):
    (blade,) = (b for b in benchmarks.BENCHMARKS if b.case == "blade" and b.numbers == {"omega": omega, "radius": 0})
    keys, limit = axial_limit.KINDS[kind]

    def scene(n):
        text = benchmarks.Scene("blade", n, "", blade.numbers).text(model=keys)
        return rodyn(tmp_path, "modes", text)

    share = omega**2 / 2 / np.pi**2  # m Omega^2 int r dr at the root
    n = axial_limit.rods(share, limit)
    found = WARNING.match(scene(1))
    assert bool(found) is (n > 1)
    if found:
        assert found[1] == "1" and float(found[2]) == two_digits(share) and float(found[3]) == two_digits(omega**2 / 2)
        assert found[4] == "tension" and float(found[6]) == two_digits(limit) and int(found[7]) == n
        assert ("or take" in found[0]) is (kind == "chord")
        if kind == "chord":
            assert int(found[8] or 1) == axial_limit.rods(share, axial_limit.KINDS["arc"][1])
    assert scene(n) == ""
    with h5py.File(tmp_path / "case.h5") as file:
        lowest = file["frequency"][file["kind"][()] == b"oscillation"][0]
    assert abs(run.errors(blade.quantities[0], [lowest])[0]) < 0.01


def test_columns_cut_so_are_right_to_one_per_cent_as_the_document_says(tmp_path):
    document = (ROOT / "docs" / "stability.md").read_text(encoding="utf-8")
    for row in axial_limit.rows(benchmarks.Program(tmp_path), ["column"]):
        assert f"| {' | '.join(row)} |" in document
        assert all(abs(float(error.replace("−", "-"))) < 0.01 for error in row[3::2])


COLUMN = """&case t_end = 0.01, n_outputs = 10 /
&spacecraft motion = 'fixed' /
&chain n_rods = 2, length = 0.5, mass_per_length = 1, bending_stiffness = 1, hinge_stiffness = 0 /
&hinge hinge = 0, held = .true. /
&hinge hinge = 1, held = .true. /
&load target = 'node', node = 2, component = 'X', value = -1.0 /
&model formulation = 'consistent' /
"""


def test_the_load_on_a_column_is_its_axial_force(tmp_path):
    share = two_digits(1.0 / (4.0 * np.pi**2))
    for command, *options in (("run",), ("modes", "--loads"), ("modes", "--equilibrium")):
        found = WARNING.match(rodyn(tmp_path, command, COLUMN, *options))
        assert float(found[2]) == share and found[3] == "1" and found[4] == "compression" and found[7] == "2"
    assert rodyn(tmp_path, "modes", COLUMN) == ""  # without loads
    assert rodyn(tmp_path, "run", COLUMN.replace("'consistent'", "'inextensible'")) == ""
    assert rodyn(tmp_path, "run", COLUMN.replace("'consistent'", "'consistent', axial_error_limit = 0.03")) == ""


@pytest.mark.parametrize("model", ["bending = 'rigid'", "inertia = 'lumped', bending = 'quasistatic'", "bending = 'quasistatic'"])
def test_rods_that_bend_by_statics_are_judged_as_chords_and_rigid_ones_are_not(tmp_path, model):
    text = re.sub("&hinge .*\n", "", COLUMN).replace("hinge_stiffness = 0", "hinge_stiffness = 5").replace(
        "formulation = 'consistent'", f"formulation = 'consistent', {model}")
    assert ("divide it into 2 rods" in rodyn(tmp_path, "run", text)) is ("rigid" not in model)


@pytest.mark.parametrize("method", ["dop853", "gauss"])  # the former in lanes
@pytest.mark.parametrize("sweep", ["", "frequencies = 1, integrate = .false., ", "probe_times = 0.005, keep_series = .true., "])
def test_cases_of_a_sweep_have_it_in_their_message(tmp_path, sweep, method):
    (tmp_path / "base.nml").write_text(f"""&case t_end = 0.01, n_outputs = 10 /
&spacecraft mass = 1e12, inertia = 1e12 /
&chain n_rods = 1, length = 1, mass_per_length = 1, bending_stiffness = 1, hinge_stiffness = 100 /
&model formulation = 'consistent' /
&solver method = '{method}' /
""")
    (tmp_path / "sweep.nml").write_text(f"""&sweep base = 'base.nml', {sweep}combine = 'grid' /
&axis key = 'initial.omega', values = 0.1, 2 /
""")
    done = subprocess.run([RODYN, "sweep", "sweep.nml", "--output", "out"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "out" / "sweep.h5") as file:
        slow, fast = (message.decode() for message in file["message"][()])
    assert slow == ""
    found = WARNING.match(fast)
    assert float(found[2]) == two_digits(2.0 / np.pi**2) and found[4] == "tension" and found[7] == "5"
