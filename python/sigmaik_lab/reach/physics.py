"""The reaching experiments with an arm that has mass: drives, effort limits, friction, noise and delay.

The arm's joints are driven every millisecond, the method runs at the experiment's rate, and its joint velocities are
held between two of its cycles. One of two feedbacks closes the loop:

- "reference": the servo follows its own command, as it does without physics, and the drives follow the servo, in
  position and velocity. No measurement reaches the method. The command is that of the kinematic run, to the last digit.
- "measured": pose error, Jacobian and posture are those of the measured joints, as in the paper's own loop, and the
  drives get the joint velocities alone.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import sigmaik as sk
from sigmaik._types import Array
from sigmaik.methods import NamedMethod
from sigmaik.sim import Measurement
from sigmaik_lab.physical_arm import PhysicsSettings, simulation

from . import experiment as reach
from .experiment import Experiment, Run
from .summary import summarize

__all__ = ["PhysicsRun", "PhysicsSummary", "run_physics", "summarize_physics"]


@dataclass(frozen=True)
class PhysicsRun:
    """A method without physics and with physics. All samples are those of the method's cycles."""

    kinematic: Run
    physical: Run  #: the true arm; q̇ is each joint's fastest in the cycle
    effort: Array  #: (N, n) the largest |τ| in the cycle, as a part of its limit; 0 where there is none
    saturation: Array  #: (N,) the part of the cycle in which any drive was at its effort limit
    tripped: float  #: [s] when the drives tripped; NaN where they did not

    @property
    def tip_distance(self) -> Array:
        """(N,) from the kinematic arm's tip to the true arm's [m]."""
        distance: Array = np.linalg.norm(self.kinematic.tip - self.physical.tip, axis=1)
        return distance

    @property
    def tracking_error(self) -> Array:
        """(N,) the largest difference of any joint between the two arms [rad or m]."""
        largest: Array = np.abs(self.kinematic.q - self.physical.q).max(axis=1)
        return largest


def run_physics(
    experiment: Experiment,
    method: NamedMethod,
    velocity_limits: bool = False,
    settings: PhysicsSettings | None = None,
    progress: Callable[[int], None] | None = None,
) -> PhysicsRun:
    """Runs the loop without physics, and with physics. The arguments are those of `run`.

    ValueError where the arm has no inertias, or friction but no effort limits, or where a setting is out of its range.
    """
    p = settings or PhysicsSettings()
    if p.feedback not in ("reference", "measured"):
        raise ValueError(f"feedback = {p.feedback!r} must be 'reference' or 'measured'")
    if not p.trip > 0.0:
        raise ValueError(f"trip = {p.trip} must be greater than 0")
    s, chain = experiment.settings, experiment.chain
    arm = simulation(chain, p, p.actuation)
    substeps = round(1.0 / (s.rate * p.period))
    if substeps < 1 or abs(substeps * p.period * s.rate - 1.0) > 1e-9:
        raise ValueError(f"the drives' period of {p.period:g} s does not divide the cycle of {1.0 / s.rate:g} s")
    control = sk.ComputedTorque(chain, frequency=p.frequency) if p.actuation == "torque" else None
    kinematic = reach.run(experiment, method, velocity_limits)
    loop = _Measured(experiment, method, velocity_limits) if p.feedback == "measured" else None

    n, dof = experiment.samples, chain.dof
    q, fastest, error = np.empty((n, dof)), np.zeros((n, dof)), np.empty((n, 6))
    effort, saturation = np.zeros((n, dof)), np.zeros(n)
    singular_values = np.empty_like(kinematic.singular_values)
    status, scale = kinematic.status.copy(), kinematic.scale.copy()
    weights = np.repeat([1.0, s.length_scale], 3)[:, None]

    measured = arm.reset(experiment.start)
    # The reference at the drives' periods, for measurements that are late.
    past = np.empty((n * substeps, dof))
    still = np.zeros(dof)
    trip, tripped = p.trip * np.array(chain.limits.velocity), math.nan
    stride = max(1, round(s.rate / 10.0))
    for k, (_, pose) in enumerate(experiment.targets()):
        q[k] = arm.q
        error[k] = sk.pose_error(chain.pose(q[k]), pose)
        singular_values[k] = np.linalg.svd(weights * chain.jacobian(q[k]), compute_uv=False)
        if loop is None or not math.isnan(tripped):
            qdot = kinematic.qdot[k]
        else:
            qdot, status[k], scale[k] = loop.update(measured, pose)
        for j in range(substeps if math.isnan(tripped) else 0):
            period = k * substeps + j
            past[period] = kinematic.q[k] + j * p.period * qdot
            behind = past[round(measured.t / p.period)] - measured.q if loop is None else still
            if control is None:
                command = qdot + p.position_gain * behind
            else:
                command = control.update(measured.q, measured.qdot, measured.q + behind, qdot, still).torque
            measured = arm.step(command)
            now = arm.qdot
            fastest[k] = np.where(np.abs(now) > np.abs(fastest[k]), now, fastest[k])
            np.maximum(effort[k], arm.peak_torque / chain.limits.effort, out=effort[k])
            saturation[k] += arm.saturated.max() / substeps
            if (np.abs(now) > trip).any():
                tripped = arm.t
                break
        if progress is not None and (k + 1) % stride == 0:
            progress(stride)
    physical = dataclasses.replace(
        kinematic,
        method=dataclasses.replace(method, label=f"{method.label} physics"),
        q=q,
        qdot=fastest,
        pose_error=error,
        singular_values=singular_values,
        status=status,
        scale=scale,
    )
    return PhysicsRun(kinematic, physical, effort, saturation, tripped)


class _Measured:
    """The servo's law without the servo's own reference: the paper's loop, which reads the joints in every cycle."""

    def __init__(self, experiment: Experiment, method: NamedMethod, velocity_limits: bool) -> None:
        chain, s = experiment.chain, experiment.settings
        self._chain, self._settings = chain, s
        self._solver = sk.VelocitySolver(method.method, length_scale=s.length_scale)
        self._limits = chain.limits.velocity if velocity_limits else np.full(chain.dof, math.inf)
        # A continuous joint has many equal postures: this one is the turn nearest to the start.
        turning = np.array(chain.joint_types) == "continuous"
        turns = np.round((experiment.posture - experiment.start) / (2.0 * math.pi))
        self._posture = experiment.posture - np.where(turning, 2.0 * math.pi * turns, 0.0)

    def update(self, measured: Measurement, target: Array) -> tuple[Array, int, float]:
        """q̇, sigmaik.Status, and the scale that the speed limits left."""
        s, q = self._settings, measured.q
        error = sk.pose_error(self._chain.pose(q), target)
        parts = ((error[:3], s.max_position_error, s.gain_linear), (error[3:], s.max_orientation_error, s.gain_angular))
        twist = np.concatenate(
            [gain * e * min(1.0, cap / max(float(np.linalg.norm(e)), 1e-300)) for e, cap, gain in parts]
        )
        posture = None
        if s.posture_gain:
            posture = np.clip(s.posture_gain * (self._posture - q), -s.posture_max_speed, s.posture_max_speed)
        answer = self._solver.solve(self._chain.jacobian(q), twist, posture)
        scale = 1.0 / max(1.0, float((np.abs(answer.qdot) / self._limits).max()))
        status = max(answer.status, sk.Status.LIMITED) if scale < 1.0 else answer.status
        return scale * answer.qdot, int(status), scale


# --- summary


@dataclass(frozen=True)
class PhysicsSummary:
    """One method at one waypoint, or in one cycle of a moving target, without physics and with physics."""

    method: str
    velocity_limits: bool
    waypoint: str
    position_error: float  #: without physics, at the waypoint's end [m]
    physical_position_error: float  #: with physics, at the waypoint's end [m]
    orientation_error: float  #: [rad]
    physical_orientation_error: float
    max_joint_speed: float  #: [rad/s, or m/s]
    physical_max_joint_speed: float
    max_speed_ratio: float  #: of the true arm: largest |q̇|/limit; 0 where the arm has no limits
    final_tip_distance: float  #: between the two tips at the waypoint's end [m]
    max_tip_distance: float  #: on the way [m]
    max_tracking_error: float  #: largest difference of any joint on the way [rad or m]
    max_effort: float  #: largest |τ|/limit; 0 where the arm has no limits
    saturated: float  #: part of the time in which any drive is at its effort limit
    tripped: float  #: [s] when the drives tripped, in the whole run; NaN where they did not


def summarize_physics(run: PhysicsRun) -> list[PhysicsSummary]:
    """One PhysicsSummary per segment of the path."""
    rows = []
    for i, (without, true) in enumerate(zip(summarize(run.kinematic), summarize(run.physical), strict=True)):
        here = run.kinematic.segment == i
        distance = run.tip_distance[here]
        rows.append(
            PhysicsSummary(
                method=without.method,
                velocity_limits=without.velocity_limits,
                waypoint=without.waypoint,
                position_error=without.position_error,
                physical_position_error=true.position_error,
                orientation_error=without.orientation_error,
                physical_orientation_error=true.orientation_error,
                max_joint_speed=without.max_joint_speed,
                physical_max_joint_speed=true.max_joint_speed,
                max_speed_ratio=true.max_speed_ratio,
                final_tip_distance=float(distance[-1]),
                max_tip_distance=float(distance.max()),
                max_tracking_error=float(run.tracking_error[here].max()),
                max_effort=float(run.effort[here].max()),
                saturated=float(run.saturation[here].mean()),
                tripped=run.tripped,
            )
        )
    return rows
