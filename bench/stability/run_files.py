"""Two run files side by side: what of them differs."""

from __future__ import annotations

import pathlib

import h5py
import numpy as np

#: What a repeated run may change.
OF_THE_HOUR = {"/@created", "/@hostname", "solver@wall_seconds"}


def contents(path: pathlib.Path) -> dict[str, bytes]:
    """Every data set and attribute, as bytes with type and shape."""
    found: dict[str, bytes] = {}

    def take(name: str, item: h5py.Group | h5py.Dataset) -> None:
        if isinstance(item, h5py.Dataset):
            text = h5py.check_string_dtype(item.dtype)
            values = item.asstr()[()].astype(str) if text and text.length is None else item[()]
            found[name] = f"{item.dtype}{item.shape}{item.chunks}".encode() + values.tobytes()
        for key in item.attrs:
            if key in ("DIMENSION_LIST", "REFERENCE_LIST"):
                continue  # addresses in the file
            value = np.asarray(item.attrs[key])
            found[f"{name}@{key}"] = f"{value.dtype}{value.shape}".encode() + value.tobytes()

    with h5py.File(path) as file:
        take("/", file)
        file.visititems(take)
    return found


def differences(one: pathlib.Path, other: pathlib.Path) -> set[str]:
    """Names of data sets and attributes (`phi`, `solver@n_steps`) that are not the same bytes."""
    a, b = contents(one), contents(other)
    return {name for name in a.keys() | b.keys() if a.get(name) != b.get(name)}


def largest_difference(one: pathlib.Path, other: pathlib.Path, without: set[str] = frozenset()) -> tuple[float, str]:
    """Of all series but some, relative to the largest value of each kind of quantity; and where it is."""
    worst, where = 0.0, ""
    with h5py.File(one) as a, h5py.File(other) as b:
        for name in a:
            if not isinstance(a[name], h5py.Dataset) or a[name].dtype.kind != "f" or name in without | {"energy_residual"}:
                continue
            x, y = a[name][()], b[name][()]
            if x.shape != y.shape:
                return float("inf"), name
            scale = max(np.abs(a[peer][()]).max() for peer in peers(name) if peer in a)
            difference = np.abs(x - y).max() / scale if scale > 0 else np.abs(x - y).max()
            if not difference <= worst:
                worst, where = float(difference), name
    return worst, where


def peers(name: str) -> list[str]:
    """Quantities of one unit that lend each other their scale: an angle near zero has none of its own."""
    for group in (["phi", "alpha", "beta", "rotation"], ["phi_rate", "alpha_rate", "beta_rate", "omega"],
                  ["velocity_x", "velocity_y"], ["displacement_x", "displacement_y"], ["momentum_x", "momentum_y"],
                  ["energy_kinetic", "energy_elastic", "energy_dissipated", "work_external"]):
        if name in group:
            return group
    return [name]
