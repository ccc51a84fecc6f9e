"""Motions planned ahead, clear of singularities and obstacles.

Every planner returns a trajectory, which can be drawn and played:

    trajectory = sk.planning.time_optimal(chain, start, goal, avoid="potential", time_weight=600.0)
    trajectory.t, trajectory.q, trajectory.qdot, trajectory.qddot
    cost = sk.planning.costs.Potential() + 2.0 * sk.planning.costs.Collision(obstacles)  # or any object with value(q)
    options = sk.planning.TimeOptimalOptions(nodes=40)
    trajectory = sk.planning.time_optimal(chain, start, goal, cost=cost, options=options)
    trajectory = sk.planning.gradient(chain, start, goal)  # or stochastic: along a good geometry-aware index
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
    Clearance,
    Crossing,
    DistanceField,
    JointCost,
    Playback,
    Trajectory,
    joint_limit_cost,
    play,
    self_collision_cost,
    self_collision_pairs,
    sum_of_costs,
)

from . import costs
from ._cart_trajectory import CartTrajectory, ShoulderCylinder, cart_trajectory, shoulder_cylinder
from ._time_optimal import time_optimal
from .batch_cost import BatchCost
from .cart import CartError, CartMotion, CartRegion, cart_motion, evaluate_cart_motion
from .cart_plane import PlaneCartMotion, cart_motion_plane, evaluate_cart_motion_plane
from .collision import arm_spheres, collision_cost, min_distance
from .costs import Cost
from .obstacles import Box, Cylinder, Obstacles, Sphere
from .options import GradientOptions, StochasticOptions, TimeOptimalOptions
from .smooth import gradient, stochastic
from .status import PlanStatus

__all__ = [
    "Cost",
    "GradientOptions",
    "StochasticOptions",
    "TimeOptimalOptions",
    "costs",
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
    "PlanStatus",
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
