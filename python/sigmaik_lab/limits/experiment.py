"""A rule with joint limits: what limits cost, and what breaks without them.

Three scenarios, each driven in several ways: a target beyond reach, targets beyond joint limits, and random
twists like those of teleoperation. A kinematic simulation: the arm does what it is told for 1/rate.

Units: m, rad, s; of prismatic joints m where rad is said of joints.
"""

from __future__ import annotations

import dataclasses
import json
import math
import pathlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array
from sigmaik.files import write_atomically
from sigmaik.methods import NamedMethod
from sigmaik_lab.reach.methods import parse_method

__all__ = [
    "SCENARIOS",
    "VARIANTS",
    "LimitsExperiment",
    "LimitsSettings",
    "LimitsSummary",
    "Phase",
    "Trace",
    "Trial",
    "drive",
    "load_limits",
    "save_traces",
    "shown_trial",
    "summarize_limits",
]

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

BEYOND_REACH = 0.5  #: [m]
#: [rad or m] distance from the joint limit: of the start inside the limit, and of the target's configuration beyond it.
BEYOND_LIMIT = 0.3
SATURATION = (0.5, 1.5)  #: [m/s, rad/s] longest twists of the teleoperation
BAND = 1.0  #: [Hz] and slower: what a hand does
#: A cycle counts as limited where the tool's twist misses a larger part of the rule's twist.
MISSED = 1e-3
#: An excess below this part of the limit is the rounding of finite differences.
TOLERANCE = 1e-7


@dataclass(frozen=True)
class LimitsSettings:
    """Rate, gains and duration of the loop, and limits that replace those of the arm."""

    rate: float = 1000.0  #: [Hz]
    trials: int = 3  #: directions that the target out of reach is tried in
    seconds: float = 60.0  #: of teleoperation
    pace: float = 1.0  #: the other scenarios' times are multiplied with it
    seed: int = 0
    gain_linear: float = 5.0  #: [1/s] position error to velocity
    gain_angular: float = 5.0  #: [1/s] orientation error to angular velocity
    max_linear_error: float = 0.25  #: [m] longer errors are shortened to it
    max_angular_error: float = 1.0  #: [rad]
    soft_start: float = 0.1  #: [s]
    acceleration: float | None = None  #: limit of all joints; None: the arm's own
    jerk: float | None = None  #: limit of all joints; None: the arm's own


@dataclass(frozen=True)
class Phase:
    """A stretch of a trial."""

    name: str  #: "reach", "hold", "wander", "return", "drive"
    begin: int  #: cycle
    end: int


@dataclass(frozen=True)
class Trial:
    """Commands for one start: poses (N, 4, 4), or twists (N, 6)."""

    name: str
    start: Array  #: (n,)
    commands: Array
    phases: tuple[Phase, ...]

    @property
    def by_pose(self) -> bool:
        """Whether the commands are poses."""
        return self.commands.ndim == 3

    def phase(self, name: str) -> slice:
        """Cycles of the phase; empty where there is none of that name."""
        return next((slice(p.begin, p.end) for p in self.phases if p.name == name), slice(0, 0))


@dataclass(frozen=True)
class LimitsExperiment:
    """An arm, a rule, and the trials of each scenario."""

    robot: str
    chain: sk.Chain
    method: NamedMethod
    settings: LimitsSettings
    trials: dict[str, tuple[Trial, ...]]

    @property
    def cycles(self) -> int:
        """Of all trials together."""
        return sum(len(trial.commands) for trials in self.trials.values() for trial in trials)


@dataclass(frozen=True)
class Trace:
    """Time series of a trial. Sample k is the state before cycle k, and the command of cycle k."""

    experiment: LimitsExperiment
    scenario: str
    trial: Trial
    variant: str
    q: Array  #: (N + 1, n) positions; the last is the end
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
                for part in _parts(len(self.qdot))
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


@dataclass(frozen=True)
class LimitsSummary:
    """A variant in a scenario, all trials together. A figure is NaN where no sample belongs to the figure.

    Broken limits are counted per joint and cycle; worst is the largest excess of positions [rad or m], and
    the largest ratio to the limit of the others. What limits cost is measured against the rule alone in the same
    state, in the cycles where limits changed the tool's motion.
    """

    scenario: str
    variant: str
    cycles: int
    non_finite: int  #: cycles with a number that is none
    position_broken: int
    position_excess: float  #: [rad or m]
    speed_broken: int
    speed_worst: float
    acceleration_broken: int
    acceleration_worst: float
    jerk_broken: int
    jerk_worst: float
    limited: float  #: share of cycles in which limits changed the tool's motion
    taken_over: float  #: share of cycles in which limits changed the joints' motion, but not the tool's
    achieved: float  #: part of the rule's twist, along itself, over all cycles
    direction_error: float  #: [rad] angle between the rule's and the achieved velocity of the tool, median
    direction_error_worst: float  #: [rad] the same, of 95 % of these cycles
    turning_error: float  #: [rad/s] rotation that the rule did not ask for, root mean square
    acceleration_peak: float  #: [rad/s² or m/s²]
    acceleration_rms: float
    hold_error: float  #: [m] distance to the target at the end of a hold, median of the trials
    hold_angle: float  #: [rad] the same of the orientation
    rest_speed: float  #: [rad/s or m/s] root mean square of q̇ at the end of a hold
    rest_speed_peak: float  #: the largest |q̇| then
    resume_time: float  #: [s] after release until a tenth of the way back is done, the longest
    resume_speed: float  #: [rad/s or m/s] largest |q̇| in the first second after release
    returned: int  #: trials that came back to where they started, within 1 mm and 0.01 rad
    trials: int  #: trials that were to come back


def load_limits(
    robot: str,
    settings: LimitsSettings | None = None,
    method: str = "jparse",
    base: str | None = None,
    tip: str | None = None,
) -> LimitsExperiment:
    """The experiment with a shipped arm, or a URDF file. ValueError where a part is wrong."""
    settings = settings or LimitsSettings()
    for name in (
        "rate",
        "seconds",
        "pace",
        "gain_linear",
        "gain_angular",
        "max_linear_error",
        "max_angular_error",
    ):
        value = getattr(settings, name)
        if not 0.0 < value < math.inf:
            raise ValueError(f"{name} must be positive and finite, not {value:g}")
    if settings.trials < 1 or settings.seed < 0:
        raise ValueError("trials must be positive, and seed not negative")
    label, chain, home, _ = sk.robots.open(robot, base, tip)
    for name, limit in (("acceleration", settings.acceleration), ("jerk", settings.jerk)):
        if limit is not None:
            if not limit > 0.0:
                raise ValueError(f"{name} must be positive, not {limit:g}")
            chain = chain.with_limits(**{name: limit})
    trials = {
        "beyond reach": tuple(_beyond_reach(chain, home, settings)),
        "beyond limits": tuple(_beyond_limits(chain, home, settings)),
        "teleoperation": (_teleoperation(home, settings),),
    }
    return LimitsExperiment(label, chain, parse_method(method), settings, trials)


# --- the trials


def _beyond_reach(chain: sk.Chain, home: Array, settings: LimitsSettings) -> Iterator[Trial]:
    rng = np.random.default_rng([settings.seed, 1])
    sampled = (chain.random_configuration(rng) for _ in range(2000))
    reach = max(float(np.linalg.norm(chain.pose(q)[:3, 3])) for q in sampled)
    start = chain.pose(home)
    for i in range(settings.trials):
        direction = start[:3, 3] / max(1e-9, float(np.linalg.norm(start[:3, 3])))
        if i > 0:  # the first straight on, the others to the sides
            direction = direction + rng.normal(scale=0.5, size=3)
            direction /= np.linalg.norm(direction)
        counts = [_count(settings, settings.pace * s) for s in (0.5, 8.0, 5.0, 8.0)]
        far = start.copy()
        far[:3, 3] = (reach + BEYOND_REACH) * direction
        poses = np.concatenate(
            [np.broadcast_to(p, (c, 4, 4)) for p, c in zip((start, far, far, start), counts, strict=True)]
        )
        wander = slice(sum(counts[:2]), sum(counts[:3]))
        fade = np.sin(np.linspace(0.0, math.pi, counts[2]))[:, None]
        poses[wander, :3, 3] += 0.3 * fade * _noise(rng, counts[2], 3, settings.rate)
        phases = _phases(("start", "hold", "wander", "return"), counts)
        yield Trial(f"direction {i + 1}", home, poses, phases)


def _beyond_limits(chain: sk.Chain, home: Array, settings: LimitsSettings) -> Iterator[Trial]:
    rng = np.random.default_rng([settings.seed, 2])
    for joint, name in enumerate(chain.joint_names):
        for sign, limit in ((-1.0, chain.limits.lower[joint]), (1.0, chain.limits.upper[joint])):
            if not math.isfinite(limit):
                continue
            start = np.clip(home + rng.uniform(-0.2, 0.2, chain.dof), chain.limits.lower, chain.limits.upper)
            start[joint] = limit - sign * min(
                BEYOND_LIMIT, 0.25 * (chain.limits.upper[joint] - chain.limits.lower[joint])
            )
            beyond = start.copy()
            beyond[joint] = limit + sign * BEYOND_LIMIT
            counts = [_count(settings, settings.pace * s) for s in (3.0, 3.0)]
            poses = np.concatenate(
                [np.broadcast_to(chain.pose(q), (c, 4, 4)) for q, c in zip((beyond, start), counts, strict=True)]
            )
            side = "lower" if sign < 0.0 else "upper"
            yield Trial(f"{name} {side}", start, poses, _phases(("hold", "return"), counts))


def _teleoperation(home: Array, settings: LimitsSettings) -> Trial:
    rng = np.random.default_rng([settings.seed, 3])
    count = _count(settings, settings.seconds)
    twists = _noise(rng, count, 6, settings.rate)
    for rows, longest in ((slice(0, 3), SATURATION[0]), (slice(3, 6), SATURATION[1])):
        twists[:, rows] *= longest
        length = np.linalg.norm(twists[:, rows], axis=1, keepdims=True)
        twists[:, rows] /= np.maximum(1.0, length / longest)
    return Trial("twists", home, twists, _phases(("drive",), [count]))


def _noise(rng: np.random.Generator, count: int, columns: int, rate: float) -> Array:
    """Band-limited noise (count, columns), of mean 0 and variance 1, up to BAND."""
    spectrum = rng.normal(size=(count // 2 + 1, columns)) + 1j * rng.normal(size=(count // 2 + 1, columns))
    frequency = np.fft.rfftfreq(count, 1.0 / rate)
    spectrum[(frequency > max(BAND, 2.0 * rate / count)) | (frequency == 0.0)] = 0.0
    noise: Array = np.fft.irfft(spectrum, count, axis=0)
    noise /= np.maximum(noise.std(axis=0), 1e-300)
    return noise


def _count(settings: LimitsSettings, seconds: float) -> int:
    return max(4, round(seconds * settings.rate))


def _phases(names: Sequence[str], counts: Sequence[int]) -> tuple[Phase, ...]:
    ends = np.cumsum(counts)
    return tuple(Phase(n, int(e - c), int(e)) for n, c, e in zip(names, counts, ends, strict=True))


# --- the loop


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
    tip: Array = np.concatenate([experiment.chain.pose(q[:-1][p])[:, :3, 3] for p in _parts(len(qdot))])
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
    solver = sk.VelocitySolver(experiment.method.method)
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
        (slice(0, 3), settings.max_linear_error, settings.gain_linear),
        (slice(3, 6), settings.max_angular_error, settings.gain_angular),
    ):
        length = np.linalg.norm(twist[:, rows], axis=1, keepdims=True)
        twist[:, rows] *= gain / np.maximum(1.0, length / longest)
    if settings.soft_start > 0.0:
        cycle = np.arange(first + 1, first + len(twist) + 1)
        twist *= np.minimum(1.0, cycle / (settings.soft_start * settings.rate))[:, None]
    return twist


def _rule(experiment: LimitsExperiment, trial: Trial, q: Array, error: Array) -> Array:
    commands = _twists(experiment.settings, error) if trial.by_pose else trial.commands
    twists = np.empty((len(q), 6))
    for part in _parts(len(q)):
        jacobian = experiment.chain.jacobian(q[part])
        qdot = sk.solve_batch(experiment.method.method, jacobian, commands[part])
        twists[part] = np.einsum("bij,bj->bi", jacobian, qdot)
    return twists


def _parts(count: int, size: int = 10_000) -> Iterator[slice]:
    return (slice(i, min(i + size, count)) for i in range(0, count, size))


# --- figures


def shown_trial(scenario: str, trials: Sequence[Trial]) -> int:
    """Which trial of a scenario makes a picture: the second direction, the second joint's upper limit."""
    names = [trial.name for trial in trials]
    upper = [i for i, name in enumerate(names) if name.endswith("upper")]
    return upper[min(1, len(upper) - 1)] if scenario == "beyond limits" and upper else min(1, len(names) - 1)


def summarize_limits(traces: Sequence[Trace]) -> LimitsSummary:
    """All trials of one variant in one scenario."""
    first = traces[0]
    chain, rate = first.experiment.chain, first.experiment.settings.rate
    limits = chain.limits
    outside = [np.maximum(limits.lower - t.q, t.q - limits.upper) for t in traces]
    speed = [np.abs(t.qdot) / limits.velocity for t in traces]
    acceleration = [np.abs(t.acceleration) / limits.acceleration for t in traces]
    jerk = [np.abs(t.jerk) / limits.jerk for t in traces]

    limited, held = np.concatenate([t.limited for t in traces]), np.concatenate([t.held for t in traces])
    rule = np.concatenate([t.rule for t in traces])
    achieved = np.concatenate([t.achieved for t in traces])
    asked = np.linalg.norm(rule[:, :3], axis=1)
    moved = np.linalg.norm(achieved[:, :3], axis=1)
    # The direction of a velocity near zero is rounding.
    judged = limited & (asked > 1e-3) & (moved > 1e-4)
    along = np.sum(rule[:, :3] * achieved[:, :3], axis=1)[judged] / (asked * moved)[judged]
    angle = np.arccos(np.clip(along, -1.0, 1.0))
    turning = np.linalg.norm(achieved[limited, 3:] - _along(achieved, rule)[limited, 3:], axis=1)
    qddot = np.concatenate([t.acceleration for t in traces])

    holds = [t.trial.phase("hold") for t in traces]
    tails = [t.qdot[h][-max(1, (h.stop - h.start) // 4) :] for t, h in zip(traces, holds, strict=True) if h.stop]
    rest = np.concatenate(tails) if tails else np.full((1, 1), math.nan)
    held_at = [t.error[h.stop - 1] for t, h in zip(traces, holds, strict=True) if h.stop]
    returns = [(t, t.trial.phase("return")) for t in traces]
    returns = [(t, phase) for t, phase in returns if phase.stop]
    resumed = [_resume(t.error[phase], rate) for t, phase in returns]
    early = [float(np.abs(t.qdot[p][: round(rate)]).max()) for t, p in returns]
    ends = [t.error[-1] for t, _ in returns]
    return LimitsSummary(
        scenario=first.scenario,
        variant=first.variant,
        cycles=len(limited),
        non_finite=sum(int((~np.isfinite(t.q[1:]) | ~np.isfinite(t.qdot)).any(axis=1).sum()) for t in traces),
        position_broken=sum(int((o > TOLERANCE).sum()) for o in outside),
        position_excess=max(0.0, *(float(o.max()) for o in outside)),
        speed_broken=_broken(speed),
        speed_worst=max(float(x.max()) for x in speed),
        acceleration_broken=_broken(acceleration),
        acceleration_worst=max(float(x.max()) for x in acceleration),
        jerk_broken=_broken(jerk),
        jerk_worst=max(float(x.max()) for x in jerk),
        limited=float(limited.mean()),
        taken_over=float((held & ~limited).mean()),
        achieved=float(np.sum(rule * achieved) / max(np.sum(rule * rule), 1e-300)),
        direction_error=_quantile(angle, 0.5),
        direction_error_worst=_quantile(angle, 0.95),
        turning_error=float(np.sqrt(np.mean(turning**2))) if len(turning) else math.nan,
        acceleration_peak=float(np.abs(qddot).max()),
        acceleration_rms=float(np.sqrt(np.mean(qddot**2))),
        hold_error=_quantile(np.array([float(np.linalg.norm(e[:3])) for e in held_at]), 0.5),
        hold_angle=_quantile(np.array([float(np.linalg.norm(e[3:])) for e in held_at]), 0.5),
        rest_speed=float(np.sqrt(np.mean(rest**2))),
        rest_speed_peak=float(np.abs(rest).max()),
        resume_time=max(resumed, default=math.nan),
        resume_speed=max(early, default=math.nan),
        returned=sum(bool(np.linalg.norm(e[:3]) < 1e-3 and np.linalg.norm(e[3:]) < 1e-2) for e in ends),
        trials=len(ends),
    )


def _broken(ratios: Sequence[Array]) -> int:
    return sum(int((x > 1.0 + TOLERANCE).sum()) for x in ratios)


def _along(achieved: Array, rule: Array) -> Array:
    """(N, 6) the projections of the achieved twists on the rule's twists."""
    whole = np.maximum(np.sum(rule * rule, axis=1, keepdims=True), 1e-300)
    along: Array = np.sum(rule * achieved, axis=1, keepdims=True) / whole * rule
    return along


def _resume(error: Array, rate: float) -> float:
    size = np.linalg.norm(error[:, :3], axis=1) + np.linalg.norm(error[:, 3:], axis=1)
    done = np.flatnonzero(size <= 0.9 * size[0])
    return float(done[0]) / rate if len(done) else math.inf


def _quantile(values: Array, part: float) -> float:
    return float(np.quantile(values, part)) if len(values) else math.nan


# --- files


def save_traces(traces: Sequence[Trace], file: str | pathlib.Path) -> pathlib.Path:
    """An npz file of one variant in one scenario, which numpy.load(file) reads.

    Per trial i q_i (N + 1, n), qdot_i (N, n), error_i (N, 6), tip_i (N, 3), rule_i (N, 6), held_i (N,), as in
    `Trace`; trials, phases (JSON), joint_names, limits (5, n: lower, upper, velocity, acceleration, jerk),
    settings (JSON) and version.
    """
    first = traces[0]
    limits = first.experiment.chain.limits
    arrays: dict[str, NDArray[np.generic]] = {}
    for i, trace in enumerate(traces):
        for name in ("q", "qdot", "error", "tip", "rule", "held"):
            arrays[f"{name}_{i}"] = getattr(trace, name)
    arrays["trials"] = np.array([trace.trial.name for trace in traces])
    arrays["phases"] = np.array(
        json.dumps([[dataclasses.astuple(phase) for phase in trace.trial.phases] for trace in traces])
    )
    arrays["joint_names"] = np.array(first.experiment.chain.joint_names)
    arrays["limits"] = np.array(
        [limits.lower, limits.upper, limits.velocity, limits.acceleration, limits.jerk], dtype=np.float64
    )
    arrays["settings"] = np.array(json.dumps(dataclasses.asdict(first.experiment.settings)))
    arrays["version"] = np.array(sk.__version__)

    def write(stream: BinaryIO) -> None:
        np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]

    return write_atomically(pathlib.Path(file), write)
