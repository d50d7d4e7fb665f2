"""Numbers that the program is held against, by closed forms, quadrature and Ritz series of its own; beams of length, mass and EI 1."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import Legendre, Polynomial
from numpy.polynomial.legendre import leggauss

N_SHAPES = 16
#: Points and weights on 0..1, exact for products of two shapes and the functions beside them.
X, WEIGHTS = (0.5 * (leggauss(40)[0] + 1.0), 0.5 * leggauss(40)[1])


class Shapes:
    """Legendre polynomials times x^power: power 2 is clamped at x = 0, 1 hinged, 0 free. Rows are points."""

    def __init__(self, power: int):
        factor = Polynomial([0.0] * power + [1.0])
        shapes = [factor * Legendre.basis(k, domain=[0.0, 1.0]).convert(kind=Polynomial) for k in range(N_SHAPES - power)]
        self.at = lambda x, order: np.array([s.deriv(order)(np.asarray(x)) if order else s(np.asarray(x)) for s in shapes]).T

    def integral(self, order: int, factor: np.ndarray | float = 1.0) -> np.ndarray:
        """int factor v^(order) w^(order) dx for all pairs of shapes."""
        values = self.at(X, order)
        return values.T @ ((WEIGHTS * factor)[:, None] * values)

    def product(self, x: float, order: int, other: int | None = None) -> np.ndarray:
        """w^(order)(x) v^(other)(x) for all pairs."""
        return np.outer(self.at(x, order), self.at(x, order if other is None else other))


def frequencies(mass: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Rising; of motions that nothing holds, what rounding leaves."""
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    return np.sqrt(np.abs(np.linalg.eigvalsh(inverse @ stiffness @ inverse.T)))


def blade(spin: float, radius: float) -> float:
    """First frequency in the plane of rotation of a beam clamped on a turning hub."""
    shapes = Shapes(2)
    tension = spin**2 * (radius * (1.0 - X) + 0.5 * (1.0 - X**2))
    mass = shapes.integral(0)
    return frequencies(mass, shapes.integral(2) + shapes.integral(1, tension) - spin**2 * mass)[0]


def blade_elements(spin: float, radius: float, n: int) -> float:
    """The same by n Hermite elements with geometric stiffness: what rods that keep their arc are in small vibration."""
    mass, stiffness = np.zeros((2, 2 * n + 2, 2 * n + 2))
    one, h = np.ones_like(X), 1.0 / n
    value = np.array([1 - 3 * X**2 + 2 * X**3, h * (X - 2 * X**2 + X**3), 3 * X**2 - 2 * X**3, h * (X**3 - X**2)])
    slope = np.array([6 * X**2 - 6 * X, h * (1 - 4 * X + 3 * X**2), 6 * X - 6 * X**2, h * (3 * X**2 - 2 * X)]) / h
    curvature = np.array([12 * X - 6 * one, h * (6 * X - 4 * one), 6 * one - 12 * X, h * (6 * X - 2 * one)]) / h**2
    for k in range(n):
        x = (k + X) * h
        tension = spin**2 * (radius * (1.0 - x) + 0.5 * (1.0 - x**2))
        own = np.s_[2 * k:2 * k + 4, 2 * k:2 * k + 4]
        inertia = (WEIGHTS * h * value) @ value.T
        mass[own] += inertia
        stiffness[own] += (WEIGHTS * h * curvature) @ curvature.T + (WEIGHTS * h * tension * slope) @ slope.T - spin**2 * inertia
    return frequencies(mass[2:, 2:], stiffness[2:, 2:])[0]


def cantilever(tip_mass: float = 0.0, root_spring: float | None = None) -> np.ndarray:
    """Frequencies of a beam, clamped or hinged with a spring, with a mass on its tip."""
    shapes = Shapes(2 if root_spring is None else 1)
    stiffness = shapes.integral(2) + (0.0 if root_spring is None else root_spring * shapes.product(0.0, 1))
    return frequencies(shapes.integral(0) + tip_mass * shapes.product(1.0, 0), stiffness)


def tapered(power: int) -> np.ndarray:
    """Cantilevers with m = (1 - x)^power, EI = (1 - x)^(power + 2)."""
    shapes = Shapes(2)
    return frequencies(shapes.integral(0, (1.0 - X) ** power), shapes.integral(2, (1.0 - X) ** (power + 2)))


def boom(mass: float, inertia: float, radius: float) -> float:
    """Lowest frequency of a beam clamped on a free rigid hub, its root at a distance from the hub's centre of mass."""
    shapes = Shapes(0)
    centre = shapes.at(0.0, 0) - radius * shapes.at(0.0, 1)
    return frequencies(shapes.integral(0) + mass * np.outer(centre, centre) + inertia * shapes.product(0.0, 1), shapes.integral(2))[2]


def critical_weight() -> float:
    """Weight per length under which a clamped column buckles."""
    shapes = Shapes(2)
    return 1.0 / np.linalg.eigvals(np.linalg.solve(shapes.integral(2), shapes.integral(1, 1.0 - X))).real.max()


def flutter_thrust() -> tuple[float, float]:
    """Thrust on the end of a free beam, turning with it, at which two frequencies meet; this frequency.

    Compression P (1 - x); the force P v'(0) does work on v(0).
    """
    shapes = Shapes(0)
    load = -shapes.integral(1, 1.0 - X) - shapes.product(0.0, 0, 1)
    return flutter(shapes.integral(0), shapes.integral(2), load)


def flutter(mass: np.ndarray, stiffness: np.ndarray, load: np.ndarray) -> tuple[float, float]:
    """Lowest load, up to 300, at which two roots of M^-1 (K + P L) meet and become complex, and the frequency there.

    NaN if one becomes negative before.
    """
    a, b = np.linalg.solve(mass, stiffness), np.linalg.solve(mass, load)

    def pair(p: float) -> np.ndarray:
        """The two lowest beyond the zeros of rigid motions."""
        roots = np.linalg.eigvals(a + p * b)
        roots = roots[np.abs(roots) > 10.0]
        return roots[np.argsort(roots.real)][:2]

    high = next((p for p in np.linspace(1.0, 300.0, 300) if pair(p)[0].imag != 0.0 or pair(p)[0].real < 0.0), np.nan)
    if np.isnan(high) or pair(high)[0].imag == 0.0:
        return np.nan, np.nan
    low = high - 1.0
    while high - low > 1e-12 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if pair(middle)[0].imag != 0.0 else (middle, high)
    return 0.5 * (low + high), float(np.sqrt(pair(low).real.mean()))


def buckling(stiffness: np.ndarray, load: np.ndarray) -> float:
    """Lowest positive P for which K + P L is singular."""
    roots = np.linalg.eigvals(np.linalg.solve(stiffness, -load))
    roots = roots[np.abs(roots.imag) < 1e-9 * np.abs(roots)].real
    return 1.0 / roots.max()


def elastica(load: float) -> tuple[float, float]:
    """How far the tip of a cantilever goes aside, and along, under a dead load across it.

    theta'^2 = 2 P (sin theta_1 - sin theta); with sin theta = sin theta_1 (1 - t^2) the integrals over t in 0..1 are smooth.
    """
    t, weights = 0.5 * (leggauss(200)[0] + 1.0), 0.5 * leggauss(200)[1]

    def length(top: float) -> tuple[np.ndarray, np.ndarray]:
        sine = np.sin(top) * (1.0 - t**2)
        return np.sqrt(2.0 * np.sin(top) / load) * weights / np.sqrt(1.0 - sine**2), sine

    top = bisect(lambda angle: length(angle)[0].sum() - 1.0, 1e-6, 0.5 * np.pi - 1e-9)
    pieces, sine = length(top)
    return float(pieces @ sine), 1.0 - float(pieces @ np.sqrt(1.0 - sine**2))


def buckled(angle: float) -> tuple[float, float, float]:
    """Load over Euler's at which the tip of a clamped column is turned by an angle, its height and how far it is aside."""
    k = np.sin(0.5 * angle)
    first, second = complete_integrals(k)
    return (2.0 * first / np.pi) ** 2, 2.0 * second / first - 1.0, 2.0 * k / first


def complete_integrals(k: float) -> tuple[float, float]:
    """Elliptic integrals K(k), E(k), by the arithmetic-geometric mean."""
    a, g, c, total, power = 1.0, np.sqrt(1.0 - k**2), k, 0.5 * k**2, 0.5
    while abs(c) > 1e-16:
        a, g, c = 0.5 * (a + g), np.sqrt(a * g), 0.5 * (a - g)
        power *= 2.0
        total += power * c**2
    first = 0.5 * np.pi / a
    return first, first * (1.0 - total)


def bisect(function: Callable[[float], float], low: float, high: float) -> float:
    """Where a rising function is zero."""
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if function(middle) > 0.0 else (middle, high)
    return 0.5 * (low + high)


def bead_frequencies(n: int) -> np.ndarray:
    """Of n beads on a hanging string: square roots of the zeros of the Laguerre polynomial L_n."""
    return np.sqrt(np.polynomial.laguerre.laggauss(n)[0])


def turn_by_one_arm(mass: float, inertia: float, hinge: float, arm_mass: float, centre: float, arm_inertia: float) -> float:
    """Rotation of a body whose arm makes a full turn about its hinge, at zero momentum."""
    reduced = mass * arm_mass / (mass + arm_mass)
    j1, j2, k = inertia + reduced * hinge**2, arm_inertia + reduced * centre**2, reduced * hinge * centre
    return -np.pi * (1.0 + (j2 - j1) / np.sqrt((j1 + j2) ** 2 - 4.0 * k**2))


def turn_by_two_links(bodies: list[tuple[float, float]], hinge: float, length: float, centre: float,
                      corners: list[tuple[float, float]]) -> float:
    """Rotation of a body with two links whose angles to it go round a polygon, at zero momentum.

    `bodies` has mass and central moment of inertia of body, first and second link. Relative to the common centre of mass the angular
    momentum is I(shape) omega + sum_i a_i(shape) phi_i' = 0.
    """
    masses = np.array([mass for mass, _ in bodies])

    def rotation_rate(phi: np.ndarray, rate: np.ndarray) -> float:
        direction, across = np.exp(1j * phi), 1j * np.exp(1j * phi)
        places = np.array([0.0, hinge + centre * direction[0], hinge + length * direction[0] + centre * direction[1]])
        moving = np.array([0.0, centre * across[0] * rate[0], length * across[0] * rate[0] + centre * across[1] * rate[1]])
        places, moving = places - masses @ places / masses.sum(), moving - masses @ moving / masses.sum()
        inertia = masses @ np.abs(places) ** 2 + sum(j for _, j in bodies)
        return -(masses @ (places.conj() * moving).imag + bodies[1][1] * rate[0] + bodies[2][1] * rate[1]) / inertia

    total = 0.0
    for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
        side = np.subtract(end, start)
        total += sum(w * rotation_rate(np.array(start) + x * side, side) for x, w in zip(X, WEIGHTS, strict=True))
    return total
