"""What the article prints: its tables 1 to 3, in its own units.

Izvestiya vuzov. Mashinostroenie, 2017, No. 7 [688]. Tables 1 and 2 give a range over the steps it tried.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from rodyn_data import Sweep


class Printed(NamedTuple):
    """One quantity at one time; `reference` comes from two independent integrators of high order."""

    quantity: str
    time: float
    low: str
    high: str
    reference: str


TABLE_1 = [
    Printed("phi(4)", 1, "0.49135614", "0.49135614", "0.491356055226"),
    Printed("alpha_rate(1)", 1, "0.39531", "0.39535", "0.394155296535"),
]
TABLE_2 = [
    Printed("phi(4)", 30, "0.01361031", "0.01361079", "0.01360950381"),
    Printed("phi(4)", 60, "0.48224758", "0.48224818", "0.48224726060"),
    Printed("phi(4)", 120, "-0.22652622", "-0.22652627", "-0.22652528471"),
    Printed("phi(4)", 240, "0.50494062", "0.50494089", "0.50494415485"),
    Printed("alpha_rate(1)", 30, "-0.29849", "-0.29895", "-0.3051786"),
    Printed("alpha_rate(1)", 60, "-1.01004", "-1.01022", "-1.0107406"),
    Printed("alpha_rate(1)", 120, "-0.56372", "-0.56379", "-0.5632104"),
    Printed("alpha_rate(1)", 240, "0.48113", "0.48115", "0.4811614"),
]

def printed(quantity: str, time: float) -> Printed | None:
    """What tables 1 and 2 print of a quantity at a time; None: nothing."""
    return next((row for row in TABLE_1 + TABLE_2 if (row.quantity, row.time) == (quantity, time)), None)


def range_text(row: Printed | None) -> str:
    """'0.39531 to 0.39535', or the one number, or nothing."""
    if row is None:
        return ""
    return row.low if row.low == row.high else f"{row.low} to {row.high}"


TABLE_3_TIME = 1.0
TABLE_3_AXIS = "mass_ratio"
# Degrees for the angles of the rods, m, rad. What is printed for u_x is `slipped_displacement`.
TABLE_3_QUANTITIES = [("phi(1)", "deg"), ("phi(4)", "deg"), ("displacement_x", "m"), ("rotation", "rad")]
# Ratio: exact, lumped.
TABLE_3 = {
    2: (("-16.436", "21.920", "0.194", "4.046"), ("-18.122", "17.160", "0.192", "4.040")),
    4: (("14.277", "22.652", "0.258", "2.240"), ("13.212", "20.339", "0.246", "2.255")),
    8: (("-60.441", "-142.412", "0.104", "3.611"), ("-60.982", "-142.663", "0.103", "3.627")),
    16: (("-44.534", "-180.568", "0.354", "2.849"), ("-44.189", "-180.659", "0.355", "2.844")),
    32: (("-39.314", "-177.633", "0.627", "1.894"), ("-38.930", "-177.281", "0.629", "1.887")),
}


def slipped_displacement(sweep: Sweep) -> np.ndarray:
    """What table 3 prints for u_x [m]: the solution of u' = V_x - w u, where u_x' = V_x + w u_y; it acts on nothing else.

    With theta' = w it is u = int V_x exp(theta(s) - theta(t)) ds, here by Simpson's rule over the series up to the end of each case,
    which have equal intervals, an even number of them. NaN in a sweep without series.
    """
    names = [f"series_{name}" for name in ("time", "velocity_x", "rotation")]
    if not all(name in sweep.file for name in names):
        return np.full(sweep.n_cases, np.nan)
    t, v, theta = (sweep.file[name][()] for name in names)
    weights = np.full(t.shape[1], 2.0)
    weights[1::2], weights[[0, -1]] = 4.0, 1.0
    return (t[:, 1] - t[:, 0]) / 3.0 * (weights * v * np.exp(theta - theta[:, -1:])).sum(axis=1)
