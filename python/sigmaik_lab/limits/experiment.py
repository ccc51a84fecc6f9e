"""A rule with joint limits: what limits cost, and what breaks without them.

There are three scenarios, each driven in several ways: a target beyond reach, targets beyond joint limits, and
random twists like those of teleoperation. The simulation is kinematic: the arm moves at the commanded velocity
for 1/rate.

Units: m, rad, s; for prismatic joints m in place of rad.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array
from sigmaik.methods import NamedMethod
from sigmaik_lab.reach.methods import parse_method

from .trials import LimitsSettings, Trial, beyond_limits, beyond_reach, teleoperation

__all__ = ["SCENARIOS", "VARIANTS", "LimitsExperiment", "Trace", "drive", "load_limits"]

#: Ways to hold limits that the study compares.
VARIANTS: dict[str, str] = {
    "redistribute": "all limits held, other joints take over",
    "position first": "the same, tool position before orientation (exact)",
    "scale": "all limits held, all joints slowed down together",
    "clamp": "today's practice: each joint clamped to its speed, and stopped at its position limit",
    "none": "the rule alone",
}
#: Scenarios that every variant is driven through.
SCENARIOS: dict[str, str] = {
    "beyond reach": "a target 0.5 m out of reach: held, wandering, released",
    "beyond limits": "poses of configurations 0.3 rad beyond a limit: held, left",
    "teleoperation": "random twists, band-limited and saturating",
}

#: A cycle counts as limited where the tool's twist misses a larger part of the rule's twist.
MISSED = 1e-3


@dataclass(frozen=True)
class LimitsExperiment:
    """An arm, a rule, and the trials of each scenario. The settings have the arm's length scale and largest error."""

    robot: str
    chain: sk.Chain
    method: NamedMethod
    settings: LimitsSettings
    trials: dict[str, tuple[Trial, ...]]

    @property
    def cycles(self) -> int:
        """Number of cycles of all trials together."""
        return sum(len(trial.commands) for trials in self.trials.values() for trial in trials)


@dataclass(frozen=True)
class Trace:
    """Time series of a trial. Sample k is the state before cycle k, and the command of cycle k."""

    experiment: LimitsExperiment
    scenario: str
    trial: Trial
    variant: str
    q: Array  #: (N + 1, n) positions; the last one is after the last cycle
    qdot: Array  #: (N, n) commanded
    error: Array  #: (N, 6) target minus tip [m, rad]; zero for twists
    tip: Array  #: (N, 3) [m]
    rule: Array  #: (N, 6) twist that the rule alone gives in this state
    held: NDArray[np.bool_]  #: (N,) a limit changed the command

    @property
    def limited(self) -> NDArray[np.bool_]:
        """(N,) a limit changed the tool's motion, by more than a thousandth of the rule's."""
        missed = np.linalg.norm(self.achieved - self.rule, axis=1)
        limited: NDArray[np.bool_] = self.held & (missed > MISSED * np.linalg.norm(self.rule, axis=1))
        return limited

    @property
    def t(self) -> Array:
        """(N,) [s]"""
        return np.arange(len(self.qdot)) / self.experiment.settings.rate

    @property
    def achieved(self) -> Array:
        """(N, 6) J q̇."""
        out: Array = np.concatenate(
            [
                np.einsum("bij,bj->bi", self.experiment.chain.jacobian(self.q[:-1][part]), self.qdot[part])
                for part in parts(len(self.qdot))
            ]
        )
        return out

    @property
    def acceleration(self) -> Array:
        """(N, n) of the command, by differences, from rest."""
        out: Array = np.diff(self.qdot, axis=0, prepend=0.0) * self.experiment.settings.rate
        return out

    @property
    def jerk(self) -> Array:
        """(N, n) of the command, by differences, from rest."""
        out: Array = np.diff(self.acceleration, axis=0, prepend=0.0) * self.experiment.settings.rate
        return out


def load_limits(
    robot: str,
    settings: LimitsSettings | None = None,
    method: str = "jparse",
    base: str | None = None,
    tip: str | None = None,
) -> LimitsExperiment:
    """The experiment with a shipped arm, or a URDF file. ValueError where a part is wrong."""
    settings = settings or LimitsSettings()
    label, chain, home, _ = sk.robots.open(robot, base, tip)
    length_scale = chain.characteristic_length if settings.length_scale is None else settings.length_scale
    longest = 0.5 * length_scale if settings.max_linear_error is None else settings.max_linear_error
    settings = dataclasses.replace(settings, length_scale=length_scale, max_linear_error=longest)
    for name in (
        "rate",
        "seconds",
        "pace",
        "gain_linear",
        "gain_angular",
        "max_linear_error",
        "max_angular_error",
        "length_scale",
    ):
        value = getattr(settings, name)
        if not 0.0 < value < math.inf:
            raise ValueError(f"{name} must be positive and finite, not {value:g}")
    if settings.trials < 1 or settings.seed < 0:
        raise ValueError("trials must be positive, and seed not negative")
    for name, limit in (("acceleration", settings.acceleration), ("jerk", settings.jerk)):
        if limit is not None:
            if not limit > 0.0:
                raise ValueError(f"{name} must be positive, not {limit:g}")
            chain = chain.with_limits(**{name: limit})
    trials = {
        "beyond reach": tuple(beyond_reach(chain, home, settings)),
        "beyond limits": tuple(beyond_limits(chain, home, settings)),
        "teleoperation": (teleoperation(home, settings),),
    }
    return LimitsExperiment(label, chain, parse_method(method), settings, trials)


def drive(
    experiment: LimitsExperiment,
    scenario: str,
    trial: Trial,
    variant: str,
    progress: Callable[[int], None] | None = None,
) -> Trace:
    """Drives a trial. progress: called with the cycles since the last call, every 500 cycles and at the end."""
    if variant not in VARIANTS:
        raise ValueError(f"no variant '{variant}'; there are {', '.join(VARIANTS)}")
    loop = _clamped if variant == "clamp" else _served
    q, qdot, error, held = loop(experiment, trial, variant, progress)
    tip: Array = np.concatenate([experiment.chain.pose(q[:-1][p])[:, :3, 3] for p in parts(len(qdot))])
    rule = _rule(experiment, trial, q[:-1], error)
    return Trace(experiment, scenario, trial, variant, q, qdot, error, tip, rule, held)


_Loop = tuple[Array, Array, Array, NDArray[np.bool_]]


def _served(experiment: LimitsExperiment, trial: Trial, variant: str, progress: Callable[[int], None] | None) -> _Loop:
    s = experiment.settings
    on = variant != "none"
    servo = sk.Servo(
        experiment.chain,
        experiment.method.method,
        dt=1.0 / s.rate,
        gain_linear=s.gain_linear,
        gain_angular=s.gain_angular,
        max_linear_error=s.max_linear_error,
        max_angular_error=s.max_angular_error,
        length_scale=s.length_scale,
        soft_start=s.soft_start,
        position_limits=on,
        velocity_limits=on,
        acceleration_limits=on,
        jerk_limits=on,
        on_limit="scale" if variant == "scale" else "redistribute",
        exact=(1, 1, 1, 0, 0, 0) if variant == "position first" else None,
    )
    servo.reset(trial.start)
    q, qdot, error, held = _empty(experiment, trial)
    update = servo.update if trial.by_pose else servo.update_twist
    for k, command in enumerate(trial.commands):
        step = update(command)
        q[k + 1], qdot[k] = step.q, step.qdot
        held[k] = step.status == sk.Status.LIMITED or bool(step.limiting_joints)
        if trial.by_pose:
            error[k] = step.pose_error
        if progress is not None and k % 500 == 499:
            progress(500)
    if progress is not None:
        progress(len(trial.commands) % 500)
    return q, qdot, error, held


def _clamped(experiment: LimitsExperiment, trial: Trial, _: str, progress: Callable[[int], None] | None) -> _Loop:
    """The rule's velocities; each joint's velocity is clamped to the speed limit and to the distance from the position
    limit."""
    chain, dt = experiment.chain, 1.0 / experiment.settings.rate
    limits = chain.limits
    lower, upper, speed = limits.lower, limits.upper, limits.velocity
    solver = sk.VelocitySolver(experiment.method.method, _length_scale(experiment))
    q, qdot, error, held = _empty(experiment, trial)
    for k, command in enumerate(trial.commands):
        here = q[k]
        if trial.by_pose:
            error[k] = sk.pose_error(chain.pose(here), command)
            twist = _twists(experiment.settings, error[k : k + 1], k)[0]
        else:
            twist = command
        asked = solver.solve(chain.jacobian(here), twist).qdot
        ahead = np.clip(here + dt * np.clip(asked, -speed, speed), lower, upper)
        q[k + 1], qdot[k] = ahead, (ahead - here) / dt
        held[k] = bool(np.any(np.abs(qdot[k] - asked) > 1e-9 * (1.0 + np.abs(asked))))
        if progress is not None and k % 500 == 499:
            progress(500)
    if progress is not None:
        progress(len(trial.commands) % 500)
    return q, qdot, error, held


def _empty(experiment: LimitsExperiment, trial: Trial) -> _Loop:
    count, n = len(trial.commands), experiment.chain.dof
    q = np.empty((count + 1, n))
    q[0] = trial.start
    return q, np.empty((count, n)), np.zeros((count, 6)), np.zeros(count, dtype=np.bool_)


def _twists(settings: LimitsSettings, error: Array, first: int = 0) -> Array:
    """Twists (N, 6) of pose errors (N, 6), as the Servo has them, from cycle `first` on."""
    twist = error.copy()
    for rows, longest, gain in (
        (slice(0, 3), settings.max_linear_error or math.inf, settings.gain_linear),
        (slice(3, 6), settings.max_angular_error, settings.gain_angular),
    ):
        length = np.linalg.norm(twist[:, rows], axis=1, keepdims=True)
        twist[:, rows] *= gain / np.maximum(1.0, length / longest)
    if settings.soft_start > 0.0:
        cycle = np.arange(first + 1, first + len(twist) + 1)
        twist *= np.minimum(1.0, cycle / (settings.soft_start * settings.rate))[:, None]
    return twist


def _length_scale(experiment: LimitsExperiment) -> float:
    scale = experiment.settings.length_scale
    return experiment.chain.characteristic_length if scale is None else scale


def _rule(experiment: LimitsExperiment, trial: Trial, q: Array, error: Array) -> Array:
    commands = _twists(experiment.settings, error) if trial.by_pose else trial.commands
    twists = np.empty((len(q), 6))
    for part in parts(len(q)):
        jacobian = experiment.chain.jacobian(q[part])
        qdot = sk.solve_batch(
            experiment.method.method, jacobian, commands[part], length_scale=_length_scale(experiment)
        )
        twists[part] = np.einsum("bij,bj->bi", jacobian, qdot)
    return twists


def parts(count: int, size: int = 10_000) -> Iterator[slice]:
    """Slices of at most `size` samples, which bound the memory that a computation takes."""
    return (slice(i, min(i + size, count)) for i in range(0, count, size))
