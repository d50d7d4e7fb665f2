"""Where the tools look for compiler and libraries, and what they say (tools/flags, tools/build)."""

import os
import pathlib
import shutil
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
VARIABLES = ("SUNDIALS_ROOT", "HDF5_ROOT", "MPI_ROOT", "SUNDIALS_DIR", "HDF5_DIR", "EBROOTSUNDIALS", "EBROOTHDF5", "CMAKE_PREFIX_PATH",
             "CONDA_PREFIX", "PKG_CONFIG_PATH", "LIBRARY_PATH", "LAPACK_LIBS", "FPM_FC")
SUNDIALS_7 = ("fcvode_mod", "cvode", "farkode_mod", "arkode", "fsunnonlinsolfixedpoint_mod", "sunnonlinsolfixedpoint", "fcore_mod", "core")


@pytest.fixture
def tools(tmp_path):
    """The tools alone, in a directory without a build."""
    shutil.copytree(ROOT / "tools", tmp_path / "rodyn" / "tools")
    return tmp_path / "rodyn" / "tools"


def call(*command, **variables):
    environment = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    return subprocess.run(command, env=environment | {name: str(value) for name, value in variables.items()},
                          capture_output=True, text=True, timeout=60)


def touch(*paths):
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()


def make_sundials(prefix, version="7.1.1", libraries="lib64", modules="fortran"):
    """What `make install` of SUNDIALS leaves, without content."""
    touch(prefix / modules / "fcvode_mod.mod", prefix / modules / "fsundials_core_mod.mod", prefix / "include/sundials/sundials_config.h",
          *(prefix / libraries / f"libsundials_{name}.so" for name in SUNDIALS_7))
    (prefix / "include/sundials/sundials_config.h").write_text(f'#define SUNDIALS_VERSION "{version}"\n')
    return prefix


def make_hdf5(prefix, names, modules="include", libraries="lib", version="1.14.5"):
    touch(prefix / modules / "hdf5.mod", prefix / modules / "h5ds.mod", *(prefix / libraries / f"lib{name}" for name in names))
    header = prefix / modules / "H5public.h"
    header.write_text(f'#define H5_VERS_INFO "HDF5 library version: {version}"\n')
    return prefix


def test_libraries_of_a_prefix_have_their_upstream_names(tools, tmp_path):
    sundials = make_sundials(tmp_path / "s")
    hdf5 = make_hdf5(tmp_path / "h", [f"{name}.so" for name in ("hdf5_hl_fortran", "hdf5_fortran", "hdf5_hl", "hdf5")])
    places = {"SUNDIALS_ROOT": sundials, "HDF5_ROOT": hdf5}
    assert call(tools / "flags", "include", **places).stdout == f"-I{hdf5}/include -I{sundials}/fortran -DRODYN_SUNDIALS=7\n"
    flags = call(tools / "flags", "link", **places, LAPACK_LIBS="-lmine").stdout.split()
    assert flags == [f"-L{sundials}/lib64", f"-Wl,-rpath,{sundials}/lib64", *(f"-lsundials_{name}" for name in SUNDIALS_7),
                     f"-L{hdf5}/lib", f"-Wl,-rpath,{hdf5}/lib", "-lhdf5_hl_fortran", "-lhdf5_fortran", "-lhdf5_hl", "-lhdf5", "-lmine"]


def test_environment_modules_and_directories_of_module_files_name_prefixes(tools, tmp_path):
    hdf5 = make_hdf5(tmp_path / "h", ["hdf5_fortran.so"])
    for variables in ({"SUNDIALS_DIR": make_sundials(tmp_path / "a")}, {"EBROOTSUNDIALS": make_sundials(tmp_path / "b")},
                      {"CMAKE_PREFIX_PATH": f"/nowhere:{make_sundials(tmp_path / 'c')}"}, {"CONDA_PREFIX": make_sundials(tmp_path / "d")},
                      {"SUNDIALS_ROOT": make_sundials(tmp_path / "e") / "fortran"}):
        result = call(tools / "flags", "link", HDF5_ROOT=hdf5, LAPACK_LIBS="", **variables)
        prefix = str(next(iter(variables.values()))).split(":")[-1].removesuffix("/fortran")
        assert f"-L{prefix}/lib64" in result.stdout.split(), result.stderr


def test_parallel_modules_of_hdf5_go_with_parallel_libraries(tools, tmp_path):
    prefix = tmp_path / "usr"
    for kind in ("openmpi", "serial"):
        make_hdf5(prefix, ["hdf5hl_fortran.so", "hdf5_fortran.so", "hdf5_hl.so", "hdf5.so"], f"include/hdf5/{kind}",
                  f"lib/x86_64-linux-gnu/hdf5/{kind}")
    sundials = make_sundials(tmp_path / "s")
    for root, kind in ((prefix / "include/hdf5/openmpi", "openmpi"), (prefix, "serial")):
        flags = call(tools / "flags", "link", SUNDIALS_ROOT=sundials, HDF5_ROOT=root).stdout.split()
        assert f"-L{prefix}/lib/x86_64-linux-gnu/hdf5/{kind}" in flags and "-lhdf5hl_fortran" in flags


def test_what_static_hdf5_needs_is_linked_behind_it(tools, tmp_path):
    hdf5 = make_hdf5(tmp_path / "h", ["hdf5_hl_fortran.a", "hdf5_fortran.a", "hdf5_f90cstub.a", "hdf5_hl.a", "hdf5.a"])
    (hdf5 / "lib/libhdf5.settings").write_text("     Extra libraries: -lsz m;/opt/libz.a\n")
    flags = call(tools / "flags", "link", SUNDIALS_ROOT=make_sundials(tmp_path / "s"), HDF5_ROOT=hdf5, LAPACK_LIBS="-lmine").stdout.split()
    assert flags[-9:] == ["-lhdf5_hl_fortran", "-lhdf5_fortran", "-lhdf5_f90cstub", "-lhdf5_hl", "-lhdf5",
                          "-lsz", "-lm", "/opt/libz.a", "-lmine"]


def test_what_cannot_work_is_said_with_the_version(tools, tmp_path):
    hdf5, sundials = make_hdf5(tmp_path / "h", ["hdf5_fortran.so"]), make_sundials(tmp_path / "s")
    bare = tmp_path / "bare"
    make_sundials(bare, "6.1.0")
    shutil.rmtree(bare / "fortran")
    for places, text in (
            ({"SUNDIALS_ROOT": make_sundials(tmp_path / "old", "5.7.0"), "HDF5_ROOT": hdf5},
             "SUNDIALS 5.7.0 was found; SUNDIALS 6 or 7 is needed"),
            ({"SUNDIALS_ROOT": bare, "HDF5_ROOT": hdf5}, "SUNDIALS 6.1.0 has no Fortran interface here: fcvode_mod.mod not found"),
            ({"SUNDIALS_ROOT": tmp_path / "no", "HDF5_ROOT": hdf5}, f"not found below SUNDIALS_ROOT = {tmp_path / 'no'}"),
            ({"SUNDIALS_ROOT": sundials, "HDF5_ROOT": make_hdf5(tmp_path / "h8", ["hdf5_fortran.so"], version="1.8.22")},
             "HDF5 1.8.22 was found; HDF5 1.10 or newer is needed")):
        result = call(tools / "flags", "include", **places)
        assert result.returncode == 1 and result.stderr.count("\n") == 1 and text in result.stderr


# A Debian system that has none of the packages and offers old ones; `apt-get install` leaves a mark.
STUBS = {
    "dpkg-query": "echo not-installed",
    "dpkg": '[ "$2" != 5.7.0-1 ]',
    "apt-cache": 'echo "  Candidate: 1:5.7.0-1"',
    "apt-get": 'case "$*" in *install*) touch "$INSTALLED" ;; esac',
    "id": 'echo "$USER_NUMBER"',
}


def build(tools, tmp_path, user, *arguments, **variables):
    """tools/build --setup on that system, by a user; was something installed?"""
    stubs = tmp_path / "stubs"
    stubs.mkdir(exist_ok=True)
    for name, text in STUBS.items():
        (stubs / name).write_text(f"#!/bin/sh\n{text}\n")
        (stubs / name).chmod(0o755)
    place = tools.parent
    touch(place / ".venv/bin/python", place / ".venv/bin/ninja")
    (place / ".venv/bin/python").write_text("#!/bin/sh\n")
    (place / ".venv/bin/python").chmod(0o755)
    (place / ".venv/requirements.installed").write_text(f"{place}\n{(tools / 'requirements.txt').read_text()}")
    path = f"{stubs}:{os.environ['PATH']}"
    result = call(tools / "build", "--setup", *arguments, PATH=path, USER_NUMBER=user, INSTALLED=tmp_path / "installed", **variables)
    return result, (tmp_path / "installed").exists()


def test_old_packages_are_refused_before_anything_is_installed(tools, tmp_path):
    result, installed = build(tools, tmp_path, 0)
    assert result.returncode == 1 and not installed
    assert "this system's gfortran is 5.7.0-1, and gfortran 12 or newer is needed; nothing was installed" in result.stderr


def test_nobody_is_asked_for_root_where_all_is_there(tools, tmp_path):
    result, installed = build(tools, tmp_path, 1000)
    assert result.returncode == 0 and not installed, result.stderr


def test_prefixes_are_remembered_and_checked(tools, tmp_path):
    sundials = make_sundials(tmp_path / "s", "5.7.0")
    result, installed = build(tools, tmp_path, 1000, f"--prefix-of=sundials={sundials}")
    assert result.returncode == 1 and "SUNDIALS 5.7.0 was found" in result.stderr and not installed
    assert "SUNDIALS 5.7.0 was found" in call(tools / "flags", "include").stderr
    for value in ("sundials=/nowhere", "sundials", "netcdf=/usr"):
        assert build(tools, tmp_path, 1000, "--prefix-of", value)[0].returncode == 1
