"""Costs of configurations, which add up before the arm is known.

    cost = costs.Potential() + 2.0 * costs.Collision(obstacles) + MyCost()
    sk.planning.time_optimal(chain, start, goal, cost=cost)

This module is the one list of all costs. A new cost needs a file of its own in this folder, with a `Term`, and its name
in this list. A cost of a user's own is any object with ``value(q: (B, n)) -> (B,)``, and needs neither.
"""

from .clear import Collision, JointLimits, SelfCollision
from .cost import Cost
from .geometry_aware import GeometryAware
from .singular_sets import ETA1, ETA2, LogManipulability, Manipulability, Potential

__all__ = [
    "ETA1",
    "ETA2",
    "Collision",
    "Cost",
    "GeometryAware",
    "JointLimits",
    "LogManipulability",
    "Manipulability",
    "Potential",
    "SelfCollision",
]
