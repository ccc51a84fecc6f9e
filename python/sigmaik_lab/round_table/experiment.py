"""From under a table to above it, with and without the geometry-aware index (Petrović et al., section 4.2 and figure
2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import sigmaik as sk
from sigmaik._types import Array
from sigmaik.planning import ArmSpheres, Box, Obstacles, Trajectory, arm_spheres, min_distance, stochastic

__all__ = ["ROBOT", "TABLE", "Along", "RoundTable", "along", "load", "plan"]

ROBOT = "kuka_lbr_iiwa_14_r820"
TABLE = Box(size=(0.5, 1.0, 0.04), pose=(0.65, 0.0, 0.45))


@dataclass(frozen=True)
class RoundTable:
    """The arm, the table, and where to go."""

    chain: sk.Chain
    spheres: ArmSpheres
    obstacles: Obstacles
    start: Array
    goal: Array


def load(seed: int = 0) -> RoundTable:
    """A random start with the flange under the table, and a random goal with the flange above the table. Both are 3 cm
    or more clear of the table, not near singular, and have the elbow bent to the same side, so that no motion between
    them has to be singular."""
    chain = sk.robots.load(ROBOT)
    spheres, obstacles = arm_spheres(chain), Obstacles([TABLE])
    rng = np.random.default_rng(seed)

    def configuration(low: float, high: float, bent: float) -> Array:
        while True:
            q: Array = np.asarray(chain.random_configuration(rng))
            x, y, z = chain.pose(q)[:3, 3]
            inside = 0.45 < x < 0.8 and abs(y) < 0.3 and low < z < high
            good = bent * q[3] >= 0.0 and float(sk.indices.evaluate(chain, q, "manipulability")) > 0.03
            if inside and good and float(min_distance(spheres, obstacles, q)) > 0.03:
                return q

    start = configuration(0.1, 0.3, 0.0)
    return RoundTable(chain, spheres, obstacles, start, configuration(0.55, 0.9, float(start[3])))


def plan(task: RoundTable, index: bool, seed: int = 0) -> Trajectory:
    """A motion by samples; without the index only collisions and the distance from the straight line cost."""
    return stochastic(
        task.chain,
        task.start,
        task.goal,
        task.obstacles,
        seed,
        spheres=task.spheres,
        index="geometry_aware" if index else None,
        max_iterations=100,
    )


@dataclass(frozen=True)
class Along:
    """Indices and distances along a motion, at 10 times as many points as the planner uses."""

    s: Array
    """(M,) in unit time"""
    q: Array
    """(M, n)"""
    distance: Array
    """(M,) [m] from the table"""
    lambda_1: Array
    m: Array
    kappa: Array


def along(task: RoundTable, trajectory: Trajectory, points: int = 2001) -> Along:
    """Indices and distances along a plan."""
    s = np.linspace(0.0, 1.0, points)
    q = trajectory.sample(s * trajectory.duration)[0]
    eigenvalues: Array = np.square(np.linalg.svd(task.chain.jacobian(q), compute_uv=False), dtype=np.float64)
    return Along(
        s,
        q,
        np.asarray(min_distance(task.spheres, task.obstacles, q)),
        np.asarray(eigenvalues[:, -1]),
        np.sqrt(eigenvalues.prod(axis=1)),
        np.log10(eigenvalues[:, 0] / np.maximum(eigenvalues[:, -1], 1e-30)),
    )
