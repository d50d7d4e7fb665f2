"""Natural frequencies of a run's scene about its initial configuration, from the input that the file carries.

M by integrals over the rods that are exact for their cubics, K of hinges and rods in closed form: K x = w^2 M x. For uniform
rods and hinges without laws of their own; `rodyn modes` knows the others.
"""

from __future__ import annotations

import numpy as np
from rodyn_data import Run

# Gauss points and weights on 0..1, exact to degree 9: mass integrals of cubics have degree 6, of bubbles 8.
_X, _W = np.polynomial.legendre.leggauss(5)
GAUSS_X, GAUSS_W = 0.5 * (_X + 1.0), 0.5 * _W


def beyond_us(run: Run) -> list[str]:
    """What of the scene has no matrices here."""
    return [f"&{group}" for group in ("hinge", "rod_profile") if group in run.scene()]


def natural_frequencies(run: Run) -> np.ndarray:
    """All frequencies above zero, rising [rad/s]; none if some rod is not uniform or some hinge has a law."""
    if beyond_us(run):
        return np.array([])
    mass, stiffness = matrices(run)
    lower = np.linalg.cholesky(mass)
    half = np.linalg.solve(lower, stiffness)
    square = np.linalg.eigvalsh(np.linalg.solve(lower, half.T))
    largest = max(square[-1], 0.0)
    return np.sqrt(square[square > 1e-12 * largest])


def matrices(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """M and K; unknowns (u_x, u_y, theta) of a free spacecraft, phi, and alpha, beta (and bubbles) of dynamic bending."""
    n = run.n_rods
    model, initial = run.group("model"), run.group("initial")
    dynamic = model.get("bending", "dynamic") == "dynamic"
    lumped = model.get("inertia") == "lumped"
    condensed = model.get("bending") == "quasistatic" and not lumped
    base = 0 if run.group("spacecraft").get("motion") == "fixed" else 3
    shapes = int(model.get("bending_shapes", 2))
    at = {"phi": base, "alpha": base + n, "beta": base + 2 * n, "bubble": base + 3 * n}
    size = base + n * (1 + shapes if dynamic or condensed else 1)

    length, density = run.per_rod("length"), run.per_rod("mass_per_length")
    phi = np.zeros(n) + np.asarray(initial.get("phi", 0.0), dtype=float)
    node_mass = np.concatenate([[0.0], run.per_rod("node_mass")])
    if lumped:
        node_mass[:-1] += 0.5 * density * length
        node_mass[1:] += 0.5 * density * length

    mass = np.zeros((size, size))
    position = np.array([run.number("spacecraft", "hinge_x", 0.0), run.number("spacecraft", "hinge_y", 0.0)])
    move = np.zeros((2, size))  # velocity of the node = move @ rates
    if base:
        mass[0, 0] = mass[1, 1] = run.number("spacecraft", "mass")
        mass[2, 2] = run.number("spacecraft", "inertia")
        move[:, :3] = [[1, 0, -position[1]], [0, 1, position[0]]]
    mass += node_mass[0] * move.T @ move
    for k in range(n):
        across = np.array([-np.sin(phi[k]), np.cos(phi[k])])
        turn = np.zeros((2, size))  # per metre along the rod
        turn[:, at["phi"] + k] = across
        if base:
            turn[:, 2] = across
        if not lumped:
            for x, weight in zip(GAUSS_X, GAUSS_W, strict=True):
                point = move + x * length[k] * turn
                if dynamic or condensed:
                    point[:, at["alpha"] + k] = length[k] * x * (1 - x) ** 2 * across
                    point[:, at["beta"] + k] = -length[k] * x**2 * (1 - x) * across
                if dynamic and shapes == 3:
                    point[:, at["bubble"] + k] = 16 * (x * (1 - x)) ** 2 * across
                mass += weight * density[k] * length[k] * point.T @ point
        move = move + length[k] * turn
        mass += node_mass[k + 1] * move.T @ move
    if condensed:  # T^T M T
        slopes = _slopes(run, at, base + n)
        expansion = np.vstack([np.eye(base + n), slopes])
        mass, size = expansion.T @ mass @ expansion, base + n
    return mass, _stiffness(run, at, size, dynamic)


def _slopes(run: Run, at: dict[str, int], size: int) -> np.ndarray:
    """alpha and beta of all rods by the coordinates, where they follow from the moments of the hinges."""
    opening, spring = _springs(run, at, size, dynamic=False)
    inner = spring @ opening
    outer = np.vstack([inner[1:], np.zeros(size)])
    unit = (run.per_rod("length") / (6.0 * run.per_rod("bending_stiffness")))[:, None]
    return np.vstack([-unit * (2.0 * inner + outer), unit * (inner + 2.0 * outer)])


def _springs(run: Run, at: dict[str, int], size: int, dynamic: bool) -> tuple[np.ndarray, np.ndarray]:
    """B, the openings of the hinges, and C G: their moments by these, G = (I + F C)^-1 if bending follows from the moments."""
    n = run.n_rods
    opening = np.zeros((n, size))
    for k in range(n):
        opening[k, at["phi"] + k] = 1
        if k > 0:
            opening[k, at["phi"] + k - 1] = -1
        if dynamic:
            opening[k, at["alpha"] + k] = 1
            if k > 0:
                opening[k, at["beta"] + k - 1] = -1
    spring = np.diag(run.per_rod("hinge_stiffness"))
    if run.group("model").get("bending") == "quasistatic":
        slope = run.per_rod("length") / (6.0 * run.per_rod("bending_stiffness"))
        flexibility = np.diag(2.0 * slope)
        for k in range(1, n):
            flexibility[k, k] += 2.0 * slope[k - 1]
            flexibility[k - 1, k] = flexibility[k, k - 1] = slope[k - 1]
        spring = spring @ np.linalg.inv(np.eye(n) + flexibility @ spring)
    return opening, spring


def _stiffness(run: Run, at: dict[str, int], size: int, dynamic: bool) -> np.ndarray:
    """B^T C G B of the hinges, (2 EI/l)(2 1; 1 2) of the rods."""
    n = run.n_rods
    opening, spring = _springs(run, at, size, dynamic)
    stiffness = opening.T @ spring @ opening
    if dynamic:
        bending = 2.0 * run.per_rod("bending_stiffness") / run.per_rod("length")
        for k in range(n):
            pair = [at["alpha"] + k, at["beta"] + k]
            stiffness[np.ix_(pair, pair)] += bending[k] * np.array([[2.0, 1.0], [1.0, 2.0]])
            if size > at["bubble"]:  # int EI Nc''^2 = 204.8 EI / l^3, and nothing with Na, Nb
                stiffness[at["bubble"] + k, at["bubble"] + k] += 102.4 * bending[k] / run.per_rod("length")[k] ** 2
    return 0.5 * (stiffness + stiffness.T)
