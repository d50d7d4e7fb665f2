"""postproc/studies.py on the article's table 3 as it ships, and on a file that is no such study."""

import os
import pathlib
import subprocess
import sys

import h5py
import numpy as np
import pytest
from article import TABLE_3

ROOT = pathlib.Path(__file__).resolve().parents[2]
RODYN = os.environ.get("RODYN", str(ROOT / "bin" / "rodyn"))
KINDS = 3  # exact, condensed, lumped: cases of each ratio
STUDIES = [sys.executable, str(ROOT / "postproc" / "studies.py")]


def study(name: str, file: pathlib.Path) -> subprocess.CompletedProcess:
    return subprocess.run([*STUDIES, name, str(file)], capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory) -> pathlib.Path:
    directory = tmp_path_factory.mktemp("table3") / "s"
    subprocess.run([RODYN, "sweep", str(ROOT / "cases" / "sweep_table3.nml"), "--output", str(directory), "--quiet"], check=True)
    return directory / "sweep.h5"


def by_steps(t, derivative) -> np.ndarray:
    """Runge and Kutta's method of order 4 from rest; a step covers two rows."""
    u = 0.0 * derivative(0, 0.0)
    for i in range(0, t.size - 2, 2):
        h = t[i + 2] - t[i]
        k1 = derivative(i, u)
        k2 = derivative(i + 1, u + h / 2 * k1)
        k3 = derivative(i + 1, u + h / 2 * k2)
        u = u + h / 6 * (k1 + 2 * k2 + 2 * k3 + derivative(i + 2, u + h * k3))
    return u


def test_all_twenty_exact_numbers_of_table_3_have_the_printed_digits(sweep):
    with h5py.File(sweep) as file:
        t, phi, theta, v_x, v_y, omega, u_x = (file[f"series_{name}"][::KINDS] for name in (
            "time", "phi", "rotation", "velocity_x", "velocity_y", "omega", "displacement_x"))
        assert list(file["param_model.bending"][::KINDS]) == [b"dynamic"] * 5
    slipped = by_steps(t[0], lambda i, u: v_x[:, i] - omega[:, i] * u)
    true = by_steps(t[0], lambda i, u: v_x[:, i] + 1j * v_y[:, i] - 1j * omega[:, i] * u).real  # u_x + i u_y along the turning axes
    for ratio, case in zip(TABLE_3, range(5), strict=True):
        ours = [*np.degrees(phi[case, -1, [0, 3]]), slipped[case], theta[case, -1]]
        assert tuple(f"{number:.3f}" for number in ours) == TABLE_3[ratio][0], f"mass ratio {ratio}"
    # Found by another program, from the inputs behind the printed ones, to five digits.
    other = np.array([-0.56196, 0.45029, -0.80036, -0.43268, 0.42952])
    assert np.abs(u_x[:, -1] - other).max() < 0.6e-5
    assert np.abs(true - other).max() < 1e-5


def test_table_3_stands_beside_the_articles(sweep):
    result = study("table3", sweep)
    assert result.returncode == 0, result.stderr
    *lines, last = result.stdout.splitlines()[1:]
    rows = [line.split() for line in lines]
    assert [row[:2] for row in rows] == [[str(ratio), kind] for ratio in TABLE_3 for kind in ("exact", "condensed", "lumped")]
    exact, condensed, lumped = rows[::KINDS], rows[1::KINDS], rows[2::KINDS]
    assert [row[2:10:2] for row in exact] == [row[3:10:2] for row in exact] == [list(printed) for printed, _ in TABLE_3.values()]
    assert last.startswith("exact: 20 of 20 numbers are the printed ones")
    # The claim: exact and lumped come together as the nodes grow heavy.
    gaps = [abs(float(a[4]) - float(b[4])) for a, b in zip(exact, lumped, strict=True)]
    assert gaps[-1] < 0.2 * gaps[0]
    # Condensed rods have the inertia of the exact ones, less that of their bending vibration.
    assert all(20.0 * abs(float(a[4]) - float(c[3])) < gap for a, c, gap in zip(exact, condensed, gaps, strict=True))


def test_a_study_of_another_file_says_what_it_misses(sweep):
    assert study("table1", sweep).returncode == 0
    missing = study("table2", sweep)
    assert missing.returncode == 2
    assert "no probe time 30 s" in missing.stderr
