"""Motions planned ahead, clear of singularities and obstacles.

    trajectory = sk.planning.time_optimal(chain, start, goal, avoid="potential", time_weight=600.0)
    trajectory.t, trajectory.q, trajectory.qdot, trajectory.qddot
    trajectory.clearance.min_manipulability, trajectory.clearance.crossings

    obstacles = sk.planning.Obstacles([sk.planning.Box(size=(0.8, 1.2, 0.04), pose=(0.6, 0.0, 0.4))])
    spheres = sk.planning.arm_spheres(chain, "arm.urdf")
    sk.planning.min_distance(spheres, obstacles, trajectory.q)
"""

from sigmaik._core import (
    ArmSpheres,
    DistanceField,
    JointCost,
    joint_limit_cost,
    self_collision_cost,
    self_collision_pairs,
    sum_of,
)

from .clearance import Clearance, Crossing
from .collision import arm_spheres, collision_cost, min_distance
from .obstacles import Box, Cylinder, Obstacles, Sphere
from .time_optimal import time_optimal
from .trajectory import Trajectory

__all__ = [
    "ArmSpheres",
    "Box",
    "Clearance",
    "Crossing",
    "Cylinder",
    "DistanceField",
    "JointCost",
    "Obstacles",
    "Sphere",
    "Trajectory",
    "arm_spheres",
    "collision_cost",
    "joint_limit_cost",
    "min_distance",
    "self_collision_cost",
    "self_collision_pairs",
    "sum_of",
    "time_optimal",
]
