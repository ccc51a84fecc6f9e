"""The motions round the table, as a text table."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sigmaik.planning import Trajectory
from sigmaik_lab.report import Table

from .experiment import Along

__all__ = ["motion_table"]


def motion_table(plans: Mapping[str, Trajectory], motions: Mapping[str, Along]) -> Table:
    """A line per plan; `motions` has the plans that did not fail."""
    table = Table("", "index")
    table.add_numbers("mean λ₁", "m", "κ", "least λ₁", "m", "clear mm", "length", "ms")
    for name, plan in plans.items():
        if name not in motions:
            table.add_row(f"{name}: failed", *["–"] * 7, f"{1e3 * plan.solve_time:.1f}")
            continue
        motion = motions[name]
        table.add_row(
            name,
            f"{motion.lambda_1.mean():.4f}",
            f"{motion.m.mean():.3f}",
            f"{motion.kappa.mean():.3f}",
            f"{motion.lambda_1.min():.4f}",
            f"{motion.m.min():.3f}",
            f"{1e3 * motion.distance.min():.1f}",
            f"{np.linalg.norm(np.diff(motion.q, axis=0), axis=1).sum():.2f}",
            f"{1e3 * plan.solve_time:.1f}",
        )
    return table
