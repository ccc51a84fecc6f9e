"""Time-optimal motions that keep clear of what a cost marks (Beck et al. 2022, eqs. 21 to 27)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, cast

from numpy.typing import ArrayLike

from sigmaik import _core, singularities
from sigmaik._core import Chain, DistanceField, Error, JointCost, Trajectory

from . import costs
from .clear import add_clear
from .costs import Cost
from .obstacles import Obstacles
from .options import Avoid, TimeOptimalKeywords, TimeOptimalOptions, checked

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = ["time_optimal"]


def time_optimal(
    chain: Chain,
    start: ArrayLike,
    goal: ArrayLike,
    cost: Cost | JointCost | Avoid | None = None,
    obstacles: Obstacles | DistanceField | None = None,
    options: TimeOptimalOptions | None = None,
    **keywords: Unpack[TimeOptimalKeywords],
) -> Trajectory:
    """A motion from start to goal in little time, at little effort, within limits, clear of singularities.

    Minimises ``time_weight t_F + effort_weight Σ q̈_kᵀ q̈_k + Σ cost(q_k)`` over N nodes, t_k = k h, h = t_F/N, as
    in Beck et al. (2022), eqs. 21 to 27: a double integrator for each joint, q̈ constant over a step, free t_F,
    the chain's limits of position, velocity and acceleration at every node.

    Parameters
    ----------
    start, goal
        (n,) [rad or m] within the limits. Joints without position limits go to the nearest turn of the goal, unless
        ``whole_turns`` is True: then 0 and 2π are different places.
    cost
        Of the nodes: `costs` that add up, any `JointCost`, or one of `avoid`'s words.
    obstacles
        What to keep clear of: the cost counts them (`costs.Collision`), and a motion that touches one between its nodes
        has failed.
    options, keywords
        `TimeOptimalOptions` as one object, or as keywords, which come first; and `TimeOptimalKeywords`: avoid,
        start_velocity, acceleration, sets, …

    Returns
    -------
    Trajectory
        with ``duration`` = t_F = N h as the paper defines h: the last step of length h is spent at the goal. `status`
        says whether the motion is "optimal" (a local minimum), "feasible" (stopped before), or "failed": then there are
        no samples. What is returned keeps the dynamics and all limits. `clearance` tells m and ψ between the nodes, and
        which crossings of singular sets no path could avoid.

    Raises
    ------
    ValueError
        where an end or an option is out of its range, an end touches an obstacle, a cost has no Hessian, or "potential"
        is asked for and the arm's sets are not known.
    MissingPackage
        a ValueError too, with the command that installs CasADi, where that is missing and asked for.
    """
    given = checked("time_optimal", TimeOptimalKeywords, keywords, options)
    acceleration = given.pop("acceleration", None)
    if acceleration is not None:
        chain = chain.with_limits(acceleration=acceleration)
    velocities = given.pop("start_velocity", None), given.pop("goal_velocity", None)
    solver = given.pop("solver", "sigmaik")
    if isinstance(cost, str):
        given["avoid"], cost = cost, None
    avoid = {name: given.pop(name) for name in _AVOID if name in given}
    sets = avoid.pop("sets", None) or singularities.of(chain)
    eta2 = avoid.get("eta2", costs.ETA2)
    if solver != "sigmaik":
        if not given.pop("whole_turns", False):
            goal = _core.nearest_turn(chain, start, goal)
        return _other_solver(solver)(chain, sets, (start, goal, *velocities), given, avoid)
    total = _marked(sets, **avoid) if cost is None else Cost.of(cost)
    total, scene = add_clear(total, chain, obstacles, given)
    smooth, others = total.bind(chain)
    if others:
        raise Error("a time-optimal motion needs costs with a Hessian (JointCost); one of these has none")
    planner = _core.TimeOptimal(chain, smooth, **{"clearance_width": eta2, "sets": sets, **given, **scene})
    return planner.plan(start, goal, *velocities)


def _other_solver(name: str) -> Callable[..., Trajectory]:
    """A solver that another package brings, by an entry point of the group sigmaik.solvers."""
    from importlib.metadata import entry_points

    found = {entry.name: entry for entry in entry_points(group="sigmaik.solvers")}
    if name not in found:
        raise Error(f"solver = {name!r} must be 'sigmaik'" + "".join(f" or {other!r}" for other in sorted(found)))
    return cast("Callable[..., Trajectory]", found[name].load())


_AVOID = ("avoid", "avoid_weight", "epsilon", "eta1", "eta2", "generic_manipulability", "sets")


def _marked(
    sets: singularities.SingularSets | None,
    avoid: Avoid | None = None,
    avoid_weight: float = 1e2,
    epsilon: float = 1e-6,
    eta1: float = costs.ETA1,
    eta2: float = costs.ETA2,
    generic_manipulability: bool = False,
) -> Cost:
    """The cost that `avoid` names."""
    if avoid is None:
        return Cost()
    if avoid == "potential":
        return costs.Potential(avoid_weight, eta1, eta2, sets)
    if avoid == "manipulability":
        return costs.Manipulability(avoid_weight, epsilon, not generic_manipulability, sets)
    raise Error(f"avoid = {avoid!r} must be None, 'manipulability' or 'potential'")
