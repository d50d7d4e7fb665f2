"""The model for the peers, written once: the recursion of docs/model.md in plain arithmetic, for numbers (numba) and for expressions (heyoka).

    scene = read_scene("table1.nml")
    flexible(scene.n, scene.rods, ...)          # under numba.njit, or with arrays of heyoka's expressions

State: y = (u_x, u_y, theta, phi, [alpha, beta,] Vx, Vy, w, phi', [alpha', beta']); a fixed spacecraft has no first three. The equations
are those of `src/rodyn/dynamics` in the shortest form (Schur complements, angles from rod to rod), which costs fewest products;
only `consistent` scenes, without kinks, with constant loads on the spacecraft or sin^2 forces on the tip.
"""

from __future__ import annotations

import itertools
import pathlib
import sys
from dataclasses import dataclass, field

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "postproc"))
from namelist import read_namelist

# Columns of the constants of a rod.
(LENGTH, M0, M1, A1, B1, SA, SB, AA, AB, BB, G1, G2, H1, H2, I11, I12, I22, M0R, M1R, M2R, KAPPA, MU, COUNT) = range(23)


@dataclass
class Segment:
    """Between two switches of the loads. The force on the tip is `tip * sin(rate t)**2`."""

    start: float
    end: float
    base: np.ndarray = field(default_factory=lambda: np.zeros(3))  # X_C, Y_C, M_C
    tip: np.ndarray = field(default_factory=lambda: np.zeros(2))
    rate: float = 0.0


@dataclass
class Scene:
    n: int
    kind: str  # 'flexible', 'rigid' or 'lumped'
    free: bool
    rods: np.ndarray  # (n, COUNT)
    stiffness: np.ndarray  # hinges: C
    damping: np.ndarray  # D
    series: np.ndarray | None  # quasistatic bending: th = series @ opening
    body: np.ndarray  # M0, J0, x0, y0, mass on hinge 0
    segments: list[Segment]

    @property
    def n_dof(self) -> int:
        return 3 * self.free + (3 if self.kind == "flexible" else 1) * self.n

    def pick(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """phi and alpha' of a state."""
        first = 3 * self.free
        rates = first + self.n + self.n_dof
        return y[first:first + self.n], y[rates:rates + self.n] if self.kind == "flexible" else y[:0]


def read_scene(path: str, hinge_factor: float = 1.0, number: type = float) -> Scene:
    """The scene in `number`: what follows from the numbers of the file is computed in its precision."""
    groups = read_namelist(pathlib.Path(path).read_text())
    case, craft, chain = (groups[name][0] for name in ("case", "spacecraft", "chain"))
    model = groups.get("model", [{}])[0]
    if model.get("bending", "dynamic") == "dynamic" and model.get("formulation", "inextensible") != "consistent":
        raise ValueError("peers know the consistent formulation only")
    n = chain["n_rods"]

    def spread(key: str, default: float = 0.0) -> np.ndarray:
        return np.broadcast_to(np.asarray(chain.get(key, default), float), n).astype(number)

    lumped, bending = model.get("inertia") == "lumped", model.get("bending", "dynamic")
    kind = "lumped" if lumped else "rigid" if bending == "rigid" else "flexible"
    length, stiffness = spread("length"), number(hinge_factor) * spread("hinge_stiffness")
    rods, on_hinge = rod_constants(kind, length, spread("mass_per_length"), spread("bending_stiffness"), spread("node_mass"))
    series = three_moments(stiffness, length / (6 * spread("bending_stiffness"))) if bending == "quasistatic" else None
    free = craft.get("motion", "free") == "free"
    body = np.array([craft.get("mass", 0.0), craft.get("inertia", 0.0), craft["hinge_x"], craft["hinge_y"], 0.0]).astype(number)
    body[4] = on_hinge
    return Scene(n, kind, free, rods, stiffness, spread("hinge_damping"), series, body, segments_of(groups.get("load", []), case["t_end"], n))


def rod_constants(kind: str, l: np.ndarray, m: np.ndarray, ei: np.ndarray, mu: np.ndarray) -> tuple[np.ndarray, float]:
    c = np.zeros((l.size, COUNT), l.dtype)
    c[:, LENGTH], c[:, MU] = l, mu
    if kind == "lumped":  # half of each rod to each of its nodes
        half = m * l / 2
        c[:, MU] += half
        c[:-1, MU] += half[1:]
        return c, half[0]
    c[:, M0], c[:, M1] = m * l, m * l**2 / 2
    m2 = m * l**3 / 3
    c[:, M0R], c[:, M1R], c[:, M2R] = c[:, M0], c[:, M1], m2
    if kind == "rigid":
        return c, 0.0
    c[:, A1], c[:, B1] = m * l**2 / 12, -m * l**2 / 12
    c[:, SA], c[:, SB] = m * l**3 / 30, -m * l**3 / 20
    c[:, AA], c[:, AB], c[:, BB] = m * l**3 / 105, -m * l**3 / 140, m * l**3 / 105
    c[:, KAPPA] = 2 * ei / l
    for row in c:
        inverse = inverse_of(row[[[AA, AB], [AB, BB]]])
        row[I11], row[I12], row[I22] = inverse[0, 0], inverse[0, 1], inverse[1, 1]
        row[G1:G2 + 1] = inverse @ row[[A1, B1]]
        row[H1:H2 + 1] = inverse @ row[[SA, SB]]
        row[M0R] = row[M0] - row[[A1, B1]] @ row[G1:G2 + 1]
        row[M1R] = row[M1] - row[[SA, SB]] @ row[G1:G2 + 1]
    c[:, M2R] = m2 - c[:, SA] * c[:, H1] - c[:, SB] * c[:, H2]
    return c, 0.0


def three_moments(stiffness: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """th = (I + F C)^-1 opening."""
    return inverse_of(np.eye(slope.size).astype(slope.dtype) + three_moment_matrix(slope) * stiffness)


def inverse_of(matrix: np.ndarray) -> np.ndarray:
    """By Gauss and Jordan, in any precision; rows need no exchange in matrices as these."""
    n = len(matrix)
    both = np.concatenate([matrix, np.eye(n).astype(matrix.dtype)], axis=1)
    for i in range(n):
        both[i] = both[i] / both[i, i]
        for j in range(n):
            if j != i:
                both[j] = both[j] - both[j, i] * both[i]
    return both[:, n:]


def three_moment_matrix(slope: np.ndarray) -> np.ndarray:
    """F: beta_k - alpha_{k+1} = F T, alpha_k = -s_k (2 T_{k-1} + T_k), beta_k = s_k (T_{k-1} + 2 T_k), T_n = 0."""
    n = slope.size
    f = np.zeros((n, n), slope.dtype)
    for k in range(n):  # hinge k, between rod k and rod k + 1 (slope[k])
        f[k, k] += 2 * slope[k]
        if k + 1 < n:
            f[k, k + 1] += slope[k]
        if k > 0:
            f[k, k] += 2 * slope[k - 1]
            f[k, k - 1] += slope[k - 1]
    return f


def segments_of(loads: list[dict], t_end: float, n: int) -> list[Segment]:
    times = {0.0, float(t_end)}
    for load in loads:
        times |= {float(t) for t in (load.get("t_start", 0.0), load.get("t_end", t_end)) if 0 < t < t_end}
    edges = sorted(times)
    segments = [Segment(a, b) for a, b in itertools.pairwise(edges)]
    for load in loads:
        for segment in segments:
            if not load.get("t_start", 0.0) <= segment.start < load.get("t_end", t_end):
                continue
            component, law = "XYM".index(load["component"]), load.get("law", "constant")
            if load.get("target", "spacecraft") == "spacecraft" and law == "constant":
                segment.base[component] += load["value"]
            elif load.get("node") == n and law == "sine_squared":
                segment.tip[component] += load["value"]
                segment.rate = load["rate"]
            else:
                raise ValueError("peers do not know this load")
    return segments


def flexible_moments(n, stiffness, damping, q, p, i, moment):
    """T of the hinges; phi, alpha, beta stand in q and p behind i places."""
    outer = 0.0 * q[0]
    outer_rate = 0.0 * q[0]
    for k in range(n):
        moment[k] = stiffness[k] * ((q[i + k] + q[i + n + k]) - outer) + damping[k] * ((p[i + k] + p[i + n + k]) - outer_rate)
        outer = q[i + k] + q[i + 2 * n + k]
        outer_rate = p[i + k] + p[i + 2 * n + k]
    moment[n] = 0.0 * q[0]


def rigid_moments(n, stiffness, damping, q, p, i, moment):
    moment[0] = stiffness[0] * q[i] + damping[0] * p[i]
    for k in range(1, n):
        moment[k] = stiffness[k] * (q[i + k] - q[i + k - 1]) + damping[k] * (p[i + k] - p[i + k - 1])
    moment[n] = 0.0 * q[0]


def series_moments(n, spring, damper, q, p, i, moment):
    """T = spring @ phi + damper @ phi', of hinges in series with bending."""
    for k in range(n):
        total = 0.0 * q[0]
        for j in range(n):
            total = total + (spring[k, j] * q[i + j] + damper[k, j] * p[i + j])
        moment[k] = total
    moment[n] = 0.0 * q[0]


def flexible(n, i, rods, cosine, sine, q, p, moment, tip_e, tip_n, work, out):
    """Inward over flexible rods: what hinge 0 feels, as (pee, pen, pnn, be, bn) in `out`, axes of the spacecraft."""
    omega = 0.0
    if i > 0:
        omega = p[2]
    pee = pen = pnn = 0.0
    be, bn = -tip_e, -tip_n
    for k in range(n - 1, -1, -1):
        c = rods[k]
        length = c[LENGTH]
        pee = pee + c[MU]
        pnn = pnn + c[MU]
        alpha = q[i + n + k]
        beta = q[i + 2 * n + k]
        alpha_rate = p[i + n + k]
        beta_rate = p[i + 2 * n + k]
        w = omega + p[i + k]
        w2 = w * w
        mv = c[A1] * alpha + c[B1] * beta
        mv_rate = c[A1] * alpha_rate + c[B1] * beta_rate
        qa = c[AA] * alpha + c[AB] * beta
        qb = c[AB] * alpha + c[BB] * beta
        mvv = alpha * qa + beta * qb
        mvv_rate = alpha_rate * qa + beta_rate * qb
        ma = -moment[k] - c[KAPPA] * (2.0 * alpha + beta)
        mb = moment[k + 1] - c[KAPPA] * (alpha + 2.0 * beta)
        r0 = moment[k + 1] - moment[k] - (c[H1] * ma + c[H2] * mb) - w2 * (c[SA] * alpha + c[SB] * beta) - 2.0 * (w * mvv_rate)
        work[3, k] = w2 * alpha + (c[I11] * ma + c[I12] * mb)
        work[4, k] = w2 * beta + (c[I12] * ma + c[I22] * mb)
        lw2 = length * w2
        inv = 1.0 / (c[M2R] + mvv + (length * length) * pnn)
        ce = length * pen - mv
        cn = c[M1R] + length * pnn
        be = be - pee * lw2
        bn = bn - pen * lw2
        r = (r0 - length * bn) * inv
        xe = ce * inv
        xn = cn * inv
        work[0, k] = r
        work[1, k] = xe
        work[2, k] = xn
        work[5, k] = lw2
        be = be - c[M1] * w2 - 2.0 * (w * mv_rate) + ce * r
        bn = bn + (c[G1] * ma + c[G2] * mb) + cn * r
        ee = c[M0] + pee - ce * xe
        en = pen - ce * xn
        nn = c[M0R] + pnn - cn * xn
        pee, pen, pnn, be, bn = turn(cosine[k], sine[k], ee, en, nn, be, bn)
    out[0], out[1], out[2], out[3], out[4] = pee, pen, pnn, be, bn


def turn(cd, sd, ee, en, nn, be, bn):
    """From the axes of rod k to those of rod k - 1: with c^2 + s^2 = 1, three products more than the two of the vector."""
    cs = cd * sd
    ss = sd * sd
    difference = nn - ee
    shift = ss * difference - 2.0 * (cs * en)
    return ee + shift, en - 2.0 * (ss * en) - cs * difference, nn - shift, cd * be - sd * bn, sd * be + cd * bn


def flexible_outward(n, i, rods, cosine, sine, ae, an, omega_rate, work, acceleration):
    for k in range(n):
        c = rods[k]
        cd = cosine[k]
        sd = sine[k]
        ae, an = cd * ae + sd * an, cd * an - sd * ae
        w_rate = work[0, k] - work[1, k] * ae - work[2, k] * an
        acceleration[i + k] = w_rate - omega_rate
        acceleration[i + n + k] = work[3, k] - c[G1] * an - c[H1] * w_rate
        acceleration[i + 2 * n + k] = work[4, k] - c[G2] * an - c[H2] * w_rate
        ae = ae - work[5, k]
        an = an + c[LENGTH] * w_rate


def rigid(n, i, rods, cosine, sine, q, p, moment, tip_e, tip_n, work, out):
    omega = 0.0
    if i > 0:
        omega = p[2]
    pee = pen = pnn = 0.0
    be, bn = -tip_e, -tip_n
    for k in range(n - 1, -1, -1):
        c = rods[k]
        length = c[LENGTH]
        pee = pee + c[MU]
        pnn = pnn + c[MU]
        w = omega + p[i + k]
        w2 = w * w
        lw2 = length * w2
        inv = 1.0 / (c[M2R] + (length * length) * pnn)
        ce = length * pen
        cn = c[M1] + length * pnn
        be = be - pee * lw2
        bn = bn - pen * lw2
        r = (moment[k + 1] - moment[k] - length * bn) * inv
        xe = ce * inv
        xn = cn * inv
        work[0, k] = r
        work[1, k] = xe
        work[2, k] = xn
        work[5, k] = lw2
        be = be - c[M1] * w2 + ce * r
        bn = bn + cn * r
        ee = c[M0] + pee - ce * xe
        en = pen - ce * xn
        nn = c[M0] + pnn - cn * xn
        pee, pen, pnn, be, bn = turn(cosine[k], sine[k], ee, en, nn, be, bn)
    out[0], out[1], out[2], out[3], out[4] = pee, pen, pnn, be, bn


def rigid_outward(n, i, rods, cosine, sine, ae, an, omega_rate, work, acceleration):
    for k in range(n):
        ae, an = cosine[k] * ae + sine[k] * an, cosine[k] * an - sine[k] * ae
        w_rate = work[0, k] - work[1, k] * ae - work[2, k] * an
        acceleration[i + k] = w_rate - omega_rate
        ae = ae - work[5, k]
        an = an + rods[k, LENGTH] * w_rate


def lumped(n, i, rods, cosine, sine, q, p, moment, tip_e, tip_n, work, out):
    """Massless rods: one axial apparent mass `a` in place of P, see `recursion_lumped.f90`."""
    omega = 0.0
    if i > 0:
        omega = p[2]
    a = 0.0
    be, bn = -tip_e, -tip_n
    cd, sd = 1.0, 0.0
    for k in range(n - 1, -1, -1):
        mu = rods[k, MU]
        w = omega + p[i + k]
        lw2 = rods[k, LENGTH] * (w * w)
        shear = (moment[k + 1] - moment[k]) * (1.0 / rods[k, LENGTH])
        inv = 1.0 / (mu + a * (sd * sd))
        ratio = (a * (cd * sd)) * inv
        a = mu * ((mu + a) * inv)
        work[0, k] = (shear - bn) * inv
        work[1, k] = ratio
        work[2, k] = lw2
        be = be - a * lw2 - ratio * (bn - shear)
        bn = shear
        cd = cosine[k]
        sd = sine[k]
        be, bn = cd * be - sd * bn, sd * be + cd * bn
    out[0], out[1], out[2], out[3], out[4] = a * (cd * cd), a * (cd * sd), a * (sd * sd), be, bn


def lumped_outward(n, i, rods, cosine, sine, ae, an, omega_rate, work, acceleration):
    for k in range(n):
        ae, an = cosine[k] * ae + sine[k] * an - work[2, k], cosine[k] * an - sine[k] * ae
        outer_an = work[0, k] - work[1, k] * ae
        acceleration[i + k] = (outer_an - an) * (1.0 / rods[k, LENGTH]) - omega_rate
        an = outer_an


def spacecraft(body, p, base, moment_0, out, acceleration):
    """Accelerations of a free spacecraft, and that of hinge 0 in `out`: the 3x3 system by elimination."""
    mass, inertia, x, y = body[0], body[1], body[2], body[3]
    w = p[2]
    w2 = w * w
    pxx = out[0] + body[4]
    pxy = out[1]
    pyy = out[2] + body[4]
    cx = out[3] - w2 * (pxx * x + pxy * y)
    cy = out[4] - w2 * (pxy * x + pyy * y)
    m13 = pxy * x - pxx * y
    m23 = pyy * x - pxy * y
    i1 = 1.0 / (mass + pxx)
    l2 = pxy * i1
    l3 = m13 * i1
    u = m23 - m13 * l2
    i2 = 1.0 / (mass + pyy - pxy * l2)
    l32 = u * i2
    d3 = inertia + (x * m23 - y * m13) - m13 * l3 - u * l32
    f1 = base[0] - cx
    f2 = base[1] - cy
    f3 = base[2] + moment_0 - (x * cy - y * cx)
    f2r = f2 - l2 * f1
    w_rate = (f3 - l3 * f1 - l32 * f2r) / d3
    ay = i2 * f2r - l32 * w_rate
    ax = i1 * f1 - l2 * ay - l3 * w_rate
    acceleration[0] = ax + w * p[1]
    acceleration[1] = ay - w * p[0]
    acceleration[2] = w_rate
    out[0] = ax - y * w_rate - x * w2
    out[1] = ay + x * w_rate - y * w2


RECURSION = {"flexible": (flexible, flexible_outward), "rigid": (rigid, rigid_outward), "lumped": (lumped, lumped_outward)}
