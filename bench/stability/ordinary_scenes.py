#!/usr/bin/env python3
"""Random ordinary scenes: what an engineer would type, in numbers of two or three digits.

    bench/stability/ordinary_scenes.py                          the families
    bench/stability/ordinary_scenes.py damped_slews 17          the namelist of one scene
    bench/stability/ordinary_scenes.py --count 10 --to DIR      ten scenes of every family as DIR/FAMILY_SEED.nml

A scene is a function of its family and its seed alone, so that one that went wrong can be made again. Families stand in
`FAMILIES`; durations are chosen such that no scene has much more than `RADIANS` radians of its fastest motion.
"""

from __future__ import annotations

import argparse
import math
import pathlib
import random
from collections.abc import Sequence

RADIANS = 3e3
Value = float | int | bool | str | list
Group = tuple[str, dict[str, Value]]


class Typist:
    """Draws numbers as people type them. Only `random()` of the standard library is used, whose sequence is fixed."""

    def __init__(self, family: str, seed: int) -> None:
        self.draw = random.Random(f"{family} {seed}").random

    def number(self, low: float, high: float, digits: int = 2, even: bool = False) -> float:
        """Between two bounds, evenly in its logarithm (`even`: in itself), to some significant digits."""
        x = low + (high - low) * self.draw() if even else low * (high / low) ** self.draw()
        return float(f"{x:.{digits - 1}e}")

    def angle(self, size: float) -> float:
        """Between -size and size, to two decimals at most."""
        return round((2 * self.draw() - 1) * size, 2)

    def whole(self, low: int, high: int) -> int:
        return low + int(self.draw() * (high - low + 1))

    def one_of(self, *values):
        return values[int(self.draw() * len(values))]

    def chance(self, probability: float) -> bool:
        return self.draw() < probability

    def each(self, n: int, low: float, high: float, digits: int = 2, equal: float = 0.6) -> list[float]:
        """n numbers, often all the same."""
        if self.chance(equal):
            return [self.number(low, high, digits)] * n
        return [self.number(low, high, digits) for _ in range(n)]


class Scene:
    """The groups of a case, and what a duration follows from."""

    def __init__(self, typist: Typist, n: int, bending: str = "dynamic", inertia: str = "distributed", shapes: int = 2) -> None:
        self.typist, self.n, self.bending, self.inertia = typist, n, bending, inertia
        self.model: dict[str, Value] = {"formulation": "consistent", "inertia": inertia, "bending": bending}
        if shapes == 3:
            self.model |= {"bending_shapes": 3, "gauss_points": 5}
        self.chain: dict[str, Value] = {"n_rods": n}
        self.spacecraft: dict[str, Value] = {}
        self.initial: dict[str, Value] = {}
        self.more: list[Group] = []

    # ---------------------------------------------------------------- what every scene has

    def add_spacecraft(self, fixed: float = 0.25, light: bool = False) -> None:
        t = self.typist
        if t.chance(fixed):
            self.spacecraft = {"motion": "fixed"}
            if t.chance(0.5):
                self.spacecraft["hinge_x"] = t.number(0.1, 2.0)
            return
        self.spacecraft = {"mass": t.number(2, 50) if light else t.number(20, 900), "inertia": t.number(1, 20) if light else t.number(10, 500),
                           "hinge_x": t.number(0.1, 1.5)}
        if t.chance(0.4):
            self.spacecraft["hinge_y"] = t.angle(0.8)

    def add_chain(self, stiffness=(50, 5000), damping=(0, 0), bending_stiffness=(200, 1e4), kinks: bool = False, length=(0.8, 2.5)) -> None:
        t, n = self.typist, self.n
        self.chain |= {"length": t.each(n, *length), "mass_per_length": t.each(n, 0.3, 3.0)}
        if self.bending != "rigid":
            self.chain["bending_stiffness"] = t.each(n, *bending_stiffness)
        if t.chance(0.7) or self.inertia == "lumped":
            self.chain["node_mass"] = t.each(n, 0.1, 4.0)
        self.chain["hinge_stiffness"] = t.each(n, *stiffness)
        if damping[1] > 0:
            self.chain["hinge_damping"] = t.each(n, *damping)
        if kinks:
            self.chain["kink"] = [t.angle(0.3) if t.chance(0.5) else 0.0 for _ in range(n)]

    def add_motion(self, bent: float = 0.3, rates: float = 0.5, omega: float = 0.0, size: float = 0.5) -> None:
        """A state at the start that is not rest."""
        t = self.typist
        if t.chance(0.7):
            self.initial["phi"] = [t.angle(size) for _ in range(self.n)]
        if t.chance(rates):
            self.initial["phi_rate"] = [t.angle(size) for _ in range(self.n)]
        if self.bending == "dynamic" and t.chance(bent):
            self.initial["alpha"] = [t.angle(0.03) for _ in range(self.n)]
            self.initial["beta"] = [t.angle(0.03) for _ in range(self.n)]
        if omega and not self.fixed:
            self.initial["omega"] = t.one_of(-1, 1) * t.number(0.1 * omega, omega)

    @property
    def fixed(self) -> bool:
        return self.spacecraft.get("motion") == "fixed"

    def add(self, group: str, **keys: Value) -> None:
        self.more.append((group, keys))

    # ---------------------------------------------------------------- its size

    def values(self, key: str) -> list[float]:
        """A key of &chain for each rod or hinge."""
        given = self.chain.get(key, 0.0)
        return given if isinstance(given, list) else [given] * self.n

    def masses(self) -> list[float]:
        """Of each rod with its node [kg]."""
        parts = zip(self.values("mass_per_length"), self.values("length"), self.values("node_mass"), strict=True)
        return [m * length + node for m, length, node in parts]

    def load_of(self, target: str, component: str, duration: float) -> float:
        """A load of ordinary size: a pulse that turns or moves the whole by up to 1 rad/s or 1 m/s, a force on a node that bends the
        hinges, or accelerates the chain, by some tenths."""
        reach = sum(self.values("length"))
        if target == "node":
            softest = max(min(self.values("hinge_stiffness")), 1.0)
            return self.typist.number(0.01, 0.3) * min(softest / reach, sum(self.masses()) / duration)
        chain = sum(self.masses())
        size = self.spacecraft["inertia"] + chain * reach**2 / 3.0 if component == "M" else self.spacecraft["mass"] + chain
        return self.typist.number(0.03, 1.0) * size / duration

    def fastest(self) -> float:
        """A rough upper bound of frequencies and decay rates [rad/s]."""
        values = self.values
        c, d = max(values("hinge_stiffness")), max(values("hinge_damping"))
        soft = max(values("bending_stiffness"))
        for group, keys in self.more:
            if group == "hinge":
                c = max(c, max(values("hinge_stiffness")) + keys.get("stop_stiffness", 0.0) + keys.get("lock_stiffness", 0.0))
                d = max(d, max(values("hinge_damping")) + keys.get("stop_damping", 0.0) + keys.get("lock_damping", 0.0)
                        + keys.get("friction_moment", 0.0) / keys.get("friction_velocity", 1.0))
        m, length, node = min(values("mass_per_length")), min(values("length")), min(values("node_mass"))
        if self.bending == "dynamic":
            inertia = m * length**3 / 420.0
            more = 3.0 if self.model.get("bending_shapes") == 3 else 1.0
            return max(more * math.sqrt(6.0 * soft / length / inertia + 2.0 * c / inertia), 2.0 * d / inertia)
        inertia = (m * length / 2.0 + node) * length**2 / 4.0 if self.inertia == "lumped" else m * length**3 / 12.0
        if self.bending == "quasistatic" and self.model.get("dampers") == "exact":
            least = min(x for x in values("hinge_damping") if x > 0.0) if d > 0.0 else 1.0
            return max(math.sqrt(4.0 * c / inertia), (c + 6.0 * soft / length) / least)
        if self.bending == "quasistatic":
            return math.sqrt(4.0 * min(c, 3.0 * soft / length) / inertia) + 2.0 * min(d, soft / length * 0.1) / inertia
        return max(math.sqrt(4.0 * c / inertia), 2.0 * d / inertia)

    def duration(self, longest: float = 100.0, times: float = 1.0) -> float:
        """A time as it is typed, such that the fastest motion has no more than `RADIANS` radians (`times` as many), often fewer."""
        most = min(times * RADIANS * 0.1 ** self.typist.draw() / self.fastest(), longest)
        typed = [x * 10.0**k for k in range(-3, 3) for x in (1.0, 2.0, 3.0, 4.0, 5.0, 8.0)]
        return float(f"{max([x for x in typed if x <= most], default=typed[0]):.3g}")

    def groups(self, t_end: float, n_outputs: int | None = None) -> list[Group]:
        outputs = n_outputs or self.typist.one_of(10, 20, 50, 100, 200)
        start = [("initial", self.initial)] if self.initial else []
        return [("case", {"t_end": t_end, "n_outputs": outputs}), ("spacecraft", self.spacecraft), ("chain", self.chain),
                ("model", self.model), *start, *self.more]


# -------------------------------------------------------------------- pieces

def add_pulses(scene: Scene, t_end: float) -> None:
    """Moments and forces of thrusters: one pulse, or two against each other, one after the other or overlapping."""
    t = scene.typist
    for _ in range(t.whole(1, 3)):
        where: dict[str, Value] = {"component": t.one_of("M", "M", "X", "Y")}
        if scene.fixed or t.chance(0.25):
            where = {"target": "node", "node": t.whole(1, scene.n), "component": t.one_of("X", "Y")}
        begin = t.one_of(0.0, round(t_end * 0.2 * t.draw(), 2), round(t_end * 0.5 * t.draw(), 2))
        end = round(begin + t_end * t.one_of(0.05, 0.1, 0.3) + 0.01, 2)
        size = scene.load_of(str(where.get("target", "")), str(where["component"]), end - begin)
        value = float(f"{t.one_of(-1, 1) * size:.1e}")
        law = t.one_of("constant", "constant", "constant", "smooth_step", "sine_squared", "table", "pair")
        if law == "constant":
            scene.add("load", **where, t_start=begin, t_end=end, value=value)
        elif law == "pair":
            gap = t.one_of(0.0, 0.0, round(0.1 * t_end, 2))
            scene.add("load", **where, t_start=begin, t_end=end, value=value)
            scene.add("load", **where, t_start=end + gap, t_end=2 * end - begin + gap, value=-value)
        elif law == "smooth_step":
            scene.add("load", **where, law=law, t_start=begin, t_end=end, value=value)
            if t.chance(0.5):
                scene.more[-1][1]["rise_time"] = round(0.3 * (end - begin), 3)
        elif law == "sine_squared":
            scene.add("load", **where, law=law, t_start=begin, t_end=end, value=value, rate=t.number(0.5, 20))
        else:
            times = [begin, round(begin + 0.3 * (end - begin), 3), round(begin + 0.6 * (end - begin), 3), end]
            scene.add("load", **where, law=law, times=times, values=[0.0, value, round(0.5 * value, 3), t.one_of(0.0, value)])


def fold(scene: Scene, size: float = 1.6) -> list[float]:
    """Angles of a folded array, like an accordion or all to one side; returns the joint rotations."""
    t = scene.typist
    first = t.number(0.3, size, even=True) * t.one_of(-1, 1)
    phi = [round(first * (-1) ** k * (0.8 if k else 1.0), 3) for k in range(scene.n)]
    if t.chance(0.3):
        phi = [round(t.number(0.2, 0.8, even=True) * (k + 1) * (1 if first > 0 else -1), 3) for k in range(scene.n)]
    scene.initial["phi"] = phi
    return [round(b - a, 3) for a, b in zip([0.0, *phi], phi, strict=False)]


def hinge_extras(scene: Scene, keys: dict[str, Value], side: float, friction: float = 0.3, freeplay: float = 0.15) -> None:
    """Friction and freeplay of a hinge that is more than a spring."""
    t = scene.typist
    if t.chance(friction):
        keys |= {"friction_moment": t.number(0.05, 3), "friction_velocity": t.one_of(0.01, 0.02, 0.05, 0.1)}
    if t.chance(freeplay):
        keys["freeplay"] = t.one_of(0.002, 0.005, 0.01, 0.02)
        if t.chance(0.3):
            keys["freeplay_stiffness"] = t.number(0.1, 5)


def stops(scene: Scene, keys: dict[str, Value], th: float) -> None:
    """A stop at the end of the way, and what holds there."""
    t = scene.typist
    keys["lower_stop" if th > 0 else "upper_stop"] = 0.0
    keys["stop_stiffness"] = t.number(100, 5000)
    if t.chance(0.6):
        keys["stop_damping"] = t.number(0.5, 60)


# -------------------------------------------------------------------- families

def some_model(t: Typist, n: int, dynamic: float = 0.5) -> Scene:
    """Bending rods, or rigid ones with either inertia."""
    if t.chance(dynamic):
        return Scene(t, n)
    return Scene(t, n, "rigid", t.one_of("distributed", "distributed", "lumped"))


def smooth(t: Typist) -> list[Group]:
    scene = some_model(t, t.whole(1, 6), 0.7)
    scene.add_spacecraft()
    scene.add_chain(damping=t.one_of((0, 0), (0.01, 1)), kinks=t.chance(0.3))
    scene.add_motion(omega=t.one_of(0.0, 2.0))
    return scene.groups(scene.duration())


def damped_slews(t: Typist) -> list[Group]:
    """Linear but for the geometry: pulses on a free spacecraft, dampers from weak to strong."""
    scene = some_model(t, t.whole(1, 6), 0.8)
    scene.add_spacecraft(fixed=0.0)
    scene.add_chain(stiffness=(50, 3000), damping=(0.5, 50))
    t_end = scene.duration(times=4.0)
    add_pulses(scene, t_end)
    return scene.groups(t_end)


def slews(t: Typist) -> list[Group]:
    scene = some_model(t, t.whole(1, 6), 0.7)
    scene.add_spacecraft()
    scene.add_chain(damping=t.one_of((0, 0), (0.01, 0.5)), kinks=t.chance(0.2))
    t_end = scene.duration()
    add_pulses(scene, t_end)
    return scene.groups(t_end)


def deployments(t: Typist) -> list[Group]:
    """Held hinges, each released at its own time, that latch."""
    scene = some_model(t, t.whole(1, 4), 0.35)
    scene.add_spacecraft()
    scene.add_chain(stiffness=(0.5, 20), damping=t.one_of((0, 0), (0.05, 1)), bending_stiffness=(100, 5000))
    joints = fold(scene)
    release = 0.0
    for k, th in enumerate(joints):
        release = round(release + t.number(0.1, 2.0), 1)
        keys: dict[str, Value] = {"hinge": k, "held": True, "release_time": release, "rest_angle": -math.copysign(t.number(0.1, 0.5), th)}
        if t.chance(0.8):
            keys["latch_angle"] = 0.0
            if t.chance(0.2):
                keys |= {"lock_stiffness": t.number(500, 5000), "lock_damping": t.number(0.5, 10)}
        hinge_extras(scene, keys, th)
        scene.add("hinge", **keys)
    return scene.groups(max(scene.duration(30.0), round(release + 1.0, 1)))


def sequences(t: Typist) -> list[Group]:
    """Panels that are released one after the other, each by the latch of the one before."""
    scene = some_model(t, t.whole(2, 4), 0.3)
    scene.add_spacecraft()
    scene.add_chain(stiffness=(1, 30), damping=t.one_of((0, 0), (0.05, 1)), bending_stiffness=(200, 5000))
    for k, th in enumerate(fold(scene)):
        keys: dict[str, Value] = {"hinge": k, "held": True, "rest_angle": -math.copysign(t.number(0.1, 0.5), th), "latch_angle": 0.0}
        keys |= {"release_time": t.one_of(0.0, 0.1, 0.5)} if k == 0 else {"release_after": k - 1}
        hinge_extras(scene, keys, th, 0.2, 0.1)
        scene.add("hinge", **keys)
    return scene.groups(max(scene.duration(30.0), 2.0))


def onto_stops(t: Typist) -> list[Group]:
    scene = some_model(t, t.whole(1, 3), 0.3)
    scene.add_spacecraft(fixed=0.4)
    scene.add_chain(stiffness=(2, 100), damping=t.one_of((0, 0), (0.01, 1)), bending_stiffness=(200, 5000))
    held = t.chance(0.4)
    for k, th in enumerate(fold(scene, 1.2)):
        keys: dict[str, Value] = {"hinge": k, "rest_angle": -math.copysign(t.number(0.1, 0.4), th)}
        if held:
            keys |= {"held": True, "release_time": t.one_of(0.1, 0.2, 0.5)}
        stops(scene, keys, th)
        hinge_extras(scene, keys, th)
        scene.add("hinge", **keys)
    return scene.groups(max(scene.duration(10.0), 1.0))


def friction(t: Typist) -> list[Group]:
    """Joints with friction and freeplay that swing down, or are shaken by pulses."""
    scene = some_model(t, t.whole(1, 4), 0.4)
    scene.add_spacecraft()
    scene.add_chain(stiffness=(5, 500), damping=t.one_of((0, 0), (0.01, 1)), bending_stiffness=(200, 5000))
    for k in range(scene.n):
        if t.chance(0.3) and k:
            continue
        keys: dict[str, Value] = {"hinge": k}
        hinge_extras(scene, keys, 1.0, 0.8, 0.5)
        if len(keys) > 1:
            scene.add("hinge", **keys)
    scene.add_motion(bent=0.0)
    t_end = max(scene.duration(20.0), 0.5)
    if not scene.initial or t.chance(0.5):
        add_pulses(scene, t_end)
    return scene.groups(t_end)


def spin_ups(t: Typist) -> list[Group]:
    """A spacecraft that turns, or is spun up, and lets its rods go."""
    scene = some_model(t, t.whole(1, 4), 0.5)
    scene.add_spacecraft(fixed=0.0)
    scene.add_chain(stiffness=(5, 2000), damping=t.one_of((0, 0), (0.01, 1)), bending_stiffness=(500, 2e4))
    joints = fold(scene)
    up = t.one_of(0.2, 0.5, 1.0)
    if t.chance(0.6):
        scene.initial["omega"] = t.number(0.2, 3)
    if t.chance(0.7) or "omega" not in scene.initial:
        scene.add("load", component="M", value=float(f"{t.number(1, 3) * scene.load_of('', 'M', up):.1e}"), t_end=up)
    for k, th in enumerate(joints):
        if t.chance(0.2):
            continue
        keys: dict[str, Value] = {"hinge": k, "held": True, "release_time": t.one_of(up, 2 * up, 0.1)}
        if t.chance(0.3):
            keys["latch_angle"] = 0.0
        elif t.chance(0.3):
            stops(scene, keys, th)
        hinge_extras(scene, keys, th, 0.15, 0.1)
        scene.add("hinge", **keys)
    return scene.groups(max(scene.duration(20.0), 3 * up))


def quasistatic_chain(t: Typist, n: int, exact: bool) -> Scene:
    scene = Scene(t, n, "quasistatic", "lumped")
    scene.model["dampers"] = "exact" if exact else "reduced"
    scene.add_spacecraft()
    return scene


def quasistatic(t: Typist) -> list[Group]:
    exact = t.chance(0.5)
    scene = quasistatic_chain(t, t.whole(1, 6), exact)
    scene.add_chain(stiffness=(50, 3000), damping=(1, 60) if exact else t.one_of((0, 0), (0.01, 1)), kinks=t.chance(0.4))
    scene.add_motion(omega=t.one_of(0.0, 2.0))
    t_end = scene.duration(20.0)
    if t.chance(0.6):
        add_pulses(scene, t_end)
    if t.chance(0.3):
        add_kink(scene, t_end, t.whole(0, scene.n - 1))
    return scene.groups(t_end)


def quasistatic_joints(t: Typist) -> list[Group]:
    """Massless rods between joints that are held, stopped, released, latched."""
    exact = t.chance(0.5)
    scene = quasistatic_chain(t, t.whole(1, 3), exact)
    scene.add_chain(stiffness=(20, 1000), damping=(1, 40) if exact else t.one_of((0, 0), (0.01, 0.5)), bending_stiffness=(50, 3000))
    joints = fold(scene, 0.6)
    for k, th in enumerate(joints):
        if t.chance(0.2):
            continue
        keys: dict[str, Value] = {"hinge": k}
        if t.chance(0.5):
            keys["rest_angle"] = -math.copysign(t.number(0.05, 0.3), th)
        if t.chance(0.4):
            keys |= {"held": True, "release_time": t.one_of(0.05, 0.1, 0.2)}
        if t.chance(0.4):
            keys["latch_angle"] = round(0.5 * th, 2)
        if t.chance(0.4):
            stops(scene, keys, th)
        hinge_extras(scene, keys, th, 0.2, 0.2)
        scene.add("hinge", **keys)
    t_end = max(scene.duration(5.0), 0.5)
    if t.chance(0.3):
        add_pulses(scene, t_end)
    return scene.groups(t_end)


def lumped(t: Typist) -> list[Group]:
    scene = Scene(t, t.whole(1, 12), "rigid", "lumped")
    scene.add_spacecraft(fixed=0.4)
    scene.add_chain(damping=t.one_of((0, 0), (0.01, 5)), kinks=t.chance(0.2))
    scene.add_motion()
    t_end = scene.duration(50.0)
    add_pulses(scene, t_end)
    return scene.groups(t_end)


def three_shapes(t: Typist) -> list[Group]:
    scene = Scene(t, t.whole(1, 4), shapes=3)
    scene.add_spacecraft()
    scene.add_chain(damping=t.one_of((0, 0), (0.01, 1)))
    scene.add_motion()
    t_end = scene.duration(20.0)
    add_pulses(scene, t_end)
    return scene.groups(t_end)


def profiles(t: Typist) -> list[Group]:
    """Rods whose mass or stiffness varies."""
    kind = t.one_of("dynamic", "dynamic", "three", "quasistatic", "lumped", "rigid")
    inertia = "lumped" if kind in ("quasistatic", "lumped") else "distributed"
    bending = {"three": "dynamic", "lumped": "rigid"}.get(kind, kind)
    scene = Scene(t, t.whole(1, 5), bending, inertia, 3 if kind == "three" else 2)
    scene.add_spacecraft()
    scene.add_chain(damping=t.one_of((0, 0), (0.01, 1)))
    scene.add_motion()
    for quantity in ("mass_per_length", "bending_stiffness"):
        if bending == "rigid" and quantity == "bending_stiffness":
            continue
        where: dict[str, Value] = {"quantity": quantity}
        if t.chance(0.3):
            where |= {"first_rod": t.whole(1, scene.n)}
        if t.chance(0.6):
            scene.add("rod_profile", **where, polynomial=[1.0, round(-0.7 * t.draw(), 1), round(0.3 * t.draw(), 2)][: t.whole(2, 3)])
        else:
            jump = t.one_of(0.3, 0.4, 0.5)
            scene.add("rod_profile", **where, positions=[0.0, jump, jump, 1.0], values=[1.0, 1.0, t.number(0.5, 2.5), t.number(0.5, 2.0)])
    t_end = scene.duration(20.0)
    add_pulses(scene, t_end)
    return scene.groups(t_end)


def add_kink(scene: Scene, t_end: float, hinge: int, smooth: bool = False) -> None:
    t = scene.typist
    law = t.one_of("smooth_step", "table") if smooth else t.one_of("smooth_step", "smooth_step", "ramp", "sine", "table")
    begin = t.one_of(0.0, round(0.1 * t_end, 3))
    end = round(begin + t_end * t.one_of(0.2, 0.4, 0.6), 3)
    value = t.one_of(-1, 1) * t.number(0.05, 1.2)
    if law == "table":
        middle = round(0.5 * (begin + end), 3)
        scene.add("kink_program", hinge=hinge, law=law, times=[begin, middle, end], values=[0.0, round(0.7 * value, 3), value])
    elif law == "sine":
        scene.add("kink_program", hinge=hinge, law=law, t_start=begin, t_end=end, value=round(0.3 * value, 3), rate=t.number(1, 20))
    else:
        scene.add("kink_program", hinge=hinge, law=law, t_start=begin, t_end=end, value=value)


def kink_programs(t: Typist) -> list[Group]:
    kind = t.one_of("dynamic", "dynamic", "rigid", "quasistatic", "exact")
    n = t.whole(1, 6)
    scene = quasistatic_chain(t, n, kind == "exact") if kind in ("quasistatic", "exact") else Scene(t, n, kind)
    scene.add_spacecraft()
    scene.add_chain(stiffness=(50, 3000), damping=(1, 40) if kind == "exact" else t.one_of((0, 0), (0.01, 1)))
    t_end = scene.duration(20.0)
    held = -1
    if t.chance(0.3) and kind not in ("quasistatic", "exact"):
        held = t.whole(0, n - 1)
        scene.add("hinge", hinge=held, held=True)
    for hinge in range(n):
        if hinge == 0 or t.chance(0.4):
            add_kink(scene, t_end, hinge, hinge == held)
    return scene.groups(t_end)


def booms(t: Typist) -> list[Group]:
    """Hinges held for good, some of them or all: a boom cut into rods."""
    scene = Scene(t, t.whole(1, 10), shapes=t.one_of(2, 2, 3))
    scene.add_spacecraft(fixed=0.5)
    scene.add_chain(stiffness=(100, 3000), damping=t.one_of((0, 0), (0.01, 1)), length=(0.3, 1.2))
    all_held = t.chance(0.6)
    for k in range(scene.n):
        if all_held or t.chance(0.5):
            scene.add("hinge", hinge=k, held=True)
    if all_held:
        scene.chain["hinge_stiffness"] = 0.0
        scene.chain.pop("hinge_damping", None)
    t_end = scene.duration(20.0)
    add_pulses(scene, t_end)
    return scene.groups(t_end)


def long_chains(t: Typist) -> list[Group]:
    """Ten to sixty rods."""
    kind = t.one_of("dynamic", "dynamic", "rigid", "lumped", "quasistatic")
    n = t.one_of(10, 12, 16, 20, 30, 40, 60)
    if kind == "quasistatic":
        scene = quasistatic_chain(t, n, False)
    else:
        scene = Scene(t, n, "dynamic" if kind == "dynamic" else "rigid", "lumped" if kind == "lumped" else "distributed")
        scene.add_spacecraft(fixed=0.4)
    scene.add_chain(stiffness=(50, 1000), damping=t.one_of((0, 0), (0.01, 0.5)), bending_stiffness=(50, 1000), length=(0.2, 1.0))
    if t.chance(0.5):
        scene.add_motion(size=0.1)
    t_end = min(scene.duration(20.0), scene.duration(20.0))
    add_pulses(scene, t_end)
    return scene.groups(t_end)


FAMILIES = {family.__name__: family for family in (
    smooth, slews, damped_slews, deployments, sequences, onto_stops, friction, spin_ups, quasistatic, quasistatic_joints, lumped,
    three_shapes, profiles, kink_programs, booms, long_chains)}


# -------------------------------------------------------------------- texts

def groups_of(family: str, seed: int) -> list[Group]:
    """The groups of a scene, in order: what `text_of` writes."""
    return FAMILIES[family](Typist(family, seed))


def text_of(groups: Sequence[Group], **solver: Value) -> str:
    """A namelist; `solver` are keys of &solver."""
    given = [*groups, ("solver", solver)] if solver else groups
    return "".join(f"&{group} " + ", ".join(f"{key} = {in_namelist(value)}" for key, value in keys.items()) + " /\n" for group, keys in given)


def in_namelist(value: Value) -> str:
    if isinstance(value, bool):
        return ".true." if value else ".false."
    if isinstance(value, str):
        return f"'{value}'"
    if isinstance(value, list):
        same = len(value) > 1 and all(x == value[0] for x in value)
        return f"{len(value)}*{value[0]!r}" if same else ", ".join(map(in_namelist, value))
    return repr(value)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("family", nargs="?", choices=FAMILIES)
    parser.add_argument("seed", nargs="?", type=int, default=1)
    parser.add_argument("--count", type=int, default=0, help="so many scenes of the family, or of every family, from the seed on")
    parser.add_argument("--to", type=pathlib.Path, default=pathlib.Path(), help="directory of the namelists")
    arguments = parser.parse_args()
    families = [arguments.family] if arguments.family else list(FAMILIES)
    if arguments.count:
        arguments.to.mkdir(parents=True, exist_ok=True)
        for family in families:
            for seed in range(arguments.seed, arguments.seed + arguments.count):
                (arguments.to / f"{family}_{seed}.nml").write_text(f"! {family} {seed}\n" + text_of(groups_of(family, seed)))
    elif arguments.family:
        print(f"! {arguments.family} {arguments.seed}\n" + text_of(groups_of(arguments.family, arguments.seed)), end="")
    else:
        print("\n".join(f"{name:20s} {(make.__doc__ or '').strip()}" for name, make in FAMILIES.items()))


if __name__ == "__main__":
    main()
