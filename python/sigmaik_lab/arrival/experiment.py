"""Random targets that rest: which a servo reaches, when it arrives, and whether it comes to rest inside all limits.

The simulation is kinematic: the arm moves at the commanded velocity for dt.

Units: m, rad, s; for prismatic joints m in place of rad.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array

from .driven import DrivenServo
from .judge import Motion, TrialRow, joint_time, judge
from .servos import make_driven

__all__ = [
    "ON_TIME",
    "TARGETS",
    "TIMES",
    "ArrivalSettings",
    "Arrivals",
    "Trial",
    "arrivals",
    "draw_trials",
    "drive",
    "drive_trial",
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
#: [s] of a trial, where --time does not say.
TIMES = {"near": 4.0, "random": 10.0, "beyond": 30.0, "home": 10.0, "zeros": 8.0}
STEP = 0.2  #: [rad, or characteristic lengths] of `zeros`
NEAR = 0.25  #: [rad or m] in each joint
RANGE = 0.98  #: part of a joint's range in which starts and targets are drawn
TURN = math.pi  #: [rad or m] to both sides: the range of a joint without position limits
AWAY = 4.0  #: [s] for which a trial of `home` goes out of reach
ON_TIME = (5.0, 1.5)  #: an arrival is on time within 5 s, or 1.5 times the least time of the joints


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
    """What a servo did in all trials. A row per trial; the fields of `TrialRow`."""

    time: Array  #: (N,) [s] from which on the tip stays within `ARRIVED`; inf: the tip did not arrive
    position: Array  #: (N,) [m] the error at the end
    angle: Array  #: (N,) [rad]
    rest: NDArray[np.bool_]  #: (N,) whether all joints rest at the end
    speed: Array  #: (N,) [rad/s or m/s] of the fastest joint at the end
    excess: Array  #: (N,) the largest excess over any limit: part of the limit, and of positions rad or m; 0: none
    over: Array  #: (N,) the same, over limits of position, velocity and jerk alone
    jump: Array  #: (N,) the largest change of q̇ in one cycle, as a part of what the acceleration limits allow
    departure: Array  #: (N,) [m] the tip's largest distance from the line between its start and the target
    cycle: Array  #: (N,) [s] the mean wall time of an update
    least: Array  #: (N,) [s] in which the joints can get to the nearest configuration that PositionIk finds; inf: none
    led: NDArray[np.bool_]  #: (N,) whether the guide led the joints away from the tool's own way
    failed: NDArray[np.bool_]  #: (N,) whether the servo raised an error; such a trial has not arrived


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


def drive(
    chain: sk.Chain,
    trials: Sequence[Trial],
    name: str,
    settings: ArrivalSettings,
    progress: Callable[[], None] | None = None,
) -> Arrivals:
    """Drives a servo (see `make_driven`) to all targets. progress: called after each trial."""
    servo = make_driven(name, chain, settings.rate)
    rows = []
    for number, trial in enumerate(trials):
        rows.append(drive_trial(chain, trial, servo, settings, ("", name, number)))
        if progress is not None:
            progress()
    return arrivals(rows)


def arrivals(rows: Sequence[TrialRow]) -> Arrivals:
    """The rows of one arm and servo, as arrays."""
    names = [field.name for field in dataclasses.fields(Arrivals)]
    return Arrivals(*(np.array([getattr(row, name) for row in rows]) for name in names))


def drive_trial(
    chain: sk.Chain, trial: Trial, servo: DrivenServo, settings: ArrivalSettings, label: tuple[str, str, int]
) -> TrialRow:
    """One trial. label: names of arm and servo, and the trial's number, for the row."""
    motion = _move(chain, trial, servo, settings)
    found = sk.PositionIk(chain).solve(trial.target, near=motion.q[0])
    least = joint_time(chain, motion.q[0], found.q) if found.status == sk.PositionIkStatus.OK else math.inf
    return TrialRow(
        *label,
        **judge(chain, motion, trial.target, settings.rate),
        least=least,
        setup=f"{servo.version}: {servo.settings}",
    )


def _move(chain: sk.Chain, trial: Trial, servo: DrivenServo, settings: ArrivalSettings) -> Motion:
    """The motion of a trial. Where a servo raises an error or its answer is not finite, the arm stands still, and the
    servo has failed."""
    cycles, clock = settings.cycles, time.perf_counter_ns
    q, qdot = np.empty((cycles + 1, chain.dof)), np.zeros((cycles, chain.dof))
    start_qdot = np.zeros(chain.dof)
    taken, led, k, failed = 0, False, 0, False
    servo.reset(trial.start)
    q[0] = trial.start
    try:
        if trial.before is not None:
            for _ in range(round(AWAY * settings.rate)):
                start_qdot = servo.update(trial.before)
            q[0] = servo.q
        for k in range(cycles):
            begin = clock()
            command = servo.update(trial.target)
            taken += clock() - begin
            if not np.all(np.isfinite(command)):
                raise ValueError("a command that is not finite")
            q[k + 1], qdot[k] = servo.q, command
            led = led or servo.led
        k = cycles
    except Exception:  # whatever a peer may raise in its loop
        failed = True
        q[k + 1 :] = q[k]
    return Motion(q, qdot, start_qdot, 1e-9 * taken / max(1, k), led, failed, k)
