"""The shared library: found, loaded, its calls declared (src/rodyn/interface/rodyn.h has what they mean).

Its calls must not overlap, so `LOCK` is held in each. Whoever wants several cores takes processes (`rodyn.sweep`).
"""

from __future__ import annotations

import ctypes
import os
import pathlib
import threading
from ctypes import POINTER, Structure, c_char_p, c_double, c_int, c_int64, c_void_p

HERE = pathlib.Path(__file__).resolve().parent
WATCHER = ctypes.CFUNCTYPE(c_int, c_double, c_double, c_int64, c_void_p)


class _Lock:
    """One thread at a time; the same one may come again, from a watcher. A forked process has none of its parent's threads."""

    def __init__(self) -> None:
        self._renew()
        os.register_at_fork(after_in_child=self._renew)

    def _renew(self) -> None:
        self._lock = threading.RLock()

    def __enter__(self) -> None:
        self._lock.acquire()

    def __exit__(self, *_: object) -> None:
        self._lock.release()


LOCK = _Lock()


class Array(Structure):
    """rodyn_array"""

    _fields_ = [
        ("name", c_char_p), ("dims", c_char_p), ("units", c_char_p), ("long_name", c_char_p),
        ("kind", c_int), ("text_length", c_int), ("shape", c_int64 * 2), ("values", c_void_p),
    ]


class Attribute(Structure):
    """rodyn_attribute"""

    _fields_ = [("name", c_char_p), ("kind", c_int), ("text", c_char_p), ("x", c_double), ("number", c_int64)]


SIGNATURES = {
    "rodyn_initialize": (None, []),
    "rodyn_version": (c_char_p, []),
    "rodyn_case_new": (c_void_p, [c_char_p, c_char_p]),
    "rodyn_case_set": (c_int, [c_void_p, c_char_p, c_char_p]),
    "rodyn_case_check": (c_int, [c_void_p]),
    "rodyn_case_run": (c_int, [c_void_p, WATCHER, c_void_p, POINTER(c_void_p)]),
    "rodyn_case_modes": (c_int, [c_void_p, c_int, POINTER(c_void_p)]),
    "rodyn_case_message": (c_char_p, [c_void_p]),
    "rodyn_case_resolved": (c_char_p, [c_void_p]),
    "rodyn_case_free": (None, [c_void_p]),
    "rodyn_result_arrays": (c_int, [c_void_p]),
    "rodyn_result_array": (None, [c_void_p, c_int, POINTER(Array)]),
    "rodyn_result_attributes": (c_int, [c_void_p]),
    "rodyn_result_attribute": (None, [c_void_p, c_int, POINTER(Attribute)]),
    "rodyn_result_free": (None, [c_void_p]),
}


def _path() -> pathlib.Path:
    """RODYN_LIBRARY, what was installed with the package, or what a checkout has built."""
    if "RODYN_LIBRARY" in os.environ:
        return pathlib.Path(os.environ["RODYN_LIBRARY"])
    places = [HERE / "librodyn.so", HERE.parents[1] / "build" / "stage-release" / "lib" / "librodyn.so"]
    for place in places:
        if place.exists():
            return place
    raise ImportError(f"librodyn.so is not there; call tools/build in {HERE.parents[1]}")


def _load() -> ctypes.CDLL:
    library = ctypes.CDLL(str(_path()))
    for name, (result, arguments) in SIGNATURES.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    library.rodyn_initialize()
    return library


library = _load()
version = library.rodyn_version().decode()
