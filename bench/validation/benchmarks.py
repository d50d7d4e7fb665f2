"""The benchmarks of docs/validation.md: which case file, with which numbers in it, and what is held against which reference.

A case file is a template: fields in braces are numbers, or groups made here for a chain cut into n rods. Its first comment is its
text in the document.
"""

from __future__ import annotations

import dataclasses
import functools
import pathlib
import subprocess
import sys
from collections.abc import Callable, Sequence
from typing import Any

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]
import h5py  # noqa: E402
import numpy as np  # noqa: E402
import references  # noqa: E402
from support import RODYN  # noqa: E402

#: What elastic rods may be, side by side: the keys of &model. A program that does not know one leaves it out.
MODELS = {"consistent": "formulation = 'consistent'", "inextensible": "formulation = 'inextensible'"}
RIGID = ""  # the model of a case without elastic rods, which has a group &model of its own

Data = dict[str, Any]


class Program:
    """The program under test; cases and results stay in a directory."""

    def __init__(self, directory: pathlib.Path):
        self.directory = directory
        directory.mkdir(parents=True, exist_ok=True)

    @functools.cached_property
    def models(self) -> list[str]:
        """Those of MODELS that it knows."""
        words = subprocess.run([RODYN, "defaults", "run"], capture_output=True, text=True, check=True).stdout
        return [name for name in MODELS if f"'{name}'" in words]

    def modes(self, case: str, *options: str) -> Data:
        return self._compute([RODYN, "modes"], case, [*options, "--output"], "--force", "--quiet")

    def run(self, case: str) -> Data:
        return self._compute([RODYN, "run"], case, ["--output"], "--force", "--quiet")

    def _compute(self, command: list[str], case: str, before: list[str], *after: str) -> Data:
        source, result = self.directory / "case.nml", self.directory / "result.h5"
        source.write_text(case)
        done = subprocess.run([*command, str(source), *before, str(result), *after], capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)}: {done.stdout}{done.stderr}\n{case}")
        with h5py.File(result) as file:
            return {name: data[()] for name, data in file.items() if isinstance(data, h5py.Dataset)}


@dataclasses.dataclass(frozen=True)
class Scene:
    """A template filled in, for n rods and one of MODELS."""

    name: str
    n: int
    model: str
    numbers: dict[str, Any]

    def text(self, **more: Any) -> str:
        fields = {"n": self.n, "length": repr(self.numbers.get("total", 1.0) / self.n), "model": MODELS.get(self.model, ""),
                  "clamped": held(range(self.n))}
        own = {name: value(self.n) if callable(value) else value for name, value in self.numbers.items()}
        return (HERE / f"{self.name}.nml").read_text().format(**fields | own | more)

    def nodes(self, phi: np.ndarray, alpha: np.ndarray, beta: np.ndarray, length: float) -> np.ndarray:
        """Places of nodes 1..n from hinge 0 as complex numbers, over the last axis. Where the arc is kept, the chord is shorter."""
        shortening = (2.0 * alpha**2 - alpha * beta + 2.0 * beta**2) / 30.0 if self.model == "inextensible" else 0.0
        return np.cumsum(length * (1.0 - shortening) * np.exp(1j * phi), axis=-1)


@dataclasses.dataclass(frozen=True)
class Quantity:
    name: str
    reference: float
    unit: str = ""
    scale: float | None = None  # errors are parts of it; by default of the reference
    floor: float = 0.0  # what the digits of the reference leave open


@dataclasses.dataclass(frozen=True)
class Benchmark:
    """Quantities that one family of scenes gives."""

    case: str
    quantities: list[Quantity]
    measure: Callable[[Program, Scene], Sequence[float]]
    numbers: dict[str, Any] = dataclasses.field(default_factory=dict)
    rods: tuple[int, ...] = (1, 2, 4, 8, 16, 32)
    elastic: bool = True
    exact: bool = False  # the reference is a solution of the scene itself: only rounding and tolerances are between them
    order: float = 2.0  # in 1/n, of rods that keep their chord; 4 of those that keep their arc


def held(hinges: Sequence[int]) -> str:
    return "\n".join(f"&hinge hinge = {k}, held = .true. /" for k in hinges)


def listed(values: Sequence[float]) -> str:
    return ", ".join(repr(float(value)) for value in values)


def oscillations(modes: Data) -> np.ndarray:
    """Frequencies in rising order."""
    return modes["frequency"][modes["kind"] == b"oscillation"]


def first(program: Program, scene: Scene) -> list[float]:
    """The lowest frequency at the initial state; none that is stable: NaN."""
    modes = program.modes(scene.text())
    return [oscillations(modes)[0] if not (modes["kind"] == b"relaxation").any() else np.nan]


def lowest(count: int, *options: str) -> Callable[[Program, Scene], Sequence[float]]:
    def measure(program: Program, scene: Scene) -> Sequence[float]:
        found = oscillations(program.modes(scene.text(), *options))[:count]
        return np.pad(found, (0, count - found.size), constant_values=np.nan)

    return measure


def matrices(program: Program, scene: Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass matrix, stiffness matrix, and what a load of 1 adds to the latter."""
    none, one = (program.modes(scene.text(load=load), "--loads") for load in ("0.0", "1.0"))
    return none["mass_matrix"], none["stiffness_matrix"], one["stiffness_matrix"] - none["stiffness_matrix"]


def buckling(sign: float) -> Callable[[Program, Scene], Sequence[float]]:
    """The load is along x times `sign`."""
    def measure(program: Program, scene: Scene) -> Sequence[float]:
        _, stiffness, load = matrices(program, scene)
        own = np.abs(np.diag(stiffness)) > 0.0  # without the coordinates of a free spacecraft
        return [references.buckling(stiffness[np.ix_(own, own)], sign * load[np.ix_(own, own)])]

    return measure


def flutter(program: Program, scene: Scene) -> Sequence[float]:
    return references.flutter(*matrices(program, scene))


def equilibrium_tip(program: Program, scene: Scene, text: str) -> complex:
    modes = program.modes(text, "--equilibrium")
    phi, alpha, beta = (modes[f"state_{name}"][: scene.n] for name in ("phi", "alpha", "beta"))
    return scene.nodes(phi, alpha, beta, 1.0 / scene.n)[-1]


def elastica(program: Program, scene: Scene) -> Sequence[float]:
    tip = equilibrium_tip(program, scene, scene.text())
    return tip.imag, 1.0 - tip.real


def buckled(program: Program, scene: Scene) -> Sequence[float]:
    angle = scene.numbers["angle"]
    arc = angle * (np.arange(scene.n) + 0.5) / scene.n
    half = 0.5 * angle / scene.n
    tip = equilibrium_tip(program, scene, scene.text(angles=listed(arc), inner=-half, outer=half))
    return tip.real, tip.imag


def roll_up(program: Program, scene: Scene) -> Sequence[float]:
    turns = [*(2.0 * np.pi * (np.arange(scene.n) + 0.5) / scene.n), 2.0 * np.pi]
    half = np.array([np.pi / scene.n] * scene.n + [0.0])
    text = scene.text(more=scene.n + 1, angles=listed(turns), inner=listed(-half), outer=listed(half), clamped=held(range(scene.n + 1)))
    return [abs(equilibrium_tip(program, scene, text))]


def spin_up(program: Program, scene: Scene) -> Sequence[float]:
    """Least deflection of the tip, by a parabola through three rows; at 10 s; amplitude of what goes on after 15 s."""
    run = program.run(scene.text())
    t = run["time"]
    y = scene.nodes(run["phi"], run["alpha"], run["beta"], 10.0 / scene.n)[:, -1].imag
    i = int(np.argmin(y))
    curve = np.polynomial.Polynomial.fit(t[i - 1:i + 2] - t[i], y[i - 1:i + 2], 2)
    at = curve.deriv().roots()[0]
    later = y[t >= 15.0]
    return curve(at), y[np.argmin(np.abs(t - 10.0))], 0.5 * (later.max() - later.min())


def flying_beam(program: Program, scene: Scene) -> Sequence[float]:
    """Where the other end is at 8 s, in fixed axes."""
    run = program.run(scene.text())
    chain = scene.nodes(*(run[name][-1] for name in ("phi", "alpha", "beta")), 10.0 / scene.n)[-1]
    end = np.exp(1j * run["rotation"][-1]) * (run["displacement_x"][-1] + 1j * run["displacement_y"][-1] + chain)
    return end.real, end.imag


def pendulum(program: Program, scene: Scene) -> Sequence[float]:
    phi = program.run(scene.text())["phi"][-1, 0]
    return np.cos(phi), np.sin(phi)


def rotation(program: Program, scene: Scene) -> Sequence[float]:
    return [program.run(scene.text())["rotation"][-1]]


def exudyn(program: Program, scene: Scene) -> Sequence[float]:
    run = program.run(scene.text())
    place = np.exp(1j * run["rotation"][-1]) * (run["displacement_x"][-1] + 1j * run["displacement_y"][-1])
    return place.real, place.imag, run["rotation"][-1], *run["phi"][-1]


def weights(each: Sequence[float]) -> str:
    return "\n".join(f"&load target = 'node', node = {k + 1}, component = 'Y', value = {-weight!r} /" for k, weight in enumerate(each))


def profiles(power: int) -> Callable[[int], str]:
    """Of n pieces of a beam with m = (1 - x)^power and EI = (1 - x)^(power + 2)."""
    def group(quantity: str, k: int, n: int, degree: int) -> str:
        coefficients = (np.polynomial.Polynomial([1.0 - k / n, -1.0 / n]) ** degree).coef
        return f"&rod_profile quantity = '{quantity}', first_rod = {k + 1}, last_rod = {k + 1}, polynomial = {listed(coefficients)} /"

    def groups(n: int) -> str:
        what = (("mass_per_length", power), ("bending_stiffness", power + 2))
        return "\n".join(group(quantity, k, n, degree) for quantity, degree in what for k in range(n))

    return groups


def bars(program: Program, scene: Scene) -> Sequence[float]:
    """Load on a discrete column over its closed form, for which the reference is 1."""
    (load,) = buckling(-1.0)(program, scene)
    return [load / (2.0 * scene.n * np.sin(0.25 * np.pi / scene.n)) ** 2]


def at_tip(mass: float) -> Callable[[int], str]:
    return lambda n: listed([0.0] * (n - 1) + [mass])


def at_root(spring: float) -> Callable[[int], str]:
    return lambda n: listed([spring] + [0.0] * (n - 1))


def driven(hinge: int, value: float, start: float) -> str:
    return f"&kink_program hinge = {hinge}, t_start = {start}, t_end = {start + 1.0}, value = {value!r} /"


def arm(masses_at: Sequence[tuple[float, float]], own: float) -> tuple[float, float, float]:
    """Mass, distance of its centre from the hinge and central moment of inertia of bodies in a row, `own` being the sum of theirs."""
    mass = sum(m for m, _ in masses_at)
    centre = sum(m * x for m, x in masses_at) / mass
    return mass, centre, own + sum(m * (x - centre) ** 2 for m, x in masses_at)


LINK = arm([(1.2, 0.6), (0.5, 1.2)], 1.2 * 1.2**2 / 12.0)  # of reorientation.nml
ONE_ARM = references.turn_by_one_arm(3.0, 0.7, 0.4, *LINK)
TWO_LINKS = references.turn_by_two_links([(3.0, 0.7), LINK[::2], LINK[::2]], 0.4, 1.2, LINK[1],
                                         [(0.0, 0.0), (1.5, 1.5), (1.5, 3.5), (0.0, 2.0)])
PINNED = {"springs": at_root(1e-8), "clamped": lambda n: held(range(1, n))}
FIXED, HUGE = "motion = 'fixed'", "mass = 1e12, inertia = 1e12"

BENCHMARKS = [
    *(Benchmark("blade", [Quantity(f"Omega = {omega}, hub radius {radius}", references.blade(omega, radius))], first,
                {"omega": omega, "radius": radius}) for omega, radius in ((2, 0), (6, 0), (12, 0), (8, 1), (4, 3))),
    Benchmark("column", [Quantity("load on the tip", np.pi**2 / 4)], buckling(-1.0),
              {"spacecraft": FIXED, "target": lambda n: f"target = 'node', node = {n}", "power": ""}),
    Benchmark("column", [Quantity("own weight", references.critical_weight())], buckling(1.0),
              {"spacecraft": HUGE, "target": "target = 'spacecraft'", "power": "e12"}),
    Benchmark("thrust", [Quantity(*pair) for pair in zip(("flutter load", "frequency"), references.flutter_thrust(), strict=True)], flutter),
    *(Benchmark("elastica", [Quantity(f"P = {load}: {name}", value, scale=1.0)
                             for name, value in zip("wu", references.elastica(load), strict=True)],
                elastica, {"load": float(load)}) for load in (1, 2, 5, 10)),
    *(Benchmark("buckled", [Quantity(f"{degrees} deg, P/P_Euler = {load:.4f}: {name}", value, scale=1.0)
                            for name, value in (("height", height), ("aside", aside))], buckled,
                {"angle": np.radians(degrees), "load": -load * np.pi**2 / 4})
      for degrees, (load, height, aside) in ((d, references.buckled(np.radians(d))) for d in (20, 60, 100, 140))),
    Benchmark("roll_up", [Quantity("distance of the end from the root", 0.0, scale=1.0)], roll_up, rods=(4, 8, 16, 32)),
    Benchmark("spin_up", [Quantity("least deflection", -0.573751, "m", 10.0, 5e-7), Quantity("deflection at 10 s", -0.362672, "m", 10.0, 5e-7),
                          Quantity("amplitude after 15 s", 0.003634, "m", 10.0, 5e-7)],
              spin_up, {"total": 10.0}, rods=(1, 2, 4, 8, 16)),
    Benchmark("flying_beam", [Quantity("x of the tip at 8 s", -5.250778, "m", 10.0, 5e-7), Quantity("y", -11.384804, "m", 10.0, 5e-7)],
              flying_beam, PINNED | {"total": 10.0}, rods=(2, 4, 8, 16)),
    *(Benchmark("boom", [Quantity(f"M0 = {mass}, J0 = {inertia}, r = {radius}", references.boom(mass, inertia, radius))], first,
                {"mass": mass, "inertia": inertia, "radius": radius}, order=4.0) for mass, inertia, radius in ((10, 2, 0.3), (1, 0.1, 0.5))),
    Benchmark("cantilever", [Quantity(f"omega_{k}", references.cantilever()[k - 1]) for k in (1, 2, 3)], lowest(3),
              {"nodes": 0.0, "springs": 0.0}, order=4.0),
    *(Benchmark("cantilever", [Quantity(f"tip mass {mass}: beta_1", np.sqrt(references.cantilever(tip_mass=mass)[0]))],
                lambda program, scene: np.sqrt(first(program, scene)), {"nodes": at_tip(mass), "springs": 0.0}, order=4.0)
      for mass in (0.2, 1.0, 10.0)),
    *(Benchmark("cantilever", [Quantity(f"root spring {spring}: omega_1", references.cantilever(root_spring=spring)[0])], first,
                {"nodes": 0.0, "springs": at_root(spring), "clamped": lambda n: held(range(1, n))}, order=4.0) for spring in (0.01, 1.0, 10.0)),
    *(Benchmark("tapered", [Quantity(f"{name}: omega_{k}", references.tapered(power)[k - 1]) for k in (1, 2, 3)], lowest(3),
                {"profiles": profiles(power)}, order=4.0) for name, power in (("wedge", 1), ("cone", 2))),
    Benchmark("hanging_chain", [Quantity(f"omega_{k}", 0.5 * zero) for k, zero in enumerate(
              (2.404825557695773, 5.520078110286311, 8.653727912911013), 1)], lowest(3, "--loads"),
              {"weights": lambda n: weights([1.0 / n] * (n - 1) + [0.5 / n])}, rods=(4, 8, 16, 32, 64), elastic=False),
    Benchmark("string", [Quantity(f"omega_{k}", value) for k, value in enumerate(np.sqrt([5.0, 14.0, 27.0]), 1)],
              lowest(3), rods=(4, 8, 16, 32, 64), elastic=False),
    Benchmark("hencky", [Quantity("load over the closed form", 1.0)], bars,
              {"springs": lambda n: listed([2.0 * n] + [1.0 * n] * (n - 1))}, rods=(1, 4, 16, 64), elastic=False, exact=True),
    Benchmark("beads", [Quantity(f"omega_{k}", references.bead_frequencies(10)[k - 1]) for k in (1, 2, 10)],
              lambda program, scene: lowest(10, "--loads")(program, scene)[[0, 1, 9]], {"weights": weights([1.0] * 10)},
              rods=(10,), elastic=False, exact=True),
    Benchmark("pendulum", [Quantity("x at 10 s", -0.2750874625761, "m", 1.0), Quantity("y", -0.9614192050991, "m", 1.0)], pendulum,
              rods=(1,), elastic=False, exact=True),
    Benchmark("reorientation", [Quantity("one arm, a full turn", ONE_ARM, "rad", 1.0)], rotation,
              {"total": 1.2, "t_end": 1, "driven": "&hinge hinge = 0, held = .true. /\n" + driven(0, 2.0 * np.pi, 0.0)},
              rods=(1,), elastic=False, exact=True),
    Benchmark("reorientation", [Quantity("two links, a rectangle", TWO_LINKS, "rad", 1.0)], rotation,
              {"total": 2.4, "t_end": 4, "driven": "\n".join([held(range(2)), driven(0, 1.5, 0.0), driven(1, 2.0, 1.0), driven(0, -1.5, 2.0),
                                                             driven(1, -2.0, 3.0)])}, rods=(2,), elastic=False, exact=True),
    Benchmark("exudyn", [Quantity(name, value, unit, 1.0, 1e-8) for name, value, unit in (
              ("x", 0.31374764, "m"), ("y", 2.26214291, "m"), ("theta", 4.2851772, "rad"), ("phi_1", -0.27395382, "rad"),
              ("phi_2", -0.52354411, "rad"), ("phi_3", -0.65566718, "rad"), ("phi_4", -0.69764288, "rad"))], exudyn,
              rods=(4,), elastic=False, exact=True),
]
