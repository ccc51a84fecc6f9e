"""Motions planned ahead, clear of singularities.

    trajectory = sk.planning.time_optimal(chain, start, goal, avoid="potential", time_weight=600.0)
    trajectory.t, trajectory.q, trajectory.qdot, trajectory.qddot
    trajectory = sk.planning.gradient(chain, start, goal)              # or stochastic: along a good geometry-aware index
    trajectory.clearance.min_manipulability, trajectory.clearance.crossings

    motion = sk.planning.cart_motion(flange_xy, start, end, radius)   # of the cart under an arm
    motion.x, motion.energy, motion.clearance
"""

from .cart import CartError, CartMotion, CartRegion, cart_motion, evaluate_cart_motion
from .cart_trajectory import CartTrajectory, ShoulderCylinder, cart_trajectory, shoulder_cylinder
from .clearance import Clearance, Crossing
from .support import gradient, stochastic
from .time_optimal import time_optimal
from .trajectory import Trajectory

__all__ = [
    "CartError",
    "CartMotion",
    "CartRegion",
    "CartTrajectory",
    "Clearance",
    "Crossing",
    "ShoulderCylinder",
    "Trajectory",
    "cart_motion",
    "cart_trajectory",
    "evaluate_cart_motion",
    "gradient",
    "shoulder_cylinder",
    "stochastic",
    "time_optimal",
]
