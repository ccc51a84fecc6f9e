"""What a motion pays for where it is: costs that add up, before it is known of which arm.

    cost = costs.Potential() + 2.0 * costs.Collision(obstacles) + MyCost()
    sk.planning.time_optimal(chain, start, goal, cost=cost)

This is the one list of them. A new cost is a file of its own here with a `Term`, and its name in this list; a cost of a
user's own is any object with ``value(q: (B, n)) -> (B,)`` and needs neither.
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
