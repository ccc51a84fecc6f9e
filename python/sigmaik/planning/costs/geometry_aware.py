"""The geometry-aware index as a cost (Petrović et al.)."""

from __future__ import annotations

import functools
from dataclasses import dataclass

from sigmaik import _core, indices
from sigmaik._core import Chain, JointCost

from .cost import Term

__all__ = ["GeometryAware"]

_reference_scale = functools.lru_cache(maxsize=32)(indices.reference_scale)  # takes a few ms


@dataclass(frozen=True)
class GeometryAware(Term):
    """weight · ξ(q), ξ with Σ = kI (eq. 12), cut off at 2000: ξ is infinite at a singularity."""

    weight: float = 1.0
    k: float | None = None
    """By default `indices.reference_scale(chain)`."""

    def bind_term(self, chain: Chain) -> JointCost:
        return _core.geometry_aware_cost(chain, _reference_scale(chain) if self.k is None else self.k, self.weight)
