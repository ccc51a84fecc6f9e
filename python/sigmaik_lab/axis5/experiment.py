"""The axis-5 singularity of an industrial arm: closed form against constrained least squares.

The two experiments of G. Schreiber, M. Otter, G. Hirzinger, "Solving the singularity problem of non-redundant
manipulators by constraint optimization", IROS 1999, on a KUKA KR 6 R900. The tip follows a straight line with
constant orientation, one sample every dt:

1. there and back, close by the singularity. The wrist's centre stays in the plane of axis 1, and the hand is
   tilted out of this plane by the offset, so that axis 5 comes no closer to zero than the offset.
2. straight across: the arm starts with axis 5 at zero (or at the offset), and moves at right angles to the
   plane in which the wrist is.

    from sigmaik_lab.axis5.experiment import VARIANTS, Axis5Settings, motion, run
    from sigmaik_lab.axis5.summary import summarize

    tracks = [run(motion(1), variant, Axis5Settings()) for variant in VARIANTS]
    rows = [summarize(track) for track in tracks]

Units: m, rad, s.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array

__all__ = ["EXAMPLES", "ROBOT", "VARIANTS", "Axis5Settings", "Motion", "Track", "count_samples", "motion", "run"]

ROBOT = "kuka_kr6_r900"
EXAMPLES = (1, 2)

#: Variants by name, with their titles.
VARIANTS = {
    "closed": "closed form",
    "constrained": "constrained",
    "no-beta": "constrained, β = 0",
    "scaled": "time scaling",
    "scaled-exact": "scaled, all exact",
}

# The forearm is level and points ahead where axis 5 passes zero. Where the tip goes across, the forearm is raised
# by 20°, so that geometry, and not rounding, decides which way axes 4 and 6 turn.
_CLOSE_BY = (0.0, -90.0, 90.0, 90.0, 0.0, -90.0)  # [°]
_ACROSS = (0.0, -80.0, 100.0, 0.0, 0.0, 0.0)  # [°]

_MOST_SAMPLES = 200_000
_STUCK = 0.25  # [s] at a complete stop of target and joints, after which a run is given up


@dataclass(frozen=True)
class Axis5Settings:
    """The sampling and the weights. None stands for a value that depends on dt, see the properties."""

    dt: float = 4e-3  #: [s] from one sample to the next
    rest: float = 0.3  #: [s] the target stands still after the motion, so that the remaining error decays
    beta: float | None = None  #: weight of the error's change in a sample
    gamma: float | None = None  #: weight of the time scaling
    max_error: float | None = math.radians(3.0)  #: [rad] largest orientation error, each axis; None: any
    iterations: int = 2  #: linearisations a sample

    @property
    def error_rate_weight(self) -> float:
        """β. By default 5 at 1 ms, ∝ 1/√dt: an error decays to 1/e in about β² samples, which is 25 ms."""
        return 5.0 * math.sqrt(1e-3 / self.dt) if self.beta is None else self.beta

    @property
    def time_scaling_weight(self) -> float:
        """γ. By default 0.005 at 4 ms and ∝ √dt."""
        return 0.005 * math.sqrt(self.dt / 4e-3) if self.gamma is None else self.gamma


@dataclass(frozen=True)
class Motion:
    """A straight line of the tip, at constant orientation, and where the arm starts."""

    example: int  #: 1 or 2
    chain: sk.Chain
    start: Array  #: (6,) [rad]
    pose: Array  #: (4, 4) tip in base at the start
    direction: Array  #: (3,) of length 1, base axes
    distance: float  #: [m] from one end to the other
    duration: float  #: [s] from one end to the other
    offset: float  #: [rad] of axis 5 from zero, where it is closest
    back: bool  #: whether the tip moves back again, in the same time

    @property
    def total(self) -> float:
        """[s]"""
        return 2.0 * self.duration if self.back else self.duration

    def target(self, t: float) -> Array:
        """Pose (4, 4) after t [s]: fifth-order in time, at rest at each end."""
        u = min(max(t / self.duration, 0.0), 2.0 if self.back else 1.0)
        u = 2.0 - u if u > 1.0 else u
        pose = self.pose.copy()
        pose[:3, 3] += self.distance * u**3 * (10.0 - 15.0 * u + 6.0 * u * u) * self.direction
        return pose


@dataclass(frozen=True)
class Track:
    """Time series of a variant. Sample 0 is the start, at rest; sample k is k dt later."""

    motion: Motion
    settings: Axis5Settings
    variant: str  #: a key of VARIANTS
    finished: bool  #: whether the end was reached; time scaling may come to a complete stop
    clock: Array  #: (N,) [s] the target's own time, which is t where time is not scaled
    q: Array  #: (N, 6) [rad]
    error: Array  #: (N, 6) [m, rad] tip minus target, base axes
    path_error: Array  #: (N, 6) the same, against the target slowed down by ϑ
    time_scale: Array  #: (N,) ϑ
    optimised: NDArray[np.bool_]  #: (N,) from the optimisation, not from the closed form
    error_active: NDArray[np.bool_]  #: (N,) max_error is active, or cannot be met
    exact_met: NDArray[np.bool_]  #: (N,) the exact part's equations hold

    @property
    def t(self) -> Array:
        """(N,) [s]"""
        t: Array = np.arange(len(self.q), dtype=np.float64) * self.settings.dt
        return t

    @property
    def qdot(self) -> Array:
        """(N, 6) [rad/s] over the sample before."""
        speed: Array = np.diff(self.q, axis=0, prepend=self.q[:1]) / self.settings.dt
        return speed

    @property
    def qddot(self) -> Array:
        """(N, 6) [rad/s²], change of speed from the sample before."""
        acceleration: Array = np.diff(self.qdot, axis=0, prepend=np.zeros((1, 6))) / self.settings.dt
        return acceleration

    @property
    def position_error(self) -> Array:
        """(N,) [m] of the path: against the target slowed down by ϑ."""
        norm: Array = np.linalg.norm(self.path_error[:, :3], axis=1)
        return norm

    @property
    def orientation_error(self) -> Array:
        """(N,) [rad] of the path."""
        norm: Array = np.linalg.norm(self.path_error[:, 3:], axis=1)
        return norm


def motion(
    example: int, distance: float | None = None, duration: float | None = None, offset: float | None = None
) -> Motion:
    """Example 1 or 2.

    distance, duration: [m, s] from one end of the line to the other
    offset: [rad] of axis 5 from the singularity, where it is closest (1), or at the start (2)
    ValueError where a value is out of range, or an end of the line out of reach.
    """
    if example not in EXAMPLES:
        raise ValueError(f"example must be 1 or 2, not {example}")
    first = example == 1
    distance = 0.2 if distance is None else distance
    duration = (2.0 if first else 0.5) if duration is None else duration
    offset = (math.radians(1.0) if first else 0.0) if offset is None else offset
    for name, value in (("distance", distance), ("duration", duration)):
        if not 0.0 < value < math.inf:
            raise ValueError(f"{name} must be positive and finite, not {value:g}")
    if not 0.0 <= offset <= 0.5:
        raise ValueError(f"offset must be from 0° to {math.degrees(0.5):.1f}°")

    chain = sk.robots.load(ROBOT)
    q = np.radians(_CLOSE_BY if first else _ACROSS)
    q[4] = offset
    pose = chain.pose(q)
    if not first:
        return Motion(example, chain, q, pose, np.array([0.0, 1.0, 0.0]), distance, duration, offset, False)
    # The line leads down from half the distance above; the closed form moves the arm there, on the same branch.
    closed = sk.AnalyticIk(chain)
    pose[2, 3] += 0.5 * distance
    for left in np.linspace(0.5, 0.0, 501):
        here = pose.copy()
        here[2, 3] -= distance * left
        q = _closed_form(closed, here, q)
    down = np.array([0.0, 0.0, -1.0])
    return Motion(example, chain, q, pose, down, distance, duration, offset, True)


def run(motion: Motion, variant: str, settings: Axis5Settings, progress: Callable[[int], None] | None = None) -> Track:
    """Follows the target by one of VARIANTS.

    progress: called with the number of samples done since the last call
    ValueError where the variant is unknown or a setting out of range, or the target gets out of reach.
    """
    if variant not in VARIANTS:
        raise ValueError(f"no variant '{variant}'; there are {', '.join(VARIANTS)}")
    dt, samples = settings.dt, count_samples(motion, settings)
    recorder = _Recorder(motion, settings, variant)
    if variant == "closed":
        closed = sk.AnalyticIk(motion.chain)
        q = motion.start
        for k in range(1, samples + 1):
            target = motion.target(k * dt)
            q = _closed_form(closed, target, q)
            error = -sk.pose_error(motion.chain.pose(q), target)
            recorder.add(k * dt, q, error, error)
            if progress is not None and k % 100 == 0:
                progress(100)
        if progress is not None:
            progress(samples % 100)
        return recorder.track(True)

    ik = _solver(motion, variant, settings)
    ik.reset(motion.start)
    clock, standing, k = 0.0, 0.0, 0
    while k < _MOST_SAMPLES and standing < _STUCK and clock < (samples - 0.5) * dt:
        k += 1
        step = ik.update(motion.target(clock + dt))
        clock = clock + (1.0 - step.time_scale) * dt if step.time_scale > 0.0 else clock + dt
        stands = step.time_scale > 1.0 - 1e-6 and bool(np.all(np.abs(step.qdot) < 1e-6))
        standing = standing + dt if stands else 0.0
        recorder.add(clock, step.q, step.error, step.path_error, step)
        if progress is not None and k % 100 == 0:
            progress(100)
    if progress is not None:
        progress(k % 100)
    return recorder.track(clock >= (samples - 0.5) * dt)


def count_samples(motion: Motion, settings: Axis5Settings) -> int:
    """Samples of the motion and the rest, without time scaling. ValueError where dt or rest is out of range."""
    for name, value in (("dt", settings.dt), ("rest", settings.rest)):
        if not 0.0 < value < math.inf:
            raise ValueError(f"{name} must be positive and finite, not {value:g}")
    samples = max(1, math.ceil((motion.total + settings.rest) / settings.dt - 1e-9))
    if samples > _MOST_SAMPLES:
        raise ValueError(f"{samples} samples are too many; {_MOST_SAMPLES} at most")
    return samples


def _solver(motion: Motion, variant: str, settings: Axis5Settings) -> sk.ConstrainedIk:
    scaled = variant in ("scaled", "scaled-exact")
    whole = variant == "scaled-exact"
    max_error = settings.max_error
    return sk.ConstrainedIk(
        motion.chain,
        settings.dt,
        exact=(1.0,) * 6 if whole else (1.0, 1.0, 1.0, 0.0, 0.0, 0.0),
        beta=0.0 if variant == "no-beta" else settings.error_rate_weight,
        gamma=settings.time_scaling_weight if scaled else None,
        max_error=None if max_error is None else (math.inf,) * 3 + (max_error,) * 3,
        iterations=settings.iterations,
    )


def _closed_form(closed: sk.AnalyticIk, target: Array, q: Array) -> Array:
    nearest = closed.nearest(target, q)
    if nearest is None:
        x, y, z = target[:3, 3]
        raise ValueError(f"the line leaves the arm's reach at ({x:.3f}, {y:.3f}, {z:.3f}) m")
    return nearest


class _Recorder:
    def __init__(self, motion: Motion, settings: Axis5Settings, variant: str) -> None:
        self._of = (motion, settings, variant)
        self._clock, self._q = [0.0], [motion.start]
        self._error, self._path_error = [np.zeros(6)], [np.zeros(6)]
        self._scale, self._optimised = [0.0], [False]
        self._error_active, self._exact_met = [False], [True]

    def add(
        self,
        clock: float,
        q: Array,
        error: Array,
        path_error: Array,
        step: sk.ConstrainedIkStep | None = None,
    ) -> None:
        self._clock.append(clock)
        self._q.append(q)
        self._error.append(error)
        self._path_error.append(path_error)
        self._scale.append(0.0 if step is None else step.time_scale)
        self._optimised.append(step is not None and step.used == "optimised")
        self._error_active.append(step is not None and step.error_active)
        self._exact_met.append(step is None or step.exact_met)

    def track(self, finished: bool) -> Track:
        motion, settings, variant = self._of
        return Track(
            motion,
            settings,
            variant,
            finished,
            np.array(self._clock),
            np.array(self._q),
            np.array(self._error),
            np.array(self._path_error),
            np.array(self._scale),
            np.array(self._optimised),
            np.array(self._error_active),
            np.array(self._exact_met),
        )
