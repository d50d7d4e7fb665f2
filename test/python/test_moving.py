"""Cases that deploy: events in the file, on the terminal and in pictures; closed forms of the shipped cases."""

import pathlib
import subprocess

import h5py
import histories
import numpy as np
import pytest
import result_files
import spectrum
import xarray
from natural_frequencies import natural_frequencies
from rodyn_data import open_run

CASES = result_files.ROOT / "cases"


def run(case, output, *replacements):
    text = pathlib.Path(case).read_text()
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    path = output.with_suffix(".nml")
    path.write_text(text)
    return subprocess.run([result_files.RODYN, "run", str(path), "--output", str(output)], capture_output=True, text=True)


@pytest.fixture(scope="module")
def deployment(tmp_path_factory):
    output = tmp_path_factory.mktemp("deployment") / "d.h5"
    done = run(CASES / "deployment.nml", output)
    assert done.returncode == 0, done.stderr
    return output, done.stdout


def test_each_latch_of_the_deployment_loses_what_its_spring_gave(deployment):
    with open_run(deployment[0]) as result:
        events = result.events()
        momenta = [result.rows(name) for name in ("momentum_x", "momentum_y", "angular_momentum")]
        phi, rates, residual = result.rows("phi"), result.rows("phi_rate"), result.rows("energy_residual")
    assert [(e.hinge, e.kind) for e in events] == [
        (0, "released"), (0, "latched"), (1, "released"), (1, "latched"), (2, "released"), (2, "latched"), (3, "released"),
        (3, "latched"),
    ]
    lost = [e.energy_lost for e in events if e.kind == "latched"]
    np.testing.assert_allclose(lost, [3.52, 9.52, 9.52, 9.52], atol=1e-8)
    assert np.max(np.abs(momenta)) < 1e-9
    assert np.max(np.abs(phi[-1])) < 1e-9 and np.max(np.abs(rates[-1])) < 1e-9
    assert np.max(np.abs(residual)) < 1e-9 * 32.08


def test_events_stand_on_the_terminal_and_open_in_xarray(deployment):
    output, printed = deployment
    assert "event   t = 1 s: hinge 0 released, 0.000E+00 J lost" in printed
    assert printed.count(" latched, ") == 4
    with xarray.open_dataset(output, group="events") as events:
        assert events.energy_lost.dims == ("time",) and events.energy_lost.attrs["units"] == "J"
        assert events.kind.values[1] == "latched"


def test_events_are_marked_in_histories(deployment, tmp_path):
    figure = histories.plot(deployment[0], tmp_path / "h", ["phi(1)"])
    (axes,) = [a for a in figure.axes if a.get_visible()]
    marks = [line for line in axes.lines if line.get_linestyle() == ":" and len(set(line.get_xdata())) == 1]
    assert len(marks) == 5  # one release by time, four latchings that release the next


def test_a_spectrum_has_no_natural_frequencies_of_hinges_that_change(deployment, tmp_path):
    with open_run(deployment[0]) as result:
        assert natural_frequencies(result).size == 0
    figure = spectrum.plot(deployment[0], tmp_path / "s.png", ["phi(1)"])
    assert len(figure.axes[0].lines) == 1
    assert figure.axes[0].get_xlabel().endswith("; natural frequencies are not marked: the scene has &hinge (see rodyn modes)")


def test_a_case_without_laws_of_hinges_has_no_events(runs):
    with h5py.File(runs["n4"]) as file:
        assert "events" not in file


def test_the_accordion_comes_to_rest_folded_and_keeps_its_momentum(tmp_path):
    done = run(CASES / "accordion.nml", tmp_path / "a.h5")
    assert done.returncode == 0, done.stderr
    with open_run(tmp_path / "a.h5") as result:
        phi, residual, scale = result.rows("phi"), result.rows("energy_residual"), result.rows("energy_kinetic").max()
        momenta = [result.rows(name) for name in ("momentum_x", "momentum_y", "angular_momentum")]
    np.testing.assert_allclose(phi[-1], np.cumsum([0, -1, 1, -1, 1, -1]) * 2 * np.pi / 3, atol=2e-2)
    assert np.max(np.abs(momenta)) < 1e-9
    assert np.max(np.abs(residual)) < 1e-9 * scale


def test_too_many_events_end_the_run_with_a_message(tmp_path):
    done = run(CASES / "deployment.nml", tmp_path / "e.h5", ("&solver ", "&solver max_events = 3, "))
    assert done.returncode == 1
    assert "max_events = 3 reached at t = 6.70" in done.stderr
    with open_run(tmp_path / "e.h5") as result:
        assert result.status == "failed" and len(result.events()) == 4


def test_a_sweep_of_a_deployment_goes_one_by_one_and_says_so(tmp_path):
    (tmp_path / "base.nml").write_text((CASES / "deployment.nml").read_text())
    (tmp_path / "s.nml").write_text(
        "&sweep base = 'base.nml' /\n&axis key = 'chain.hinge_stiffness', start = 1, stop = 3, count = 16 /\n"
    )
    done = subprocess.run(
        [result_files.RODYN, "sweep", str(tmp_path / "s.nml"), "--output", str(tmp_path / "out")], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "one by one (hinges move by programs or have events)" in done.stdout
    with h5py.File(tmp_path / "out" / "sweep.h5") as file:
        assert all(status in (b"done", "done") for status in file["status"][()])
        assert np.max(np.abs(file["final_phi"][()])) < 1e-8
