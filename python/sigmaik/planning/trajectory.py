"""What planners return: a motion on a grid of times, and how the planning went."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .clearance import Clearance

__all__ = ["Trajectory"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trajectory:
    """Joint positions over time, N samples of n joints, and how they were found.

    Between samples acceleration is constant, or, where `cubic`, changes evenly: `sample` is exact. A failed plan has no
    samples: its arrays are empty.
    """

    t: Array = field(repr=False)
    """(N,) [s]"""
    q: Array = field(repr=False)
    """(N, n) [rad or m]"""
    qdot: Array = field(repr=False)
    """(N, n) [rad/s or m/s]"""
    qddot: Array = field(repr=False)
    """(N, n) [rad/s² or m/s²], of the step that begins at the sample, zero in the last row; where `cubic`, at the sample."""
    duration: float
    """[s]; nan where the plan failed. See the planner for what it counts."""
    status: str
    """"optimal", a local minimum; "feasible", within all constraints, but with something left to gain; "failed"."""
    cost: float
    """The planner's objective; nan where the plan failed."""
    solve_time: float
    """[s] of wall-clock time, of the optimiser alone."""
    iterations: int = 0
    """Steps of the optimiser, of all starts."""
    starts: int = 1
    """First guesses tried."""
    cubic: bool = False
    """Whether positions are cubic between samples, as the prior of a Gaussian process has them, or quadratic."""
    clearance: Clearance | None = field(default=None, repr=False)
    """How near singularities it comes, between the samples too; None where the plan failed."""

    def sample(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """q, q̇, q̈ (M, n) at times t (M,) [s], held at the ends. ValueError where there is nothing to sample."""
        times = np.asarray(t, dtype=np.float64)
        if self.t.size == 0:
            raise ValueError(f"this trajectory is empty: its plan {self.status}")
        if times.ndim != 1 or not np.all(np.isfinite(times)):
            raise ValueError(f"t must be finite and of shape (M,), not {times.shape}")
        k = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, self.t.size - 1)
        s = (np.clip(times, self.t[0], self.t[-1]) - self.t[k])[:, None]
        q, qdot, qddot = self.q[k], self.qdot[k], self.qddot[k]
        if not self.cubic:
            return q + s * (qdot + 0.5 * s * qddot), qdot + s * qddot, qddot.copy()
        after = np.minimum(k + 1, self.t.size - 1)
        jerk = (self.qddot[after] - qddot) / np.maximum(self.t[after] - self.t[k], 1e-300)[:, None]
        return (
            q + s * (qdot + s * (0.5 * qddot + s * jerk / 6.0)),
            qdot + s * (qddot + 0.5 * s * jerk),
            qddot + s * jerk,
        )
