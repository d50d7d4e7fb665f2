"""Where spacecraft, nodes and points of the rods are: nodes joined by chords, cubic (or quartic) deflections on them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from rodyn_data import Run

POINTS = 21  # of the curve of a rod


class Shape(NamedTuple):
    """One configuration, in the frame that was asked for."""

    time: float
    centre: np.ndarray  # (2) centre of mass of the spacecraft [m]
    body: np.ndarray  # (corner, 2) outline of the spacecraft, closed; empty on a fixed one
    nodes: np.ndarray  # (n + 1, 2)
    rods: np.ndarray  # (n, POINTS, 2) curves, deflection magnified


def shapes(run: Run, rows: np.ndarray, magnification: float = 1.0, frame: str = "moving") -> list[Shape]:
    """Shapes at rows of the run (rising)."""
    names = ["phi", "alpha", "beta", "displacement_x", "displacement_y", "rotation"]
    state = {name: run.rows(name, rows) for name in names} | {"bubble": bubbles(run, rows)}
    time = run.rows("time", rows)
    place = Place(run)
    return [place.shape({name: values[i] for name, values in state.items()}, frame, magnification, float(t)) for i, t in enumerate(time)]


class Place:
    """What all configurations of a file have in common."""

    def __init__(self, run: Run):
        self.hinge = np.array([run.number("spacecraft", "hinge_x", 0.0), run.number("spacecraft", "hinge_y", 0.0)])
        self.length = run.per_rod("length")
        self.keeps_arc = run.group("model").get("formulation") == "inextensible" and run.group("model").get("bending") == "dynamic"
        self.outline = body_outline(run)

    def chord(self, alpha: np.ndarray, beta: np.ndarray, bubble: np.ndarray | float = 0.0) -> np.ndarray:
        """Lengths of the chords, (..., n)."""
        return self.length - foreshortening(self.length, alpha, beta, bubble) if self.keeps_arc else self.length

    def shape(self, state: dict[str, np.ndarray], frame: str, magnification: float = 1.0, time: float = 0.0) -> Shape:
        """The configuration of a state: phi, alpha, beta (and bubble) of all rods; displacement and rotation of the spacecraft."""
        length, bent = self.length, (state["alpha"], state["beta"], state.get("bubble", 0.0))
        nodes, rods = chain(self.hinge, length, state["phi"], *bent[:2], magnification, bent[2], self.chord(*bent))
        shape = Shape(time, np.zeros(2), self.outline, nodes, rods)
        if frame == "moving":
            return shape
        return turned(shape, np.array([state["displacement_x"], state["displacement_y"]]), float(state["rotation"]))


def chain(hinge: np.ndarray, length: np.ndarray, phi: np.ndarray, alpha: np.ndarray, beta: np.ndarray,
          magnification: float, bubble: np.ndarray | float = 0.0, chord: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Nodes r_k = r_{k-1} + chord e_k, and points r_{k-1} + x chord e_k + v n_k, x = s/l, v = Na alpha + Nb beta + Nc bubble.

    Arcs so drawn are longer than l by less than a thousandth where the chord keeps the arc's length and slopes stay below 0.5.
    """
    chord = length if chord is None else chord
    along = np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    across = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    nodes = np.concatenate([hinge[None], hinge + np.cumsum(chord[:, None] * along, axis=0)])
    x = np.linspace(0.0, 1.0, POINTS)
    v = magnification * deflection(length, alpha, beta, x, bubble)
    rods = nodes[:-1, None] + (chord[:, None] * x)[..., None] * along[:, None] + v[..., None] * across[:, None]
    return nodes, rods


def deflection(length: np.ndarray, alpha: np.ndarray, beta: np.ndarray, x: np.ndarray,
               bubble: np.ndarray | float = 0.0) -> np.ndarray:
    """v at s = x l of each rod, (..., n, points)."""
    na, nb, nc = x * (1 - x) ** 2, -(x**2) * (1 - x), 16 * (x * (1 - x)) ** 2
    return length[..., None] * (na * alpha[..., None] + nb * beta[..., None]) + nc * np.asarray(bubble)[..., None]


def foreshortening(length: np.ndarray, alpha: np.ndarray, beta: np.ndarray, bubble: np.ndarray | float = 0.0) -> np.ndarray:
    """int v'^2/2 over each rod, by which its chord is shorter than its arc, [m]."""
    x, weight = np.polynomial.legendre.leggauss(4)
    x = (x + 1) / 2
    slope = ((1 - x) * (1 - 3 * x) * alpha[..., None] + x * (3 * x - 2) * beta[..., None]
             + 32 * x * (1 - x) * (1 - 2 * x) * (np.asarray(bubble) / length)[..., None])
    return length / 4 * (slope**2 @ weight)


def bubbles(run: Run, rows: np.ndarray | int) -> np.ndarray:
    """Deflections by the third bending shape, zero in a run without."""
    return run.rows("bubble", rows) if "bubble" in run.file else np.zeros_like(run.rows("phi", rows))


def largest_deflection(run: Run, row: int) -> float:
    """Of all rods, at the points of the curves [m]."""
    v = deflection(run.per_rod("length"), run.rows("alpha", row), run.rows("beta", row), np.linspace(0, 1, 201), bubbles(run, row))
    return float(np.max(np.abs(v)))


def body_outline(run: Run) -> np.ndarray:
    """The uniform square body of the same mass and inertia, J = M a^2 / 6; nothing if the spacecraft is fixed."""
    if run.group("spacecraft").get("motion") == "fixed":
        return np.empty((0, 2))
    mass, inertia = run.number("spacecraft", "mass"), run.number("spacecraft", "inertia")
    if not mass or not inertia:
        return np.empty((0, 2))
    half = 0.5 * np.sqrt(6.0 * inertia / mass)
    return half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]])


def turned(shape: Shape, displacement: np.ndarray, rotation: float) -> Shape:
    """In the inertial frame: R(theta) (u + r), since u is projected on the moving axes."""
    c, s = np.cos(rotation), np.sin(rotation)
    matrix = np.array([[c, s], [-s, c]])  # for rows
    move = lambda points: (points + displacement) @ matrix  # noqa: E731
    return Shape(shape.time, move(shape.centre), move(shape.body), move(shape.nodes), move(shape.rods))


def tip_path(run: Run, frame: str = "moving", rows: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    """Times and places (row, 2) of the outermost node, at no more than so many rows."""
    every = slice(None, None, max(1, -(-run.time.size // rows)))
    phi, place = run.rows("phi", every), Place(run)
    chord = place.chord(run.rows("alpha", every), run.rows("beta", every), bubbles(run, every))
    path = place.hinge + np.stack([(chord * np.cos(phi)).sum(axis=-1), (chord * np.sin(phi)).sum(axis=-1)], axis=-1)
    if frame == "inertial":
        path += np.stack([run.rows("displacement_x", every), run.rows("displacement_y", every)], axis=-1)
        theta = run.rows("rotation", every)
        c, s = np.cos(theta), np.sin(theta)
        path = np.stack([c * path[:, 0] - s * path[:, 1], s * path[:, 0] + c * path[:, 1]], axis=-1)
    return run.rows("time", every), path


def limits(found: list[Shape], margin: float = 0.06) -> tuple[float, float, float, float]:
    """x and y limits that hold all shapes."""
    points = np.concatenate([p.reshape(-1, 2) for s in found for p in (s.centre[None], s.body, s.nodes, s.rods)])
    low, high = points.min(axis=0), points.max(axis=0)
    pad = margin * max(*(high - low), 1e-9)
    return low[0] - pad, high[0] + pad, low[1] - pad, high[1] + pad
