"""What a time-optimal planner is asked for: the objective, and the ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from numpy.typing import ArrayLike

from sigmaik._core import SingularSets

__all__ = ["Avoid", "Ends", "Objective", "Sets", "Solver"]

Avoid = Literal["manipulability", "potential"]
Solver = Literal["sigmaik", "ipopt"]
Ends: TypeAlias = tuple[ArrayLike, ArrayLike, ArrayLike | None, ArrayLike | None]
"""Start, goal, and velocities there."""
Sets: TypeAlias = SingularSets | None


@dataclass(frozen=True)
class Objective:
    """All that a solver object depends on, but for the arm. Hashable: solvers are built once for each."""

    avoid: Avoid | None
    nodes: int
    time_weight: float
    effort_weight: float
    avoid_weight: float
    epsilon: float
    eta1: float
    eta2: float
    generic_manipulability: bool
    tolerance: float
    max_iterations: int
    between_nodes: bool
    restarts: bool
