"""Random targets that rest: which a servo reaches, when it arrives, and whether it comes to rest inside all limits.

The simulation is kinematic: the arm moves at the commanded velocity for dt.

Units: m, rad, s; for prismatic joints m in place of rad.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array

__all__ = [
    "ARRIVED",
    "ON_TIME",
    "SERVOS",
    "TARGETS",
    "TIMES",
    "ArrivalSettings",
    "Arrivals",
    "Trial",
    "draw_trials",
    "drive",
    "held_limits",
    "joint_time",
    "make_servo",
]

#: Kinds of targets.
TARGETS: dict[str, str] = {
    "near": "the pose of a configuration that differs from the start by up to 0.25 rad or m in each joint",
    "random": "the pose of any configuration",
    "beyond": "the same pose, 1.2 to 2 times as far from the base as the arm reaches",
    "home": "the pose of the start, after four seconds towards such a pose beyond reach",
    "zeros": "from all joints at zero, a step of 0.2 characteristic lengths along an axis or of 0.2 rad about it, in "
    "turn, where PositionIk finds a configuration",
}
#: Servos that the study compares.
SERVOS: dict[str, str] = {
    "default": "sk.Servo(arm)",
    "guided": "sk.Servo(arm, guided=True)",
    "fixed": "J-PARSE with γ = 0.02, not adaptive",
}
#: [m, rad] A tip this near has arrived: 1 mm, 0.5°.
ARRIVED = (1e-3, math.radians(0.5))
#: [s] of a trial, where --time does not say.
TIMES = {"near": 4.0, "random": 10.0, "beyond": 30.0, "home": 10.0, "zeros": 8.0}
STEP = 0.2  #: [rad, or characteristic lengths] of `zeros`
NEAR = 0.25  #: [rad or m] in each joint
RANGE = 0.98  #: part of a joint's range in which starts and targets are drawn
TURN = math.pi  #: [rad or m] to both sides: the range of a joint without position limits
AWAY = 4.0  #: [s] for which a trial of `home` goes out of reach
ON_TIME = (5.0, 1.5)  #: an arrival is on time within 5 s, or 1.5 times the least time of the joints
RESTING = 1e-3  #: part of the velocity limit (or rad/s, m/s): a slower joint rests


@dataclass(frozen=True)
class ArrivalSettings:
    """Targets, time, and limits that replace those of the arm."""

    targets: str = "near"  #: of `TARGETS`
    trials: int = 200
    time: float | None = None  #: [s] of each trial; None: that of `TIMES`
    rate: float = 1000.0  #: [Hz]
    seed: int = 0
    acceleration: float | None = None  #: limit of all joints; None: the arm's own, or the servo's assumption
    jerk: float | None = None  #: limit of all joints; None: the arm's own

    def __post_init__(self) -> None:
        if self.targets not in TARGETS:
            raise ValueError(f"no targets '{self.targets}'; there are {', '.join(TARGETS)}")
        if self.trials < 1 or self.seed < 0:
            raise ValueError("trials must be positive, and seed not negative")
        for name in ("time", "rate", "acceleration", "jerk"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be positive and finite, not {value:g}")
        if self.cycles < 1:
            raise ValueError(f"time must be a cycle at least, not {self.seconds:g} s at {self.rate:g} Hz")

    @property
    def seconds(self) -> float:
        """[s] of each trial."""
        return TIMES[self.targets] if self.time is None else self.time

    @property
    def cycles(self) -> int:
        """Number of cycles of each trial."""
        return round(self.seconds * self.rate)

    def with_limits(self, chain: sk.Chain) -> sk.Chain:
        """The chain with the limits that were given."""
        given = {"acceleration": self.acceleration, "jerk": self.jerk}
        return chain.with_limits(**{name: value for name, value in given.items() if value is not None})


@dataclass(frozen=True)
class Trial:
    """A start and a target."""

    start: Array  #: (n,)
    target: Array  #: (4, 4)
    before: Array | None = None  #: (4, 4) where the arm goes first, for `AWAY`; the time starts after this


@dataclass(frozen=True)
class Arrivals:
    """What a servo did in all trials. A row per trial."""

    time: Array  #: (N,) [s] from which on the tip stays within `ARRIVED`; inf: the tip did not arrive
    position: Array  #: (N,) [m] the error at the end
    angle: Array  #: (N,) [rad]
    rest: NDArray[np.bool_]  #: (N,) whether all joints rest at the end
    speed: Array  #: (N,) [rad/s or m/s] of the fastest joint at the end
    excess: Array  #: (N,) the largest excess over a limit: part of the limit, and of positions rad or m; 0: none
    least: Array  #: (N,) [s] in which the joints can get to the nearest configuration that PositionIk finds; inf: none
    led: NDArray[np.bool_]  #: (N,) whether the guide led the joints away from the tool's own way


def draw_trials(chain: sk.Chain, settings: ArrivalSettings) -> list[Trial]:
    """The same trials for every servo, inside the position limits."""
    rng = np.random.default_rng(settings.seed)
    limits = chain.limits
    bounded = np.isfinite(limits.lower) & np.isfinite(limits.upper)
    lower, upper = np.where(bounded, limits.lower, -TURN / RANGE), np.where(bounded, limits.upper, TURN / RANGE)
    middle, half = 0.5 * (lower + upper), 0.5 * RANGE * (upper - lower)

    def anywhere() -> Array:
        q: Array = middle + half * rng.uniform(-1.0, 1.0, chain.dof)
        return q

    if settings.targets == "zeros":
        return _steps_from_zeros(chain, settings.trials)
    reach = 0.0
    if settings.targets in ("beyond", "home"):
        reach = max(float(np.linalg.norm(chain.pose(anywhere())[:3, 3])) for _ in range(2000))
    trials = []
    for _ in range(settings.trials):
        start = anywhere()
        if settings.targets == "near":
            goal: Array = np.clip(start + rng.uniform(-NEAR, NEAR, chain.dof), limits.lower, limits.upper)
        else:
            goal = anywhere()
        target = chain.pose(goal)
        if reach > 0.0:
            away = target[:3, 3] / max(1e-9, float(np.linalg.norm(target[:3, 3])))
            target[:3, 3] = rng.uniform(1.2, 2.0) * reach * away
        home = settings.targets == "home"
        trials.append(Trial(start, chain.pose(start), target) if home else Trial(start, target))
    return trials


def _steps_from_zeros(chain: sk.Chain, most: int) -> list[Trial]:
    start = np.clip(np.zeros(chain.dof), chain.limits.lower, chain.limits.upper)
    ik = sk.PositionIk(chain)
    trials = []
    for axis in range(6):
        for sign in (1.0, -1.0):
            target = chain.pose(start)
            step = sign * STEP * np.eye(3)[axis % 3]
            if axis < 3:
                target[:3, 3] += chain.characteristic_length * step
            else:
                target[:3, :3] = sk.rotation_exp(step) @ target[:3, :3]
            if ik.solve(target, near=start).status == sk.PositionIkStatus.OK:
                trials.append(Trial(start, target))
    return trials[:most]


def make_servo(name: str, chain: sk.Chain, rate: float) -> sk.Servo:
    """A servo of `SERVOS`, or one with a method by name. Error where there is neither."""
    if name not in SERVOS:
        return sk.Servo(chain, sk.methods.parse(name), dt=1.0 / rate)
    if name != "fixed":
        return sk.Servo(chain, dt=1.0 / rate, guided=name == "guided")
    rule = sk.JParse(gamma=0.02, adaptive=False)
    return sk.Servo(chain, rule, dt=1.0 / rate, gain_linear=10.0, gain_angular=10.0)


def held_limits(servo: sk.Servo) -> tuple[Array, Array, Array]:
    """(n,) limits of velocity, acceleration and jerk that the servo holds, the assumed ones too."""
    limits = servo.chain.limits
    assumed = float(servo.options["assumed_acceleration"])
    acceleration = np.where(np.isfinite(limits.acceleration), limits.acceleration, assumed)
    return limits.velocity, acceleration, limits.jerk


def drive(
    chain: sk.Chain,
    trials: list[Trial],
    name: str,
    settings: ArrivalSettings,
    progress: Callable[[], None] | None = None,
) -> Arrivals:
    """Drives a servo (see `make_servo`) to all targets. progress: called after each trial."""
    servo = make_servo(name, chain, settings.rate)
    ik = sk.PositionIk(chain)
    cycles = settings.cycles
    columns = []
    for trial in trials:
        q, qdot, error = np.empty((cycles + 1, chain.dof)), np.empty((cycles, chain.dof)), np.empty((cycles + 1, 6))
        servo.reset(trial.start)
        start_qdot = np.zeros(chain.dof)
        if trial.before is not None:
            for _ in range(round(AWAY * settings.rate)):
                start_qdot = servo.update(trial.before).qdot
        q[0] = servo.q
        led = False
        for k in range(cycles):
            step = servo.update(trial.target)
            q[k + 1], qdot[k], error[k] = step.q, step.qdot, step.pose_error
            led = led or step.guide == sk.GuideState.CHANGING_BRANCH
        error[cycles] = sk.pose_error(chain.pose(q[cycles]), trial.target)
        found = ik.solve(trial.target, near=q[0])
        least = joint_time(servo, q[0], found.q) if found.status == sk.PositionIkStatus.OK else math.inf
        columns.append((*_judge(servo, q, qdot, error, settings.rate, start_qdot), least, led))
        if progress is not None:
            progress()
    return Arrivals(*(np.array(column) for column in zip(*columns, strict=True)))


def joint_time(servo: sk.Servo, start: Array, goal: Array) -> float:
    """[s] of the fastest motion of all joints from rest at `start` to rest at `goal`, without jerk limits."""
    velocity, acceleration, _ = held_limits(servo)
    way = np.abs(goal - start)
    ramps = 2.0 * np.sqrt(way / acceleration)  # never at full speed
    with np.errstate(invalid="ignore"):
        cruise = way / velocity + velocity / acceleration
    return float(np.where(way * acceleration > velocity**2, cruise, ramps).max())


def _judge(
    servo: sk.Servo, q: Array, qdot: Array, error: Array, rate: float, start_qdot: Array | None = None
) -> tuple[float, float, float, bool, float, float]:
    position, angle = np.linalg.norm(error[:, :3], axis=1), np.linalg.norm(error[:, 3:], axis=1)
    away = np.flatnonzero((position > ARRIVED[0]) | (angle > ARRIVED[1]))
    first = int(away[-1]) + 1 if len(away) else 0
    time = first / rate if first < len(position) else math.inf
    velocity, acceleration, jerk = held_limits(servo)
    last = np.abs(qdot[-1])
    rest = bool(np.all(last <= RESTING * np.where(np.isfinite(velocity), velocity, 1.0)))
    return (
        time,
        float(position[-1]),
        float(angle[-1]),
        rest,
        float(last.max()),
        _excess(servo, q, qdot, rate, start_qdot),
    )


def _excess(servo: sk.Servo, q: Array, qdot: Array, rate: float, start_qdot: Array | None = None) -> float:
    """The largest excess over a limit, by differences of the commands, as a robot's controller checks them.

    What the rounding of the differences can make is not counted. start_qdot: (n,) before the first command; None: zero.
    After a motion, the jerk of the first cycle is not known.
    """
    limits = servo.chain.limits
    velocity, acceleration, jerk = held_limits(servo)
    moving = start_qdot is not None and bool(np.any(start_qdot != 0.0))
    before = np.zeros(servo.chain.dof) if start_qdot is None else start_qdot
    change = np.diff(qdot, axis=0, prepend=before[None]) * rate
    change_of_change = np.diff(change, axis=0, prepend=change[:1] if moving else 0.0) * rate
    rounding = 4.0 * np.finfo(float).eps * max(1.0, float(np.abs(qdot).max()))
    worst = max(0.0, float((q - limits.upper).max()), float((limits.lower - q).max()))
    for value, limit, slack in (
        (qdot, velocity, rounding),
        (change, acceleration, rounding * rate),
        (change_of_change, jerk, 2.0 * rounding * rate**2),
    ):
        over = (np.abs(value) - slack) / limit - 1.0  # −1 without a limit
        worst = max(worst, float(over.max()))
    return worst
