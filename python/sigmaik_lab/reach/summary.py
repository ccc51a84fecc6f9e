"""Errors, speeds and times of a run, per waypoint."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .experiment import Run

__all__ = ["Summary", "summarize"]

#: The last second of a waypoint shows whether the arm has come to rest.
REST = 1.0


@dataclass(frozen=True)
class Summary:
    """One method at one waypoint, or in one cycle of a moving target."""

    method: str
    velocity_limits: bool
    waypoint: str
    position_error: float  #: settled, at the waypoint's end [m]
    orientation_error: float  #: settled, at the waypoint's end [rad]
    max_joint_speed: float  #: largest |q̇| of all joints on the way [rad/s, or m/s]
    max_speed_ratio: float  #: largest |q̇|/limit of all joints on the way; 0 where the arm has no limits
    min_inverse_condition: float  #: smallest σ_min/σ_max on the way
    settling_time: float  #: [s], see `settling_time`; NaN where the error does not settle
    rest_speed: float  #: largest |q̇| in the waypoint's last second [rad/s, or m/s]
    max_position_error: float  #: on the way [m]
    max_orientation_error: float  #: on the way [rad]
    max_deviation: float  #: largest distance from the path's line [m]; NaN where the path has no line
    rms_deviation: float  #: root mean square of this distance [m]


def summarize(run: Run) -> list[Summary]:
    """One Summary per segment of the path."""
    rows = []
    rate = run.experiment.settings.rate
    for i, segment in enumerate(run.experiment.path.segments):
        here = run.segment == i
        position, orientation = run.position_error[here], run.orientation_error[here]
        speed = run.joint_speed[here]
        deviation = None if run.deviation is None else run.deviation[here]
        rows.append(
            Summary(
                method=run.method.label,
                velocity_limits=run.velocity_limits,
                waypoint=segment.name,
                position_error=float(position[-1]),
                orientation_error=float(orientation[-1]),
                max_joint_speed=float(speed.max()),
                max_speed_ratio=float((np.abs(run.qdot[here]) / run.experiment.chain.limits.velocity).max()),
                min_inverse_condition=float(run.inverse_condition[here].min()),
                settling_time=settling_time(position, orientation, rate),
                rest_speed=float(speed[-max(1, round(REST * rate)) :].max()),
                max_position_error=float(position.max()),
                max_orientation_error=float(orientation.max()),
                max_deviation=math.nan if deviation is None else float(deviation.max()),
                rms_deviation=math.nan if deviation is None else float(np.sqrt(np.mean(deviation**2))),
            )
        )
    return rows


def settling_time(position: NDArray[np.float64], orientation: NDArray[np.float64], rate: float) -> float:
    """Time [s] after which both errors stay near their last values; NaN where this time is in the last second.

    Near means within 2 % of the largest error on the way, but at least within 1 mm and 0.01 rad.

    position, orientation: errors (N,) [m, rad] from the waypoint's start, at the given rate [Hz]
    """
    away = np.zeros(len(position), dtype=bool)
    for error, least in ((position, 1e-3), (orientation, 1e-2)):
        away |= np.abs(error - error[-1]) > max(least, 0.02 * float(error.max()))
    settled = float(np.flatnonzero(away)[-1] + 1) if away.any() else 0.0
    return settled / rate if settled <= len(position) - REST * rate else math.nan
