"""Files for the tests of postproc/: runs by bin/rodyn (or RODYN), sweeps and benchmarks in the layout of the documentation."""

import os
import pathlib
import subprocess

import h5py
import numpy as np
import xarray

ROOT = pathlib.Path(__file__).resolve().parents[2]
RODYN = os.environ.get("RODYN", str(ROOT / "bin" / "rodyn"))

FREE = "&spacecraft mass = 100, inertia = 10, hinge_x = 0.4, hinge_y = 0.1 /\n"
LOADS = (
    "&load component = 'M', t_end = 0.3, value = 400 /\n"
    "&load component = 'X', t_end = 0.3, value = 200 /\n"
)
CHAIN = (
    "&chain n_rods = {n}, length = {l}, mass_per_length = 1.7, bending_stiffness = 1e4, node_mass = {mu}, "
    "hinge_stiffness = 3000, hinge_damping = 0.01 /\n"
)


def case(title: str, n: int, model: str = "", *, length: float = 1.2, spacecraft: str = FREE, extra: str = "", t_end: float = 0.5,
         node_mass: float = 0.5, n_outputs: int = 200, loads: str = LOADS) -> str:
    return (
        f"&case title = '{title}', t_end = {t_end}, n_outputs = {n_outputs} /\n" + spacecraft
        + CHAIN.format(n=n, l=length, mu=node_mass) + f"&model {model} /\n" + loads + extra
    )


SCENES = {
    "n1": case("One rod", 1),
    "n4": case("Four rods", 4, "formulation = 'paper'"),
    "n40": case("Forty rods, fixed", 40, "inertia = 'lumped', bending = 'rigid'", length=0.05, node_mass=0,
                spacecraft="&spacecraft motion = 'fixed' /\n",
                loads="&load target = 'node', node = 40, component = 'Y', t_end = 0.3, value = 5 /\n"),
    "rigid": case("Rigid rods", 3, "bending = 'rigid'"),
    "lumped": case("Lumped rods, quasistatic bending", 3, "inertia = 'lumped', bending = 'quasistatic'"),
    "failed": case("A run that fails", 2, extra="&solver method = 'dop853', max_steps = 40 /\n"),
    "no_ledger": case("No ledger", 2, extra="&output ledger = .false. /\n"),
    "rest": case("At rest", 2, loads=""),
}
COMPLETE = [name for name in SCENES if name != "failed"]


def read(path: pathlib.Path, group: str = "/") -> xarray.Dataset:
    """What `xarray.load_dataset` reads, at a fiftieth of its time, in which h5netcdf asks again and again how long a dimension is."""
    with h5py.File(path) as file:
        variables = {}
        for name, data in file[group].items():
            if isinstance(data, h5py.Dataset):
                dimensions = [name] if data.is_scale else [scale[0].name.rpartition("/")[2] for scale in data.dims]
                values = data.asstr()[()] if data.dtype.kind in "SO" else data[()]
                variables[name] = (dimensions, values, attributes(data))
        return xarray.Dataset(variables, attrs=attributes(file[group]))


def attributes(of: h5py.HLObject) -> dict[str, object]:
    """Attributes, without those by which HDF5 holds dimensions together."""
    kept = {name: value for name, value in of.attrs.items() if name not in ("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST")}
    return {name: value.decode() if isinstance(value, bytes) else value for name, value in kept.items() if name[0] != "_"}


def make_runs(directory: pathlib.Path) -> dict[str, pathlib.Path]:
    paths = {}
    for name, text in SCENES.items():
        (directory / f"{name}.nml").write_text(text)
        paths[name] = directory / f"{name}.h5"
        done = subprocess.run([RODYN, "run", str(directory / f"{name}.nml"), "--output", str(paths[name])],
                              capture_output=True, text=True)
        assert done.returncode == (1 if name == "failed" else 0), done.stderr
    return paths


def write_sweep(path: pathlib.Path, axes: dict[str, list], phi: np.ndarray, failed=(), probe_times=(1.0,), title="A sweep",
                text_type="S16") -> pathlib.Path:
    """A sweep file: phi (case, probe_time, rod) is given, all other states follow from it."""
    n_cases, _, n_rods = phi.shape
    bad = np.isin(np.arange(n_cases), list(failed))
    with h5py.File(path, "w") as file:
        file.attrs["title"] = np.bytes_(title)
        file.attrs["input"] = np.bytes_("&sweep base = 'x.nml' /")
        file.attrs["program_version"] = np.bytes_("0.1.0")
        file["case"], file["probe_time"], file["rod"] = np.arange(n_cases), np.array(probe_times), np.arange(1, n_rods + 1)
        file["probe_time"].attrs["units"] = np.bytes_("s")
        for factor, name in enumerate(("phi", "alpha", "beta", "phi_rate", "alpha_rate", "beta_rate")):
            file[name] = np.where(bad[:, None, None], np.nan, phi * 10.0**-factor)
            describe(file[name], "rad s-1" if name.endswith("rate") else "rad", f"{name} of a rod, at the probe times")
        for factor, name in enumerate(("velocity_x", "velocity_y", "omega", "displacement_x", "displacement_y", "rotation")):
            file[name] = np.where(bad[:, None], np.nan, phi[:, :, 0] + factor)
        file["final_phi"] = phi[:, -1] + 100.0
        describe(file["final_phi"], "rad", "phi of a rod, at the end of the case")
        file["final_rotation"] = phi[:, -1, 0] + 100.0
        for key, values in axes.items():
            column = np.array(values)
            if column.dtype.kind == "U":
                column = column.astype(text_type) if text_type != "vlen" else column.astype(h5py.string_dtype())
            file[f"param_{key}"] = column
            describe(file[f"param_{key}"], AXIS_UNITS.get(key, "1"), f"value of {key}")
        file["status"] = np.where(bad, "failed", "done").astype("S8")
        file["message"] = np.where(bad, "t = 0.3 s: step size too small", "").astype("S64")
        file["t_reached"] = np.where(bad, 0.3, probe_times[-1])
        file["n_rhs"] = np.arange(n_cases) * 100
        file["wall_seconds"] = np.full(n_cases, 0.01)
        for scale in ("case", "probe_time", "rod"):
            file[scale].make_scale(scale)
        for name, data in file.items():
            for i, scale in enumerate(() if data.is_scale else scales_of(name, data.ndim)):
                data.dims[i].attach_scale(file[scale])
    return path


AXIS_UNITS = {"chain.hinge_stiffness(0)": "N m rad-1", "solver.fixed_step": "s"}


def describe(data: h5py.Dataset, units: str, long_name: str) -> None:
    data.attrs["units"], data.attrs["long_name"] = np.bytes_(units), np.bytes_(long_name)


def scales_of(name: str, rank: int) -> list[str]:
    """What a data set of a sweep runs over."""
    return (["case", "rod"] if name.startswith("final_") else ["case", "probe_time", "rod"])[:rank]


RATIOS = [2.0, 4.0, 8.0, 16.0, 32.0]
STIFFNESS = np.geomspace(1e3, 1e4, 6)
STEPS = np.array([1e-2, 5e-3, 2.5e-3, 1.25e-3, 6.25e-4])


def make_sweeps(directory: pathlib.Path) -> dict[str, pathlib.Path]:
    """'inertia': exact is -1/ratio of rod k times k, lumped 10 % more; 'grid'; 'orders': errors 3 h^2 and 5 h^4."""
    paths = {}
    ratio = np.repeat(RATIOS, 2)
    inertia = ["distributed", "lumped"] * 5
    rod = np.arange(1, 5)
    phi = (-1.0 / ratio * np.where(np.arange(10) % 2, 1.1, 1.0))[:, None, None] * rod
    axes = {"mass_ratio": list(ratio), "model.inertia": inertia}
    paths["inertia"] = write_sweep(directory / "inertia.h5", axes, phi, title="Mass ratio and inertia")
    paths["inertia_failed"] = write_sweep(directory / "inertia_failed.h5", axes, phi, failed=[3], text_type="vlen")

    x, y = (g.ravel() for g in np.meshgrid(RATIOS, STIFFNESS, indexing="ij"))
    paths["grid"] = write_sweep(directory / "grid.h5", {"mass_ratio": list(x), "chain.hinge_stiffness(0)": list(y)},
                                (x * np.log10(y))[:, None, None] * np.ones((1, 1, 1)), failed=[0, 7, 22], title="Ratio and stiffness")

    method = ["erk"] * STEPS.size + ["dop853"] * STEPS.size
    h = np.tile(STEPS, 2)
    error = np.where(np.arange(h.size) < STEPS.size, 3 * h**2, 5 * h**4)
    values = (0.25 + error)[:, None, None] * np.ones((1, 1, 4))
    paths["orders"] = write_sweep(directory / "orders.h5", {"solver.fixed_step": list(h), "solver.method": method}, values,
                                  title="Fixed steps", failed=[0])
    everything = np.full((3, 1, 2), np.nan)
    paths["all_failed"] = write_sweep(directory / "all_failed.h5", {"mass_ratio": [1.0, 2.0, 3.0]}, everything, failed=[0, 1, 2])
    return paths


def write_benchmark(path: pathlib.Path) -> pathlib.Path:
    with h5py.File(path, "w") as file:
        for scene in ("table1", "beam"):
            group = file.create_group(scene)
            group.attrs["title"] = np.bytes_(f"Scene {scene}")
            group["method"] = np.array(["adams"] * 3 + ["dop853"] * 3, dtype="S8")
            group["rtol"] = np.tile([1e-4, 1e-8, 1e-12], 2)
            group["seconds"] = np.array([1.0, 2.0, 4.0, 0.5, 0.7, 1.1])
            group["error_phi"] = np.array([1e-3, 1e-7, np.nan, 1e-5, 1e-9, 1e-12])
            if scene == "table1":
                group["error_alpha_rate"] = group["error_phi"][()] * 100
    return path


def write_large_run(path: pathlib.Path, like: pathlib.Path, megabytes: int) -> int:
    """A run file of so many megabytes on disk with the scene of another one; returns the row of a peak that lasts one row."""
    with h5py.File(like) as source, h5py.File(path, "w") as file:
        for name, value in source.attrs.items():
            file.attrs[name] = value
        sets = {name: data for name, data in source.items() if isinstance(data, h5py.Dataset)}
        row_bytes = sum(8 * int(np.prod(data.shape[1:])) for name, data in sets.items() if name not in ("rod", "hinge", "node"))
        rows = megabytes * 1_000_000 // row_bytes + 1
        time = np.linspace(0.0, 100.0, rows)
        peak = rows // 3
        for i, (name, data) in enumerate(sets.items()):
            if name in ("rod", "hinge", "node"):
                values = data[()]
            elif name == "time":
                values = time
            else:
                values = np.sin((5 + i) * time)
                values[peak] = 7.0
                values = values if data.ndim == 1 else np.repeat(values[:, None], data.shape[1], axis=1)
            file[name] = values
            for key in ("units", "long_name"):
                file[name].attrs[key] = data.attrs[key]
        for name, data in sets.items():
            if data.is_scale:
                file[name].make_scale(name)
        for name, data in sets.items():
            for i, dimension in enumerate(data.dims):
                for scale in dimension.values():
                    file[name].dims[i].attach_scale(file[scale.name])
    return peak
