"""The MuJoCo model of the task: arm, gripper, cup and shelves, for contacts and for pictures. Needs mujoco."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sigmaik._types import Array
from sigmaik.sim.model import arm_spec, compiled, draw_arm, quaternion
from sigmaik.sim.simulation import largest_inertias

from .scene import CUP, GRIPPER, Task

__all__ = ["BANDWIDTH", "TIMESTEP", "SceneModel", "scene_model"]

#: [s] of physics.
TIMESTEP = 1e-3
#: [1/s] of the velocity loops, as in `sk.sim.Simulation`.
BANDWIDTH = 100.0
_GRAVITY = (0.0, 0.0, -9.80665)
#: [N] of a finger's drive, [N/m] its stiffness, [kg] a finger's mass.
_GRIP, _STIFF, _FINGER = 20.0, 3000.0, 0.05
#: [m] half the sizes of a fingertip along x, y and z of the tool.
_TIP = (0.012, 0.005, 0.022)
#: [m] half the side of a shelf.
_SHELF = 0.12
_GREY, _DARK, _RED, _WOOD, _GREEN = (
    (0.82, 0.83, 0.85, 1.0),
    (0.25, 0.26, 0.28, 1.0),
    (0.80, 0.12, 0.10, 1.0),
    (0.72, 0.60, 0.45, 1.0),
    (0.20, 0.60, 0.30, 1.0),
)


@dataclass(frozen=True)
class SceneModel:
    """A compiled model, and where its parts are."""

    model: Any  #: mujoco.MjModel
    arm: slice  #: of qpos, qvel and ctrl
    fingers: slice  #: of qpos, qvel and ctrl: the way of each finger from the middle [m]
    cup: int  #: first entry of the cup in qpos: position (3) and quaternion wxyz (4)
    cup_dof: int  #: first entry of the cup in qvel
    gain: Array  #: (n,) K_v of the drives [N·m·s/rad]
    goal: int  #: number of the mocap body that marks the goal


def scene_model(task: Task, contacts: bool) -> SceneModel:
    """The task's model. contacts: whether arm and gripper have masses and drives, and things touch each other; Error
    then where links of the arm have no inertias."""
    import mujoco  # type: ignore[import-untyped]

    chain = task.chain
    n = chain.dof
    gain = BANDWIDTH * largest_inertias(chain, _GRAVITY) if contacts else np.ones(n)
    none = np.zeros(n)
    joints = {"viscous_friction": none, "coulomb_friction": none, "armature": none}
    arm = arm_spec(chain, gain, np.array(chain.limits.effort), False, joints, _GRAVITY, TIMESTEP)
    spec = arm.spec
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0  # friction holds without creep
    for body in arm.bodies:
        body.gravcomp = 1.0  # drives hold their own arm
    draw_arm(arm.bodies, spec.worldbody, 0.045 * task.reach / 0.9, _GREY[:3])
    _add_gripper(spec, arm.bodies[-1], arm.tip)
    _add_table(task, spec.worldbody)
    _add_cup(spec.worldbody)
    goal = spec.worldbody.add_body(name="goal", mocap=True)
    goal.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[CUP.radius, 0.001, 0.0],
        rgba=_GREEN,
        contype=0,
        conaffinity=0,
    )
    _add_view(task, spec)
    if not contacts:
        arm.inertias.clear()
    model = compiled(arm)
    place = int(model.jnt_qposadr[model.body("cup").jntadr[0]])
    return SceneModel(
        model,
        slice(0, n),
        slice(n, n + 2),
        place,
        int(model.jnt_dofadr[model.body("cup").jntadr[0]]),
        gain,
        int(model.body("goal").mocapid[0]),
    )


def _add_gripper(spec: Any, flange: Any, tip: Array) -> None:
    """A palm, and two fingers that slide along y of the tool."""
    import mujoco

    to_flange = tip[:3, 3] - GRIPPER.length * tip[:3, 2]
    flange.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[*to_flange, *(tip[:3, 3] - 0.06 * tip[:3, 2])],
        size=[0.03, 0.0, 0.0],
        rgba=_DARK,
        contype=0,
        conaffinity=0,
        mass=0.0,
    )
    flange.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=tip[:3, 3] - 0.05 * tip[:3, 2],
        quat=quaternion(tip[:3, :3]),
        size=[_TIP[0], 0.5 * GRIPPER.stroke + 2.0 * _TIP[1], 0.008],
        rgba=_DARK,
        contype=0,
        conaffinity=0,
        mass=0.0,
    )
    for side, name in ((1.0, "left"), (-1.0, "right")):
        finger = flange.add_body(
            name=name,
            pos=tip[:3, 3],
            quat=quaternion(tip[:3, :3]),
            mass=_FINGER,
            inertia=[2e-5] * 3,
            explicitinertial=True,
        )
        finger.gravcomp = 1.0
        finger.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=[0.0, side, 0.0],
            damping=10.0,
            limited=True,
            range=[0.0, 0.5 * GRIPPER.stroke],
        )
        finger.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[0.0, side * _TIP[1], 0.0],
            size=_TIP,
            rgba=_DARK,
            solref=[2.5 * TIMESTEP, 1.0],
            solimp=[0.95, 0.99, 0.0005, 0.5, 2.0],
            friction=[1.5, 0.02, 0.001],
            condim=4,
            mass=0.0,
        )
        drive = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.gainprm[0] = _STIFF
        drive.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        drive.biasprm[1] = -_STIFF
        drive.forcelimited = True
        drive.forcerange = [-_GRIP, _GRIP]


def _add_table(task: Task, world: Any) -> None:
    import mujoco

    world.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5.0, 5.0, 0.1], rgba=[0.55, 0.6, 0.65, 1.0])
    for name, centre in (("pick", task.cup), ("place", task.goal)):
        height = float(task.support(centre))
        world.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[centre[0], centre[1], 0.5 * height],
            size=[_SHELF, _SHELF, 0.5 * height],
            rgba=_WOOD,
        )


def _add_cup(world: Any) -> None:
    import mujoco

    cup = world.add_body(name="cup")
    cup.add_freejoint()
    cup.add_geom(
        name="cup",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[CUP.radius, 0.5 * CUP.height, 0.0],
        mass=CUP.mass,
        rgba=_RED,
        solref=[2.5 * TIMESTEP, 1.0],
        solimp=[0.95, 0.99, 0.0005, 0.5, 2.0],
        friction=[1.0, 0.02, 0.001],
        condim=4,
    )


def _add_view(task: Task, spec: Any) -> None:
    """A light, and a camera that sees both discs and the arm."""
    look = (task.cup + task.goal + np.array([0.2, 0.0, 0.4]) * task.reach) / 3.0
    eye = look + task.reach * np.array([0.4, -1.5, 0.8])
    back = (eye - look) / np.linalg.norm(eye - look)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    spec.worldbody.add_camera(
        name="view", pos=eye, quat=quaternion(np.stack([right, np.cross(back, right), back], axis=1))
    )
    spec.worldbody.add_light(pos=[0.0, -1.0, 3.0], dir=[0.0, 0.3, -1.0])
    spec.visual.headlight.ambient = [0.4, 0.4, 0.4]
