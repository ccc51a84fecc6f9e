"""Commands that lead an arm to its limits: targets beyond reach and beyond joint limits, and random twists."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

import sigmaik as sk
from sigmaik._types import Array

__all__ = ["LimitsSettings", "Phase", "Trial", "beyond_limits", "beyond_reach", "shown_trial", "teleoperation"]

BEYOND_REACH = 0.5  #: [m]
#: [rad or m] distance from the joint limit: of the start inside the limit, and of the target's configuration beyond it.
BEYOND_LIMIT = 0.3
SATURATION = (0.5, 1.5)  #: [m/s, rad/s] longest twists of the teleoperation
BAND = 1.0  #: [Hz] the highest frequency of a hand's commands


@dataclass(frozen=True)
class LimitsSettings:
    """Rate, gains and duration of the loop, and limits that replace those of the arm."""

    rate: float = 1000.0  #: [Hz]
    trials: int = 3  #: directions that the target out of reach is tried in
    seconds: float = 60.0  #: of teleoperation
    pace: float = 1.0  #: factor on the times of the other scenarios
    seed: int = 0
    gain_linear: float = 10.0  #: [1/s] position error to velocity
    gain_angular: float = 10.0  #: [1/s] orientation error to angular velocity
    max_linear_error: float | None = None  #: [m] longer errors are shortened to this length; None: the servo's
    max_angular_error: float = 1.0  #: [rad]
    #: [m] 1 rad weighs as much as this length, for the rule with limits and without; None: the arm's own.
    length_scale: float | None = None
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


def shown_trial(scenario: str, trials: Sequence[Trial]) -> int:
    """Which trial of a scenario makes a picture: the second direction, the second joint's upper limit."""
    names = [trial.name for trial in trials]
    upper = [i for i, name in enumerate(names) if name.endswith("upper")]
    return upper[min(1, len(upper) - 1)] if scenario == "beyond limits" and upper else min(1, len(names) - 1)


def beyond_reach(chain: sk.Chain, home: Array, settings: LimitsSettings) -> Iterator[Trial]:
    """A target out of reach in several directions: held, wandering, and back."""
    rng = np.random.default_rng([settings.seed, 1])
    sampled = (chain.random_configuration(rng) for _ in range(2000))
    reach = max(float(np.linalg.norm(chain.pose(q)[:3, 3])) for q in sampled)
    start = chain.pose(home)
    for i in range(settings.trials):
        direction = start[:3, 3] / max(1e-9, float(np.linalg.norm(start[:3, 3])))
        if i > 0:  # the first direction is straight on, the others lead to the sides
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


def beyond_limits(chain: sk.Chain, home: Array, settings: LimitsSettings) -> Iterator[Trial]:
    """The pose of a configuration beyond each joint limit, and back."""
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


def teleoperation(home: Array, settings: LimitsSettings) -> Trial:
    """Random twists, band-limited and saturating."""
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
