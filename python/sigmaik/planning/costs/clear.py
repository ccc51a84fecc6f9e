"""Costs of being near to obstacles, to the arm itself, and to joint limits; `collision_cost` has their formula."""

from __future__ import annotations

from dataclasses import dataclass, field

from sigmaik import _core
from sigmaik._core import ArmSpheres, Chain, DistanceField, JointCost

from ..collision import arm_spheres, collision_cost
from ..obstacles import Obstacles
from .cost import Term

__all__ = ["Collision", "JointLimits", "SelfCollision"]


@dataclass(frozen=True)
class Collision(Term):
    """weight · Σ c(d) over the arm's spheres that move, d their distance to the obstacles."""

    obstacles: Obstacles | DistanceField
    spheres: ArmSpheres | None = field(default=None, repr=False)
    """The arm as spheres; by default `arm_spheres(chain)`, capsules along its links."""
    clearance: float = 0.05
    """[m] > 0: obstacles that are farther cost nothing."""
    weight: float = 1e4
    """[1/m] > 0"""

    def bind_term(self, chain: Chain) -> JointCost:
        return collision_cost(self.spheres or arm_spheres(chain), self.obstacles, self.clearance, self.weight)


@dataclass(frozen=True)
class SelfCollision(Term):
    """weight · Σ c(d) over the pairs of the arm's spheres that may come into contact, d the distance of their
    surfaces."""

    spheres: ArmSpheres | None = field(default=None, repr=False)
    """The arm as spheres; by default `arm_spheres(chain)`, capsules along its links."""
    clearance: float = 0.02
    """[m] > 0: spheres that are farther apart cost nothing."""
    weight: float = 1e4
    """[1/m] > 0"""

    def bind_term(self, chain: Chain) -> JointCost:
        spheres = self.spheres or arm_spheres(chain)
        return _core.self_collision_cost(spheres, clearance=self.clearance, weight=self.weight)


@dataclass(frozen=True)
class JointLimits(Term):
    """weight · Σ_j ½ x_j², x_j = max(0, margin − d_j), d_j the distance of joint j to its nearer limit, negative beyond
    the limit."""

    margin: float = 0.1
    """[rad or m] ≥ 0"""
    weight: float = 1.0

    def bind_term(self, chain: Chain) -> JointCost:
        return _core.joint_limit_cost(chain, self.margin, self.weight)
