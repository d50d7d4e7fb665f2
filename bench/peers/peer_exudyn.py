"""Exudyn on scenes of rigid rods: as a kinematic tree (minimal coordinates, explicit integrators) and as bodies with joints.

Loads on the spacecraft follow it, as in Rodyn. Errors are those of runs to each probe time; the time is that of the last one
without what a run of one step takes (start-up).
"""

from __future__ import annotations

import functools
import sys
import time
from typing import Any

import numpy as np

sys.exudynFast = True  # the build without checks of ranges
import exudyn as exu  # noqa: E402
import exudyn.itemInterface as ei  # noqa: E402, N813
from model import LENGTH, M0, MU, Scene, read_scene  # noqa: E402

TREE = {"Exudyn tree DOPRI5": "DOPRI5", "Exudyn tree RK67": "RK67"}
ADAPTIVE = {"DOPRI5"}
JOINTS = {"Exudyn joints trapezoidal": "TrapezoidalIndex2"}


def version() -> str:
    return f"Exudyn {exu.GetVersionString()}"


def lines(scene: str) -> list[dict[str, Any]]:
    known = read_scene(scene)
    if known.kind != "rigid" or not known.free or len(known.segments) > 1 or known.n > 64:
        return []
    return [{"method": m, "fixed": s not in ADAPTIVE} for m, s in TREE.items()] + [{"method": m, "fixed": True} for m in JOINTS]


def links(scene: Scene) -> list[tuple[float, float, float]]:
    """Mass, centre of mass and inertia about it of each rod with the mass on its outer node."""
    found = []
    for row in scene.rods:
        rod, node, length = row[M0], row[MU], row[LENGTH]
        mass = rod + node
        centre = (rod * length / 2 + node * length) / mass
        found.append((mass, centre, rod * length**2 / 12 + rod * (centre - length / 2) ** 2 + node * (length - centre) ** 2))
    return found


def tree(scene: Scene) -> tuple[Any, Any]:
    system = exu.SystemContainer()
    mbs = system.AddSystem()
    n, dof = scene.n, scene.n + 3
    mass, inertia, x, y = scene.body[:4]
    rods = links(scene)
    node = mbs.AddNode(ei.NodeGenericODE2(referenceCoordinates=[0.0] * dof, initialCoordinates=[0.0] * dof,
                                          initialCoordinates_t=[0.0] * dof, numberOfODE2Coordinates=dof))
    joint = exu.JointType
    types = [joint.PrismaticX, joint.PrismaticY, joint.RevoluteZ] + [joint.RevoluteZ] * n
    offsets = [[0, 0, 0]] * 3 + [[x, y, 0]] + [[row[LENGTH], 0, 0] for row in scene.rods[:-1]]
    tensors = [np.zeros((3, 3))] * 2 + [np.diag([inertia] * 3)] + [np.diag([i] * 3) for _, _, i in rods]
    centres = [[0, 0, 0]] * 3 + [[c, 0, 0] for _, c, _ in rods]
    body = mbs.AddObject(ei.ObjectKinematicTree(
        nodeNumber=node, jointTypes=types, linkParents=list(range(-1, dof - 1)),
        jointTransformations=exu.Matrix3DList([np.eye(3)] * dof), jointOffsets=exu.Vector3DList(offsets),
        linkInertiasCOM=exu.Matrix3DList(tensors), linkCOMs=exu.Vector3DList(centres), linkMasses=[0.0, 0.0, mass] + [m for m, _, _ in rods],
        jointPositionOffsetVector=[0.0] * dof, jointVelocityOffsetVector=[0.0] * dof,
        jointPControlVector=[0.0] * 3 + list(scene.stiffness), jointDControlVector=[0.0] * 3 + list(scene.damping)))
    marker = mbs.AddMarker(ei.MarkerKinematicTreeRigid(objectNumber=body, linkNumber=2, localPosition=[0, 0, 0]))
    load(mbs, marker, scene)
    mbs.Assemble()
    return mbs, lambda: np.cumsum(mbs.GetNodeOutput(node, exu.OutputVariableType.Coordinates)[3:])


def joints(scene: Scene) -> tuple[Any, Any]:
    system = exu.SystemContainer()
    mbs = system.AddSystem()
    mass, inertia, x, y = scene.body[:4]
    node = mbs.AddNode(ei.NodeRigidBody2D(referenceCoordinates=[0, 0, 0]))
    body = mbs.AddObject(ei.ObjectRigidBody2D(physicsMass=mass, physicsInertia=inertia, nodeNumber=node))
    load(mbs, mbs.AddMarker(ei.MarkerBodyRigid(bodyNumber=body, localPosition=[0, 0, 0])), scene)
    nodes, outer, at = [node], [x, y, 0], np.array([x, y])
    angle = mbs.AddMarker(ei.MarkerNodeCoordinate(nodeNumber=node, coordinate=2))
    for k, (m, centre, i) in enumerate(links(scene)):
        length = scene.rods[k, LENGTH]
        node = mbs.AddNode(ei.NodeRigidBody2D(referenceCoordinates=[at[0] + centre, at[1], 0]))
        new = mbs.AddObject(ei.ObjectRigidBody2D(physicsMass=m, physicsInertia=i, nodeNumber=node))
        ends = [mbs.AddMarker(ei.MarkerBodyRigid(bodyNumber=body, localPosition=outer)),
                mbs.AddMarker(ei.MarkerBodyRigid(bodyNumber=new, localPosition=[-centre, 0, 0]))]
        mbs.AddObject(ei.ObjectJointRevolute2D(markerNumbers=ends))
        new_angle = mbs.AddMarker(ei.MarkerNodeCoordinate(nodeNumber=node, coordinate=2))
        mbs.AddObject(ei.ObjectConnectorCoordinateSpringDamper(markerNumbers=[angle, new_angle], stiffness=scene.stiffness[k],
                                                               damping=scene.damping[k]))
        body, angle, outer, at = new, new_angle, [length - centre, 0, 0], at + np.array([length, 0])
        nodes.append(node)
    mbs.Assemble()

    def phi() -> np.ndarray:
        angles = [mbs.GetNodeOutput(n, exu.OutputVariableType.Coordinates)[2] for n in nodes]
        return np.array(angles[1:]) - angles[0]

    return mbs, phi


def load(mbs: Any, marker: Any, scene: Scene) -> None:
    force = scene.segments[0].base
    mbs.AddLoad(ei.LoadForceVector(markerNumber=marker, loadVector=[force[0], force[1], 0], bodyFixed=True))
    mbs.AddLoad(ei.LoadTorqueVector(markerNumber=marker, loadVector=[0, 0, force[2]]))


@functools.lru_cache(maxsize=16)
def made(path: str, kind: str) -> tuple[Any, Any]:
    return (tree if kind == "tree" else joints)(read_scene(path))


def prepare(job: dict[str, Any]):
    method = job["method"]
    mbs, phi = made(job["scene"], "tree" if method in TREE else "joints")
    solver = (TREE | JOINTS)[method]

    def integrate(t_end: float, steps: int, adaptive: bool) -> float:
        settings = exu.SimulationSettings()
        settings.timeIntegration.endTime = t_end
        settings.timeIntegration.numberOfSteps = steps
        settings.timeIntegration.verboseMode = 0
        settings.solutionSettings.writeSolutionToFile = False
        settings.solutionSettings.sensorsWritePeriod = 1e9
        settings.timeIntegration.automaticStepSize = adaptive
        settings.timeIntegration.relativeTolerance = job["rtol"]
        settings.timeIntegration.absoluteTolerance = job["atol"]
        settings.timeIntegration.minimumStepSize = 1e-12
        settings.timeIntegration.explicitIntegration.computeMassMatrixInversePerBody = True  # 3 % faster
        settings.timeIntegration.newton.useModifiedNewton = True
        settings.linearSolverType = exu.LinearSolverType.EXUdense
        start = time.perf_counter()
        mbs.SolveDynamic(settings, solverType=getattr(exu.DynamicSolverType, solver))
        return time.perf_counter() - start

    def steps_to(t: float) -> int:
        return 1 if solver in ADAPTIVE else max(1, round(t / job["fixed_step"]))

    angles: list[list[float]] = []

    def run():
        t_end = job["probe_times"][-1]
        if not angles:
            for t in job["probe_times"]:
                integrate(t, steps_to(t), solver in ADAPTIVE)
                angles.append(phi().tolist())
        start_up = integrate(1e-6 * t_end, 1, False)
        seconds = integrate(t_end, steps_to(t_end), solver in ADAPTIVE) - start_up
        return seconds, {"phi": angles, "alpha_rate": [[]] * len(angles)}

    return run
