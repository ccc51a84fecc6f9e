"""Errors, motion and events of a variant, as numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sigmaik._types import Array

from .experiment import Follow

__all__ = ["TrackSummary", "largest", "mean", "quantile", "summarize_track"]

BACK = 0.1  #: [m] from the target: a tip this near is back, whatever its lag is
#: An excess below this part of the limit is the rounding of finite differences.
TOLERANCE = 1e-7


@dataclass(frozen=True)
class TrackSummary:
    """One variant. A figure without samples is NaN. Errors are against the true target, where judged."""

    method: str
    mode: str
    feedforward: bool
    position_mean: float  #: [m] within reach
    position_95: float  #: [m] the error is less than this for 95 % of the time
    position_max: float
    orientation_mean: float  #: [rad] within reach
    orientation_95: float
    orientation_max: float
    outside_mean: float  #: [m] while the target is out of reach
    outside_max: float
    return_time: float  #: [s] after the target is back within reach, until the tip stays near; the longest
    delay: float  #: [s] by which the tip's velocity is most like the target's, within reach
    tip_jerk_rms: float  #: [m/s³]
    tip_jerk_max: float
    joint_jerk_rms: float  #: [rad/s³]
    joint_jerk_max: float
    broken: int  #: limits, joints times cycles
    asked_speed: float  #: part of the joints' velocity limits that the target asks for within reach
    speed: float  #: the largest part of a joint's limit
    acceleration: float
    jerk: float
    margin: float  #: [rad or m] the least distance from a position limit
    accepted: int  #: samples
    refused: int  #: outliers, late samples, and samples that are no pose
    wrong: int  #: outliers that came; 0 in "true"
    moved_by_outliers: float  #: [m] largest distance of the tip from the run without outliers; NaN without this run
    drift: float  #: [m] of the tip in the gap, from half a second after the stream is stale


def summarize_track(run: Follow, without: Follow | None = None) -> TrackSummary:
    """A variant's figures. without: the same variant without outliers."""
    e, chain = run.experiment, run.experiment.chain
    limits = chain.limits
    inside, outside = e.judged & e.reachable, e.judged & ~e.reachable
    position, orientation = run.position_error, run.orientation_error
    ratios = [np.abs(run.qdot) / limits.velocity, np.abs(run.acceleration) / limits.acceleration]
    ratios.append(np.abs(run.jerk) / limits.jerk)
    margin = np.minimum(run.q - limits.lower, limits.upper - run.q)
    broken = sum(int((ratio > 1.0 + TOLERANCE).sum()) for ratio in ratios) + int((margin < -TOLERANCE).sum())
    frames = e.frames if run.variant.outliers else [f for f in e.frames if not f.outlier]
    return TrackSummary(
        method=run.variant.method.label,
        mode=run.variant.mode,
        feedforward=run.variant.feedforward,
        position_mean=mean(position[inside]),
        position_95=quantile(position[inside]),
        position_max=largest(position[inside]),
        orientation_mean=mean(orientation[inside]),
        orientation_95=quantile(orientation[inside]),
        orientation_max=largest(orientation[inside]),
        outside_mean=mean(position[outside]),
        outside_max=largest(position[outside]),
        return_time=_return_time(run),
        delay=_delay(run),
        tip_jerk_rms=float(np.sqrt(np.mean(run.tip_jerk**2))),
        tip_jerk_max=float(run.tip_jerk.max()),
        joint_jerk_rms=float(np.sqrt(np.mean(run.jerk**2))),
        joint_jerk_max=float(np.abs(run.jerk).max()),
        broken=broken,
        asked_speed=e.asked_speed,
        speed=float(ratios[0].max()),
        acceleration=float(ratios[1].max()),
        jerk=float(ratios[2].max()),
        margin=float(margin.min()),
        accepted=run.counts["accepted"],
        refused=run.counts["outliers"] + run.counts["out_of_order"] + run.counts["invalid"],
        wrong=0 if run.variant.mode == "true" else sum(frame.outlier for frame in frames),
        moved_by_outliers=math.nan
        if without is None
        else float(np.linalg.norm(run.tips[:, :3, 3] - without.tips[:, :3, 3], axis=1).max()),
        drift=_drift(run),
    )


def _delay(run: Follow) -> float:
    """[s] the lag of the largest correlation of both velocities, by a parabola through three values around it."""
    e = run.experiment
    rate = e.settings.rate
    stride = max(1, round(rate / 200.0))  # 200 Hz are enough
    target = np.diff(e.poses[::stride, :3, 3], axis=0)
    tip = np.diff(run.tips[:-1:stride, :3, 3], axis=0)
    counts = (e.judged & e.reachable)[::stride][:-1]
    longest = round(0.8 * rate / stride)
    lags = np.arange(-longest // 8, longest + 1)
    n = len(target)
    likeness = np.full(len(lags), -1.0)
    for i, lag in enumerate(lags.tolist()):
        a, b = max(0, -lag), min(n, n - lag)
        both = counts[a:b] & counts[a + lag : b + lag]
        x, y = target[a:b][both], tip[a + lag : b + lag][both]
        size = math.sqrt(float(np.sum(x * x) * np.sum(y * y)))
        if size > 0.0:
            likeness[i] = float(np.sum(x * y)) / size
    best = int(np.argmax(likeness))
    if not 0 < best < len(lags) - 1 or likeness[best] <= 0.0:
        return math.nan
    before, at, after = (float(x) for x in likeness[best - 1 : best + 2])
    bend = before - 2.0 * at + after
    offset = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return (float(lags[best]) + offset) * stride / rate


def _return_time(run: Follow) -> float:
    e = run.experiment
    error, rate = run.position_error, e.settings.rate
    times = [math.nan]
    for k in e.back:
        # Until the target leaves again, or the stream stops, 5 s at most.
        until = next(
            (
                j
                for j in range(k, min(len(error), k + round(5.0 * rate)))
                if not e.reachable[j] or j == round(e.gap[0] * rate)
            ),
            None,
        )
        part = error[k : k + round(5.0 * rate) if until is None else until]
        away = np.flatnonzero(part > BACK)
        times.append((int(away[-1]) + 1) / rate if len(away) else 0.0)
    return float(np.nanmax(times)) if len(times) > 1 else math.nan


def _drift(run: Follow) -> float:
    """[m] how far the tip goes in the gap, from half a second after the stream is stale."""
    e = run.experiment
    if run.variant.mode == "true":
        return math.nan
    stopped = run.stale & (e.t >= e.gap[0]) & (e.t < e.gap[1])
    at = np.flatnonzero(stopped)[round(0.5 * e.settings.rate) :]
    if len(at) == 0:
        return math.nan
    return float(np.linalg.norm(run.tips[at, :3, 3] - run.tips[at[0], :3, 3], axis=1).max())


def mean(values: Array) -> float:
    """NaN where there are no values, as for the two below."""
    return float(values.mean()) if len(values) else math.nan


def quantile(values: Array) -> float:
    """Below which 95 % of the values are."""
    return float(np.quantile(values, 0.95)) if len(values) else math.nan


def largest(values: Array) -> float:
    """The largest value."""
    return float(values.max()) if len(values) else math.nan
