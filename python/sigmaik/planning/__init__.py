"""Motions planned ahead, clear of singularities.

    trajectory = sk.planning.time_optimal(chain, start, goal, avoid="potential", time_weight=600.0)
    trajectory.t, trajectory.q, trajectory.qdot, trajectory.qddot
    trajectory = sk.planning.gradient(chain, start, goal)              # or stochastic: along a good geometry-aware index
    trajectory.clearance.min_manipulability, trajectory.clearance.crossings
"""

from .clearance import Clearance, Crossing
from .support import gradient, stochastic
from .time_optimal import time_optimal
from .trajectory import Trajectory

__all__ = ["Clearance", "Crossing", "Trajectory", "gradient", "stochastic", "time_optimal"]
