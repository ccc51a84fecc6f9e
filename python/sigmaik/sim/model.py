"""The MuJoCo model of a chain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sigmaik import _core
from sigmaik._types import Array

__all__ = ["ArmSpec", "add_body", "arm_spec", "build", "compiled", "draw_arm", "quaternion"]


@dataclass
class ArmSpec:
    """A mujoco.MjSpec of an arm, to which bodies can be added before it is compiled."""

    spec: Any
    bodies: list[Any]  #: one for each movable joint, from the base on
    tip: Array  #: (4, 4) the chain's tip in the last body
    inertias: list[list[tuple[_core.Inertia, Array]]]  #: of the bodies, each with its frame in the body


def build(
    chain: _core.Chain,
    gain: Array | None,
    effort: Array,
    stops: bool,
    joints: dict[str, Array],
    payload: _core.Inertia | None,
    gravity: ArrayLike,
    timestep: float,
) -> Any:
    """A mujoco.MjModel of an arm in free space, with a body for the payload; arguments as for `arm_spec`."""
    import mujoco  # type: ignore[import-untyped]

    arm = arm_spec(chain, gain, effort, stops, joints, gravity, timestep)
    arm.spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    if payload is not None and payload.mass > 0.0:
        add_body(arm.bodies[-1], "payload", arm.tip)
        arm.inertias.append([(payload, np.eye(4))])
    return compiled(arm)


def arm_spec(
    chain: _core.Chain,
    gain: Array | None,
    effort: Array,
    stops: bool,
    joints: dict[str, Array],
    gravity: ArrayLike,
    timestep: float,
) -> ArmSpec:
    """A body for each movable joint with all links that move with the joint, and a site "tip".

    gain: (n,) K_v of the velocity loops [N·m·s/rad]; None: the drives are torque motors
    effort: (n,) limits of the drives [N·m or N]
    stops: whether the position limits are stops
    joints: viscous_friction, coulomb_friction and armature, (n,) each
    gravity: (3,) [m/s²] in base axes
    timestep: [s]
    """
    import mujoco

    if any(segment.mimic is not None for segment in chain.segments):
        raise _core.Error(
            "the arm has joints that mimic others; the simulation supports joints that move by themselves"
        )
    spec = mujoco.MjSpec()
    spec.option.gravity = np.asarray(gravity, dtype=np.float64)
    spec.option.timestep = timestep
    # The integrator is implicit in the friction, and in the velocity loops while their torque is below the limit.
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET

    body, place, joint = spec.worldbody, np.eye(4), 0
    bodies: list[Any] = []
    inertias: list[list[tuple[_core.Inertia, Array]]] = []
    limits = chain.limits
    for segment in chain.segments:
        place = place @ segment.origin
        if segment.type != "fixed":
            body = add_body(body, segment.link_name, place)
            span = (limits.lower[joint], limits.upper[joint]) if stops else (-math.inf, math.inf)
            _add_joint(body, segment, span, {name: values[joint] for name, values in joints.items()})
            _add_drive(spec, segment.joint_name, None if gain is None else gain[joint], effort[joint])
            bodies.append(body)
            inertias.append([])
            place, joint = np.eye(4), joint + 1
        if inertias and segment.inertia is not None:
            inertias[-1].append((segment.inertia, place))
    body.add_site(name="tip", pos=place[:3, 3], quat=quaternion(place[:3, :3]))
    return ArmSpec(spec, bodies, place, inertias)


def compiled(arm: ArmSpec) -> Any:
    """The mujoco.MjModel, whose first bodies have the inertias of `arm`; other bodies keep those of the spec.

    MuJoCo's solver accepts inertias that no rigid body can have, such as the published ones of the PUMA, but MuJoCo's
    compiler refuses them. The bodies are therefore compiled with other inertias, which are replaced here.
    """
    import mujoco

    model = arm.spec.compile()
    for number, parts in enumerate(arm.inertias, start=1):
        mass, centre, tensor = _together(parts)
        moments, axes = np.linalg.eigh(tensor)
        axes[:, 2] *= np.linalg.det(axes)
        model.body_mass[number] = mass
        model.body_ipos[number] = centre
        model.body_iquat[number] = quaternion(axes)
        model.body_inertia[number] = moments
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _add_joint(body: Any, segment: _core.Segment, span: tuple[float, float], friction: dict[str, float]) -> None:
    import mujoco

    kind = mujoco.mjtJoint.mjJNT_SLIDE if segment.type == "prismatic" else mujoco.mjtJoint.mjJNT_HINGE
    options: dict[str, Any] = {}
    lower, upper = span
    if math.isfinite(lower) or math.isfinite(upper):
        # A range needs two ends; the end that does not exist is far away.
        options = {"limited": True, "range": [max(lower, -1e6), min(upper, 1e6)]}
    body.add_joint(
        name=segment.joint_name,
        type=kind,
        axis=segment.axis,
        damping=friction["viscous_friction"],
        frictionloss=friction["coulomb_friction"],
        armature=friction["armature"],
        **options,
    )


def _add_drive(spec: Any, joint: str, gain: float | None, effort: float) -> None:
    """A motor; with a gain K_v, a velocity loop: torque K_v (command − q̇). `effort` limits the torque."""
    import mujoco

    actuator = spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    if gain is not None:
        actuator.gainprm[0] = gain
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        actuator.biasprm[2] = -gain
    if math.isfinite(effort):
        actuator.forcelimited = True
        actuator.forcerange = [-effort, effort]


def add_body(parent: Any, name: str, place: Array) -> Any:
    """A body at a place (4, 4) in its parent, with an inertia that `compiled` replaces."""
    # The inertia has a frame of its own and no principal axes. With simpler values MuJoCo would take short cuts that
    # are wrong for the true inertia, which is set later.
    return parent.add_body(
        name=name,
        pos=place[:3, 3],
        quat=quaternion(place[:3, :3]),
        mass=1.0,
        ipos=[0.1, 0.2, 0.3],
        fullinertia=[1.0, 1.1, 1.2, 0.1, 0.1, 0.1],
        explicitinertial=True,
    )


def draw_arm(bodies: list[Any], world: Any, radius: float, colour: tuple[float, ...]) -> None:
    """Capsules from joint to joint, for pictures: they touch nothing and have no mass."""
    import mujoco

    for parent, body in zip([world, *bodies[:-1]], bodies, strict=True):
        if np.linalg.norm(body.pos) > 1e-3:
            parent.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=[0.0, 0.0, 0.0, *body.pos],
                size=[radius, 0.0, 0.0],
                rgba=[*colour, 1.0],
                contype=0,
                conaffinity=0,
                mass=0.0,
            )


def quaternion(rotation: Array) -> Array:
    """The quaternion wxyz of a rotation, in the order of MuJoCo."""
    import mujoco

    wxyz = np.empty(4)
    mujoco.mju_mat2Quat(wxyz, np.ascontiguousarray(rotation).reshape(9))
    return wxyz


def _together(parts: Sequence[tuple[_core.Inertia, Array]]) -> tuple[float, Array, Array]:
    """Mass, centre, and tensor about the centre, of several inertias, each with its frame (4, 4) in a common frame.
    Steiner's theorem adds m (r·r I − r rᵀ)."""
    mass = sum(inertia.mass for inertia, _ in parts)
    centres = [frame[:3, :3] @ inertia.center_of_mass + frame[:3, 3] for inertia, frame in parts]
    centre = np.zeros(3)
    if mass > 0.0:
        centre = sum((i.mass * c for (i, _), c in zip(parts, centres, strict=True)), np.zeros(3)) / mass
    tensor = np.zeros((3, 3))
    for (inertia, frame), c in zip(parts, centres, strict=True):
        r = c - centre
        tensor += frame[:3, :3] @ inertia.tensor @ frame[:3, :3].T
        tensor += inertia.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return mass, centre, tensor
