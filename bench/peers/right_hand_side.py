"""The model as a right-hand side: compiled by numba for numbers, or as heyoka's expressions."""

from __future__ import annotations

import math
import types
from collections.abc import Callable
from typing import Any

import model
import numpy as np
from model import Scene, Segment


def spring_and_damper(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """T = spring @ phi + damper @ phi' of hinges in series with bending, docs/model.md sec. 5."""
    if scene.series is None:
        return np.zeros((1, 1)), np.zeros((1, 1))
    opening = (np.eye(scene.n) - np.eye(scene.n, k=-1)).astype(scene.series.dtype)
    theta = scene.series @ opening
    return scene.stiffness[:, None] * theta, scene.series.T @ (scene.damping[:, None] * theta)


def compiled(scene: Scene, segment: Segment) -> Callable[[float, np.ndarray, np.ndarray], None]:
    """f(t, y, ydot) by numba. Products and sums may be fused, as gfortran does; nothing else of fast arithmetic."""
    from numba import njit

    jit = njit(fastmath={"contract"}, error_model="numpy")
    n, n_dof, i = scene.n, scene.n_dof, 3 * scene.free
    rods, body, base, tip, rate = scene.rods, scene.body, segment.base, segment.tip, segment.rate
    stiffness, damping = scene.stiffness, scene.damping
    spring, damper = spring_and_damper(scene)
    quasistatic, tip_loaded = scene.series is not None, bool(np.any(segment.tip))
    turn = jit(model.turn)
    inward, outward = (jit(with_turn(function, turn)) for function in model.RECURSION[scene.kind])
    spacecraft, series_moments = jit(model.spacecraft), jit(model.series_moments)
    moments = jit(model.flexible_moments if scene.kind == "flexible" else model.rigid_moments)
    sin, cos = math.sin, math.cos

    @jit
    def right_hand_side(t, y, ydot):
        memory = np.empty((10, n + 5))  # one allocation
        cosine, sine, moment, out, work = memory[0], memory[1], memory[2], memory[3], memory[4:]
        q = y[:n_dof]
        p = y[n_dof:]
        acceleration = ydot[n_dof:]
        before = 0.0
        for k in range(n):
            cosine[k] = cos(q[i + k] - before)
            sine[k] = sin(q[i + k] - before)
            before = q[i + k]
        if quasistatic:
            series_moments(n, spring, damper, q, p, i, moment)
        else:
            moments(n, stiffness, damping, q, p, i, moment)
        tip_e = tip_n = 0.0
        if tip_loaded:
            factor = sin(rate * t) ** 2
            ct = cos(before)
            st = sin(before)
            tip_e = factor * (tip[0] * ct + tip[1] * st)
            tip_n = factor * (tip[1] * ct - tip[0] * st)
        inward(n, i, rods, cosine, sine, q, p, moment, tip_e, tip_n, work, out)
        omega_rate = 0.0
        if i > 0:
            spacecraft(body, p, base, moment[0], out, acceleration)
            omega_rate = acceleration[2]
        else:
            out[0] = 0.0
            out[1] = 0.0
        outward(n, i, rods, cosine, sine, out[0], out[1], omega_rate, work, acceleration)
        for k in range(n_dof):
            ydot[k] = p[k]
        if i > 0:
            ydot[0] += p[2] * q[1]
            ydot[1] -= p[2] * q[0]

    return right_hand_side


def with_turn(function: Callable, turn: Callable) -> Callable:
    """The function with a compiled `turn` among its globals."""
    return types.FunctionType(function.__code__, function.__globals__ | {"turn": turn}, function.__name__)


def expressions(scene: Scene, segment: Segment, hinge_factor: Any = None, base: Any = None) -> list[tuple[Any, Any]]:
    """heyoka's system. `hinge_factor` multiplies the stiffness of all hinges, `base` replaces the loads on the spacecraft: parameters."""
    import heyoka as hy

    n, n_dof, i = scene.n, scene.n_dof, 3 * scene.free
    names = [f"q{k}" for k in range(n_dof)] + [f"p{k}" for k in range(n_dof)]
    y = np.array(hy.make_vars(*names), dtype=object)
    q, p = y[:n_dof], y[n_dof:]
    phi = q[i:i + n]
    relative = [phi[0]] + [phi[k] - phi[k - 1] for k in range(1, n)]
    cosine = np.array([hy.cos(x) for x in relative], dtype=object)
    sine = np.array([hy.sin(x) for x in relative], dtype=object)
    moment, work, out = (np.empty(shape, dtype=object) for shape in (n + 1, (6, n), 5))
    acceleration = np.empty(n_dof, dtype=object)
    stiffness = scene.stiffness.astype(object)
    if hinge_factor is not None:
        stiffness = stiffness * hinge_factor
    if scene.series is not None:
        model.series_moments(n, *spring_and_damper(scene), q, p, i, moment)
    else:
        moments = model.flexible_moments if scene.kind == "flexible" else model.rigid_moments
        moments(n, stiffness, scene.damping, q, p, i, moment)
    tip_e = tip_n = 0.0
    if np.any(segment.tip):
        factor = hy.sin(segment.rate * hy.time) ** 2.0
        ct, st = hy.cos(phi[-1]), hy.sin(phi[-1])
        tip_e = factor * (segment.tip[0] * ct + segment.tip[1] * st)
        tip_n = factor * (segment.tip[1] * ct - segment.tip[0] * st)
    inward, outward = model.RECURSION[scene.kind]
    inward(n, i, scene.rods, cosine, sine, q, p, moment, tip_e, tip_n, work, out)
    omega_rate = 0.0
    if scene.free:
        model.spacecraft(scene.body, p, segment.base if base is None else base, moment[0], out, acceleration)
        omega_rate = acceleration[2]
    else:
        out[0] = out[1] = 0.0
    outward(n, i, scene.rods, cosine, sine, out[0], out[1], omega_rate, work, acceleration)
    rates = list(p) + list(acceleration)
    if scene.free:
        rates[0] = rates[0] + p[2] * q[1]
        rates[1] = rates[1] - p[2] * q[0]
    return list(zip(y, rates, strict=True))
