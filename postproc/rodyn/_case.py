"""Cases and what comes of them."""

from __future__ import annotations

import ctypes
import importlib.util
import math
import os
import pathlib
import signal
import sys
import threading
import weakref
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import xarray

from . import _library
from ._library import HERE, Array, Attribute, library

BAD_INPUT, STOPPED = 2, 75  # exit codes of the program
KINDS = np.dtype("float64"), np.dtype("int32")
MODES_AT = {"start": 0, "equilibrium": 1, "loads": 2}
Watcher = Callable[[float, float, int], Any]
_last: dict[str, Any] = {"key": None, "blank": None}


class RodynError(Exception):
    """What the program would end with a message for."""


class CaseError(RodynError):
    """A case is refused; `faults` has one line for each fault, as `rodyn check` prints them."""

    def __init__(self, message: str):
        super().__init__(message)
        self.faults = message.splitlines()


class RunError(RodynError):
    """A run failed; `run` has the rows until then (None if there are none)."""

    def __init__(self, message: str, run: xarray.Dataset | None):
        super().__init__(message)
        self.run = run


class Case:
    """A case: a namelist, with keys set since.

    Keys are those of axes of sweeps: `group.name`, `group.name(3)` for one element, `load(2).value` where a group is repeated.
    """

    def __init__(self, path: str | os.PathLike[str] | None = None, *, text: str | None = None, name: str = "case",
                 settings: Mapping[str, str] | None = None):
        """Of a file, or of `text`, which messages call `name`."""
        if (path is None) == (text is None):
            raise TypeError("give the path of a case, or text=...")
        self.name = name if path is None else os.fspath(path)
        self.text = pathlib.Path(path).read_text(encoding="utf-8") if text is None else text
        self._resolved: str | None = None
        self._settings: dict[str, str] = {}
        with _library.LOCK:
            self._handle = library.rodyn_case_new(_bytes(self.text), _bytes(self.name))
        weakref.finalize(self, _free_case, self._handle)
        for key, values in (settings or {}).items():
            self._set(key, values)

    def __setitem__(self, key: str, value: Any) -> None:
        self._set(key, namelist_text(value))

    def __getitem__(self, key: str) -> Any:
        """The value that is used, given or by default: a number, a text, or an array."""
        group, _, name = key.lower().partition(".")
        group, instance = _with_index(group, 1)
        name, element = _with_index(name, None)
        found = _read_namelist(self.resolved()).get(group, [])
        try:
            value = found[instance - 1][name]
        except (IndexError, KeyError):
            raise KeyError(f"{key}: the case has no such key") from None
        if element is None:
            return np.array(value) if isinstance(value, list) else value
        first = 0 if name.startswith(("hinge_", "kink")) and group == "chain" else 1
        return np.atleast_1d(value)[element - first]

    def __repr__(self) -> str:
        changes = "".join(f", {key} = {values}" for key, values in self._settings.items())
        return f"<Case {self.name}{changes}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return _make_case, (self.text, self.name, self._settings)

    def copy(self) -> Case:
        """Another case with the same keys."""
        return _make_case(self.text, self.name, self._settings)

    def check(self) -> None:
        """Raise a CaseError if the case has faults."""
        with _library.LOCK:
            self._judge(library.rodyn_case_check(self._handle))

    def resolved(self) -> str:
        """Every key with the value that is used, as a namelist."""
        if self._resolved is None:
            with _library.LOCK:
                text = library.rodyn_case_resolved(self._handle)
                if text is None:
                    self._judge(BAD_INPUT)
                self._resolved = text.decode()
        return self._resolved

    def run(self, progress: bool | Watcher = False) -> xarray.Dataset:
        """Integrate, and return the rows.

        The data set is that of `xarray.open_dataset` for the file of `rodyn run`, to the last bit. Attributes `solver_...` are those of
        the file's group `solver`, variables `event_...` its group `events`. `progress = True` writes a line to standard error; a
        function is called about five times a second with the time reached, the end (s) and the number of steps, and what it raises
        stops the run, as Ctrl-C does.
        """
        return self._integrate(progress, _dataset)

    def _integrate(self, progress: bool | Watcher, read: Callable[[ctypes.c_void_p], Any]) -> Any:
        watch = _Watch(progress)
        result = ctypes.c_void_p()
        with watch, _library.LOCK:
            code = library.rodyn_case_run(self._handle, watch.callback, None, ctypes.byref(result))
            message = self._message() if code else ""
            run = _take(result, read)
        if watch.raised is not None:
            raise watch.raised
        if code == BAD_INPUT:
            raise CaseError(message)
        if code != 0:
            raise RunError(message, run)
        return run

    def arrays(self) -> dict[str, np.ndarray]:
        """Integrate, and return nothing but the arrays by name: for loops over runs of a few milliseconds."""
        run = self._integrate(False, _arrays)
        return {name: values for name, _, values, _ in run}

    def modes(self, at: str = "start") -> xarray.Dataset:
        """Frequencies, damping, shapes and matrices at 'start', with the 'loads' of t = 0 there, or at the 'equilibrium'."""
        result = ctypes.c_void_p()
        with _library.LOCK:
            code = library.rodyn_case_modes(self._handle, MODES_AT[at], ctypes.byref(result))
            message = self._message()
            modes = _take(result, _dataset)
        if code == 0:
            return modes
        raise CaseError(message) if code == BAD_INPUT else RunError(message, None)

    def _set(self, key: str, values: str) -> None:
        with _library.LOCK:
            self._judge(library.rodyn_case_set(self._handle, _bytes(key), _bytes(values)))
        self._settings.pop(key, None)  # the last one holds
        self._settings[key] = values
        self._resolved = None

    def _message(self) -> str:
        return library.rodyn_case_message(self._handle).decode(errors="replace")

    def _judge(self, code: int) -> None:
        if code != 0:
            raise CaseError(self._message())


def modes(case: Case, at: str = "start") -> xarray.Dataset:
    """`case.modes(at)`"""
    return case.modes(at)


def namelist_text(value: Any) -> str:
    """A value, or several, as a namelist has them."""
    if isinstance(value, str):
        return "'" + value.replace("'", "''") + "'"
    if isinstance(value, (bool, np.bool_)):
        return ".true." if value else ".false."
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, Iterable) and np.ndim(value) > 0:
        return ", ".join(map(namelist_text, value))
    return repr(float(value))


class _Watch:
    """Stands between a run and whoever watches it. What is raised meanwhile is raised again afterwards.

    Python would raise KeyboardInterrupt as soon as the library calls it, before anything could catch it there: the signal is noted, and
    goes to its handler once the run has ended.
    """

    def __init__(self, progress: bool | Watcher):
        self.raised: BaseException | None = None
        self._watch = progress if callable(progress) else _print_progress if progress else None
        self._prints = progress is True
        self._handler: Any = None
        self._signal: tuple[int, Any] | None = None
        self.callback = _library.WATCHER(self._call)

    def _call(self, t: float, t_end: float, n_steps: int, _: Any) -> int:
        try:
            if self._watch and not self._signal:
                self._watch(t, t_end, n_steps)
        except BaseException as error:
            self.raised = error
        return int(self.raised is not None or self._signal is not None)

    def _note(self, number: int, frame: Any) -> None:
        self._signal = number, frame

    def __enter__(self) -> None:
        if threading.current_thread() is threading.main_thread() and callable(signal.getsignal(signal.SIGINT)):
            self._handler = signal.signal(signal.SIGINT, self._note)

    def __exit__(self, *_: object) -> None:
        if self._handler is not None:
            signal.signal(signal.SIGINT, self._handler)
        if self._prints:
            print("\r" + 60 * " ", end="\r", file=sys.stderr, flush=True)
        if self._signal is not None:
            self._handler(*self._signal)


def _print_progress(t: float, t_end: float, n_steps: int) -> None:
    """One line, in a terminal and in a notebook."""
    print(f"\rt = {t:.6g} of {t_end:.6g} s, {100 * t / t_end:.1f} %, {n_steps} steps".ljust(60), end="", file=sys.stderr, flush=True)


def _take(result: ctypes.c_void_p, read: Callable[[ctypes.c_void_p], Any]) -> Any:
    """What is read off a result, whose memory is freed; None if there is none."""
    if not result:
        return None
    try:
        return read(result)
    finally:
        library.rodyn_result_free(result)


def _arrays(result: ctypes.c_void_p) -> list[tuple[str, tuple[str, ...], np.ndarray, dict[str, str]]]:
    """Name, dimensions, values and attributes of each array."""
    array, found = Array(), []
    for i in range(library.rodyn_result_arrays(result)):
        library.rodyn_result_array(result, i, ctypes.byref(array))
        dims = tuple(array.dims.decode().split())
        attributes = {"long_name": array.long_name.decode()}
        if array.units:
            attributes["units"] = array.units.decode()
        found.append((array.name.decode(), dims, _values(array, len(dims)), attributes))
    return found


def _dataset(result: ctypes.c_void_p) -> xarray.Dataset:
    arrays = _arrays(result)
    data = {name: values for name, dims, values, _ in arrays if dims != (name,)}
    attribute, attributes = Attribute(), {}
    for i in range(library.rodyn_result_attributes(result)):
        library.rodyn_result_attribute(result, i, ctypes.byref(attribute))
        value = attribute.text.decode() if attribute.kind == 0 else _number(attribute)
        attributes[attribute.name.decode()] = value
    made = _blank(arrays).copy(data=data)
    made.attrs = attributes
    return made


def _blank(arrays: list[tuple[str, tuple[str, ...], np.ndarray, dict[str, str]]]) -> xarray.Dataset:
    """A data set with these coordinates and without numbers. Making it takes longer than a short run, so the last one is kept."""
    key = [(name, dims, values.tobytes() if dims == (name,) else (values.shape, values.dtype)) for name, dims, values, _ in arrays]
    if _last["key"] != key:
        variables, coordinates = {}, {}
        for name, dims, values, attributes in arrays:
            if dims == (name,):
                coordinates[name] = xarray.Variable(dims, values.copy(), attributes)
            else:
                variables[name] = xarray.Variable(dims, np.broadcast_to(np.zeros((), values.dtype), values.shape), attributes)
        _last.update(key=key, blank=xarray.Dataset(variables, xarray.Coordinates(coordinates)))
    return _last["blank"]


def _values(array: Array, rank: int) -> np.ndarray:
    """A copy of the numbers."""
    kind = KINDS[array.kind] if array.kind < len(KINDS) else np.dtype(f"S{max(1, array.text_length)}")
    shape = tuple(array.shape[:rank])
    memory = (ctypes.c_char * (math.prod(shape) * kind.itemsize)).from_address(array.values)
    values = np.frombuffer(memory, kind).reshape(shape)
    return values.copy() if array.kind < len(KINDS) else np.char.rstrip(np.char.decode(values, "utf-8"))


def _number(attribute: Attribute) -> np.generic:
    return np.float64(attribute.x) if attribute.kind == 1 else [np.int32, np.int64][attribute.kind - 2](attribute.number)


def _make_case(text: str, name: str, settings: Mapping[str, str]) -> Case:
    return Case(text=text, name=name, settings=settings)


def _free_case(handle: int) -> None:
    with _library.LOCK:
        library.rodyn_case_free(handle)


def _bytes(text: str) -> bytes:
    return text.encode()


def _with_index(name: str, otherwise: Any) -> tuple[str, Any]:
    """'load(2)' -> 'load', 2"""
    name, opened, rest = name.strip().partition("(")
    return name, int(rest.rstrip(") ")) if opened else otherwise


def scripts() -> pathlib.Path:
    """Where the scripts of postproc/ are: installed with this package, or beside it in a checkout."""
    return HERE / "scripts" if (HERE / "scripts").is_dir() else HERE.parent


def _load_reader() -> Callable[[str], dict[str, list[dict[str, Any]]]]:
    spec = importlib.util.spec_from_file_location("rodyn._namelist", scripts() / "namelist.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.read_namelist


_read_namelist = _load_reader()
