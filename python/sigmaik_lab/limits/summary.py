"""Limits broken by a variant, and the cost of its limits, as numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sigmaik._types import Array

from .experiment import Trace

__all__ = ["LimitsSummary", "summarize_limits"]

#: An excess below this part of the limit is the rounding of finite differences.
TOLERANCE = 1e-7


@dataclass(frozen=True)
class LimitsSummary:
    """A variant in a scenario, all trials together. A figure is NaN where no sample belongs to the figure.

    Broken limits are counted per joint and cycle; worst is the largest excess of positions [rad or m], and
    the largest ratio to the limit of the others. The cost of limits is measured against the rule alone in the same
    state, in the cycles where limits changed the tool's motion.
    """

    scenario: str
    variant: str
    cycles: int
    non_finite: int  #: cycles with a number that is not finite
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
    direction_error_worst: float  #: [rad] the same angle, which 95 % of these cycles do not exceed
    turning_error: float  #: [rad/s] rotation that the rule did not ask for, root mean square
    acceleration_peak: float  #: [rad/s² or m/s²]
    acceleration_rms: float
    hold_error: float  #: [m] distance to the target at the end of a hold, median of the trials
    hold_angle: float  #: [rad] the same for the orientation
    rest_speed: float  #: [rad/s or m/s] root mean square of q̇ at the end of a hold
    rest_speed_peak: float  #: the largest |q̇| then
    resume_time: float  #: [s] after release until a tenth of the way back is done, the longest
    resume_speed: float  #: [rad/s or m/s] largest |q̇| in the first second after release
    returned: int  #: trials that came back to where they started, within 1 mm and 0.01 rad
    trials: int  #: trials that were to come back


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
