"""The package `rodyn`: the same results as the program, faults as exceptions, threads and processes, the C interface, notebooks."""

import concurrent.futures
import ctypes
import json
import os
import pathlib
import pickle
import re
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import xarray
from result_files import RODYN, ROOT

import rodyn
from rodyn import _case, _library

CASES = ROOT / "cases"
LIBRARY = ROOT / "build" / "stage-release" / "lib"
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
OF_A_FILE = {"hdf5_version", "created"}  # attributes that a run in memory has not, or has of its own time
CLOCK = {"wall_seconds"}


def short_case() -> rodyn.Case:
    case = rodyn.Case(CASES / "table1.nml")
    case["case.t_end"], case["case.n_outputs"], case["solver.rtol"] = 0.5, 50, 1e-6
    return case


@pytest.mark.parametrize("name", ["table1", "deployment", "accordion"])
def test_a_run_is_that_of_the_program(name, tmp_path):
    """Every bit of every array, its type, dimensions and attributes, and the attributes of the file."""
    path = tmp_path / "run.h5"
    subprocess.run([RODYN, "run", CASES / f"{name}.nml", "--output", path], check=True, capture_output=True, cwd=ROOT)
    run = rodyn.Case(CASES / f"{name}.nml").run()
    with xarray.open_dataset(path) as file, xarray.open_dataset(path, group="solver") as solver:
        own = [key for key in run.variables if not key.startswith("event_")]
        assert sorted(own) == sorted(file.variables)
        for key in own:
            assert run[key].dims == file[key].dims and run[key].dtype == file[key].dtype and run[key].attrs == file[key].attrs
            assert run[key].values.tobytes() == np.ascontiguousarray(file[key].values).tobytes()
        assert set(run.coords) == set(file.coords)
        attributes = {key: value for key, value in run.attrs.items() if not key.startswith("solver_")}
        assert set(attributes) == set(file.attrs) - {"hdf5_version"}
        assert all(attributes[key] == file.attrs[key] for key in set(attributes) - OF_A_FILE)
        assert {key.removeprefix("solver_") for key in run.attrs if key.startswith("solver_")} - {"version"} == set(solver.attrs)
        assert all(run.attrs[f"solver_{key}"] == solver.attrs[key] for key in set(solver.attrs) - CLOCK)
    if "event_time" in run:
        with xarray.open_dataset(path, group="events") as events:
            assert (run.event_hinge.values == events.hinge.values).all() and (run.event_time.values == events.time.values).all()
            assert [str(kind) for kind in run.event_kind.values] == [str(np.char.decode(np.bytes_(kind))) if isinstance(kind, bytes)
                                                                   else str(kind) for kind in events.kind.values]


@pytest.mark.parametrize(("at", "option"), [("start", []), ("loads", ["--loads"])])
def test_modes_are_those_of_the_program(at, option, tmp_path):
    path = tmp_path / "modes.h5"
    subprocess.run([RODYN, "modes", CASES / "boom_slew.nml", "--output", path, *option], check=True, capture_output=True)
    modes = rodyn.modes(rodyn.Case(CASES / "boom_slew.nml"), at)
    with xarray.open_dataset(path) as file:
        assert sorted(modes.variables) == sorted(file.variables)
        for key in modes.variables:
            assert modes[key].dims == file[key].dims
            if modes[key].dtype.kind == "f":
                assert modes[key].values.tobytes() == file[key].values.tobytes()
                assert modes[key].attrs == file[key].attrs
        assert [str(kind) for kind in modes.kind.values] == [str(kind) for kind in file.kind.values]
        assert all(modes.attrs[key] == file.attrs[key] for key in ("at", "stable", "conservative", "steady", "input"))


def test_all_faults_are_in_the_exception():
    case = rodyn.Case(text="&case t_end = -1 /\n&chain n_rods = 2, lenth = 3 /", name="mine")
    with pytest.raises(rodyn.CaseError) as raised:
        case.run()
    assert "mine:1: &case t_end = -1: must be positive [s]" in raised.value.faults
    assert any("mine:2: &chain lenth: unknown key" in fault for fault in raised.value.faults)
    printed = subprocess.run([RODYN, "check", "-"], input=case.text, capture_output=True, text=True)
    assert len(raised.value.faults) == len(printed.stderr.splitlines())


def test_a_key_that_is_no_key_is_refused_at_once():
    case = short_case()
    with pytest.raises(rodyn.CaseError, match=r"a key is written group\.name"):
        case["stiffness"] = 1
    case["chain.no_such"] = 1
    with pytest.raises(rodyn.CaseError, match="no_such: unknown key"):
        case.check()


def test_keys_are_set_and_read():
    case = short_case()
    case["chain.hinge_stiffness"] = [6e3] + 3 * [4.5e3]
    case["chain.hinge_stiffness(2)"] = np.float64(1e-3) / 3
    case["load(2).value"] = 7
    case["model.formulation"] = "consistent"
    case["output.ledger"] = False
    assert list(case["chain.hinge_stiffness"]) == [6e3, 4.5e3, 1e-3 / 3, 4.5e3] and case["chain.hinge_stiffness(2)"] == 1e-3 / 3
    assert case["load(2).value"] == 7 and case["load(3).value"] == 500 and case["model.formulation"] == "consistent"
    assert "energy_kinetic" not in case.run()
    with pytest.raises(KeyError):
        case["chain.no_such"]


def test_a_value_set_does_what_the_text_does():
    case, text = short_case(), (CASES / "table1.nml").read_text()
    case["chain.hinge_stiffness"] = [7000, 3000, 3000, 3000]
    written = rodyn.Case(text=text.replace("6000, 4000, 4000, 4000", "7000, 3*3000"))
    for key in ("case.t_end", "case.n_outputs", "solver.rtol"):
        written[key] = case[key]
    assert case.run().phi.identical(written.run().phi) and not case.run().phi.identical(short_case().run().phi)


def test_a_run_that_fails_leaves_its_rows():
    case = short_case()
    case["solver.method"], case["solver.max_steps"] = "dop853", 30
    with pytest.raises(rodyn.RunError) as raised:
        case.run()
    run = raised.value.run
    assert run.status == "failed" and 0 < run.sizes["time"] < 51 and run.message == str(raised.value)
    case["solver.max_steps"] = 100000
    whole = case.run()
    assert whole.sizes["time"] == 51 and whole.phi[:run.sizes["time"]].values.tobytes() == run.phi.values.tobytes()


def test_whoever_watches_may_stop_a_run():
    case = short_case()
    case["case.t_end"], case["solver.method"], case["solver.rtol"] = 1e4, "dop853", 1e-10
    seen = []

    def watch(t, t_end, n_steps):
        seen.append((t, t_end, n_steps))
        if len(seen) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        case.run(progress=watch)
    assert len(seen) == 3 and seen[0][0] < seen[2][0] < seen[2][1] == 1e4 and seen[0][2] < seen[2][2]


def test_ctrl_c_stops_a_run():
    code = """
import rodyn, signal
signal.signal(signal.SIGINT, signal.default_int_handler)
case = rodyn.Case('cases/table1.nml')
case['case.t_end'], case['solver.method'] = 1e6, 'dop853'
case.run(progress=lambda *_: print('runs', flush=True))
"""
    environment = os.environ | {"PYTHONPATH": str(ROOT / "postproc")}
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
                          cwd=ROOT) as process:
        assert process.stdout.readline() == "runs\n"
        process.send_signal(signal.SIGINT)
        _, printed = process.communicate(timeout=60)
    assert process.returncode != 0 and printed.rstrip().endswith("KeyboardInterrupt")


def test_data_sets_share_nothing():
    case = short_case()
    first, second = case.run(), case.run()
    kept = second.copy(deep=True)
    first.phi[:] = 7.0
    first.phi.attrs["units"] = "deg"
    first.time.attrs["units"] = "min"
    assert second.identical(kept) and case.run().phi.identical(kept.phi)
    case["case.t_end"] = 0.25
    assert float(case.run().time[-1]) == 0.25 and float(second.time[-1]) == 0.5


def test_threads_get_the_results_of_one():
    """Different cases at the same time, with what reads and writes texts."""
    def values(i):
        case = short_case()
        case["chain.hinge_stiffness"] = [5e3 + 100 * i] + 3 * [4e3]
        with pytest.raises(rodyn.CaseError, match=f"thread{i}:1"):
            rodyn.Case(text="&case t_end = -1 /", name=f"thread{i}").check()
        return case.run().phi.values.tobytes(), case.modes().frequency.values.tobytes(), case.resolved()

    alone = [values(i) for i in range(8)]
    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        assert list(pool.map(values, [*range(8)] * 3)) == alone * 3


def test_calls_of_threads_do_not_overlap(monkeypatch):
    """The library has static memory."""
    inside, most = [], []

    class Watched:
        def __getattr__(self, name):
            def call(*arguments):
                inside.append(name)
                time.sleep(0.002)
                most.append(len(inside))
                answer = getattr(_library.library, name)(*arguments)
                inside.pop()
                return answer
            return call

    monkeypatch.setattr(_case, "library", Watched())
    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda _: short_case().resolved(), range(8)))
    assert len(most) > 30 and max(most) == 1


def test_other_threads_go_on_during_a_run():
    case = short_case()
    case["case.t_end"], case["solver.method"], case["solver.rtol"] = 1e4, "dop853", 1e-10
    stop, counted = threading.Event(), []

    def watch(t, t_end, n_steps):
        if stop.is_set():
            raise RuntimeError("enough")

    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        running = pool.submit(case.run, watch)
        while len(counted) < 1000 and not running.done():
            counted.append(sum(range(1000)))
        stop.set()
        with pytest.raises(RuntimeError, match="enough"):
            running.result(timeout=60)
    assert len(counted) == 1000


def test_a_case_travels_to_another_process():
    case = short_case()
    case["chain.hinge_damping"] = 0.5
    again = pickle.loads(pickle.dumps(case))
    assert again.resolved() == case.resolved() and again.run().phi.identical(case.run().phi)
    assert case.copy().resolved() == case.resolved()


@pytest.mark.parametrize("workers", [1, 2])
def test_a_sweep_over_processes(workers):
    case = short_case()
    table = rodyn.sweep(case, {"chain.hinge_damping": [0.0, 0.5, -1.0], "chain.hinge_stiffness(0)": [5e3, 6e3]},
                        {"phi": lambda run: run.phi[-1].values, "largest": lambda run: abs(run.omega).max()}, workers=workers)
    assert table.phi.dims == ("chain.hinge_damping", "chain.hinge_stiffness(0)", "phi_0") and table.phi.shape == (3, 2, 4)
    one = case.copy()
    one["chain.hinge_damping"], one["chain.hinge_stiffness(0)"] = 0.5, 5e3
    assert table.phi[1, 0].values.tobytes() == one.run().phi[-1].values.tobytes()
    assert np.isnan(table.largest[2]).all() and "hinge_damping = -1" in str(table.message[2, 0].values) and table.message[0, 0] == ""


def test_arrays_are_those_of_the_data_set():
    run, arrays = short_case().run(), short_case().arrays()
    assert set(arrays) == set(run.variables) and all(arrays[name].tobytes() == run[name].values.tobytes() for name in arrays)


def test_results_do_not_stay_in_memory():
    case = short_case()
    case["case.n_outputs"] = 5000
    size = sum(values.nbytes for values in case.arrays().values())
    before = resident()
    for _ in range(20):
        case.arrays()
    assert resident() - before < 3 * size


def resident() -> int:
    """Memory of this process [bytes]."""
    return int(pathlib.Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")


def test_the_library_needs_neither_mpi_nor_hdf5():
    needed = subprocess.run(["ldd", LIBRARY / "librodyn.so"], capture_output=True, text=True, check=True).stdout
    assert "sundials" in needed and not re.search("mpi|hdf5", needed)


def test_declarations_are_those_of_the_header():
    """Each call of rodyn.h is declared in Python with as many arguments, and is there."""
    header = (ROOT / "src" / "rodyn" / "interface" / "rodyn.h").read_text()
    calls = {name: 0 if arguments == "void" else arguments.count(",") + 1
             for name, arguments in re.findall(r"\b(rodyn_\w+)\(([^)]*)\);", header)}
    assert calls == {name: len(arguments) for name, (_, arguments) in _library.SIGNATURES.items()}
    exported = subprocess.run(["nm", "-D", "--defined-only", LIBRARY / "librodyn.so"], capture_output=True, text=True).stdout
    assert set(re.findall(r" T (\w+)", exported)) == set(calls)


def test_the_example_in_c(tmp_path):
    """The program of docs/python.md, compiled and run, prints what Python computes."""
    (source,) = re.findall(r"```c\n(.*?)```", (ROOT / "docs" / "python.md").read_text(), re.DOTALL)
    (tmp_path / "example.c").write_text(source)
    subprocess.run(["gcc", "-Wall", "-Wextra", "-Werror", f"-I{ROOT / 'src/rodyn/interface'}", "example.c", "-o", "example",
                    f"-L{LIBRARY}", "-l:librodyn.so", f"-Wl,-rpath,{LIBRARY}"], cwd=tmp_path, check=True)
    printed = subprocess.run([tmp_path / "example"], capture_output=True, text=True, cwd=ROOT)
    case = rodyn.Case(CASES / "table1.nml")
    case["chain.hinge_stiffness"] = [6e3] + 3 * [4e3]
    assert printed.returncode == 0 and float(re.search(r"phi_4 = (\S+) rad", printed.stdout)[1]) == float(case.run().phi[-1, 3])


@pytest.mark.long
def test_pip_installs_package_library_and_scripts(tmp_path):
    """Without a network: nothing is needed to build the wheel."""
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps", "--no-index", "--no-compile",
               "--target", tmp_path, ROOT / "postproc"]
    subprocess.run(command, check=True, capture_output=True)
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"} | {"PYTHONPATH": str(tmp_path)}
    code = "import rodyn; case = rodyn.Case('cases/table1.nml'); print(rodyn.__file__, case['chain.n_rods'], len(case.modes().mode))"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, cwd=ROOT)
    assert printed.stdout.split() == [str(tmp_path / "rodyn" / "__init__.py"), "4", "15"], printed.stderr
    helped = subprocess.run([tmp_path / "bin" / "rodyn-plot", "histories", "--help"], capture_output=True, text=True, env=environment)
    assert helped.returncode == 0 and "rodyn-plot histories" in helped.stdout
    asked = subprocess.run([tmp_path / "bin" / "rodyn-plot", "nonsense"], capture_output=True, text=True, env=environment)
    assert asked.returncode == 2 and "histories" in asked.stderr


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(path, monkeypatch):
    """All cells, one after the other; what they assert holds."""
    monkeypatch.chdir(path.parent)
    cells = json.loads(path.read_text())["cells"]
    names = {"__name__": "notebook"}
    for i, cell in enumerate(cells):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{path.name}, cell {i}", "exec"), names)
    assert any("assert " in "".join(cell["source"]) for cell in cells)


def test_there_are_notebooks():
    assert {path.stem for path in NOTEBOOKS} == {"identification", "monte_carlo", "attitude_slew"}


def test_structures_have_the_size_of_c(tmp_path):
    (tmp_path / "size.c").write_text('#include "rodyn.h"\n#include <stdio.h>\n'
                                     'int main(void) { printf("%zu %zu", sizeof(rodyn_array), sizeof(rodyn_attribute)); }\n')
    subprocess.run(["gcc", f"-I{ROOT / 'src/rodyn/interface'}", "size.c", "-o", "size"], cwd=tmp_path, check=True)
    sizes = subprocess.run([tmp_path / "size"], capture_output=True, text=True).stdout.split()
    assert sizes == [str(ctypes.sizeof(_library.Array)), str(ctypes.sizeof(_library.Attribute))]
