"""Sums of rollouts: how often each phase is passed, limits, and how well the arm follows the actions."""

from __future__ import annotations

import math
import pathlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from .episode import FPS, PHASES
from .rollout import DEMONSTRATOR, Rollout, Rollouts

__all__ = ["ALL_SEEDS", "Summary", "grouped", "interval", "summaries", "summarize"]

#: The name of all trained policies together.
ALL_SEEDS = "policies"


@dataclass(frozen=True)
class Summary:
    """Of all scenes of a policy under a rule."""

    policy: str
    rule: str
    region: str
    scenes: int
    approach: int  #: scenes in which the phase was passed
    grasp: int
    carry: int
    place: int  #: the cup stands at the goal
    lost: int  #: scenes in which the cup fell
    limits_broken: int  #: cycles beyond a limit, of all scenes
    median_time: float  #: [s] of the scenes that succeed
    lag: float  #: [m/s] root of the mean square of asked minus achieved linear velocity
    least_sigma: float  #: median over the scenes of the smallest σ_min/σ_max


def grouped(files: Iterable[Rollouts]) -> dict[tuple[str, str, str], list[Rollout]]:
    """(policy, rule, region) to the rollouts; where there are several trained policies, then those of all together."""
    groups: dict[tuple[str, str, str], dict[int, Rollout]] = {}
    for done in files:
        piece = done.piece
        key = (pathlib.Path(piece.policy).stem, piece.rule or "default", piece.region)
        groups.setdefault(key, {}).update({r.seed: r for r in done.rollouts})
    found = {key: [scenes[seed] for seed in sorted(scenes)] for key, scenes in groups.items()}
    trained = {policy for policy, _, _ in found if policy != DEMONSTRATOR}
    if len(trained) > 1:
        for policy, rule, region in list(found):
            if policy in trained:
                found.setdefault((ALL_SEEDS, rule, region), []).extend(found[policy, rule, region])
    return found


def summarize(key: tuple[str, str, str], rollouts: Sequence[Rollout]) -> Summary:
    approach, grasp, carry = (sum(r.reached > k for r in rollouts) for k in range(len(PHASES) - 1))
    times = [r.steps / FPS for r in rollouts if r.success]
    apart = np.concatenate([r.asked[:, :3] - r.achieved[:, :3] for r in rollouts])
    return Summary(
        *key,
        scenes=len(rollouts),
        approach=approach,
        grasp=grasp,
        carry=carry,
        place=sum(r.success for r in rollouts),
        lost=sum(r.lost for r in rollouts),
        limits_broken=sum(r.limits_broken for r in rollouts),
        median_time=float(np.median(times)) if times else math.nan,
        lag=float(np.sqrt(np.mean(np.sum(apart**2, axis=1)))),
        least_sigma=float(np.median([r.sigma.min() for r in rollouts])),
    )


def summaries(files: Iterable[Rollouts], order: Sequence[str]) -> list[Summary]:
    """Of all groups, by region and policy; rules in this order, and others after them."""
    found = [summarize(key, rollouts) for key, rollouts in grouped(files).items()]
    last = {ALL_SEEDS: 1, DEMONSTRATOR: 2}

    def place(s: Summary) -> tuple[object, ...]:
        rule = order.index(s.rule) if s.rule in order else len(order)
        return s.region, last.get(s.policy, 0), s.policy, rule, s.rule

    return sorted(found, key=place)


def interval(good: int, number: int) -> tuple[float, float]:
    """The 95 % interval of a rate by Wilson's formula."""
    z = 1.959964
    middle = (good + 0.5 * z * z) / (number + z * z)
    half = z * math.sqrt(good * (number - good) / number + 0.25 * z * z) / (number + z * z)
    return max(0.0, middle - half), min(1.0, middle + half)
