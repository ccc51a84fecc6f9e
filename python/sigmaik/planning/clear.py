"""Obstacles that a plan keeps clear of, from the planners' keywords."""

from __future__ import annotations

from typing import Any

from sigmaik._core import Chain, DistanceField

from .collision import arm_spheres
from .costs import Collision, Cost, SelfCollision
from .obstacles import Obstacles

__all__ = ["add_clear"]


def add_clear(
    cost: Cost, chain: Chain, obstacles: Obstacles | DistanceField | None, given: dict[str, Any]
) -> tuple[Cost, dict[str, Any]]:
    """The cost plus the costs of obstacles and self-collisions, and the scene against which a planner checks a motion.

    Takes spheres, margin, obstacle_weight and self_collision out of `given`.
    """
    spheres = given.pop("spheres", None)
    margin, weight = given.pop("margin", 0.05), given.pop("obstacle_weight", 1e4)
    self_collision = given.pop("self_collision", False)
    if obstacles is None and not self_collision:
        return cost, {}
    spheres = arm_spheres(chain) if spheres is None else spheres
    scene: dict[str, Any] = {}
    if obstacles is not None:
        cost = cost + Collision(obstacles, spheres, margin, weight)
        field = obstacles.field if isinstance(obstacles, Obstacles) else obstacles
        scene = {"spheres": spheres, "field": field}
    if self_collision:
        cost = cost + SelfCollision(spheres, weight=weight)
    return cost, scene
