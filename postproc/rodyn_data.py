"""Run, sweep and benchmark files of Rodyn. What a data set runs over, its unit and its meaning are read from the file.

    with open_run("example.h5") as run:
        phi_4 = run.quantity("phi(4)")   # values, symbol, unit

What a file lacks is said by a DataError, in words for its user.
"""

from __future__ import annotations

import pathlib
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import h5py
import numpy as np
from namelist import Group, read_namelist


class DataError(Exception):
    """The file is not what was asked for, or lacks something."""


class Quantity(NamedTuple):
    """Numbers that can be put on an axis."""

    name: str
    values: np.ndarray
    symbol: str  # for matplotlib
    unit: str  # for matplotlib
    meaning: str

    @property
    def label(self) -> str:
        return f"{self.symbol} [{self.unit}]" if self.unit else self.symbol


class Event(NamedTuple):
    """Something that a hinge did."""

    time: float
    hinge: int
    kind: str  # released, latched, at_upper_stop, slides, ...
    energy_lost: float  # J


TIME = "time"
PROBE_TIME = "probe_time"  # of sweeps
SYMBOLS = {  # for matplotlib; others are called by their names
    "phi": r"\varphi", "alpha": r"\alpha", "beta": r"\beta", "bubble": "c",
    "phi_rate": r"\dot{\varphi}", "alpha_rate": r"\dot{\alpha}", "beta_rate": r"\dot{\beta}", "bubble_rate": r"\dot{c}",
    "velocity_x": "V_x", "velocity_y": "V_y", "omega": r"\omega",
    "displacement_x": "u_x", "displacement_y": "u_y", "rotation": r"\theta",
    "energy_kinetic": "T", "energy_elastic": r"\Pi", "energy_dissipated": "E_D", "work_external": "W",
    "energy_residual": "r_E", "momentum_x": "P_X", "momentum_y": "P_Y", "angular_momentum": "L",
    "frequency": r"\Omega", "damping_ratio": r"\zeta",  # of sweeps
}
LEDGER = ("energy_", "work_", "momentum_", "angular_momentum")  # how names of the ledger begin
MODES_SHOWN = 4  # without being asked
RATE_OF = {
    "phi": "phi_rate", "alpha": "alpha_rate", "beta": "beta_rate", "bubble": "bubble_rate",
    "displacement_x": "velocity_x", "displacement_y": "velocity_y", "rotation": "omega",
}
FINAL = "final_"  # states at the end of each case of a sweep
WORDS = {  # for axes of sweeps and columns of sweep files; others are called by their keys
    "mass_ratio": "total node mass / total rod mass", "case.n_outputs": "number of output intervals",
    "case.t_end": "end of the simulated time", "spacecraft.mass": r"mass of the spacecraft $M_0$",
    "spacecraft.inertia": r"inertia $J_0$", "spacecraft.hinge_x": r"hinge place $x_0$", "spacecraft.hinge_y": r"hinge place $y_0$",
    "chain.n_rods": r"number of rods $n$", "chain.length": r"length $l$", "chain.mass_per_length": r"mass per length $m$",
    "chain.bending_stiffness": r"bending stiffness $EI$", "chain.node_mass": r"node mass $\mu$",
    "chain.hinge_stiffness": r"hinge stiffness $C$", "chain.hinge_damping": r"hinge damping $D$", "chain.kink": r"kink $\gamma$",
    "model.inertia": "inertia", "model.formulation": "formulation", "model.bending": "bending",
    "solver.rtol": "relative tolerance", "solver.atol": "absolute tolerance", "solver.fixed_step": r"step $\Delta t$",
    "solver.max_step": "longest step", "solver.method": "method",
    "n_rhs": "right-hand-side evaluations", "wall_seconds": "wall time", "t_reached": "time reached",
}
VERSION_ATTRIBUTES = [
    "program_version", "git_commit", "compiler", "compiler_options", "sundials_version", "hdf5_version", "hostname", "created",
]


def unit_text(unit: str) -> str:
    """'kg m2 s-1' as 'kg m²/s'."""
    above, below = [], []
    for word in unit.split():
        name, power = re.fullmatch(r"(.*?)(-?\d*)", word).groups()
        exponent = int(power or 1)
        digits = "" if abs(exponent) == 1 else str(abs(exponent)).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
        (above if exponent > 0 else below).append(name + digits)
    if not below:
        return " ".join(above)
    bottom = " ".join(below)
    return f"{' '.join(above) or '1'}/{bottom if len(below) == 1 else f'({bottom})'}"


def text_of(value: Any) -> Any:
    """Texts and numbers of HDF5 as Python's."""
    if isinstance(value, bytes):
        return value.decode(errors="replace").rstrip("\0 ")
    return value.item() if isinstance(value, np.generic) else value


def split_name(text: str) -> tuple[str, int | None]:
    """'phi(4)' -> 'phi', 4; 'omega' -> 'omega', None."""
    match = re.fullmatch(r"\s*(\w+)\s*(?:\(\s*(\d+)\s*\))?\s*", text)
    if match is None:
        raise DataError(f"'{text}' is no quantity; write for example omega or phi(4)")
    return match[1], None if match[2] is None else int(match[2])


def symbol_text(name: str, rod: int | None = None) -> str:
    """The symbol of a quantity, in matplotlib's notation."""
    symbol = SYMBOLS.get(name)
    if symbol is None:
        return name if rod is None else f"{name}({rod})"
    return f"${symbol}$" if rod is None else f"${symbol}_{{{rod}}}$"


class ResultFile:
    """What run and sweep files have in common. Data sets are read when they are asked for."""

    def __init__(self, path: str | pathlib.Path, file: h5py.File):
        self.path = pathlib.Path(path)
        self.file = file

    def attributes(self) -> dict[str, Any]:
        return {name: text_of(value) for name, value in self.file.attrs.items()}

    def dimensions(self, name: str) -> list[str]:
        """What a data set runs over, as its dimension scales say: time and rod; case, probe_time and rod; ..."""
        return [dimension[0].name.rpartition("/")[2] if len(dimension) else "" for dimension in self.file[name].dims]

    def place(self, name: str, counted: str | None, number: int | None) -> int | None:
        """Where entry `number` of dimension `counted` stands, rod 4 or hinge 0; None where nothing counts."""
        if counted is None:
            if number is not None:
                raise DataError(f"{self.path}: '{name}' does not belong to a rod, a hinge, a node or a mode: write {name}")
            return None
        entries = self.file[counted][()]
        if number is None:
            raise DataError(f"{self.path}: '{name}' has one column per {counted}: write {name}({entries[0]}) to {name}({entries[-1]})")
        if number not in entries:
            raise DataError(f"{self.path}: no {counted} {number}: there are {counted}s {entries[0]} to {entries[-1]}")
        return int(np.flatnonzero(entries == number)[0])

    def unit(self, name: str) -> str:
        unit = text_of(self.file[name].attrs.get("units", ""))
        return "" if unit in ("1", "none") else unit_text(unit)

    def meaning(self, name: str, counted: str | None, number: int | None) -> str:
        meaning = text_of(self.file[name].attrs.get("long_name", name)).removesuffix(", at the probe times")
        return meaning + (f" ({counted} {number})" if counted else "")


class Run(ResultFile):
    """One run file."""

    def __init__(self, path: str | pathlib.Path, file: h5py.File):
        super().__init__(path, file)
        if "case" in file and TIME not in file:
            raise DataError(f"{path}: is a sweep file; this script reads run files")
        for name in (TIME, "phi"):
            if name not in file:
                raise DataError(f"{path}: is no run file of Rodyn: no data set '{name}'")
        self.n_rods = file["phi"].shape[1]
        self._scene: dict[str, list[Group]] | None = None

    @property
    def time(self) -> np.ndarray:
        return self.rows(TIME)

    @property
    def title(self) -> str:
        return self.attribute("title", "") or self.path.stem

    @property
    def status(self) -> str:
        return self.attribute("status", "unknown")

    @property
    def has_ledger(self) -> bool:
        return "energy_residual" in self.file

    def attribute(self, name: str, default: Any = None) -> Any:
        return text_of(self.file.attrs[name]) if name in self.file.attrs else default

    def numbers(self) -> list[str]:
        """Names of the quantities that have one number at each time."""
        return [name for name, data in self.file.items() if isinstance(data, h5py.Dataset) and name != TIME
                and self.dimensions(name) == [TIME]]

    def events(self) -> list[Event]:
        """What hinges did, in order; empty if nothing could happen."""
        if "events" not in self.file:
            return []
        group = self.file["events"]
        columns = (group["time"][()], group["hinge"][()], group["kind"].asstr()[()], group["energy_lost"][()])
        return [Event(float(t), int(hinge), str(kind), float(lost)) for t, hinge, kind, lost in zip(*columns, strict=True)]

    def solver(self) -> dict[str, Any]:
        """What the solver did; empty if the file does not say."""
        group = self.file.get("solver")
        return {} if group is None else {name: text_of(value) for name, value in group.attrs.items()}

    def rows(self, name: str, rows: Any = ()) -> np.ndarray:
        """A data set, or some of its rows (strictly rising)."""
        if name not in self.file:
            raise DataError(f"{self.path}: no data set '{name}'" + self._why_missing(name))
        return self.file[name][rows]

    def _why_missing(self, name: str) -> str:
        if name.startswith(LEDGER):
            return "; the case was run with ledger = .false."
        return f"; it has {', '.join(sorted(k for k, v in self.file.items() if isinstance(v, h5py.Dataset)))}"

    def quantity(self, text: str) -> Quantity:
        """'omega', or 'phi(4)' of one rod, 'hinge_angle(0)' of one hinge."""
        name, number = split_name(text)
        if name not in self.file:
            self.rows(name)
        counted = next(iter(self.dimensions(name)[1:]), None)
        i = self.place(name, counted, number)
        values = self.file[name][()] if i is None else self.file[name][:, i]
        return Quantity(text.replace(" ", ""), values, symbol_text(name, number), self.unit(name), self.meaning(name, counted, number))

    def scene(self) -> dict[str, list[Group]]:
        """The namelist with every value that was used."""
        if self._scene is None:
            text = self.attribute("resolved_input")
            if text is None:
                raise DataError(f"{self.path}: no attribute 'resolved_input', so the scene is not known")
            self._scene = read_namelist(text)
        return self._scene

    def group(self, name: str) -> Group:
        return self.scene().get(name, [{}])[0]

    def per_rod(self, name: str) -> np.ndarray:
        """A key of &chain as an array over the rods (or nodes 1..n, or hinges 0..n-1)."""
        values = self.group("chain").get(name)
        if values is None:
            raise DataError(f"{self.path}: its resolved input has no &chain {name}")
        values = np.atleast_1d(np.asarray(values, dtype=float))
        return np.full(self.n_rods, values[0]) if values.size == 1 else values

    def number(self, group: str, key: str, default: float | None = None) -> float | None:
        value = self.group(group).get(key, default)
        return default if value is None else float(value)

    def nearest_row(self, t: float) -> int:
        """The row closest to time t, which must lie within the run."""
        time = self.time
        margin = 1e-9 * max(1.0, abs(time[-1]))
        if not time[0] - margin <= t <= time[-1] + margin:
            raise DataError(f"{self.path}: no row at t = {t:g} s: it has {time.size} rows, {time[0]:g} to {time[-1]:g} s")
        return int(np.argmin(np.abs(time - t)))


class Modes(Run):
    """One file of `rodyn modes`. Shapes are complex."""

    def __init__(self, path: str | pathlib.Path, file: h5py.File):
        ResultFile.__init__(self, path, file)
        for name in ("mode", "phi_real"):
            if name not in file:
                raise DataError(f"{path}: is no file of rodyn modes: no data set '{name}'")
        self.n_rods = file["phi_real"].shape[1]
        self._scene = None

    def kinds(self) -> list[str]:
        return texts(self.file["kind"])

    def oscillations(self) -> list[int]:
        """Where the oscillations stand, the slowest first."""
        return [i for i, kind in enumerate(self.kinds()) if kind == "oscillation"]

    def index(self, number: int) -> int:
        """Where mode `number` stands."""
        if not 1 <= number <= self.file["mode"].size:
            raise DataError(f"{self.path}: no mode {number}: it has modes 1 to {self.file['mode'].size}")
        return number - 1

    def shape(self, i: int) -> dict[str, np.ndarray]:
        """Changes of the coordinates in mode i."""
        return {name: self.file[f"{name}_real"][i] + 1j * self.file[f"{name}_imag"][i]
                for name in RATE_OF if f"{name}_real" in self.file}  # bubbles are there with three shapes

    def state(self) -> dict[str, np.ndarray]:
        """The coordinates about which the equations were linearised; slopes that follow from moments are left out."""
        values = dict(zip(texts(self.file["coordinate"]), self.file["state"][()], strict=True))
        names = [name for name in ("phi", "alpha", "beta", "bubble") if f"{name}_real" in self.file]
        per_rod = {name: np.array([values.get(f"{name}_{k}", 0.0) for k in range(1, self.n_rods + 1)]) for name in names}
        return per_rod | {name: np.float64(values.get(name, 0.0)) for name in ("displacement_x", "displacement_y", "rotation")}


class Sweep(ResultFile):
    """One sweep file. `axes` maps each axis to its value in every case."""

    def __init__(self, path: str | pathlib.Path, file: h5py.File):
        super().__init__(path, file)
        if "status" not in file or not isinstance(file["status"], h5py.Dataset):
            kind = "a run file; this script reads sweep files" if TIME in file else "no sweep file of Rodyn: no data set 'status'"
            raise DataError(f"{path}: is {kind}")
        self.status = texts(file["status"])
        self.axes = {name.removeprefix("param_"): column(file[name]) for name in file if name.startswith("param_")}
        self.probe_times = np.atleast_1d(file[PROBE_TIME][()]) if PROBE_TIME in file else np.array([np.nan])

    @property
    def title(self) -> str:
        return text_of(self.file.attrs.get("title", "")) or self.path.stem

    @property
    def n_cases(self) -> int:
        return len(self.status)

    @property
    def failed(self) -> np.ndarray:
        """Which cases were tried and gave no result."""
        return np.array([status not in ("done", "pending", "running", "") for status in self.status])

    @property
    def done(self) -> np.ndarray:
        return np.array([status == "done" for status in self.status])

    def messages(self) -> list[str]:
        return texts(self.file["message"]) if "message" in self.file else [""] * self.n_cases

    def axis(self, name: str) -> np.ndarray:
        if name not in self.axes:
            raise DataError(f"{self.path}: no axis '{name}'; it has {', '.join(self.axes) or 'none'}")
        return self.axes[name]

    def probe(self, t: float | None) -> int:
        """Index of a probe time; by default of the last one."""
        if t is None:
            return self.probe_times.size - 1
        i = int(np.argmin(np.abs(self.probe_times - t)))
        if not abs(self.probe_times[i] - t) <= 1e-9 * max(1.0, abs(t)):
            known = ", ".join(f"{p:g}" for p in self.probe_times)
            raise DataError(f"{self.path}: no probe time {t:g} s; it has {known} s")
        return i

    @property
    def n_rods(self) -> int:
        """Rods of the longest chain; 0 if nothing was integrated."""
        return self.file["phi"].shape[-1] if "phi" in self.file else 0

    @property
    def n_modes(self) -> int:
        """Natural frequencies that some case has; 0 if none were wanted."""
        return int(np.isfinite(self.file["frequency"][()]).any(axis=0).sum()) if "frequency" in self.file else 0

    def states(self) -> list[str]:
        """Quantities worth a first look: angles of the first and the last rod."""
        return [f"phi({k})" for k in sorted({1, self.n_rods})] if self.n_rods else []

    def frequencies(self) -> list[str]:
        """The slowest natural frequencies."""
        return [f"frequency({k})" for k in range(1, min(MODES_SHOWN, self.n_modes) + 1)]

    def is_probed(self, text: str) -> bool:
        """Does the quantity depend on the probe time?"""
        name = split_name(text)[0]
        return name in self.file and PROBE_TIME in self.dimensions(name)

    def quantity(self, text: str, t: float | None = None) -> Quantity:
        """A state at a probe time, 'phi(4)', or a number of each case, 'n_rhs', 'frequency(2)'; NaN where a case has none."""
        name, number = split_name(text)
        if name not in self.file or self.file[name].dtype.kind not in "fiu":
            raise DataError(f"{self.path}: no data set '{name}'; it has {', '.join(n for n in self.file if self._has_number(n))}")
        of = self.dimensions(name)[1:]
        if "row" in of:
            raise DataError(f"{self.path}: '{name}' is a series in time, not a number of each case")
        counted = next((what for what in of if what != PROBE_TIME), None)
        place = self.place(name, counted, number)
        where = tuple(self.probe(t) if what == PROBE_TIME else place for what in of)
        values = np.where(self.done, self.file[name][(slice(None), *where)].astype(float), np.nan)
        symbol = WORDS.get(name) or symbol_text(name.removeprefix(FINAL), number)
        meaning = WORDS.get(name) or self.meaning(name, counted, number)
        return Quantity(text.replace(" ", ""), values, symbol, self.unit(name), meaning)

    def _has_number(self, name: str) -> bool:
        """Is it a quantity of each case?"""
        data = self.file[name]
        return (isinstance(data, h5py.Dataset) and data.dtype.kind in "fiu" and not name.startswith("param_")
                and self.dimensions(name)[:1] == ["case"] and "row" not in self.dimensions(name))

    def axis_label(self, name: str) -> str:
        key, index = re.fullmatch(r"(.*?)(\(\d+\))?", name).groups()
        words = WORDS.get(key, name)
        if index and words.endswith("$"):
            words = f"{words[:-1]}_{{{index[1:-1]}}}$"
        unit = self.unit(f"param_{name}")
        return f"{words} [{unit}]" if unit else words

    def chosen(self, where: Mapping[str, str | float]) -> np.ndarray:
        """Which cases have these values on these axes."""
        keep = np.ones(self.n_cases, dtype=bool)
        for name, wanted in where.items():
            values = self.axis(name)
            if values.dtype.kind in "fiu":
                try:
                    match = np.isclose(values.astype(float), float(wanted), rtol=1e-6, atol=0)
                except ValueError:
                    raise DataError(f"{self.path}: axis '{name}' holds numbers, not '{wanted}'") from None
            else:
                match = values == str(wanted)
            if not match.any():
                known = ", ".join(str(v) for v in distinct(values))
                raise DataError(f"{self.path}: no case with {name} = {wanted}; it has {known}")
            keep &= match
        return keep

    def split(self, axes: Sequence[str], where: Mapping[str, str | float]) -> tuple[list[str], dict[tuple, list[int]]]:
        """The other axes that change among the chosen cases, and the cases by their values on them."""
        keep = self.chosen(where)
        others = [a for a in self.axes if a not in axes and a not in where and not self._follows(a, axes, keep)]
        groups: dict[tuple, list[int]] = {}
        for case in np.flatnonzero(keep):
            groups.setdefault(tuple(text_of(self.axes[a][case]) for a in others), []).append(int(case))
        return others, groups

    def _follows(self, name: str, axes: Sequence[str], keep: np.ndarray) -> bool:
        """True if the axis is constant, or a function of `axes`, such as a tolerance that goes along with another."""
        known: dict[tuple, Any] = {}
        fixed = [self.axis(a) for a in axes]
        for case in np.flatnonzero(keep):
            key = tuple(text_of(values[case]) for values in fixed)
            value = text_of(self.axes[name][case])
            if known.setdefault(key, value) != value:
                return False
        return True

    def series(self, text: str, axes: Sequence[str], where: Mapping[str, str | float], t: float | None) -> list[Series]:
        """One line for each set of values on the axes that are not in `axes`."""
        others, groups = self.split(axes, where)
        quantity = self.quantity(text, t)
        return [
            Series(dict(zip(others, key, strict=True)), np.array(cases), quantity._replace(values=quantity.values[cases]))
            for key, cases in groups.items()
        ]


class Series(NamedTuple):
    """Cases of a sweep that agree on all axes but those of the plot."""

    where: dict[str, Any]
    cases: np.ndarray
    quantity: Quantity

    @property
    def label(self) -> str:
        return ", ".join(
            value if isinstance(value, str) else f"{name.rpartition('.')[2]} = {value:.4g}" for name, value in self.where.items()
        )


class BenchmarkScene(NamedTuple):
    """Runs of one scene by several methods at several tolerances, or of several models of its rods with several numbers of them."""

    name: str
    title: str
    line: np.ndarray  # method or model
    rods: np.ndarray  # that each beam is cut into; 0: methods are compared
    rtol: np.ndarray
    seconds: np.ndarray
    fixed_step: np.ndarray  # 0: adaptive
    foreign: np.ndarray  # true: computed by another program
    errors: dict[str, tuple[str, np.ndarray]]  # data set: label, values

    def only(self, chosen: np.ndarray) -> BenchmarkScene:
        """Of these computations."""
        errors = {name: (label, values[chosen]) for name, (label, values) in self.errors.items()}
        columns = ("line", "rods", "rtol", "seconds", "fixed_step", "foreign")
        return self._replace(**{name: getattr(self, name)[chosen] for name in columns}, errors=errors)


BENCHMARK_ERRORS = {
    "error_phi": r"error of the chord angles $\varphi$ [rad]",
    "error_alpha_rate": r"error of the slope rates $\dot{\alpha}$ [rad/s]",
}


def read_benchmark(path: str | pathlib.Path) -> list[BenchmarkScene]:
    """A benchmark file, docs/postproc.md: one group per scene."""
    with opened(path) as file:
        scenes = []
        for name, group in file.items():
            if not isinstance(group, h5py.Group) or "seconds" not in group:
                continue
            for needed in ("method", "rtol"):
                if needed not in group:
                    raise DataError(f"{path}: scene '{name}' has no data set '{needed}'")
            labels = BENCHMARK_ERRORS | {"error_beam": text_of(group.attrs.get("error_label", "error to the beam"))}
            errors = {e: (label, group[e][()]) for e, label in labels.items() if e in group}
            if not errors:
                raise DataError(f"{path}: scene '{name}' has neither {' nor '.join(labels)}")
            title = text_of(group.attrs.get("title", "")) or name
            line = np.array(texts(group["model" if "model" in group else "method"]))
            none = np.zeros(line.size)
            columns = [group[x][()] if x in group else none for x in ("rods", "rtol", "seconds", "fixed_step")]
            foreign = np.array(texts(group["program"])) != "rodyn" if "program" in group else none > 0
            scene = BenchmarkScene(name, title, line, *columns, foreign, errors)
            scenes.append(scene.only(group["chosen"][()]) if "chosen" in group else scene)
    if not scenes:
        raise DataError(f"{path}: is no benchmark file: no group with a data set 'seconds'")
    return scenes


def read_stiffness(path: str | pathlib.Path) -> tuple[list[str], dict[str, np.ndarray]]:
    """A file of bench/stiffness.f90: names of the methods, and columns with one entry per run (method counts from 1)."""
    with opened(path) as file:
        if "methods" not in file.attrs:
            raise DataError(f"{path}: is no file of tools/bench stiffness: no attribute 'methods'")
        columns = {name: data[()] for name, data in file.items() if isinstance(data, h5py.Dataset)}
        methods = text_of(file.attrs["methods"]).split(",")
    for needed in ("n", "bending_factor", "damper_factor", "method", "rtol", "seconds", "error_phi", "effort", "auto"):
        if needed not in columns:
            raise DataError(f"{path}: no data set '{needed}'")
    return methods, columns


def texts(data: h5py.Dataset) -> list[str]:
    return [text_of(value) for value in np.atleast_1d(data[()]).astype(object)]


def column(data: h5py.Dataset) -> np.ndarray:
    """Numbers as they are, texts as an array of str."""
    return np.array(texts(data)) if data.dtype.kind in "SO" else np.atleast_1d(data[()])


def distinct(values: np.ndarray) -> list[Any]:
    """Distinct values: numbers sorted, texts in their order of appearance; NaN is left out."""
    if values.dtype.kind in "fiu":
        return [v.item() for v in np.unique(values) if not np.isnan(v)]
    return list(dict.fromkeys(str(v) for v in values))


def opened(path: str | pathlib.Path) -> h5py.File:
    """The file, or a DataError that says why not."""
    path = pathlib.Path(path)
    if path.is_dir():
        raise DataError(f"{path}: is the directory of a sweep; this script reads run files" if (path / "sweep.h5").is_file()
                        else f"{path}: is a directory, not a file")
    if not path.is_file():
        raise DataError(f"{path}: there is no such file")
    try:
        return h5py.File(path, "r")
    except OSError as error:
        why = "is not an HDF5 file" if not h5py.is_hdf5(path) else f"cannot be read: {error}"
        raise DataError(f"{path}: {why}") from None


@contextmanager
def open_run(path: str | pathlib.Path) -> Iterator[Run]:
    with opened(path) as file:
        yield Run(path, file)


@contextmanager
def open_modes(path: str | pathlib.Path) -> Iterator[Modes]:
    with opened(path) as file:
        yield Modes(path, file)


@contextmanager
def open_sweep(path: str | pathlib.Path) -> Iterator[Sweep]:
    path = pathlib.Path(path)
    with opened(path / "sweep.h5" if path.is_dir() else path) as file:
        yield Sweep(path, file)


def is_sweep(path: str | pathlib.Path) -> bool:
    """True for a sweep, false for a run; anything else is a DataError."""
    path = pathlib.Path(path)
    if path.is_dir():
        return True
    with opened(path) as file:
        if TIME not in file and "status" in file:
            return True
        Run(path, file)
    return False
