"""Motions planned ahead, clear of singularities.

    trajectory = sk.planning.time_optimal(chain, start, goal, avoid="potential", time_weight=600.0)
    trajectory.t, trajectory.q, trajectory.qdot, trajectory.qddot
    trajectory.clearance.min_manipulability, trajectory.clearance.crossings
"""

from .clearance import Clearance, Crossing
from .time_optimal import time_optimal
from .trajectory import Trajectory

__all__ = ["Clearance", "Crossing", "Trajectory", "time_optimal"]
