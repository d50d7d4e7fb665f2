#!/usr/bin/env python3
"""Compare a run of cases/table1.nml with reference values and with the article's table 1.

The reference values come from two independent integrators of high order; the article's are ranges over the steps it tried.
"""

import argparse
import sys
from typing import NamedTuple

import numpy as np
from article import printed, range_text
from rodyn_data import DataError, open_run


class Reference(NamedTuple):
    """What is known at one time; `tolerance` is how far a run at the tolerances of cases/table1.nml may be off."""

    value: float
    tolerance: float


# By name of the quantity: its heading, and what is known by time [s].
REFERENCES: dict[str, tuple[str, dict[float, Reference]]] = {
    "phi(4)": ("phi_4, rad", {
        1: Reference(0.491356055226, 1e-10), 2: Reference(0.413506393534, 1e-10), 30: Reference(0.01360950381, 1e-8),
        60: Reference(0.48224726060, 1e-7), 120: Reference(-0.22652528471, 1e-7), 240: Reference(0.50494415485, 1e-7),
    }),
    "alpha_rate(1)": ("alpha_1', rad/s", {
        1: Reference(0.394155296535, 1e-8), 2: Reference(-0.6967200449, 1e-8), 30: Reference(-0.3051786, 1e-5),
        60: Reference(-1.0107406, 1e-4), 120: Reference(-0.5632104, 1e-4), 240: Reference(0.4811614, 1e-4),
    }),
}


def row_at(time: np.ndarray, t: float) -> int | None:
    """The row of time t, or None if the file has no such row."""
    i = int(np.argmin(np.abs(time - t)))
    return i if abs(time[i] - t) <= 1e-9 * max(1.0, t) else None


def print_table(path: str) -> bool:
    """Print the table; true if every number lies within its tolerance."""
    with open_run(path) as run:
        time, status = run.time, run.status
        columns = {name: run.quantity(name).values for name in REFERENCES}
    times = list(REFERENCES["phi(4)"][1])
    rows = {t: row_at(time, t) for t in times}
    if all(row is None for row in rows.values()):
        wanted = ", ".join(str(t) for t in times)
        raise DataError(f"no row at t = {wanted} s (it has {time.size} rows, {time[0]:g} to {time[-1]:g} s)")

    agrees = status == "done"
    if status != "done":
        print(f"This run is not complete: its status is '{status}'.")
    for name, (heading, references) in REFERENCES.items():
        print(f"{'t, s':>5}  {heading:>17}  {'reference':>15}  {'difference':>10}  the article's range")
        for t, (value, tolerance) in references.items():
            row = rows[t]
            if row is None:
                continue
            ours = columns[name][row]
            close = abs(ours - value) <= tolerance
            agrees = agrees and close
            mark = "" if close else f"  (more than {tolerance:.0e} off)"
            article = range_text(printed(name, t))
            print(f"{t:5g}  {ours:17.12f}  {value:15.12g}  {ours - value:10.1e}  {article}{mark}".rstrip())
    return agrees


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", help="run file of cases/table1.nml")
    parser.add_argument("--check", action="store_true", help="exit with 1 unless all numbers agree with the reference")
    arguments = parser.parse_args()
    try:
        agrees = print_table(arguments.run)
    except (OSError, IndexError, DataError) as error:
        print(f"{arguments.run}: not a run of the table-1 scene that can be compared: {error}", file=sys.stderr)
        return 2
    return 1 if arguments.check and not agrees else 0


if __name__ == "__main__":
    sys.exit(main())
