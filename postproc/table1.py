#!/usr/bin/env python3
"""Compare a run of cases/table1.nml with reference values and with the article's table 1.

The reference values come from two independent integrators of high order; the article's are ranges over the steps it tried.
"""

import argparse
import sys
from typing import NamedTuple

import h5py
import numpy as np


class Reference(NamedTuple):
    """What is known at one time; `tolerance` is how far a run at the tolerances of cases/table1.nml may be off."""

    value: float
    tolerance: float
    article: str


PHI_4: dict[float, Reference] = {
    1: Reference(0.491356055226, 1e-10, "0.49135614"),
    2: Reference(0.413506393534, 1e-10, ""),
    30: Reference(0.01360950381, 1e-8, "0.01361031 to 0.01361079"),
    60: Reference(0.48224726060, 1e-7, "0.48224758 to 0.48224818"),
    120: Reference(-0.22652528471, 1e-7, "-0.22652622 to -0.22652627"),
    240: Reference(0.50494415485, 1e-7, "0.50494062 to 0.50494089"),
}
ALPHA_1_RATE: dict[float, Reference] = {
    1: Reference(0.394155296535, 1e-8, "0.39531 to 0.39535"),
    2: Reference(-0.6967200449, 1e-8, ""),
    30: Reference(-0.3051786, 1e-5, "-0.29849 to -0.29895"),
    60: Reference(-1.0107406, 1e-4, "-1.01004 to -1.01022"),
    120: Reference(-0.5632104, 1e-4, "-0.56372 to -0.56379"),
    240: Reference(0.4811614, 1e-4, "0.48113 to 0.48115"),
}


def row_at(time: np.ndarray, t: float) -> int | None:
    """The row of time t, or None if the file has no such row."""
    i = int(np.argmin(np.abs(time - t)))
    return i if abs(time[i] - t) <= 1e-9 * max(1.0, t) else None


def print_table(path: str) -> bool:
    """Print the table; true if every number lies within its tolerance."""
    with h5py.File(path) as run:
        time = run["time"][:]
        columns = {
            "phi_4, rad": (run["phi"][:, 3], PHI_4),
            "alpha_1', rad/s": (run["alpha_rate"][:, 0], ALPHA_1_RATE),
        }
        status = run.attrs["status"].decode()
    rows = {t: row_at(time, t) for t in PHI_4}
    if all(row is None for row in rows.values()):
        times = ", ".join(str(t) for t in PHI_4)
        raise ValueError(f"no row at t = {times} s (it has {time.size} rows, {time[0]:g} to {time[-1]:g} s)")

    agrees = status == "done"
    if status != "done":
        print(f"This run is not complete: its status is '{status}'.")
    for name, (values, references) in columns.items():
        print(f"{'t, s':>5}  {name:>17}  {'reference':>15}  {'difference':>10}  the article's range")
        for t, (value, tolerance, article) in references.items():
            row = rows[t]
            if row is None:
                continue
            difference = values[row] - value
            close = abs(difference) <= tolerance
            agrees = agrees and close
            mark = "" if close else f"  (more than {tolerance:.0e} off)"
            print(f"{t:5g}  {values[row]:17.12f}  {value:15.12g}  {difference:10.1e}  {article}{mark}".rstrip())
    return agrees


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", help="run file of cases/table1.nml")
    parser.add_argument("--check", action="store_true", help="exit with 1 unless all numbers agree with the reference")
    arguments = parser.parse_args()
    try:
        agrees = print_table(arguments.run)
    except (OSError, KeyError, IndexError, ValueError) as error:
        print(f"{arguments.run}: not a run of the table-1 scene that can be compared: {error}", file=sys.stderr)
        return 2
    return 1 if arguments.check and not agrees else 0


if __name__ == "__main__":
    sys.exit(main())
