"""Motions planned ahead, clear of singularities and obstacles.

Every planner returns a trajectory, which can be drawn and played:

    trajectory = sk.planning.time_optimal(chain, start, goal, avoid="potential", time_weight=600.0)
    trajectory.t, trajectory.q, trajectory.qdot, trajectory.qddot
    trajectory = sk.planning.gradient(chain, start, goal)         # or stochastic: along a good geometry-aware index
    trajectory.clearance.min_manipulability, trajectory.clearance.crossings
    trajectory.plot("motion.png", chain)
    done = sk.planning.play(trajectory, servo)                         # a servo that stands at its start
    done.q, done.max_position_error, done.max_joint_difference
    motion = sk.planning.cart_motion(flange_xy, start, end, radius)   # of the cart under an arm
    motion.x, motion.energy, motion.clearance
    motion = sk.planning.cart_motion_plane(flange_xy, (0, 0), (1, 0), radius)   # with two axes
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
    sum_of_costs,
)

from .batch_cost import BatchCost
from .cart import CartError, CartMotion, CartRegion, cart_motion, evaluate_cart_motion
from .cart_plane import PlaneCartMotion, cart_motion_plane, evaluate_cart_motion_plane
from .cart_trajectory import CartTrajectory, ShoulderCylinder, cart_trajectory, shoulder_cylinder
from .clearance import Clearance, Crossing
from .collision import arm_spheres, collision_cost, min_distance
from .obstacles import Box, Cylinder, Obstacles, Sphere
from .playing import Playback, play
from .support import gradient, stochastic
from .time_optimal import time_optimal
from .trajectory import Trajectory

__all__ = [
    "ArmSpheres",
    "BatchCost",
    "Box",
    "CartError",
    "CartMotion",
    "CartRegion",
    "CartTrajectory",
    "Clearance",
    "Crossing",
    "Cylinder",
    "DistanceField",
    "JointCost",
    "Obstacles",
    "PlaneCartMotion",
    "Playback",
    "ShoulderCylinder",
    "Sphere",
    "Trajectory",
    "arm_spheres",
    "cart_motion",
    "cart_motion_plane",
    "cart_trajectory",
    "collision_cost",
    "evaluate_cart_motion",
    "evaluate_cart_motion_plane",
    "gradient",
    "joint_limit_cost",
    "min_distance",
    "play",
    "self_collision_cost",
    "self_collision_pairs",
    "shoulder_cylinder",
    "stochastic",
    "sum_of_costs",
    "time_optimal",
]
