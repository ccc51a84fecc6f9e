"""Options and keywords of the planners, each told once: a call takes them as keywords, or as one object.

    options = sk.planning.TimeOptimalOptions(nodes=40, time_weight=600.0)
    sk.planning.time_optimal(chain, start, goal, cost=cost, options=options)

The options are those of the C++ structs of the same names (`_options.py`); the other keywords are told here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypedDict

from numpy.typing import ArrayLike

from sigmaik._core import ArmSpheres, JointCost, SingularSets

from ._options import CartOptions, GradientOptions, PlaneCartOptions, StochasticOptions, TimeOptimalOptions
from .batch_cost import BatchCost

__all__ = [
    "Avoid",
    "CartOptions",
    "GradientKeywords",
    "GradientOptions",
    "Index",
    "PlaneCartOptions",
    "Solver",
    "StochasticKeywords",
    "StochasticOptions",
    "TimeOptimalKeywords",
    "TimeOptimalOptions",
    "checked",
]

Avoid = Literal["manipulability", "potential"]
Index = Literal["geometry_aware", "manipulability"]
Solver = Literal["sigmaik", "ipopt"]


class _Clear(TypedDict, total=False):
    spheres: ArmSpheres | None
    """The arm as spheres; by default `arm_spheres(chain)`, capsules along its links."""
    margin: float
    """[m] > 0 from obstacles that costs nothing (`collision_cost`); 0.05."""
    obstacle_weight: float
    """[1/m] > 0, of links that come nearer; 1e4."""
    self_collision: bool
    """Whether the arm keeps clear of itself too; False."""


class TimeOptimalKeywords(TimeOptimalOptions, _Clear, total=False):
    """Keywords of `time_optimal`."""

    avoid: Avoid | None
    """Instead of a cost. "potential": costs.Potential(avoid_weight, eta1, eta2, sets). "manipulability":
    costs.Manipulability(avoid_weight, epsilon, not generic_manipulability, sets)."""
    avoid_weight: float
    epsilon: float
    eta1: float
    eta2: float
    generic_manipulability: bool
    sets: SingularSets | None
    """The arm's singular sets; by default `singularities.of(chain)`."""
    acceleration: ArrayLike | None
    """(n,) [rad/s² or m/s²] or one number, instead of the chain's limits."""
    start_velocity: ArrayLike | None
    """(n,) [rad/s or m/s]; by default at rest."""
    goal_velocity: ArrayLike | None
    """(n,) [rad/s or m/s]; by default at rest."""
    solver: Solver
    """"sigmaik": an interior-point method made for this problem. "ipopt": IPOPT with MUMPS by CasADi, for comparison;
    `avoid` alone, the problem as in the paper, `tolerance` is its own."""


class _Indexed(_Clear, total=False):
    index: Index | None
    """Instead of a cost. "geometry_aware": costs.GeometryAware(weight, k). "manipulability":
    costs.LogManipulability(weight). None: neither. "geometry_aware"."""
    weight: float
    k: float | None
    costs: tuple[JointCost | BatchCost, ...]
    """Further costs beside the index."""


class GradientKeywords(GradientOptions, _Indexed, total=False):
    """Keywords of `gradient`."""


class StochasticKeywords(StochasticOptions, _Indexed, total=False):
    """Keywords of `stochastic`."""


def checked(
    function: str, table: type, keywords: Mapping[str, Any], options: Mapping[str, Any] | None
) -> dict[str, Any]:
    """The options with the keywords set on them. TypeError in one line for a word that is not in the
    table."""
    known = table.__annotations__
    for name in (*(options or {}), *keywords):
        if name not in known:
            raise TypeError(f"{function} has no option '{name}'; it has {', '.join(known)}")
    return {**(options or {}), **keywords}
