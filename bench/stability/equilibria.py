"""Random chains with freeplay, stops, kinks and latches under dead loads: `rodyn modes --equilibrium` against the potential energy.

    bench/stability/equilibria.py [SCENES [SEED]]

The potential energy of rigid rods on a fixed spacecraft is written down here once more. At what the program has found its gradient
must vanish; minimised from there, it must not become less, unless the program says that a mode grows. A scene may be refused only if
a latch lies between its start and every minimum that is found from there.
"""

from __future__ import annotations

import argparse
import pathlib
import subprocess
import sys
import tempfile

import h5py
import numpy as np
from program import RODYN


def number(value: float) -> float:
    return float(f"{value:.3g}")


class Scene:
    """Rigid rods, laws of hinges, forces on nodes that do not turn."""

    def __init__(self, random: np.random.Generator):
        self.n = n = int(random.integers(1, 7))
        self.length = number(random.uniform(0.5, 2))
        self.stiffness = [number(10 ** random.uniform(2, 3)) for _ in range(n)]
        self.kink = [number(random.uniform(-0.2, 0.2)) if random.random() < 0.3 else 0.0 for _ in range(n)]
        self.phi = np.array([number(random.uniform(-0.3, 0.3)) for _ in range(n)])
        self.force = np.zeros((n, 2))
        for _ in range(random.integers(1, 4)):
            self.force[random.integers(n), random.integers(2)] = number(random.uniform(-25, 25))
        self.hinges = {int(k): self.hinge(random) for k in random.choice(n, random.integers(1, min(n, 3) + 1), replace=False)}

    @staticmethod
    def hinge(random: np.random.Generator) -> dict[str, float]:
        law = {}
        if random.random() < 0.7:
            law["freeplay"] = number(random.uniform(0.01, 0.15))
            if random.random() < 0.4:
                law["freeplay_stiffness"] = number(random.uniform(1, 50))
        if random.random() < 0.3:
            law["rest_angle"] = number(random.uniform(-0.2, 0.2))
        if random.random() < 0.5:
            law["upper_stop"] = number(random.uniform(0.005, 0.2))
        if random.random() < 0.5:
            law["lower_stop"] = -number(random.uniform(0.005, 0.2))
        if "upper_stop" in law or "lower_stop" in law:
            law["stop_stiffness"] = number(10 ** random.uniform(3, 4.5))
        if not law or random.random() < 0.15:
            law["latch_angle"] = number(random.uniform(0.4, 0.9)) * int(random.choice([-1, 1]))
        return law

    def text(self) -> str:
        def values(x):
            return ", ".join(repr(float(v)) for v in x)

        groups = ["&case t_end = 1 /", "&spacecraft motion = 'fixed' /",
                  f"&chain n_rods = {self.n}, length = {self.length}, mass_per_length = 1.5, node_mass = 0.5, "
                  f"hinge_stiffness = {values(self.stiffness)}, hinge_damping = 0.1, kink = {values(self.kink)} /",
                  "&model bending = 'rigid' /", f"&initial phi = {values(self.phi)} /"]
        for k, force in enumerate(self.force, 1):
            groups += [f"&load target = 'node', node = {k}, component = '{c}', value = {v!r} /"
                       for c, v in zip("XY", map(float, force), strict=True) if v]
        groups += [f"&hinge hinge = {k}, " + ", ".join(f"{key} = {value!r}" for key, value in law.items()) + " /"
                   for k, law in self.hinges.items()]
        return "\n".join(groups) + "\n"

    def joint(self, k: int, theta: float) -> tuple[float, float, float]:
        """Energy of the springs of a hinge, its moment, its stiffness."""
        law, c = self.hinges.get(k, {}), self.stiffness[k]
        e, g, ci = theta - law.get("rest_angle", 0.0), law.get("freeplay", 0.0), law.get("freeplay_stiffness", 0.0)
        if abs(e) <= g:
            energy, moment, slope = ci * e * e / 2, ci * e, ci
        else:
            beyond, side = abs(e) - g, np.sign(e)
            energy, moment, slope = c * beyond ** 2 / 2 + ci * g * (beyond + g / 2), side * (c * beyond + ci * g), c
        for bound, sign in ((law.get("upper_stop"), 1), (law.get("lower_stop"), -1)):
            if bound is not None and sign * (theta - bound) > 0:
                cs = law["stop_stiffness"]
                energy, moment, slope = energy + cs * (theta - bound) ** 2 / 2, moment + cs * (theta - bound), slope + cs
        return energy, moment, slope

    def angles(self, phi: np.ndarray) -> np.ndarray:
        return np.diff(phi, prepend=0.0) - self.kink

    def potential(self, phi: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Energy, its gradient and second derivatives."""
        pull = self.length * np.cumsum(self.force[::-1], axis=0)[::-1]  # of all nodes that a rod carries
        joints = [self.joint(k, theta) for k, theta in enumerate(self.angles(phi))]
        moment = np.array([j[1] for j in joints] + [0.0])
        slope = np.array([j[2] for j in joints] + [0.0])
        energy = sum(j[0] for j in joints) - np.sum(pull[:, 0] * np.cos(phi) + pull[:, 1] * np.sin(phi))
        gradient = moment[:-1] - moment[1:] + pull[:, 0] * np.sin(phi) - pull[:, 1] * np.cos(phi)
        second = (np.diag(slope[:-1] + slope[1:] + pull[:, 0] * np.cos(phi) + pull[:, 1] * np.sin(phi))
                  - np.diag(slope[1:-1], 1) - np.diag(slope[1:-1], -1))
        return energy, gradient, second

    def minimum(self, phi: np.ndarray) -> np.ndarray:
        """Downhill by short steps, Newton's where the energy is convex, halved until it falls."""
        phi = phi.copy()
        for _ in range(5000):
            energy, gradient, second = self.potential(phi)
            values, vectors = np.linalg.eigh(second)
            step = -vectors @ ((vectors.T @ gradient) / np.maximum(np.abs(values), 1e-3 * np.abs(values).max()))
            step *= min(1.0, 0.05 / max(np.abs(step).max(), 1e-300))
            if np.abs(step).max() < 1e-13:
                break
            while np.abs(step).max() > 1e-15 and self.potential(phi + step)[0] > energy - 1e-4 * abs(step @ gradient):
                step = step / 2
            phi += step
        return phi

    def beyond_latch(self, phi: np.ndarray) -> bool:
        start, here = self.angles(self.phi), self.angles(phi)
        return any((start[k] - law["latch_angle"]) * (here[k] - law["latch_angle"]) <= 0
                   for k, law in self.hinges.items() if "latch_angle" in law)


def fault_of(scene: Scene, directory: pathlib.Path) -> str:
    """What is wrong with the program's answer; empty: nothing."""
    (directory / "case.nml").write_text(scene.text())
    command = [RODYN, "modes", "case.nml", "--equilibrium", "--output", "case_modes.h5", "--force"]
    done = subprocess.run(command, cwd=directory, capture_output=True, text=True)
    if done.returncode:
        if "latches before" in done.stderr and scene.beyond_latch(scene.minimum(scene.phi)):
            return ""
        return done.stderr.strip().splitlines()[-1]
    with h5py.File(directory / "case_modes.h5") as file:
        phi, moment, stable = file["state_phi"][:], file["state_hinge_moment"][:], bool(file.attrs["stable"])
    energy, gradient, _ = scene.potential(phi)
    scale = 1 + np.abs(scene.force).sum() * scene.length * scene.n
    if np.abs(gradient).max() > 1e-9 * scale:
        return f"forces out of balance by {np.abs(gradient).max():.2g} N m of {scale:.3g}"
    law = np.array([scene.joint(k, theta)[1] for k, theta in enumerate(scene.angles(phi))])
    if np.abs(moment - law).max() > 1e-9 * scale:
        return f"hinge moments {moment}, but {law} by their laws"
    lower = scene.potential(scene.minimum(phi + 1e-6 * np.cos(np.arange(scene.n))))[0]
    if stable and lower < energy - 1e-9 * scale:
        return f"called stable, but the energy falls by {energy - lower:.2g} J nearby"
    return ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="?", type=int, default=1000)
    parser.add_argument("seed", nargs="?", type=int, default=1)
    options = parser.parse_args()
    count, seed = options.scenes, options.seed
    faults = 0
    with tempfile.TemporaryDirectory() as directory:
        for i in range(seed, seed + count):
            fault = fault_of(Scene(np.random.default_rng(i)), pathlib.Path(directory))
            if fault:
                faults += 1
                print(f"seed {i}: {fault}")
    print(f"{count} scenes from seed {seed}: {faults} not found or wrong")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
