"""Smooth motions along which a cost is low, by its gradient or by samples, under a Gaussian-process prior (Petrović et
al.)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from sigmaik import _core
from sigmaik._core import Chain, DistanceField, Error, JointCost, Trajectory

from .batch_cost import BatchCost
from .clear import add_clear
from .costs import Cost, GeometryAware, LogManipulability
from .obstacles import Obstacles
from .options import GradientKeywords, GradientOptions, Index, StochasticKeywords, StochasticOptions, checked

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = ["gradient", "stochastic"]


def gradient(
    chain: Chain,
    start: ArrayLike,
    goal: ArrayLike,
    obstacles: Obstacles | DistanceField | None = None,
    *,
    cost: Cost | JointCost | BatchCost | None = None,
    options: GradientOptions | None = None,
    **keywords: Unpack[GradientKeywords],
) -> Trajectory:
    """A smooth motion from start to goal along which a cost is low, by the gradient of this cost.

    Minimises ``Σ_i cost(q_i) + prior_weight ‖q − μ‖²`` over N + 1 support states, the norm that of the inverse
    covariance of a Gaussian process with white noise on acceleration about the straight line μ (Petrović et al., eqs. 7
    to 13), by L-BFGS in coordinates where the prior is a unit ball. Between states the prior's mean, the natural cubic
    spline, is the motion.

    Parameters
    ----------
    start, goal
        (n,) [rad or m] within the limits. Joints without position limits go to the nearest turn of the goal,
        unless ``whole_turns`` is True.
    obstacles
        What to keep clear of. ValueError where start or goal touches it; where the motion found does, `status` is
        "failed" and there are no samples.
    cost
        Of the states, instead of `index`: `costs` that add up, any `JointCost`, or one written in Python (`BatchCost`).
    options, keywords
        `GradientOptions` as one object, or as keywords, which come first; and `GradientKeywords`: index, weight,
        k, costs, spheres, margin, obstacle_weight, self_collision. Without `cost` the index is "geometry_aware".

    Returns
    -------
    Trajectory
        cubic between its N + 1 samples, within the limits of position there too. `status` is "optimal" where the search
        stopped by itself, else "feasible". `cost` is the objective.

    Raises
    ------
    ValueError
        where an end or an option is out of its range, or a cost's answer has another shape or is not finite. What a
        cost written in Python raises comes through as it is.
    """
    given = checked("gradient", GradientKeywords, keywords, options)
    costs = _costs(chain, cost, obstacles, given)
    return _core.plan_gradient(chain, start, goal, **costs, **given)


def stochastic(
    chain: Chain,
    start: ArrayLike,
    goal: ArrayLike,
    obstacles: Obstacles | DistanceField | None = None,
    seed: int = 0,
    *,
    cost: Cost | JointCost | BatchCost | None = None,
    options: StochasticOptions | None = None,
    **keywords: Unpack[StochasticKeywords],
) -> Trajectory:
    """A smooth motion from start to goal along which a cost is low, by samples (Petrović et al., eqs. 14 to 16).

    The objective is that of `gradient`, and so are the parameters that have the same names. Each iteration draws
    `samples` motions about the current one from the prior, of standard deviation `deviation` half-way, which `decay`
    shrinks, and moves it by their mean, weighted by exp(−(G − G_min)/(`temperature` (G_max − G_min))) and spread by the
    covariance, as STOMP does. The best motion that was met is returned. It ends after `max_iterations`, or where eight
    together gain less than the part `tolerance` of the objective. It needs no gradient, and can leave a local minimum;
    without obstacles `gradient` is faster and as good.

    seed
        of the samples: the same seed gives the same motion.
    options, keywords
        `StochasticOptions`, and `StochasticKeywords` as for `gradient`.

    Returns and raises as `gradient`; `status` is "feasible" unless refined: no minimum is claimed.
    """
    given = checked("stochastic", StochasticKeywords, keywords, options)
    costs = _costs(chain, cost, obstacles, given)
    return _core.plan_stochastic(chain, start, goal, seed=seed, **costs, **given)


def _costs(
    chain: Chain,
    cost: Cost | JointCost | BatchCost | None,
    obstacles: Obstacles | DistanceField | None,
    given: dict[str, Any],
) -> dict[str, Any]:
    """What the planner is given beside its options, which are left in `given`."""
    own = {name: given.pop(name) for name in ("index", "weight", "k", "costs") if name in given}
    total = _indexed(**own) if cost is None else Cost.of(cost)
    total, scene = add_clear(total, chain, obstacles, given)
    if not total.parts:
        raise Error("there is no cost: index is None, and neither obstacles nor other costs are given")
    smooth, others = total.bind(chain)
    return {"cost": smooth, "python_costs": list(others), **scene}


def _indexed(
    index: Index | None = "geometry_aware",
    weight: float = 1.0,
    k: float | None = None,
    costs: tuple[JointCost | BatchCost, ...] = (),
) -> Cost:
    """The cost that `index` names, and others."""
    if index not in (None, "geometry_aware", "manipulability"):
        raise Error(f"index = {index!r} must be None, 'geometry_aware' or 'manipulability'")
    total = Cost()
    if index == "geometry_aware":
        total = GeometryAware(weight, k)
    elif index == "manipulability":
        total = LogManipulability(weight)
    for other in costs:
        total = total + other
    return total
