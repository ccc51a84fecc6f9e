"""Pictures, tags and errors of a run before a rendered camera, as numbers."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from .experiment import START, Follow
from .stage import Look
from .summary import TrackSummary, largest, mean, quantile, summarize_track

__all__ = ["NEAR", "Lost", "SeenSummary", "in_view", "losses", "summarize_seen"]

#: Pictures in a row without a tag that count as a loss of the tag.
_ROW = 3
NEAR = 0.05  #: [m] from the target: the tip is back


@dataclass(frozen=True)
class Lost:
    """Pictures in a row without a tag."""

    camera: str
    method: str
    begin: float  #: [s] first picture without the tag
    end: float  #: [s] first picture with the tag again, or the end of the run
    pictures: int
    reason: str  #: the most frequent one
    largest_error: float  #: [m] of the tip, from `begin` to `end`
    back: float  #: [s] after `end` until the tip is nearer than `NEAR`; NaN: not before the next loss


@dataclass(frozen=True)
class SeenSummary:
    """One camera and one rule. A figure without samples is NaN."""

    camera: str
    method: str
    pictures: int
    found: int
    lost: int  #: times that the tag was lost
    longest: float  #: [s] of a loss
    tag_position_mean: float  #: [m] error of the tag's pose, as found
    tag_position_95: float
    tag_rotation_mean: float  #: [rad]
    tag_rotation_95: float
    tag_wrong: int  #: samples that are far off, as `Frame.outlier`
    refused: int  #: by the stream
    seen_mean: float  #: [m] error of the tip, where judged, within reach, and with the tag in the last picture
    seen_95: float
    seen_max: float
    seen_rotation: float  #: [rad] mean
    outside_mean: float  #: [m] while the target is out of reach
    unseen_mean: float  #: [m] error of the tip while the last picture had no tag
    unseen_max: float
    delay: float  #: [s] of the tip, as in `TrackSummary`
    joint_jerk_rms: float  #: [rad/s³]
    broken: int  #: limits, joints times cycles


def in_view(run: Follow, looks: Sequence[Look]) -> NDArray[np.bool_]:
    """(N,) whether the last picture before a cycle had the tag; true before the first picture."""
    stamps = np.array([look.stamp for look in looks])
    found = np.array([True, *(look.found for look in looks)])
    seen: NDArray[np.bool_] = found[np.searchsorted(stamps, run.experiment.t + 1e-9, side="right")]
    return seen


def losses(camera: str, run: Follow, looks: Sequence[Look]) -> list[Lost]:
    """When the tag was lost, in order."""
    e = run.experiment
    rate, end = e.settings.rate, len(e.poses) / e.settings.rate
    spans, at = [], 0
    for found, group in groupby(looks, key=lambda look: look.found):
        row = list(group)
        at += len(row)
        if not found and len(row) >= _ROW:
            until = looks[at].stamp if at < len(looks) else end
            spans.append((row[0].stamp, until, row))
    out = []
    for i, (begin, until, row) in enumerate(spans):
        errors = run.position_error[round(begin * rate) : max(round(begin * rate) + 1, round(until * rate))]
        after = run.position_error[round(until * rate) : round(rate * (spans[i + 1][0] if i + 1 < len(spans) else end))]
        near = np.flatnonzero(after < NEAR)
        back = float(near[0]) / rate if len(near) else math.nan
        reason = Counter(look.reason for look in row).most_common(1)[0][0]
        out.append(Lost(camera, run.variant.method.label, begin, until, len(row), reason, float(errors.max()), back))
    return out


def summarize_seen(camera: str, run: Follow, looks: Sequence[Look]) -> SeenSummary:
    """The figures of a run; with no looks, of a camera that takes no pictures."""
    e = run.experiment
    common: TrackSummary = summarize_track(run)
    seen = in_view(run, looks) & e.judged & e.reachable
    unseen = ~in_view(run, looks) & (e.t >= START)
    found = [look for look in looks if look.found]
    linear, angular = (
        np.array([getattr(look, name) for look in found]) for name in ("position_error", "rotation_error")
    )
    lost = losses(camera, run, looks)
    error = run.position_error
    return SeenSummary(
        camera=camera,
        method=common.method,
        pictures=len(looks),
        found=len(found),
        lost=len(lost),
        longest=max((x.end - x.begin for x in lost), default=0.0),
        tag_position_mean=mean(linear),
        tag_position_95=quantile(linear),
        tag_rotation_mean=mean(angular),
        tag_rotation_95=quantile(angular),
        tag_wrong=sum(frame.outlier for frame in e.frames),
        refused=common.refused,
        seen_mean=mean(error[seen]),
        seen_95=quantile(error[seen]),
        seen_max=largest(error[seen]),
        seen_rotation=mean(run.orientation_error[seen]),
        outside_mean=common.outside_mean,
        unseen_mean=mean(error[unseen]),
        unseen_max=largest(error[unseen]),
        delay=common.delay,
        joint_jerk_rms=common.joint_jerk_rms,
        broken=common.broken,
    )
