"""Limits, errors and smoothness of a track, as numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sigmaik._types import Array

from .experiment import Track

__all__ = ["Summary", "summarize"]


@dataclass(frozen=True)
class Summary:
    """One variant. A tuple has one number for each joint."""

    variant: str
    finished: bool
    duration: float  #: [s] until the target's end is reached, without the rest
    speed_ratio: tuple[float, ...]  #: largest |q̇|/limit
    acceleration_ratio: tuple[float, ...]  #: largest |q̈|/limit
    speed_beyond: int  #: samples with |q̇| beyond a limit by more than 1e-9 of the limit, summed over the joints
    acceleration_beyond: int  #: the same of |q̈|
    at_limit: float  #: [s] with a joint within 1e-6 of its speed or acceleration limit, or beyond
    max_position_error: float  #: [m] of the path
    max_orientation_error: float  #: [rad] of the path
    last_orientation_error: float  #: [rad] of the path, at the end
    largest_step: tuple[float, ...]  #: [rad] in one sample
    reversals: tuple[int, ...]  #: changes of q̈'s sign, where |q̈| is above 1 % of its limit
    speed_variation: tuple[float, ...]  #: [rad/s] total variation of q̇
    rms_jerk: tuple[float, ...]  #: [rad/s³] root of the mean square
    optimised: float  #: share of samples
    switches: int  #: between closed form and optimisation
    first_switch: float  #: [s] first optimised sample; NaN where there is none
    last_switch: float  #: [s] last optimised sample
    max_time_scale: float  #: largest ϑ
    error_active: int  #: samples at the largest error allowed, or beyond
    exact_missed: int  #: samples in which the exact part's equations do not hold


def summarize(track: Track) -> Summary:
    """Limits, errors and smoothness of a track, as numbers."""
    limits, dt, t = track.motion.chain.limits, track.settings.dt, track.t
    speed, acceleration = np.abs(track.qdot), np.abs(track.qddot)
    speeds, accelerations = speed / limits.velocity, acceleration / limits.acceleration
    jerk = np.diff(track.qddot, axis=0) / dt
    reversals = []
    for j, limit in enumerate(limits.acceleration):
        large = track.qddot[acceleration[:, j] > 0.01 * limit, j]
        reversals.append(int(np.count_nonzero(np.diff(np.signbit(large)))))
    optimised = np.flatnonzero(track.optimised)
    arrived = np.flatnonzero(track.clock >= track.motion.total - 1e-9)
    near = (speeds >= 1.0 - 1e-6) | (accelerations >= 1.0 - 1e-6)
    return Summary(
        variant=track.variant,
        finished=track.finished,
        duration=float(t[arrived[0]]) if len(arrived) else math.inf,
        speed_ratio=_numbers(speeds.max(axis=0)),
        acceleration_ratio=_numbers(accelerations.max(axis=0)),
        speed_beyond=int(np.count_nonzero(speeds > 1.0 + 1e-9)),
        acceleration_beyond=int(np.count_nonzero(accelerations > 1.0 + 1e-9)),
        at_limit=dt * int(np.count_nonzero(near.any(axis=1))),
        max_position_error=float(track.position_error.max()),
        max_orientation_error=float(track.orientation_error.max()),
        last_orientation_error=float(track.orientation_error[-1]),
        largest_step=_numbers(np.abs(np.diff(track.q, axis=0)).max(axis=0)),
        reversals=tuple(reversals),
        speed_variation=_numbers(np.abs(np.diff(track.qdot, axis=0)).sum(axis=0)),
        rms_jerk=_numbers(np.sqrt(np.mean(jerk**2, axis=0))),
        optimised=float(np.mean(track.optimised[1:])),
        switches=int(np.count_nonzero(np.diff(track.optimised[1:]))),
        first_switch=float(t[optimised[0]]) if len(optimised) else math.nan,
        last_switch=float(t[optimised[-1]]) if len(optimised) else math.nan,
        max_time_scale=float(track.time_scale.max()),
        error_active=int(np.count_nonzero(track.error_active)),
        exact_missed=int(np.count_nonzero(~track.exact_met)),
    )


def _numbers(values: Array) -> tuple[float, ...]:
    return tuple(float(v) for v in values)
