"""rodyn sweep: what is in sweep.h5, and that nothing is lost, doubled or overwritten.

RODYN=path  the program under test; otherwise bin/rodyn.
"""

import math
import os
import pathlib
import re
import resource
import shutil
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest
import result_files
import xarray

ROOT = pathlib.Path(__file__).resolve().parents[2]
RODYN = os.environ.get("RODYN", str(ROOT / "bin" / "rodyn"))
sys.path.insert(0, str(ROOT / "bench" / "sweeps"))
sys.path.insert(0, str(ROOT / "postproc"))
from campaign import content, results  # noqa: E402
from rodyn_data import open_sweep  # noqa: E402

BASE = """
&case t_end = 0.05, n_outputs = 5 /
&spacecraft mass = 122.5, inertia = 10, hinge_x = 0.35, hinge_y = 0.35 /
&chain n_rods = 3, length = 1.5, 1.0, 2.0, mass_per_length = 0.509, bending_stiffness = 1.374e4, node_mass = 0.5,
       hinge_stiffness = 5000, hinge_damping = 0.01 /
&load component = 'M', t_end = 1, value = 1000 /
&load component = 'X', t_end = 1, value = 10 /
&solver rtol = 1e-6, atol = 1e-8 /
"""
GRID = """&sweep base = 'base.nml', probe_times = 0.02, 0.05 /
&axis key = 'mass_ratio', values = 2, 4, 8 /
&axis key = 'model.inertia', text_values = 'distributed', 'lumped' /
"""


@pytest.fixture
def here(tmp_path) -> pathlib.Path:
    (tmp_path / "base.nml").write_text(BASE)
    return tmp_path


def sweep(here: pathlib.Path, text: str | None, *options: str, name: str = "s", code: int = 0):
    if text is not None:
        (here / f"{name}.nml").write_text(text)
    result = subprocess.run([RODYN, "sweep", f"{name}.nml", *options], cwd=here, capture_output=True, text=True)
    assert result.returncode == code, result.stdout + result.stderr
    return result


def opened(here: pathlib.Path, name: str = "s") -> xarray.Dataset:
    return result_files.read(here / name / "sweep.h5")


def single(here: pathlib.Path, *changes: tuple[str, str]) -> xarray.Dataset:
    """One run of the base with changes."""
    text = BASE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (here / "one.nml").write_text(text)
    subprocess.run([RODYN, "run", "one.nml", "--force", "--quiet"], cwd=here, check=True)
    return result_files.read(here / "one.h5")


def test_a_grid_is_the_same_as_single_runs(here):
    sweep(here, GRID)
    data = opened(here)
    xarray.testing.assert_identical(data, xarray.load_dataset(here / "s" / "sweep.h5"))
    assert dict(data.sizes) == {"case": 6, "probe_time": 2, "rod": 3}
    assert list(data.param_mass_ratio) == [2, 2, 4, 4, 8, 8]
    assert list(data["param_model.inertia"]) == ["distributed", "lumped"] * 3
    assert set(data.status.values) == {"done"}
    node = 4 * (4.5 * 0.509) / 3
    for case, model in ((2, ""), (3, "&model inertia = 'lumped', bending = 'quasistatic' /")):
        run = single(here, ("node_mass = 0.5", f"node_mass = {node!r}"), ("&solver", model + "&solver"))
        for name in ("phi", "alpha", "beta_rate", "omega", "rotation", "displacement_x"):
            expected = run[name].sel(time=[0.02, 0.05], method="nearest")
            # the mass in the file differs by rounding, and so may the steps
            np.testing.assert_allclose(data[name][case], expected, rtol=0, atol=1e-6 * float(np.abs(run[name]).max() + 1))
        np.testing.assert_array_equal(data.final_phi[case], data.phi[case, -1])


def test_every_variable_has_unit_and_meaning(here):
    sweep(here, GRID)
    data = opened(here)
    for name, variable in data.variables.items():
        assert "long_name" in variable.attrs, name
        assert "units" in variable.attrs or variable.dtype.kind in "OUT", name


def test_zip_takes_first_with_first(here):
    sweep(here, """&sweep base = 'base.nml', combine = 'zip' /
        &axis key = 'chain.hinge_stiffness(0)', start = 1000, stop = 4000, count = 3, spacing = 'log' /
        &axis key = 'load(2).value', values = 1, 2, 3 /""")
    data = opened(here)
    np.testing.assert_allclose(data["param_chain.hinge_stiffness(0)"], [1000, 2000, 4000], rtol=1e-15)
    assert list(data["param_load(2).value"]) == [1, 2, 3]
    assert data["param_chain.hinge_stiffness(0)"].units == "N m/rad"


MOVING = """
&case t_end = 0.5, n_outputs = 5 /
&spacecraft mass = 20, inertia = 8, hinge_x = 0.4 /
&chain n_rods = 3, length = 1, mass_per_length = 1.5, bending_stiffness = 900, hinge_stiffness = 40 /
&rod_profile quantity = 'mass_per_length', polynomial = 1, 0.5 /
&rod_profile quantity = 'bending_stiffness', polynomial = 2*1.0, -0.5 /
&model bending = 'quasistatic', inertia = 'lumped' /
&kink_program hinge = 0, t_end = 0.4, value = 0.2 /
&kink_program hinge = 1, law = 'table', times = 0, 0.2, 0.4, values = 0, 0.1, 0.05 /
&hinge hinge = 2, rest_angle = 0.3 /
&hinge hinge = 1, held = .true., release_time = 0.1, rest_angle = 0.2 /
&solver method = 'dop853', rtol = 1e-9, atol = 1e-11 /
"""


@pytest.mark.parametrize(("key", "values", "old", "new"), [
    ("hinge(2).release_time", "0.1, 0.3", "release_time = 0.1", "release_time = 0.3"),
    ("hinge(1).hinge", "2, 0", "hinge = 2,", "hinge = 0,"),
    ("kink_program(1).value", "0.2, 0.4", "value = 0.2 /", "value = 0.4 /"),
    ("kink_program(2).values(2)", "0.1, 0.3", "0, 0.1, 0.05", "0, 0.3, 0.05"),
    ("rod_profile(2).polynomial(2)", "1.0, 0.25", "2*1.0, -0.5", "1.0, 0.25, -0.5"),
    ("rod_profile(1).first_rod", "1, 2", "polynomial = 1, 0.5", "first_rod = 2, polynomial = 1, 0.5"),
])
def test_keys_of_repeated_groups_are_axes(here, key, values, old, new):
    """The second value is that of a single run of the changed base; the first one is not."""
    assert MOVING.count(old) == 1
    (here / "base.nml").write_text(MOVING)
    (here / "one.nml").write_text(MOVING.replace(old, new))
    sweep(here, f"&sweep base = 'base.nml' /\n&axis key = '{key}', values = {values} /")
    subprocess.run([RODYN, "run", "one.nml", "--quiet"], cwd=here, check=True)
    data = opened(here)
    assert list(data[f"param_{key}"]) == [float(value) for value in values.split(",")]
    run = result_files.read(here / "one.h5")
    np.testing.assert_allclose(data.final_phi[1], run.phi[-1], rtol=0, atol=1e-12)
    assert np.abs(data.final_phi[0] - run.phi[-1]).max() > 1e-4
    with open_sweep(here / "s" / "sweep.h5") as read:
        assert list(read.axes) == [key] and key.split("(")[0] in read.axis_label(key)


def test_angles_of_axes_that_look_like_degrees_are_noted(here):
    (here / "degrees.nml").write_text("&sweep base = 'base.nml' /\n&axis key = 'initial.phi', values = 45, 90 /\n"
                                      "&axis key = 'chain.length', values = 45, 90 /\n")
    done = subprocess.run([RODYN, "check", "degrees.nml"], cwd=here, capture_output=True, text=True)
    assert done.stdout.splitlines()[1:] == [
        "note    axis initial.phi = 45 rad is 7.161972 turns; if degrees were meant, write 0.785398"], done.stderr


def test_a_refused_combination_shows_numbers_by_as_few_digits_as_they_have(here):
    sweep(here, "&sweep base = 'base.nml' /\n&axis key = 'load(1).t_start', values = 0.05, 0.6000000000000001 /\n"
          "&axis key = 'load(1).t_end', values = 0.3, 0.9 /", code=1)
    (message,) = [text for text in opened(here).message.values.astype(str) if text]
    assert "&load t_start = 0.6000000000000001: must not be after t_end = 0.300000 [s] of the same load" in message


def test_a_hinge_is_held_or_not(here):
    (here / "base.nml").write_text(MOVING.replace(", release_time = 0.1", ""))
    sweep(here, "&sweep base = 'base.nml' /\n&axis key = 'hinge(2).held', text_values = '.true.', '.false.' /")
    assert list(opened(here)["param_hinge(2).held"]) == [".true.", ".false."]
    assert set(opened(here).status.values) == {"done"}


@pytest.mark.parametrize(("key", "message"), [
    ("hinge(3).rest_angle", "the base has 2 groups &hinge; the index counts them in the order of the file"),
    ("hinge.rest_angle", "the base has 2 groups &hinge; specify one, as in hinge(1).rest_angle"),
    ("hinge(0).rest_angle", "a key is written group.name"),
    ("hinge(2).rest_angle(1)", "takes no index"),
    ("load(1).value", "the base has no group &load"),
    ("chain(1).length", "&chain is not repeatable: write chain.length"),
    ("chain.length(4)", "there is no such rod; the numbers are 1..3"),
    ("kink_program(2).values(4)", "there is no such element; the array has 3, numbered from 1"),
    ("rod_profile(1).values(1)", "the base has no array with such an element"),
])
def test_groups_and_elements_that_are_not_there(here, key, message):
    (here / "base.nml").write_text(MOVING)
    assert message in sweep(here, f"&sweep base = 'base.nml' /\n&axis key = '{key}', values = 1 /", code=2).stderr


def test_one_key_by_two_names_is_one_key(here):
    (here / "base.nml").write_text(BASE.replace("&load component = 'X', t_end = 1, value = 10 /", ""))
    text = "&sweep base = 'base.nml' /\n&axis key = 'load.value', values = 1 /\n&axis key = 'load(1).value', values = 2 /"
    assert "the key already has an axis" in sweep(here, text, code=2).stderr


def test_an_axis_along_another_stays_with_it_in_a_grid(here):
    sweep(here, """&sweep base = 'base.nml' /
        &axis key = 'solver.rtol', values = 1e-5, 1e-7 /
        &axis key = 'model.gauss_points', values = 4, 5, 6 /
        &axis key = 'solver.atol', values = 1e-7, 1e-9, along = 'solver.rtol' /""")
    data = opened(here)
    assert data.sizes["case"] == 6
    np.testing.assert_allclose(data["param_solver.atol"] / data["param_solver.rtol"], 0.01)


def test_equal_cases_run_once(here):
    result = sweep(here, """&sweep base = 'base.nml' /
        &axis key = 'mass_ratio', values = 2, 3, 2 /
        &axis key = 'case.n_outputs', start = 1, stop = 3, count = 5 /""")
    assert "15 cases, 6 to compute" in result.stdout
    data = opened(here)
    assert list(data.same_as) == [1, 2, 2, 4, 4, 6, 7, 7, 9, 9, 1, 2, 2, 4, 4]
    np.testing.assert_array_equal(data.phi[0], data.phi[10])


def test_output_steps_do_not_change_the_integration(here):
    sweep(here, "&sweep base = 'base.nml' /\n&axis key = 'case.n_outputs', values = 1, 10, 1000 /")
    data = opened(here)
    assert list(data.same_as) == [1, 2, 3]
    assert len(np.unique(data.n_steps)) == 1 and len(np.unique(data.phi[:, 0, 2])) == 1


def test_series_are_kept_on_request(here):
    sweep(here, """&sweep base = 'base.nml', keep_series = .true., probe_times = 0.03 /
        &axis key = 'case.n_outputs', values = 5, 3 /""")
    data = opened(here)
    assert data.series_phi.shape == (2, 6, 3)
    np.testing.assert_allclose(data.series_time[0], np.linspace(0, 0.05, 6), atol=1e-17)
    assert list(np.isnan(data.series_time[1])) == [False] * 4 + [True] * 2
    run = single(here)
    # The same but for rounding: a run has a ledger.
    np.testing.assert_allclose(data.series_phi[0], run.phi, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(data.final_phi[0], run.phi[-1], rtol=1e-13, atol=1e-15)


def test_two_and_three_bending_shapes_fit_in_one_file(here):
    model = "&model gauss_points = 5 /\n"
    loose, tight = "&solver rtol = 1e-6, atol = 1e-8", "&solver rtol = 1e-11, atol = 1e-13"
    (here / "base.nml").write_text(BASE.replace(loose, tight) + model)
    sweep(here, "&sweep base = 'base.nml', keep_series = .true. /\n&axis key = 'model.bending_shapes', values = 2, 3 /")
    data = opened(here)
    assert data.series_bubble.shape == (2, 6, 3)
    assert not data.series_bubble[0].any() and not data.final_bubble_rate[0].any()
    run = single(here, (loose, "&model bending_shapes = 3, gauss_points = 5 /\n" + tight))
    for name in ("bubble", "bubble_rate", "phi", "rotation"):
        np.testing.assert_allclose(data[f"series_{name}"][1], run[name], rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(data[f"final_{name}"][1], run[name][-1], rtol=1e-8, atol=1e-9)


def test_chains_of_different_length_fit_in_one_file(here):
    text = BASE.replace("length = 1.5, 1.0, 2.0", "length = 1.5")
    (here / "base.nml").write_text(text)
    sweep(here, "&sweep base = 'base.nml' /\n&axis key = 'chain.n_rods', values = 2, 4 /")
    data = opened(here)
    assert list(np.isnan(data.phi[0, 0])) == [False, False, True, True] and not np.isnan(data.phi[1]).any()


def test_probes_behind_the_end_are_nan(here):
    sweep(here, "&sweep base = 'base.nml', probe_times = 0.02, 0.05 /\n&axis key = 'case.t_end', values = 0.03, 0.05 /")
    data = opened(here)
    assert list(data.status) == ["done", "done"] and list(np.isnan(data.omega[0])) == [False, True]
    np.testing.assert_array_equal(data.omega[0, 0], data.omega[1, 0])
    assert list(data.t_reached) == [0.03, 0.05]


def test_a_failed_case_is_nan_and_alone(here):
    axis = "&axis key = 'solver.max_steps', values = 1000000, {} /\n&axis key = 'mass_ratio', values = 2, 4 /"
    result = sweep(here, "&sweep base = 'base.nml' /\n" + axis.format(20), code=1)
    assert "case 3 failed: max_steps = 20 reached" in result.stderr and "2 done, 2 failed" in result.stdout
    data = opened(here)
    assert list(data.status) == ["done", "done", "failed", "failed"]
    assert np.isnan(data.phi[2:]).all() and np.isnan(data.final_omega[2:]).all()
    assert "max_steps" in str(data.message.values[2]) and 0 < data.t_reached[2] < 0.05
    sweep(here, "&sweep base = 'base.nml' /\n" + axis.format(1000001), name="good")
    np.testing.assert_array_equal(data.phi[:2], opened(here, "good").phi[:2])
    again = sweep(here, None, code=1)
    assert "nothing to compute" in again.stdout
    retried = sweep(here, None, "--retry-failed", code=1)
    assert "2 of them on the disk" in retried.stdout
    assert (here / "s" / "sweep-1.h5").exists()


@pytest.mark.parametrize(("method", "keep_series", "steps"), [("dop853", ".true.", (20, 150, 300, 400)), ("bdf", ".false.", (200, 3000))])
def test_a_failed_case_reached_the_last_row_of_its_run(here, method, keep_series, steps):
    case = BASE.replace("n_outputs = 5", "n_outputs = 50").replace("&solver rtol = 1e-6, atol = 1e-8", f"&solver method = '{method}'")
    (here / "base.nml").write_text(case)
    sweep(here, f"&sweep base = 'base.nml', keep_series = {keep_series} /\n&axis key = 'solver.max_steps', values = "
          + ", ".join(map(str, steps)) + " /\n", code=1)
    data = opened(here)
    assert list(data.status) == ["failed"] * len(steps)
    for number, most in enumerate(steps):
        (here / "one.nml").write_text(case.replace("&solver ", f"&solver max_steps = {most}, "))
        subprocess.run([RODYN, "run", "one.nml", "--force", "--quiet"], cwd=here, capture_output=True)
        with h5py.File(here / "one.h5") as run:
            assert data.t_reached[number] == run.attrs["t_reached"] == run["time"][-1], most
    assert np.all(np.diff(data.t_reached) > 0)


def test_compression_is_that_of_the_base(here):
    (here / "base.nml").write_text(BASE + "&output compression = 0 /\n")
    sweep(here, GRID)
    sweep(here, GRID, name="again")
    assert content(here / "s") == content(here / "again")
    with h5py.File(here / "s" / "sweep.h5") as file:
        assert {name: data.compression for name, data in file.items()} == dict.fromkeys(file, None)
    (here / "base.nml").write_text(BASE + "&output compression = 9 /\n")
    sweep(here, GRID, name="small")
    with h5py.File(here / "small" / "sweep.h5") as file:
        assert {data.compression_opts for data in file.values()} == {9}


def test_octave_reads_everything(here):
    """All kinds of files: Octave's load stops at the first thing that it does not know, and loses what follows."""
    (here / "base.nml").write_text(BASE + "&hinge hinge = 1, lower_stop = -0.01, upper_stop = 0.01, stop_stiffness = 1e5 /\n")
    for command in ("run", "modes"):
        subprocess.run([RODYN, command, "base.nml", "--output", f"{command}.h5", "--quiet"], cwd=here, check=True)
    sweep(here, "&sweep base = 'base.nml', probe_times = 0.05, keep_series = .true., frequencies = 3 /\n"
          "&axis key = 'solver.method', text_values = 'dop853', 'erk' /\n&axis key = 'solver.max_steps', values = 20, 10000 /\n", code=1)
    for path in ("run.h5", "modes.h5", "s/sweep.h5"):
        done = subprocess.run(["octave-cli", "--no-init-file", "--no-gui", "--quiet", "--eval", OCTAVE.replace("FILE", path)], cwd=here,
                              capture_output=True, text=True)
        assert "warning: load" not in done.stderr, done.stderr
        seen = dict(line.split("=", 1) for line in done.stdout.splitlines() if "=" in line)
        with h5py.File(here / path) as file:
            names = []
            file.visititems(lambda name, item, names=names: names.append(name) if isinstance(item, h5py.Dataset) else None)
            assert set(seen) == {re.sub(r"[.()]", "_", name) for name in names}
            for name in ("events/kind", "kind", "coordinate", "status", "message", "param_solver.method"):
                if name in file:
                    texts = [text.decode() for text in file[name][()]]
                    assert [text.strip() for text in seen[name.replace(".", "_")].split("|")] == texts, name


OCTAVE = """
function tell(prefix, s)
   names = fieldnames(s);
   for i = 1:numel(names)
      x = s.(names{i});
      if isstruct(x)
         tell([prefix names{i} '/'], x);
      elseif ischar(x)
         printf('%s%s=%s\\n', prefix, names{i}, strjoin(cellstr(x)', '|'));
      else
         printf('%s%s=%d\\n', prefix, names{i}, numel(x));
      end
   end
end
tell('', load('-hdf5', 'FILE'));
"""


def test_what_was_in_vain_in_a_lane_counts(here):
    """A case that gives up in a lane is computed again by itself: its work is that of both attempts."""
    (here / "base.nml").write_text("""&case t_end = 1, n_outputs = 10 /
&spacecraft mass = 122.5, inertia = 10 /
&chain n_rods = 6, length = 1.5, mass_per_length = 1.696, hinge_stiffness = 1 /
&model bending = 'rigid' /
&initial phi = 0.1, 0.2, 0.1, 0, 1, 2, phi_rate = 6*3 /
&load component = 'X', value = 1, t_start = 0.5 /
&solver rtol = 1e-4, atol = 1e-6 /
""")
    text = "&sweep base = 'base.nml' LANES /\n&axis key = 'load(1).value', values = 1, 2, 3, 4, 5, 1e306 /\n"
    counts = []
    for name, lanes in (("alone", ", lanes = .false."), ("lanes", "")):
        sweep(here, text.replace(" LANES", lanes), name=name, code=1)
        with opened(here, name) as file:
            assert list(file["status"].values) == 5*["done"] + ["failed"]
            counts.append((file["n_rhs"].values, file["n_steps"].values))
    (alone, alone_steps), (lanes, lanes_steps) = counts
    assert (lanes[:5] == alone[:5]).all() and (lanes_steps[:5] == alone_steps[:5]).all()
    assert lanes[5] > alone[5] + 100 and lanes_steps[5] > alone_steps[5] + 10  # half of 1 s, about 200 and 13


def test_a_case_over_its_wall_limit_fails_alone_and_can_be_retried(here):
    text = "&sweep base = 'base.nml', probe_times = 0.05, case_seconds = {} /\n&axis key = 'case.t_end', values = 0.05, 400 /"
    sweep(here, text.format(0.3), code=1)
    data = opened(here)
    assert list(data.status) == ["done", "failed"] and "case_seconds" in str(data.message.values[1])
    assert 0.05 < data.t_reached[1] < 400
    sweep(here, text.format(100), "--retry-failed")
    data = opened(here)
    assert list(data.status) == ["done", "done"]
    np.testing.assert_allclose(data.phi[0, 0], data.phi[1, 0], rtol=0, atol=1e-6)  # the last step ends at t_end


LANES = """&sweep base = 'base.nml', probe_times = 0.02, 0.05, keep_series = .true. /
&axis key = 'mass_ratio', start = 0.5, stop = 8, count = 11, spacing = 'log' /
&axis key = 'model.inertia', text_values = 'distributed', 'lumped' /
"""


def test_like_cases_go_in_lanes_with_the_same_bytes_in_any_company(here):
    result = sweep(here, LANES)
    assert "side by side in 8 lanes" in result.stdout
    data = opened(here)
    assert "8 lanes" in data.attrs["lanes"] and list(data.status) == ["done"] * 22
    for shard in range(1, 12):
        sweep(here, LANES, "--shard", f"{shard}/11", name="shards")  # two cases each
    assert content(here / "s") == content(here / "shards")


def test_lanes_agree_with_one_by_one_and_can_be_switched_off(here):
    sweep(here, LANES)
    alone = LANES.replace("&sweep", "&sweep lanes = .false.,")
    assert "lanes   one by one" in sweep(here, alone, name="alone").stdout
    data, other = opened(here), opened(here, "alone")
    assert other.attrs["lanes"] == "one by one"
    np.testing.assert_allclose(data.phi, other.phi, rtol=0, atol=1e-9)
    np.testing.assert_allclose(data.series_alpha, other.series_alpha, rtol=0, atol=1e-7)
    refused = sweep(here, alone, name="s", code=2)  # another plan
    assert "lanes" in refused.stderr


def test_a_case_that_fails_in_a_lane_disturbs_no_other(here):
    axis = "&axis key = 'solver.max_steps', values = {} /\n"
    head = "&sweep base = 'base.nml', probe_times = 0.05 /\n"
    sweep(here, head + axis.format("1001, 1002, 1003, 1004, 1005, 1006, 1007, 1008, 1009, 1010"), name="good")
    sweep(here, head + axis.format("1001, 1002, 1003, 3, 1005, 1006, 1007, 1008, 1009, 1010"), code=1)
    good, data = opened(here, "good"), opened(here)
    assert list(data.status[:5]) == ["done", "done", "done", "failed", "done"]
    others = [i for i in range(10) if i != 3]
    np.testing.assert_array_equal(data.phi[others], good.phi[others])
    np.testing.assert_array_equal(data.n_rhs[others], good.n_rhs[others])


def test_switches_an_ulp_apart_are_one_in_every_company(here):
    """Axes make such numbers. Each case of a sweep has the bytes of a sweep of it alone, in lanes and by itself; all are near."""
    pulse = "&load component = 'M', t_start = 0.01, t_end = {}, value = 1000 /\n&load component = 'M', t_start = 0.03, value = -900 /\n"
    ends = [np.nextafter(0.03, 0), 0.03, np.nextafter(0.03, 1), 0.01 + 0.02, 0.1 * 0.3, 3 * 0.01]
    (here / "base.nml").write_text(BASE.split("&load")[0] + pulse.format("0.03") + "&solver rtol = 1e-8, method = 'dop853' /\n")
    axes = "&axis key = 'load(1).t_end', values = {} /\n&axis key = 'case.t_end', values = 0.05, 0.03, 0.030000000000000002 /\n"
    for lanes in (".true.", ".false."):
        head = f"&sweep base = 'base.nml', lanes = {lanes}, probe_times = 0.029 /\n"
        sweep(here, head + axes.format(", ".join(repr(float(end)) for end in ends)), name=f"all{lanes[1]}")
        data = opened(here, f"all{lanes[1]}")
        assert set(data.status.values) == {"done"} and ("8 lanes" in data.attrs["lanes"]) == (lanes == ".true.")
        final = data.final_phi.values.reshape(len(ends), 3, -1)
        assert np.ptp(final[:, 0], axis=0).max() < 1e-12 and np.ptp(final[:, 1:], axis=(0, 1)).max() < 1e-12
        for shard in range(1, 19):
            sweep(here, (here / f"all{lanes[1]}.nml").read_text(), "--shard", f"{shard}/18", name=f"one{lanes[1]}")
        assert content(here / f"all{lanes[1]}") == content(here / f"one{lanes[1]}")


UNEQUAL = """&sweep base = 'base.nml', combine = 'zip', probe_times = 0.001, 0.05 /
&axis key = 'case.t_end', values = 0.05, 0.001, 3, 0.002, 0.05, 0.7, 0.001, 0.05, 1, 0.05, 0.003, 0.05 /
&axis key = 'load(1).value', values = 1000, 1e300, 1000, 1, 1e308, -1000, 3, 1e200, 1, 2, 1e305, 5 /
"""


def test_very_unequal_and_hopeless_cases_have_the_bytes_they_have_alone(here):
    """Where `auto` takes dop853: a lane that gives up is computed again by itself, with the other methods, too."""
    sweep(here, UNEQUAL, code=1)
    data = opened(here)
    assert "8 lanes" in data.attrs["lanes"]
    hopeless = np.abs(np.array([1e3, 1e300, 1e3, 1, 1e308, -1e3, 3, 1e200, 1, 2, 1e305, 5])) > 1e100
    assert np.array_equal(data.status.values == "failed", hopeless)
    for shard in range(1, 13):
        sweep(here, UNEQUAL, "--shard", f"{shard}/12", name="alone", code=int(hopeless[shard - 1]) if shard < 12 else 1)
    assert content(here / "s") == content(here / "alone")
    for case in (2, 6):
        ends = ("t_end = 0.05", f"t_end = {float(data['param_case.t_end'][case])!r}")
        one = single(here, ends, ("value = 1000 /", f"value = {float(data['param_load(1).value'][case])!r} /"))
        np.testing.assert_allclose(data.final_phi[case], one.phi[-1], rtol=0, atol=1e-6)


FREQUENCIES = """&sweep base = 'base.nml', frequencies = 9, {} probe_times = 0.02, 0.05 /
&axis key = 'chain.hinge_stiffness(0)', values = 2000, 5000 /
&axis key = 'model.inertia', text_values = 'distributed', 'lumped' /
"""


def modes(here: pathlib.Path, *changes: tuple[str, str]) -> xarray.Dataset:
    text = BASE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (here / "one.nml").write_text(text)
    subprocess.run([RODYN, "modes", "one.nml", "--force", "--quiet"], cwd=here, check=True)
    return result_files.read(here / "one_modes.h5")


def test_frequencies_are_those_of_rodyn_modes_beside_the_states(here):
    sweep(here, FREQUENCIES.format(""))
    data = opened(here)
    assert data.frequency.dims == data.damping_ratio.dims == ("case", "mode") and data.sizes["mode"] == 9
    assert data.frequency.units == "rad s-1" and not np.isnan(data.phi).any()
    for case, stiffness, model in ((0, 2000, ""), (3, 5000, "&model inertia = 'lumped', bending = 'quasistatic' /")):
        found = modes(here, ("= 5000", f"= {stiffness}, 2*5000"), ("&solver", model + "&solver"))
        found = found.isel(mode=found.kind.values == "oscillation")
        n = min(9, found.sizes["mode"])
        np.testing.assert_allclose(data.frequency[case, :n], found.frequency[:n], rtol=1e-12)
        np.testing.assert_allclose(data.damping_ratio[case, :n], found.damping_ratio[:n], rtol=1e-6)
        assert np.isnan(data.frequency[case, n:]).all() and n == (9 if model == "" else 3)
    sweep(here, FREQUENCIES.format("").replace("frequencies = 9, ", ""), name="plain")
    np.testing.assert_array_equal(opened(here, "plain").phi, data.phi)  # they do not touch the integration


@pytest.mark.parametrize("how", ["", "integrate = .false.,"])
def test_frequencies_have_the_same_bytes_in_every_way(here, how):
    text = FREQUENCIES.format(how)
    sweep(here, text)
    wanted = content(here / "s")
    for shard in (2, 1, 3):
        sweep(here, text, "--shard", f"{shard}/3", name="shards")
    assert content(here / "shards") == wanted
    (here / "s" / "sweep.h5").unlink()
    (shard,) = (here / "s" / "shards").glob("*.shard")
    damaged = bytearray(shard.read_bytes())
    damaged[-200] ^= 1
    shard.write_bytes(damaged)  # one result is done again
    assert "wrong checksum; set aside, 3 intact results" in sweep(here, None).stderr
    assert content(here / "s") == wanted


def test_frequencies_at_equilibria_are_those_of_rodyn_modes(here):
    base = """&spacecraft motion = 'fixed' /
&chain n_rods = 2, length = 1, mass_per_length = 1.5, hinge_stiffness = 40 /
&model bending = 'rigid' /
&load target = 'node', node = 2, component = 'X', value = -10 /
&load target = 'node', node = 2, component = 'Y', value = 20 /
&hinge hinge = 1, held = .true., release_time = 9 /
"""
    (here / "base.nml").write_text(base)
    text = "&sweep base = 'base.nml', frequencies = 2, frequencies_at = 'equilibrium', integrate = .false. /\n{} /"
    sweep(here, text.format("&axis key = 'load(1).value', values = -10, 30"))
    data = opened(here)
    assert "at the equilibrium" in data.frequency.long_name and np.isnan(data.frequency[:, 1]).all()
    for case, value in enumerate((-10, 30)):
        (here / "one.nml").write_text(base.replace("-10", str(value)))
        subprocess.run([RODYN, "modes", "one.nml", "--equilibrium", "--output", "one_modes.h5", "--force", "--quiet"], cwd=here, check=True)
        found = result_files.read(here / "one_modes.h5")
        np.testing.assert_allclose(data.frequency[case, 0], found.frequency[0], rtol=1e-12)
        # One rod of length 2 and J = 1.5 8/3 on C = 40 with X, Y at its end: J w^2 = C + 2 (X cos phi + Y sin phi).
        phi = float(found.state.sel(coordinate="phi_1"))
        assert abs(40 * phi - 2 * (20 * math.cos(phi) - value * math.sin(phi))) < 1e-9
        stiffness = 40 + 2 * (value * math.cos(phi) + 20 * math.sin(phi))
        np.testing.assert_allclose(found.frequency[0], math.sqrt(stiffness / 4), rtol=1e-10)
    failed = sweep(here, text.format("&axis key = 'load(1).law', text_values = 'constant', 'smooth_step'"), name="t", code=1)
    assert list(opened(here, "t").status) == ["done", "failed"] and failed.returncode == 1
    assert "a load or a kink varies in time" in str(opened(here, "t").message.values[1])
    refused = sweep(here, text.format("&axis key = 'case.t_end', values = 1").replace("frequencies = 2, ", ""), name="u", code=2)
    assert "applies only with frequencies" in refused.stderr


def test_frequencies_alone_cost_no_integration(here):
    result = sweep(here, FREQUENCIES.format("integrate = .false.,"))
    assert "lanes   none" in result.stdout
    data = opened(here)
    assert "phi" not in data and "probe_time" not in data and list(data.status) == ["done"] * 4
    assert not data.n_rhs.any() and not data.t_reached.any() and not np.isnan(data.frequency[0]).any()


def test_running_again_computes_nothing(here):
    sweep(here, GRID)
    before = (here / "s" / "sweep.h5").read_bytes()
    assert "nothing to compute" in sweep(here, None).stdout
    assert (here / "s" / "sweep.h5").read_bytes() == before


def test_a_lost_result_is_merged_again(here):
    sweep(here, GRID)
    wanted = content(here / "s")
    (here / "s" / "sweep.h5").unlink()
    sweep(here, None)
    assert content(here / "s") == wanted


def test_a_changed_sweep_is_refused_with_the_difference(here):
    sweep(here, GRID)
    before = (here / "s" / "sweep.h5").read_bytes()
    result = sweep(here, GRID.replace("2, 4, 8", "2, 4, 16"), code=2)
    assert "now:   axis 1 (dimension 1) mass_ratio = 1.6" in result.stderr and "--force" in result.stderr
    (here / "s.nml").write_text(GRID)
    (here / "base.nml").write_text(BASE.replace("= 1000 /", "= 1001 /"))
    assert "1.0010000000000000E+003" in sweep(here, None, code=2).stderr
    (here / "base.nml").write_text(BASE + "! a remark\n")
    sweep(here, None)
    plan = here / "s" / "plan.txt"
    plan.write_text(plan.read_text().replace("program: ", "program: 9.9 "))
    assert "there:  program: 9.9" in sweep(here, None, code=2).stderr.replace("there: ", "there:  ").replace("   ", "  ")
    assert (here / "s" / "sweep.h5").read_bytes() == before
    sweep(here, GRID.replace("2, 4, 8", "2, 4, 16"), "--force")
    assert opened(here).param_mass_ratio[-1] == 16


def test_shards_give_the_same_bytes(here):
    sweep(here, GRID, name="one")
    for i in (3, 1, 2):
        sweep(here, GRID, "--shard", f"{i}/3", name="s")
        assert (here / "s" / "sweep.h5").exists() == (i == 2)
    sweep(here, GRID, "--shard", "1/2", name="mixed")
    sweep(here, None, name="mixed")
    one = content(here / "one")
    assert content(here / "s") == one and content(here / "mixed") == one
    for bad in ("0/3", "4/3", "x", "1", "1/", "-1/2", "1/2/3"):
        sweep(here, None, "--shard", bad, code=2)


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="no mpirun")
def test_two_ranks_give_the_same_bytes(here):
    sweep(here, GRID, name="one")
    (here / "s.nml").write_text(GRID)
    root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    mpi = ["mpirun", "--oversubscribe", "-n", "2", RODYN, "sweep"]
    result = subprocess.run([*mpi, "s.nml"], cwd=here, capture_output=True, text=True, env=os.environ | root)
    assert result.returncode == 0 and "2 ranks of MPI" in result.stdout, result.stdout + result.stderr
    assert content(here / "s") == content(here / "one")
    failed = subprocess.run([*mpi, "none.nml"], cwd=here, capture_output=True, text=True, env=os.environ | root)
    assert failed.returncode == 2 and failed.stderr.count("none.nml: cannot be read") == 1


LONG = "&sweep base = 'base.nml' /\n&axis key = 'case.t_end', start = 4, stop = 5, count = 60 /"


def start(here: pathlib.Path, *options: str, text: str = LONG, results_there: int = 1) -> subprocess.Popen[str]:
    """A sweep that has come so far."""
    (here / "s.nml").write_text(text)
    process = subprocess.Popen([RODYN, "sweep", "s.nml", "--quiet", *options], cwd=here, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 20
    while time.monotonic() < end:
        if len(results(here / "s")) >= results_there:
            return process
        assert process.poll() is None, "the sweep ended too early"
        time.sleep(0.001)
    raise AssertionError("too few results after 20 s")


def kill(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.communicate()
    assert process.returncode == -signal.SIGKILL


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGUSR1])
def test_a_signal_stops_at_a_case_and_is_resumed(here, number):
    process = start(here)
    process.send_signal(number)
    begin = time.monotonic()
    _, errors = process.communicate()
    assert process.returncode == 75 and time.monotonic() - begin < 5
    assert number.name in errors and "resume" in errors
    assert "state = stopped" in (here / "s" / "status.txt").read_text()
    assert "of them on the disk" in sweep(here, None).stdout
    sweep(here, LONG, name="whole")
    assert content(here / "s") == content(here / "whole")


def test_a_result_is_discarded_when_its_successor_is_there(here):
    sweep(here, GRID)
    before = (here / "s" / "sweep.h5").read_bytes()
    for _ in range(2):
        shutil.rmtree(here / "s" / "shards")  # or `start` would take them for new ones
        process = start(here, "--force")
        process.terminate()
        process.communicate()
        assert process.returncode == 75
        assert not (here / "s" / "sweep.h5").exists() and (here / "s" / "sweep.h5.before").read_bytes() == before
    sweep(here, None)
    assert opened(here).sizes["case"] == 60 and not (here / "s" / "sweep.h5.before").exists()


def test_two_processes_never_work_on_one_sweep(here):
    process = start(here)
    for options in ((), ("--shard", "1/2"), ("--force",)):
        assert "works on this sweep" in sweep(here, None, *options, code=2).stderr
    kill(process)
    sweep(here, None)
    assert (here / "s" / "sweep.h5").exists()


SHORT = "&sweep base = 'base.nml' /\n&axis key = 'mass_ratio', start = 2, stop = 32, count = 1000 /"


def test_no_finished_case_is_integrated_again_after_a_kill(here):
    """A result once appended is the only one its case ever has: its bytes hold wall times, which another run would change."""
    there: list = []
    for _ in range(8):
        kill(start(here, text=SHORT, results_there=len(there) + 10))
        before, there = there, results(here / "s")
        assert set(before) <= set(there)
    assert f"{len(there)} of them on the disk" in sweep(here, None).stdout
    end = results(here / "s")
    assert sorted(case for case, _ in end) == list(range(1, 1001))
    assert set(there) <= set(end)
    wall = opened(here).wall_seconds.values
    for case, record in there:
        assert wall[case - 1] == np.frombuffer(record, "<f8")[7]
    sweep(here, SHORT, name="whole")
    assert content(here / "s") == content(here / "whole")


def test_a_result_is_in_its_file_as_soon_as_its_case_is_finished(here):
    """Cases of some 20 ms: results that waited for one another would come in few steps."""
    process = start(here)
    seen = set()
    while process.poll() is None:
        seen.add(len(results(here / "s")))
        time.sleep(0.001)
    assert process.returncode == 0 and len(seen) > 30


def test_nothing_is_deleted_by_resuming(here):
    for n in (20, 40, 60):
        kill(start(here, text=SHORT, results_there=n))
    numbers = {path.name[: len("r000000-000001")] for path in here.glob("s/shards/*")}
    sweep(here, None)
    sealed = {path.name for path in here.glob("s/shards/*.shard")}
    assert {f"{name}.shard" for name in numbers} < sealed and len(sealed) == len(numbers) + 1 == 4


def test_a_write_that_fails_leaves_whole_results(here):
    """As on a full disk: what the last write managed is cut off again, so that nothing is torn."""
    (here / "s.nml").write_text(SHORT)
    limit = 100001
    process = subprocess.run([RODYN, "sweep", "s.nml", "--quiet"], cwd=here, capture_output=True, text=True,
                             preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
    assert process.returncode == 1 and "File too large; run again" in process.stderr
    (shard,) = here.glob("s/shards/*.open")
    there = results(here / "s")
    assert shard.stat().st_size == 24 + sum(len(record) for _, record in there) > 99000
    result = sweep(here, None)
    assert result.stderr == "" and f"{len(there)} of them on the disk" in result.stdout
    assert set(there) < set(results(here / "s"))


@pytest.mark.parametrize("damage", ["cut", "odd", "bit", "empty"])
def test_good_results_of_a_damaged_open_shard_are_kept(here, damage):
    kill(start(here, text=SHORT, results_there=30))
    there = results(here / "s")
    (shard,) = here.glob("s/shards/*.open")
    data = bytearray(shard.read_bytes())
    length = len(there[0][1])
    at = 24 + 10 * length
    if damage == "cut":
        data, good = data[: at + 80], there[:10]
    elif damage == "odd":
        data, good = data[: at + 81], there[:10]
    elif damage == "bit":
        data[at + 83] ^= 16
        good = there[:10] + there[11:]
    else:
        data, good = data[:0], []
    shard.write_bytes(data)
    result = sweep(here, None)
    assert f"{len(good)} of them on the disk" in result.stdout or not good
    end = results(here / "s")
    assert sorted(case for case, _ in end) == list(range(1, 1001))
    assert set(end) & set(there) == set(good)
    kept = [path.read_bytes() for path in here.glob("s/shards/*.damaged")]
    if damage == "empty":  # as by a kill before the first word: nothing to tell
        assert result.stderr == "" and not kept
    else:
        assert f"{shard.name}: wrong checksum; set aside, {len(good)} intact results" in result.stderr or damage == "odd"
        assert "set aside" in result.stderr and kept == [bytes(data)]
    sweep(here, SHORT, name="whole")
    assert content(here / "s") == content(here / "whole")
    assert sweep(here, None).stderr == ""


def test_shards_of_living_neighbours_are_left_alone(here):
    process = start(here, "--shard", "1/2")
    process.send_signal(signal.SIGSTOP)
    (shard,) = here.glob("s/shards/*.open")
    before = shard.read_bytes()
    sweep(here, None, "--shard", "2/2")
    assert shard.read_bytes() == before and not list(here.glob("s/shards/*.damaged"))
    process.send_signal(signal.SIGCONT)
    assert process.communicate()[1] == "" and process.returncode == 0
    sweep(here, LONG, name="whole")
    assert content(here / "s") == content(here / "whole")


def test_damage_is_noticed_and_redone(here):
    sweep(here, GRID)
    wanted = content(here / "s")
    there = results(here / "s")
    shard = next(here.glob("s/shards/*.shard"))
    data = bytearray(shard.read_bytes())
    data[len(data) // 2] ^= 4
    shard.write_bytes(data)
    result = sweep(here, None)
    assert "wrong checksum; set aside, 5 intact results" in result.stderr and content(here / "s") == wanted
    assert list(here.glob("s/shards/*.damaged")) and (here / "s" / "sweep-1.h5").exists()
    assert len(results(here / "s")) == 6 and len(set(results(here / "s")) - set(there)) == 1
    next(here.glob("s/shards/*.shard")).unlink()
    result = sweep(here, None)
    assert "sealed but missing" in result.stderr and content(here / "s") == wanted
    assert sweep(here, None).stderr == ""


@pytest.mark.parametrize("damage", ["bit", "cut", "gone", "unknown"])
def test_a_damaged_result_is_merged_again(here, damage):
    sweep(here, GRID)
    wanted = content(here / "s")
    there = results(here / "s")
    file = here / "s" / "sweep.h5"
    data = bytearray(file.read_bytes())
    if damage == "bit":
        data[-5] ^= 1
    if damage == "cut":
        data = data[:-1]
    file.write_bytes(data)
    if damage == "gone":
        file.unlink()
    if damage == "unknown":  # nothing says what it should be
        (here / "s" / "journal" / "r000000.txt").unlink()
    result = sweep(here, None)
    assert content(here / "s") == wanted and results(here / "s") == there
    if damage == "gone":
        assert result.stderr == "" and not (here / "s" / "sweep-1.h5").exists()
    else:
        assert "set aside as s/sweep-1.h5, merged again" in result.stderr
        assert (here / "s" / "sweep-1.h5").read_bytes() == data
    again = sweep(here, None)
    assert "nothing to compute" in again.stdout and again.stderr == ""


def test_a_result_older_than_the_shards_is_merged_again(here):
    """As after a kill between a retried case and the merge."""
    limit = "&sweep base = 'base.nml', case_seconds = {} /\n&axis key = 'case.t_end', values = 0.05, 400 /"
    sweep(here, limit.format(0.3), code=1)
    old = (here / "s" / "sweep.h5").read_bytes()
    sweep(here, limit.format(100), "--retry-failed")
    (here / "s" / "sweep.h5").write_bytes(old)
    result = sweep(here, None)
    assert "merged again" in result.stderr and list(opened(here).status) == ["done", "done"]


def test_dry_run_writes_nothing(here):
    result = sweep(here, GRID, "--dry-run")
    assert len([line for line in result.stdout.splitlines() if "'lumped'" in line]) == 3
    assert "time    about 0:00:0" in result.stdout and "MB of sweep.h5" in result.stdout
    assert not (here / "s").exists()


def test_defaults_are_a_valid_sweep(here):
    text = subprocess.run([RODYN, "defaults", "sweep"], capture_output=True, text=True, check=True).stdout
    sweep(here, text)
    assert opened(here).sizes["case"] == 3


@pytest.mark.parametrize(("text", "message"), [
    ("&sweep base = 'base.nml' /", "&axis: at least one is required"),
    ("&sweep bas = 'x' /\n&axis key = 'mass_ratio', values = 1 /", "the nearest known one is base"),
    ("&sweep base = 'none.nml' /\n&axis key = 'mass_ratio', values = 1 /", "none.nml: cannot be read"),
    ("&sweep base = 'base.nml' /\n&axis key = 'chain.lenght', values = 1 /", "the nearest one is length"),
    ("&sweep base = 'base.nml' /\n&axis key = 'chian.length', values = 1 /", "the nearest one is chain"),
    ("&sweep base = 'base.nml' /\n&axis key = 'mass_ratio', values = 0 /", "must be positive"),
    ("&sweep base = 'base.nml' /\n&axis key = 'solver.method', text_values = 'rk4' /", "must be 'auto'"),
    ("&sweep base = 'base.nml' /\n&axis key = 'solver.method', values = 1 /", "takes text_values"),
    ("&sweep base = 'base.nml' /\n&axis key = 'case.n_outputs', values = 1.5 /", "must be an integer"),
    ("&sweep base = 'base.nml' /\n&axis key = 'case.t_end', values = 1, -1 /", "value 2 (-1) must be positive [s]"),
    ("&sweep base = 'base.nml' /\n&axis key = 'load.value', values = 1 /", "load(1).value"),
    ("&sweep base = 'base.nml' /\n&axis key = 'output.file', text_values = 'x' /", "has no influence"),
    ("&sweep base = 'base.nml' /\n&axis key = 'case.t_end', start = 0, stop = 1, count = 3, spacing = 'log' /", "positive start"),
    ("&sweep base = 'base.nml' /\n&axis key = 'case.t_end', stop = 1 /", "count: is required where the others"),
    ("&sweep base = 'base.nml', combine = 'zip' /\n&axis key = 'case.t_end', values = 1, 2 /\n"
     "&axis key = 'solver.rtol', values = 0.1 /", "has 1 values, but case.t_end"),
    ("&sweep base = 'base.nml', probe_times = 2, 1 /\n&axis key = 'mass_ratio', values = 1 /", "must increase"),
])
def test_faults_are_told_with_their_line(here, text, message):
    result = sweep(here, text, code=2)
    assert message in result.stderr
    check = subprocess.run([RODYN, "check", "s.nml"], cwd=here, capture_output=True, text=True)
    assert check.returncode == 2 and message in check.stderr
    assert not (here / "s").exists()


def faults(here: pathlib.Path, text: str) -> list[str]:
    (here / "s.nml").write_text(text)
    check = subprocess.run([RODYN, "check", "s.nml"], cwd=here, capture_output=True, text=True)
    assert (check.returncode, check.stdout) == (2, "")
    return check.stderr.splitlines()


SWEEP = "&sweep base = 'base.nml' /\n"
GOOD = "&axis key = 'chain.hinge_stiffness(0)', values = 1e3, 2e3 /\n"


@pytest.mark.parametrize("combine", ["grid", "zip"])
def test_a_bad_axis_is_reported_alone(here, combine):
    """Also where its first value is the bad one, with which all values of the others would be tried."""
    bad = "&axis key = 'model.gauss_points', values = 1, 4 /\n"
    for order in (bad + GOOD, GOOD + bad):
        lines = faults(here, SWEEP.replace(" /", f", combine = '{combine}' /") + order)
        assert len(lines) == 1, lines
        assert "&axis key = 'model.gauss_points': value 1 (1) makes a case that is refused: base.nml: &model gauss_points = 1" in lines[0]


def test_every_fault_of_a_sweep_is_told_at_once(here):
    lines = faults(here, "&sweep base = 'base.nml', probe_tims = 1 /\n" + GOOD + "&axis key = 'chain.lenght(1)', values = 1 /\n"
                   "&axis key = 'case.t_end', values = 1, -1, 2, -3 /\n&axis ky = 'solver.rtol', values = 1e-5 /\n"
                   "&axis key = 'model.bending', text_values = 'rigid', 'stiff' /\n&axis key = 'solver.order', values = 0, 3 /\n")
    words = [":1: &sweep probe_tims: unknown key", ":3: &axis key = 'chain.lenght(1)': &chain has no such key",
             ":4: &axis values = 1, -1, 2, -3: value 2 (-1) must be positive [s]",
             ":4: &axis values = 1, -1, 2, -3: value 4 (-3) must be positive [s]", ":5: &axis ky: unknown key",
             ":6: &axis text_values = 'rigid', 'stiff': value 2 ('stiff') must be 'dynamic'",
             ":7: &axis key = 'solver.order': value 2 (3) makes a case that is refused"]
    told = [line for line in lines if "&axis key: is required" not in line]
    assert len(told) == len(words), lines
    for line, word in zip(told, words, strict=True):
        assert word in line


def test_faults_of_sweep_and_base_do_not_hide_each_other(here):
    axis = "&axis key = 'chain.lenght(1)', values = 1 /\n&axis key = 'case.t_end', values = -1 /\n"
    lines = faults(here, "&sweep base = 'none.nml' /\n" + axis)
    assert [line.split(": ")[0] for line in lines] == ["s.nml:1", "s.nml:2", "s.nml:3"] and "cannot be read" in lines[0]
    (here / "bad.nml").write_text((here / "base.nml").read_text() + "&case t_end = -1 /\n")
    lines = faults(here, "&sweep base = 'bad.nml' /\n" + axis)
    assert [line.split(":")[0] for line in lines][:2] == ["s.nml", "s.nml"] and any(line.startswith("bad.nml:") for line in lines)


def test_check_says_what_it_tried(here):
    def valid(text):
        (here / "s.nml").write_text(text)
        check = subprocess.run([RODYN, "check", "s.nml"], cwd=here, capture_output=True, text=True)
        assert check.returncode == 0, check.stderr
        return check.stdout

    assert valid(SWEEP + GOOD) == "s.nml: valid; each of 2 values tried\n"
    assert valid(SWEEP + GOOD + "&axis key = 'solver.rtol', values = 1e-6, 1e-8, 1e-9 /\n") == (
        "s.nml: valid; each of 5 values tried; a combination that is refused fails as a case\n")
    many = "&axis key = 'solver.rtol', start = 1e-9, stop = 1e-3, count = 10000 /\n"
    assert valid(SWEEP + many) == "s.nml: valid; each of 10000 values tried\n"
    assert "10000 of 10001 values tried" in valid(SWEEP + many.replace("10000", "10001"))
    # rules of the key itself are kept by all, the last value is tried whatever their number
    lines = faults(here, SWEEP + "&axis key = 'chain.hinge_damping(0)', start = 1, stop = -1e-9, count = 10002 /\n")
    assert ": value 10002 (-0.1E-8) must not be negative" in lines[0] and len(lines) == 1
    lines = faults(here, SWEEP + "&axis key = 'model.gauss_points', start = 40000, stop = 1, count = 40000 /\n")
    assert any("must lie in 1..200" in line for line in lines) and "value 40000 (1) makes a case that is refused" in lines[-1]
    some = [many.replace("10000", "500").replace("solver.rtol", key) for key in ("solver.rtol", "solver.atol", "load(1).value")]
    lines = faults(here, SWEEP.replace(" /", ", probe_times = 0.01 /") + "".join(some))
    assert lines == ["s.nml: more than 100000000 cases"]


def test_a_combination_that_is_refused_is_no_fault_but_one_that_always_is(here):
    method = "&axis key = 'solver.method', text_values = 'bdf', 'erk' /\n"
    (here / "s.nml").write_text(SWEEP + method + "&axis key = 'solver.order', values = 8, 4 /\n")
    assert subprocess.run([RODYN, "check", "s.nml"], cwd=here, capture_output=True).returncode == 0
    lines = faults(here, SWEEP + method.replace("'erk'", "'gauss'") + "&axis key = 'solver.order', values = 8 /\n")
    assert all("&axis key = 'solver" in line for line in lines) and "solver order = 8" in "".join(lines)


def test_shipped_sweeps_are_valid():
    files = sorted((ROOT / "cases").glob("sweep_*.nml")) + sorted((ROOT / "bench" / "sweeps").glob("*0*.nml"))
    assert len(files) >= 7
    for file in files:
        subprocess.run([RODYN, "check", str(file)], check=True, capture_output=True)


def test_exact_and_lumped_approach_each_other(tmp_path):
    subprocess.run([RODYN, "sweep", str(ROOT / "cases" / "sweep_table3.nml"), "--output", str(tmp_path / "t")], check=True,
                   capture_output=True)
    phi = result_files.read(tmp_path / "t" / "sweep.h5").phi.values[:, 0]
    difference = np.abs(phi[0::3] - phi[2::3]).max(axis=1)  # between them condensed rods
    assert difference[-1] < 0.3 * difference[0] and math.isfinite(difference.sum())
