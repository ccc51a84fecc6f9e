"""Costs that are high near an arm's known singular sets, or where its manipulability is low (Beck et al. 2022)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sigmaik import _core, singularities
from sigmaik._core import Chain, Error, JointCost, SingularSets

from .cost import Term

__all__ = ["ETA1", "ETA2", "LogManipulability", "Manipulability", "Potential"]

ETA1 = math.log(2400.0)
"""log of a potential's height (Beck et al. 2022, table 2)."""
ETA2 = 400.0
"""[1/rad²] Inverse squared width of a potential (Beck et al. 2022, table 2)."""


@dataclass(frozen=True)
class Potential(Term):
    """weight · Σ_i exp(eta1 − eta2 ψ_i(q)), ψ_i = 0 on singular set i (eqs. 26, 27)."""

    weight: float = 1e2
    eta1: float = ETA1
    """log of the height."""
    eta2: float = ETA2
    """[1/rad²] inverse squared width."""
    sets: SingularSets | None = None
    """The arm's singular sets; by default `singularities.of(chain)`."""

    def bind_term(self, chain: Chain) -> JointCost:
        sets = self.sets or singularities.of(chain)
        if sets is None:
            raise Error(
                "the singular sets of this arm are not known; avoid='manipulability' needs none. Known are: "
                + ", ".join(singularities.names())
            )
        return _core.potential_cost(sets, self.weight, self.eta1, self.eta2)


@dataclass(frozen=True)
class Manipulability(Term):
    """weight/(m(q) + epsilon), m = √det(JJᵀ) (eq. 23)."""

    weight: float = 1e2
    epsilon: float = 1e-6
    closed_form: bool = True
    """m in closed form where the arm's singular sets are known, which is faster; False: from the Jacobian."""
    sets: SingularSets | None = None
    """The arm's singular sets; by default `singularities.of(chain)`."""

    def bind_term(self, chain: Chain) -> JointCost:
        sets = (self.sets or singularities.of(chain)) if self.closed_form else None
        return _core.manipulability_cost(chain if sets is None else sets, self.weight, self.epsilon)


@dataclass(frozen=True)
class LogManipulability(Term):
    """−weight · log m(q), m no less than 1e-9, as in manipulability maximisation over a Gaussian-process trajectory
    (after Marić et al. 2019)."""

    weight: float = 1.0

    def bind_term(self, chain: Chain) -> JointCost:
        return _core.log_manipulability_cost(chain, self.weight)
