"""Arms in physics: a MuJoCo model made from a chain's own joints and inertias. Needs the extra "sim".

    simulation = sk.sim.Simulation(arm, actuation="velocity", payload=sk.Inertia(1.0), delay=2, seed=1)
    measured = simulation.reset(q)
    while running:
        measured = simulation.step(qdot_command)        # for one control period: measured.q, measured.qdot, measured.t

    simulation = sk.sim.Simulation(arm, actuation="torque")
    done = sk.sim.execute(simulation, plan, sk.ComputedTorque(arm))
    done.max_error, done.max_effort, done.saturated

The model has no meshes and no contacts: the arm moves in free space.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from ._extras import need
from ._types import Array

if TYPE_CHECKING:
    from .planning import Trajectory

__all__ = ["Execution", "Measurement", "Simulation", "execute"]

_GRAVITY = (0.0, 0.0, -9.80665)


@dataclass(frozen=True)
class Measurement:
    """What the arm's sensors say."""

    t: float  #: [s] when it was measured: `delay` control periods ago, but not before the start
    q: Array  #: (n,) [rad or m]
    qdot: Array  #: (n,) [rad/s or m/s]


class Simulation:
    """A chain in MuJoCo, driven at its joints, one control period a `step`. The same seed gives the same motion."""

    def __init__(
        self,
        chain: _core.Chain,
        *,
        actuation: Literal["velocity", "torque"] = "velocity",
        timestep: float = 5e-4,
        control_period: float = 1e-3,
        bandwidth: float = 100.0,
        integral_rate: float = 10.0,
        gravity_compensation: bool = True,
        velocity_limits: bool = True,
        effort_limits: bool = True,
        position_stops: bool = False,
        viscous_friction: ArrayLike = 0.0,
        coulomb_friction: ArrayLike = 0.0,
        armature: ArrayLike = 0.0,
        payload: _core.Inertia | None = None,
        gravity: ArrayLike = _GRAVITY,
        position_noise: float = 0.0,
        velocity_noise: float = 0.0,
        delay: int = 0,
        seed: int = 0,
    ) -> None:
        """
        chain: an arm all of whose moving links have inertias (see Dynamics)
        actuation: what `step` takes. "velocity": each joint has a velocity loop of its own, closed in every physics
        step,
            τ = K_v (e + ω_i ∫ e dt) + g(q), e = q̇_command − q̇, cut at the effort limit; "torque": τ itself, held over
            the control period, cut
        timestep: [s] of physics; it divides control_period
        control_period: [s] from one command to the next
        bandwidth: ω_v [1/s] of the velocity loops: K_v = ω_v · max M_ii, the most over 256 configurations. As M ≤ n
        diag(M),
            no motion's error decays more slowly than with ω_v/n. K_v q̇ is integrated implicitly: any ω_v is stable
        integral_rate: ω_i [1/s]; 0: no integral. It stands still while its joint's torque is cut
        gravity_compensation: g(q), of the arm alone: the drives do not know the payload. Of "velocity" only
        velocity_limits: velocity commands are cut at the chain's limits, as drives do. Of "velocity" only
        effort_limits: torques are cut at the chain's limits; False: drives of any strength
        position_stops: the chain's position limits are stops, as stiff as MuJoCo's default; False: joints pass them
        viscous_friction: [N·m·s/rad], (n,) or one number; torque −b q̇
        coulomb_friction: [N·m], (n,) or one number; dry friction of at most this
        armature: [kg·m²], (n,) or one number: rotors' inertia, seen at the joint
        payload: what the tip carries
        gravity: (3,) [m/s²], in base axes
        position_noise, velocity_noise: standard deviations [rad or m, rad/s or m/s] of what is measured
        delay: control periods by which measurements are late
        seed: of the noise

        Error where a value is out of its range, where timestep does not divide control_period, or where Dynamics
        refuses; MissingPackage where MuJoCo is not installed.
        """
        need("mujoco")
        if actuation not in ("velocity", "torque"):
            raise _core.Error(f"actuation = {actuation!r} must be 'velocity' or 'torque'")
        for name, value in (("timestep", timestep), ("control_period", control_period), ("bandwidth", bandwidth)):
            if not 0.0 < value < math.inf:
                raise _core.Error(f"{name} = {value} must be finite and greater than 0")
        for name, value in (
            ("integral_rate", integral_rate),
            ("position_noise", position_noise),
            ("velocity_noise", velocity_noise),
            ("delay", delay),
        ):
            if not 0.0 <= value < math.inf:
                raise _core.Error(f"{name} = {value} must be finite and not negative")
        if delay != int(delay):
            raise _core.Error(f"delay = {delay} must be a whole number of control periods")
        self._substeps = round(control_period / timestep)
        if self._substeps < 1 or abs(self._substeps * timestep - control_period) > 1e-9 * control_period:
            raise _core.Error(f"timestep = {timestep} does not divide control_period = {control_period}")

        self.chain = chain
        self.actuation = actuation
        self.control_period = control_period
        self.timestep = timestep
        n = chain.dof
        joints = {
            "viscous_friction": _per_joint(viscous_friction, "viscous_friction", n),
            "coulomb_friction": _per_joint(coulomb_friction, "coulomb_friction", n),
            "armature": _per_joint(armature, "armature", n),
        }
        # Refuses arms and payloads without dynamics. Gravity alone is what the drives compensate.
        _core.Dynamics(chain, gravity, payload)
        self._compensation = (
            _core.Dynamics(chain, gravity) if gravity_compensation and actuation == "velocity" else None
        )
        effort = np.array(chain.limits.effort)
        self._effort = effort if effort_limits else np.full(n, math.inf)
        self._cut = (1.0 - 1e-9) * self._effort  # a torque that was scaled down to its limit counts
        speed = np.array(chain.limits.velocity)
        self._speed = speed if velocity_limits else np.full(n, math.inf)
        gain = None
        if actuation == "velocity":
            samples = np.random.default_rng(0)
            loaded = _core.Dynamics(chain, gravity)
            most = np.max(
                [np.diag(loaded.mass_matrix(chain.random_configuration(samples))) for _ in range(256)], axis=0
            )
            gain = bandwidth * (most + joints["armature"])
        self._gain, self._integral_rate = gain, integral_rate
        self.model = _model(chain, gain, self._effort, position_stops, joints, payload, gravity, timestep)

        import mujoco  # type: ignore[import-untyped]

        self._step = mujoco.mj_step
        self._forward = mujoco.mj_forward
        self.data = mujoco.MjData(self.model)
        self._position_noise, self._velocity_noise = position_noise, velocity_noise
        self._seed = seed
        self._late: deque[Measurement] = deque(maxlen=int(delay) + 1)
        self.reset(np.zeros(n))

    def reset(self, q: ArrayLike, qdot: ArrayLike | None = None) -> Measurement:
        """Starts, or starts again, at q (n,) and q̇ (n,), at rest where none is given; time and noise begin anew."""
        self.data.time = 0.0
        self.data.qpos[:] = self._sized(q, "q")
        self.data.qvel[:] = 0.0 if qdot is None else self._sized(qdot, "qdot")
        self.data.qacc_warmstart[:] = 0.0
        self.data.ctrl[:] = 0.0
        self._forward(self.model, self.data)
        self._periods = 0
        self._noise = np.random.default_rng(self._seed)
        self._saturated = np.zeros(self.chain.dof, dtype=np.int64)
        self._peak = np.zeros(self.chain.dof)
        self._integral = np.zeros(self.chain.dof)
        self._late.clear()
        return self._measure()

    def step(self, command: ArrayLike) -> Measurement:
        """Drives the joints by a command (n,) [rad/s, or N·m] for one control period; then measures.

        Error where the command has a wrong size or is not finite, and where the motion is no longer finite. Of the
        latter MuJoCo itself warns on stderr and in a file MUJOCO_LOG.TXT.
        """
        asked = self._sized(command, "the command")
        data = self.data
        if self._gain is not None:
            asked = np.clip(asked, -self._speed, self._speed)
        self._saturated[:] = 0
        self._peak[:] = 0.0
        for _ in range(self._substeps):
            data.ctrl[:] = asked
            if self._gain is not None:
                # The actuator's force is K_v (ctrl − q̇), cut at the effort limit.
                data.ctrl += self._integral_rate * self._integral
                if self._compensation is not None:
                    data.ctrl += self._compensation.gravity(data.qpos) / self._gain
                error = asked - data.qvel
            self._step(self.model, data)
            torque = np.abs(data.actuator_force)
            cut = torque >= self._cut
            if self._gain is not None:
                self._integral += np.where(cut, 0.0, self.timestep * error)
            self._saturated += cut
            np.maximum(self._peak, torque, out=self._peak)
            if not np.isfinite(data.qvel).all():
                raise _core.Error(f"the motion is no longer finite {data.time:g} s after the start")
        self._periods += 1
        return self._measure()

    @property
    def t(self) -> float:
        """[s] since `reset`."""
        return self._periods * self.control_period

    @property
    def q(self) -> Array:
        """(n,) where the arm truly is [rad or m]."""
        return np.array(self.data.qpos)

    @property
    def qdot(self) -> Array:
        """(n,) how it truly moves [rad/s or m/s]."""
        return np.array(self.data.qvel)

    @property
    def peak_torque(self) -> Array:
        """(n,) the largest |τ| of the drives in the last control period [N·m or N]."""
        return self._peak.copy()

    @property
    def saturated(self) -> Array:
        """(n,) the part of the last control period's physics steps in which a drive was at its effort limit."""
        share: Array = self._saturated / self._substeps
        return share

    def _measure(self) -> Measurement:
        n = self.chain.dof
        # Drawn even where there is no noise, so that its amount does not change the rest.
        dq, dqdot = self._noise.standard_normal((2, n))
        measured = Measurement(self.t, self.q + self._position_noise * dq, self.qdot + self._velocity_noise * dqdot)
        self._late.append(measured)
        return self._late[0]

    def _sized(self, values: ArrayLike, name: str) -> Array:
        array = np.asarray(values, dtype=np.float64)
        if array.shape != (self.chain.dof,):
            raise _core.Error(f"{name} has shape {array.shape}, needs ({self.chain.dof},)")
        if not np.isfinite(array).all():
            raise _core.Error(f"{name} has an entry that is not finite: {array.tolist()}")
        return array


def _per_joint(values: ArrayLike, name: str, n: int) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (n,)):
        raise _core.Error(f"{name} has shape {array.shape}, needs ({n},) or one number")
    if not (np.isfinite(array).all() and (array >= 0.0).all()):
        raise _core.Error(f"{name} = {array.tolist()} must be finite and not negative")
    return np.broadcast_to(array, (n,)).copy()


# --- the model


def _model(
    chain: _core.Chain,
    gain: Array | None,
    effort: Array,
    stops: bool,
    joints: dict[str, Array],
    payload: _core.Inertia | None,
    gravity: ArrayLike,
    timestep: float,
) -> Any:
    """One body a movable joint, with all that moves with it; the payload is a body of its own. → mujoco.MjModel"""
    import mujoco

    spec = mujoco.MjSpec()
    spec.option.gravity = np.asarray(gravity, dtype=np.float64)
    spec.option.timestep = timestep
    # Implicit in friction and in the velocity loops, where their force is not cut.
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET | mujoco.mjtDisableBit.mjDSBL_CONTACT

    body, place, joint = spec.worldbody, np.eye(4), 0
    inertias: list[list[tuple[_core.Inertia, Array]]] = []
    limits = chain.limits
    for segment in chain.segments:
        place = place @ segment.origin
        if segment.type != "fixed":
            body = _add_body(body, segment.link_name, place)
            kind = mujoco.mjtJoint.mjJNT_SLIDE if segment.type == "prismatic" else mujoco.mjtJoint.mjJNT_HINGE
            options: dict[str, Any] = {}
            lower, upper = limits.lower[joint], limits.upper[joint]
            if stops and (math.isfinite(lower) or math.isfinite(upper)):
                # One-sided ranges: the other end is where no arm goes.
                options = {"limited": True, "range": [max(lower, -1e6), min(upper, 1e6)]}
            body.add_joint(
                name=segment.joint_name,
                type=kind,
                axis=segment.axis,
                damping=joints["viscous_friction"][joint],
                frictionloss=joints["coulomb_friction"][joint],
                armature=joints["armature"][joint],
                **options,
            )
            actuator = spec.add_actuator(
                name=segment.joint_name, target=segment.joint_name, trntype=mujoco.mjtTrn.mjTRN_JOINT
            )
            if gain is not None:
                actuator.gainprm[0] = gain[joint]
                actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
                actuator.biasprm[2] = -gain[joint]
            if math.isfinite(effort[joint]):
                actuator.forcelimited = True
                actuator.forcerange = [-effort[joint], effort[joint]]
            inertias.append([])
            place, joint = np.eye(4), joint + 1
        if inertias and segment.inertia is not None:
            inertias[-1].append((segment.inertia, place))
    body.add_site(name="tip", pos=place[:3, 3], quat=_quaternion(place[:3, :3]))
    if payload is not None and payload.mass > 0.0:
        _add_body(body, "payload", place)
        inertias.append([(payload, np.eye(4))])
    model = spec.compile()

    # MuJoCo's compiler refuses inertias that no body has, which its solver takes: the PUMA's published ones are such.
    # So the bodies were compiled with others.
    for number, parts in enumerate(inertias, start=1):
        mass, centre, tensor = _together(parts)
        moments, axes = np.linalg.eigh(tensor)
        axes[:, 2] *= np.linalg.det(axes)
        model.body_mass[number] = mass
        model.body_ipos[number] = centre
        model.body_iquat[number] = _quaternion(axes)
        model.body_inertia[number] = moments
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _add_body(parent: Any, name: str, place: Array) -> Any:
    # No link's frame and no principal axes, lest MuJoCo takes short cuts that the true inertia does not allow.
    return parent.add_body(
        name=name,
        pos=place[:3, 3],
        quat=_quaternion(place[:3, :3]),
        mass=1.0,
        ipos=[0.1, 0.2, 0.3],
        fullinertia=[1.0, 1.1, 1.2, 0.1, 0.1, 0.1],
        explicitinertial=True,
    )


def _quaternion(rotation: Array) -> Array:
    """wxyz, which MuJoCo wants."""
    import mujoco

    wxyz = np.empty(4)
    mujoco.mju_mat2Quat(wxyz, np.ascontiguousarray(rotation).reshape(9))
    return wxyz


def _together(parts: Sequence[tuple[_core.Inertia, Array]]) -> tuple[float, Array, Array]:
    """Mass, centre and tensor about it, of inertias in frames (4, 4), in the frame of these. Steiner: m (r·r I − r
    rᵀ)."""
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


# --- planned motions


@dataclass(frozen=True)
class Execution:
    """A planned motion in physics: N samples, one a control period, the state before the period's command."""

    t: Array = field(repr=False)  #: (N,) [s]
    planned: Array = field(repr=False)  #: (N, n) [rad or m]
    q: Array = field(repr=False)  #: (N, n) where the arm truly was
    qdot: Array = field(repr=False)  #: (N, n) [rad/s or m/s]
    torque: Array = field(
        repr=False
    )  #: (N, n) the largest |τ| in the period after the sample (the last: before) [N·m or N]
    saturation: Array = field(repr=False)  #: (N, n) the part of it at the effort limit
    effort: Array = field(repr=False)  #: (n,) the effort limits, infinite where there is none

    @property
    def error(self) -> Array:
        """(N, n) planned minus true [rad or m]."""
        return self.planned - self.q

    @property
    def max_error(self) -> float:
        """The largest |error| of all joints [rad or m]."""
        return float(np.abs(self.error).max())

    @property
    def rms_error(self) -> float:
        """Root of the mean square error, of all joints and samples."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def final_error(self) -> float:
        """The largest |error| of all joints at the end."""
        return float(np.abs(self.error[-1]).max())

    @property
    def max_effort(self) -> float:
        """The largest torque as a part of its limit; 0 where there is none."""
        return float((self.torque / self.effort).max())

    @property
    def saturated(self) -> float:
        """The part of the time in which any drive was at its limit."""
        return float(self.saturation.max(axis=1).mean())


def execute(
    simulation: Simulation,
    trajectory: Trajectory,
    control: _core.ComputedTorque | None = None,
    *,
    position_gain: float = 10.0,
    settle: float = 0.5,
    progress: Callable[[float], None] | None = None,
) -> Execution:
    """Executes a planned motion, from its first position, by what the simulation measures.

    A simulation of torques is driven by computed torque; one of velocities by q̇ = Δq_d/T + k (q_d − q), T the control
    period, Δq_d the planned way in it. Errors are taken at the time of the measurement.

    control: None: the default one, of the arm alone. Of torques only
    position_gain: k [1/s] of velocities
    settle: [s] for which the last position is held
    progress: called with the simulated time [s], once a period

    ValueError where the trajectory is empty, has other joints, or a parameter is out of its range.
    """
    chain, period = simulation.chain, simulation.control_period
    if trajectory.q.ndim != 2 or trajectory.q.shape[1] != chain.dof:
        raise ValueError(f"the trajectory's q has shape {trajectory.q.shape}, the arm {chain.dof} joints")
    for name, value in (("position_gain", position_gain), ("settle", settle)):
        if not 0.0 <= value < math.inf:
            raise ValueError(f"{name} = {value} must be finite and not negative")
    if simulation.actuation == "velocity" and control is not None:
        raise ValueError("a simulation of velocities takes no torques: control must be None")
    start = float(trajectory.t[0]) if trajectory.t.size else 0.0
    samples = max(1, math.ceil((trajectory.duration + settle) / period - 1e-9)) + 1 if trajectory.t.size else 0
    t: Array = period * np.arange(samples, dtype=np.float64)
    planned, velocity, _ = trajectory.sample(start + t)
    velocity[t > trajectory.duration] = 0.0  # held at the end, even where a trajectory ends in motion
    if simulation.actuation == "torque" and control is None:
        control = _core.ComputedTorque(chain)

    measured = simulation.reset(planned[0], velocity[0])
    q, qdot = np.empty_like(planned), np.empty_like(planned)
    torque, saturation = np.zeros_like(planned), np.zeros_like(planned)
    for k in range(samples):
        q[k], qdot[k] = simulation.q, simulation.qdot
        if k + 1 == samples:
            break
        seen = round(measured.t / period)
        if control is not None:
            # Over the coming period the plan accelerates by what its velocity changes.
            ahead = (velocity[k + 1] - velocity[k]) / period
            step = control.update(measured.q, measured.qdot, planned[seen], velocity[seen], ahead)
            measured = simulation.step(step.torque)
        else:
            ahead = (planned[k + 1] - planned[k]) / period
            measured = simulation.step(ahead + position_gain * (planned[seen] - measured.q))
        torque[k], saturation[k] = simulation.peak_torque, simulation.saturated
        if progress is not None:
            progress(simulation.t)
    torque[-1], saturation[-1] = torque[-2], saturation[-2]  # no period follows the last sample
    return Execution(t, planned, q, qdot, torque, saturation, np.array(chain.limits.effort))
