"""Arrivals of a servo, as numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .experiment import ON_TIME, Arrivals

__all__ = ["ArrivalSummary", "summarize_arrivals"]


@dataclass(frozen=True)
class ArrivalSummary:
    """A servo and an arm, all trials together."""

    robot: str
    targets: str
    servo: str
    trials: int
    arrived: float  #: share of trials in which the tip arrived and stayed
    on_time: float  #: share of trials in which the tip arrived within `ON_TIME`
    led: float  #: share of trials in which the guide led the joints away from the tool's own way
    least_time: float  #: [s] the median of the least times of the joints; inf: most targets are out of reach
    median_time: float  #: [s] in which half of all trials had arrived; inf: fewer arrived
    time_90: float  #: [s] the same for 90 % of all trials
    at_rest: float  #: share of trials at whose end all joints rest
    end_speed: float  #: [rad/s or m/s] the fastest joint at the end of any trial
    excess: float  #: the largest excess over any limit, a part of the limit, or rad or m; 0: every limit was held
    over: float  #: the same, over limits of position, velocity and jerk alone
    jump: float  #: the largest change of q̇ in one cycle, as a part of what the acceleration limits allow
    departure: float  #: [m] the tool's largest distance from the line between start and target, median of the trials
    end_error: float  #: [m] the position error at the end, median of the trials
    cycle: float  #: [s] the mean wall time of an update, median of the trials
    failed: float  #: share of trials in which the servo raised an error; these have not arrived


def summarize_arrivals(robot: str, targets: str, servo: str, done: Arrivals) -> ArrivalSummary:
    times = np.sort(done.time)
    n = len(times)
    return ArrivalSummary(
        robot=robot,
        targets=targets,
        servo=servo,
        trials=n,
        arrived=float(np.isfinite(times).mean()),
        on_time=float(
            (done.time <= np.maximum(ON_TIME[0], ON_TIME[1] * np.where(done.least < np.inf, done.least, 0.0))).mean()
        ),
        led=float(done.led.mean()),
        least_time=float(np.sort(done.least)[(n - 1) // 2]),
        median_time=float(times[(n - 1) // 2]),
        time_90=float(times[min(n - 1, int(np.ceil(0.9 * n)) - 1)]),
        at_rest=float(done.rest.mean()),
        end_speed=float(done.speed.max()),
        excess=float(done.excess.max()),
        over=float(done.over.max()),
        jump=float(done.jump.max()),
        departure=float(np.median(done.departure)),
        end_error=float(np.median(done.position)),
        cycle=float(np.median(done.cycle)),
        failed=float(done.failed.mean()),
    )
