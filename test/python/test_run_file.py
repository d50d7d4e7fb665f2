"""A run file opens with xarray and h5py without arguments and holds what is promised.

RODYN_RUN_FILE=path    test this file; otherwise one is made by the program `sample_run` of the Fortran tests.
RODYN_SAMPLE_RUN=path  that program (`tools/build --test` makes it); otherwise the newest below build/.
"""

import os
import pathlib
import resource
import signal
import subprocess
import time

import h5py
import numpy as np
import pytest
import result_files
import xarray

ROOT = pathlib.Path(__file__).resolve().parents[2]

ROD_STATES = {
    "phi": "rad", "alpha": "rad", "beta": "rad",
    "phi_rate": "rad s-1", "alpha_rate": "rad s-1", "beta_rate": "rad s-1",
    "bubble": "m", "bubble_rate": "m s-1",
}
SCALAR_STATES = {
    "velocity_x": "m s-1", "velocity_y": "m s-1", "omega": "rad s-1",
    "displacement_x": "m", "displacement_y": "m", "rotation": "rad",
}
LEDGER = {
    "energy_kinetic": "J", "energy_elastic": "J", "energy_dissipated": "J", "work_external": "J",
    "energy_residual": "J", "momentum_x": "kg m s-1", "momentum_y": "kg m s-1", "angular_momentum": "kg m2 s-1",
}
ROOT_TEXTS = [
    "title", "status", "program_version", "git_commit", "compiler", "compiler_options", "sundials_version",
    "hdf5_version", "hostname", "created", "input", "resolved_input", "notes", "warnings",
]


def sample_run_program():
    if "RODYN_SAMPLE_RUN" in os.environ:
        return os.environ["RODYN_SAMPLE_RUN"]
    programs = sorted(ROOT.glob("build/*/test/sample_run"), key=lambda p: p.stat().st_mtime)
    if not programs:
        pytest.skip("sample_run is not built: call tools/build --test")
    return str(programs[-1])


@pytest.fixture(scope="session")
def run_path(tmp_path_factory):
    if "RODYN_RUN_FILE" in os.environ:
        return os.environ["RODYN_RUN_FILE"]
    path = tmp_path_factory.mktemp("run") / "sample.h5"
    subprocess.run([sample_run_program(), str(path), "4", "1001"], check=True)
    return str(path)


def test_xarray_sees_dimensions_and_coordinates(run_path):
    with xarray.open_dataset(run_path) as run:
        n = run.sizes["rod"]
        assert dict(run.sizes) == {"time": run.sizes["time"], "rod": n, "hinge": n, "node": n + 1}
        assert set(run.coords) == {"time", "rod", "hinge", "node"}
        assert run.rod.values.tolist() == list(range(1, n + 1))
        assert run.hinge.values.tolist() == list(range(n))
        assert run.node.values.tolist() == list(range(n + 1))
        assert run.time.dtype == np.float64  # not a date
        assert run.time.units == "s"
        assert np.all(np.diff(run.time) > 0)


def test_the_reader_of_the_tests_reads_what_xarray_does(run_path):
    for group in ("/", "solver"):
        xarray.testing.assert_identical(result_files.read(run_path, group), xarray.load_dataset(run_path, group=group))


def test_xarray_sees_states_with_units(run_path):
    with xarray.open_dataset(run_path) as run:
        expected = {k: (("time", "rod"), u) for k, u in ROD_STATES.items()}
        expected |= {k: (("time",), u) for k, u in SCALAR_STATES.items()}
        if "energy_kinetic" in run:
            expected |= {k: (("time",), u) for k, u in LEDGER.items()}
        assert set(run.data_vars) == set(expected)
        for name, (dims, units) in expected.items():
            assert run[name].dims == dims, name
            assert run[name].units == units, name
            assert run[name].long_name, name
            assert run[name].dtype == np.float64, name
            assert np.all(np.isfinite(run[name])), name


def test_xarray_sees_texts(run_path):
    with xarray.open_dataset(run_path) as run:
        for name in ROOT_TEXTS:
            assert isinstance(run.attrs[name], str), name
        assert run.attrs["status"] in ("done", "failed", "stopped")
        assert np.datetime64(run.attrs["created"].removesuffix("Z"))


def test_xarray_sees_the_solver(run_path):
    with xarray.open_dataset(run_path, group="solver") as solver:
        for name in ("method", "rtol", "atol", "n_steps", "n_rhs", "n_jac", "wall_seconds"):
            assert name in solver.attrs


def test_every_text_is_scalar_and_of_fixed_length(run_path):
    def check(name, item):
        for key in item.attrs:
            attribute = item.attrs.get_id(key)
            if key in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"):
                continue  # of the dimension scales
            assert attribute.shape == (), (name, key)
            if attribute.dtype.kind == "S":
                info = h5py.check_string_dtype(attribute.dtype)
                assert info.length is not None and info.encoding == "utf-8", (name, key)
            else:
                assert attribute.dtype.kind in "if", (name, key)

    with h5py.File(run_path) as file:
        check("/", file)
        file.visititems(check)


def test_every_data_set_is_compressed_and_checksummed(run_path):
    with h5py.File(run_path) as file:
        for name, item in file.items():
            if not isinstance(item, h5py.Dataset):
                continue
            assert item.compression == "gzip" and item.shuffle and item.fletcher32, name
            assert item.attrs["units"] and item.attrs["long_name"], name
            assert item.dtype == (np.int32 if name in ("rod", "hinge", "node") else np.float64)
        assert file["phi"].maxshape == (None, file["rod"].size)
        assert [list(d.keys()) for d in file["phi"].dims] == [["time"], ["rod"]]


def limited(blocks):
    """Run before exec: files may not exceed so many bytes, and the signal acts as it does in a shell."""
    def apply():
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_FSIZE, (blocks, blocks))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    return apply


@pytest.mark.parametrize("limit", [3_000, 150_000, 280_000, 330_000, 400_000, 2_500_000, 20_000_000])
def test_a_full_disk_ends_with_a_message_and_the_rows_until_then(tmp_path, limit):
    path = tmp_path / "full.h5"
    n_rods = 4 if limit < 500_000 else 1000
    run = subprocess.run([sample_run_program(), str(path), str(n_rods), "1001"], preexec_fn=limited(limit),
                         capture_output=True, text=True, timeout=60)
    assert run.returncode == 1, run.stderr
    assert "File too large" in run.stderr
    assert len(run.stderr.splitlines()) == 1  # no backtrace, nothing from HDF5
    if limit < 200_000:  # the input alone takes 150 kB
        assert list(tmp_path.iterdir()) == []
        return
    assert [p.name for p in tmp_path.iterdir()] == ["full.h5"]
    whole = tmp_path / "whole.h5"
    subprocess.run([sample_run_program(), str(whole), str(n_rods), "1001"], check=True)
    rows, all_rows = result_files.read(path), result_files.read(whole)
    n = rows.sizes["time"]
    assert 0 < n < 1001
    assert (rows.attrs["status"], rows.attrs["t_reached"]) == ("failed", rows.time[-1])
    assert "File too large" in rows.attrs["message"]
    assert rows.equals(all_rows.isel(time=slice(n)))


def test_a_killed_run_leaves_only_its_temporary_name(tmp_path):
    for delay in np.linspace(0.005, 0.6, 12):
        path = tmp_path / "killed.h5"
        run = subprocess.Popen([sample_run_program(), str(path), "1000", "1001"])
        time.sleep(delay)
        run.kill()
        if run.wait() == 0:
            continue
        for left in tmp_path.iterdir():
            assert left.name.startswith("killed.h5.partial-"), left


def test_an_existing_result_is_kept(tmp_path):
    path = tmp_path / "result.h5"
    path.write_text("precious")
    run = subprocess.run([sample_run_program(), str(path), "1", "2"], capture_output=True, text=True)
    assert run.returncode == 2
    assert run.stderr == f"{path}: exists already; --force replaces it\n"
    assert path.read_text() == "precious"
