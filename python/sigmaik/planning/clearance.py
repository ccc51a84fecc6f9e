"""How near a motion comes to singularities, between its nodes too: a grid can step over a singular set unseen.

A set of codimension 1, a wall in the joints' space, has a signed residual. Where it differs in sign between start and
goal, every path crosses the wall: such a crossing is unavoidable. One of an even number of crossings is not, and
nothing of higher codimension is: there is a way round.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from sigmaik._types import Array

if TYPE_CHECKING:
    from sigmaik import Chain
    from sigmaik.singularities import SingularSets

__all__ = ["Clearance", "Crossing", "clearance"]


@dataclass(frozen=True)
class Crossing:
    """A motion that goes through a singular set, or so near by that the set's potential does not tell the
    difference."""

    name: str
    """Of the set."""
    t: float
    """[s]"""
    q: Array = field(repr=False)
    """(n,) there"""
    psi: float
    """ψ there: 0 on the set."""
    avoidable: bool
    """Whether a path from start to goal can do without."""


@dataclass(frozen=True)
class Clearance:
    """Singularity along a motion, sampled densely."""

    t: Array = field(repr=False)
    """(M,) [s]"""
    manipulability: Array = field(repr=False)
    """(M,) √det(JJᵀ)"""
    names: tuple[str, ...]
    """Of the singular sets that are known; empty where none are."""
    psi: Array = field(repr=False)
    """(M, c) ψ of every set: 0 on it."""
    crossings: tuple[Crossing, ...]
    """In the order of time."""

    @property
    def min_manipulability(self) -> float:
        """The smallest √det(JJᵀ) of all samples."""
        return float(self.manipulability.min())

    @property
    def nearest_set(self) -> str | None:
        """The set with the smallest ψ; None where no sets are known."""
        return self.names[int(self.psi.min(axis=0).argmin())] if self.names else None

    @property
    def min_psi(self) -> float:
        """The smallest ψ of all sets and samples; inf where no sets are known."""
        return float(self.psi.min(initial=np.inf))

    @property
    def unavoidable(self) -> tuple[Crossing, ...]:
        return tuple(c for c in self.crossings if not c.avoidable)

    @property
    def avoidable(self) -> tuple[Crossing, ...]:
        return tuple(c for c in self.crossings if c.avoidable)


def clearance(chain: Chain, sets: SingularSets | None, t: Array, q: Array, *, width: float = 400.0) -> Clearance:
    """Clearance of a densely sampled motion.

    t (M,) [s], q (M, n). `width` is η₂ [1/rad²]: sets of codimension above 1 count as crossed where ψ < 1/(2η₂) in
    between while both ends are outside: inside its inflection a potential does not push outwards reliably.
    """
    from sigmaik import indices

    if sets is None:
        return Clearance(t, np.asarray(indices.evaluate(chain, q, "manipulability")), (), np.empty((len(t), 0)), ())
    psi = np.asarray(sets.residuals(q))
    crossings: list[Crossing] = []
    for i, (name, codimension) in enumerate(zip(sets.names, sets.codimensions, strict=True)):
        if codimension == 1:
            crossings += _wall(name, t, q, np.asarray(sets.signed_residuals(q))[:, _column(sets, i)])
        else:
            crossings += _tube(name, t, q, psi[:, i], 0.5 / width)
    crossings.sort(key=lambda c: c.t)
    return Clearance(t, np.asarray(sets.manipulability(q)), tuple(sets.names), psi, tuple(crossings))


def _column(sets: SingularSets, i: int) -> int:
    """Where the residuals of set i begin in signed_residuals."""
    return int(sum(sets.codimensions[:i]))


def _wall(name: str, t: Array, q: Array, r: Array) -> list[Crossing]:
    inside = r >= 0.0
    at = np.flatnonzero(inside[1:] != inside[:-1])
    needed = inside[0] != inside[-1]
    found = []
    for j, k in enumerate(at):
        s = r[k] / (r[k] - r[k + 1])
        # Of an odd number one has to be; which of them is for nobody to say: the first is taken.
        found.append(
            Crossing(
                name, float(t[k] + s * (t[k + 1] - t[k])), q[k] + s * (q[k + 1] - q[k]), 0.0, not (needed and j == 0)
            )
        )
    return found


def _tube(name: str, t: Array, q: Array, psi: Array, within: float) -> list[Crossing]:
    inside = np.concatenate([[False], psi < within, [False]])
    begins, ends = np.flatnonzero(inside[1:] & ~inside[:-1]), np.flatnonzero(~inside[1:] & inside[:-1])
    found = []
    for begin, end in zip(begins, ends, strict=True):
        if begin == 0 or end == len(psi):  # the start or the goal itself is there
            continue
        k = int(begin + psi[begin:end].argmin())
        found.append(Crossing(name, float(t[k]), q[k].copy(), float(psi[k]), True))
    return found
