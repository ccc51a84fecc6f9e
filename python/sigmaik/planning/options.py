"""Options and keywords of the planners, each told once: a call takes them as keywords, or as one object.

    options = sk.planning.TimeOptimalOptions(nodes=40, time_weight=600.0)
    sk.planning.time_optimal(chain, start, goal, cost=cost, options=options)

An option that is left out has the default of the C++ struct of the same name, which is given here for readers.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypedDict

from numpy.typing import ArrayLike

from sigmaik._core import ArmSpheres, JointCost, SingularSets

from .batch_cost import BatchCost

__all__ = [
    "Avoid",
    "GradientKeywords",
    "GradientOptions",
    "Index",
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


class TimeOptimalOptions(TypedDict, total=False):
    """Options of `time_optimal`."""

    nodes: int
    """N, 5 to 10 000; 30."""
    time_weight: float
    """[1/s] > 0; 1."""
    effort_weight: float
    """[s⁴/rad²] ≥ 0, > 0 where a joint has no acceleration limit; 1."""
    tolerance: float
    """In [1e-12, 1e-2], what is left to gain, as a part of the objective between the ends; 1e-9."""
    max_iterations: int
    """≥ 1, Newton steps of a start; 500."""
    between_nodes: bool
    """Keep the limits of position between the nodes too, where a parabola can overshoot; False: at the nodes
    alone, as in the paper. True."""
    restarts: bool
    """Where the motion found still leads through what the cost marks, look on the other sides too; True."""
    clearance_width: float
    """[1/rad²] > 0: sets of codimension above 1 count as crossed where ψ < 1/(2 clearance_width); eta2."""


class GradientOptions(TypedDict, total=False):
    """Options of `gradient`."""

    states: int
    """N + 1, 3 to 1000 support states, ends included; 21."""
    prior_weight: float
    """> 0, of ‖q − μ‖² against the cost; 10."""
    max_iterations: int
    """≥ 1; 100."""
    tolerance: float
    """≥ 0: the search stops where an iteration gains less than this part of the objective; 1e-4."""
    restarts: int
    """≥ 0. Where the motion found from the straight line touches an obstacle, so many others are found from first
    guesses drawn from the prior, the same each time, with a standard deviation of 0.5 rad or m half-way, and the
    one of least cost that touches none is the answer; 8."""
    duration: float | None
    """[s] > 0; by default the shortest that keeps the limits of velocity and acceleration, 1 s where there are none."""


class StochasticOptions(TypedDict, total=False):
    """Options of `stochastic`."""

    states: int
    """N + 1, 3 to 1000 support states, ends included; 21."""
    samples: int
    """≥ 2, motions drawn in an iteration; 10."""
    max_iterations: int
    """≥ 1; 30."""
    deviation: float
    """[rad or m] > 0, standard deviation of the samples half-way; 0.5."""
    decay: float
    """In (0, 1], of the deviation from one iteration to the next; 0.98."""
    temperature: float
    """> 0: a sample weighs exp(−(G − G_min)/(temperature (G_max − G_min))); 0.1."""
    prior_weight: float
    """≥ 0, of ‖q − μ‖² against the cost; 10."""
    tolerance: float
    """≥ 0: the search stops where eight iterations together gain less than this part of the objective; 1e-3."""
    refine: bool
    """Finish with `gradient` from there; False."""
    duration: float | None
    """[s] as for `gradient`."""


class _Clear(TypedDict, total=False):
    spheres: ArmSpheres | None
    """The arm as spheres; by default `arm_spheres(chain)`, capsules along its links."""
    margin: float
    """[m] > 0 from obstacles that costs nothing (`collision_cost`); 0.05."""
    obstacle_weight: float
    """[1/m] > 0, of what comes nearer; 1e4."""
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
