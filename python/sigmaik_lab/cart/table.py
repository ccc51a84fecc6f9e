"""The cart's runs as a text table, and as CSV."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence

import numpy as np

from sigmaik.planning.cart import CartMotion
from sigmaik_lab.csv_file import save_csv
from sigmaik_lab.report import Table, red

from .experiment import METHODS, CartExperiment, CartRun

__all__ = ["cart_table", "save_cart_table"]

_HEADS = (
    "time in\nregion\ns",
    "least\ndist.\nmm",
    "energy\n\nmm²",
    "arm\nfollows\n%",
    "taught\nmissed\nrad",
    "least\nσ_min\n",
    "joint\nspeed\nrad/s",
)


def cart_table(e: CartExperiment, runs: Sequence[CartRun]) -> Table:
    """A line per method. Red: samples in the region, a path not followed, joints missed."""
    table = Table(f"{e.variant}: {e.samples} samples, radius {1e3 * e.radius:g} mm")
    table.add_column("cart", wrap=True)
    table.add_numbers(*_HEADS)
    for run in runs:
        missed = float(np.max(np.abs(run.joint_error[1:])))
        table.add_row(
            METHODS[run.method],
            red(f"{run.motion.time_inside:.2f}", run.motion.inside > 0),
            f"{1e3 * run.motion.clearance:.1f}",
            f"{1e6 * run.motion.energy:.2f}",
            red(f"{100.0 * run.followed:.1f}", run.followed < 1.0),
            red("–" if np.isnan(missed) else f"{missed:.1e}", not missed < 1e-3),
            f"{run.min_singular_value:.4f}",
            f"{run.max_joint_speed:.3f}",
        )
    return table


def save_cart_table(e: CartExperiment, runs: Sequence[CartRun], file: pathlib.Path) -> pathlib.Path:
    """One line per method, m, rad, s."""
    columns = ["variant", "method", "samples", "iterations", "inside", "time_inside", "clearance", "energy", "followed"]
    columns += ["task_error", "min_singular_value", "max_joint_speed", "cart_error"]
    columns += [f"q{k}_error" for k in range(1, 7)]
    rows = []
    for run in runs:
        m = run.motion
        iterations = m.iterations if isinstance(m, CartMotion) else m.programs
        rows.append(
            [e.variant, run.method, e.samples, iterations, m.inside, m.time_inside, m.clearance, m.energy]
            + [run.followed, run.task_error, run.min_singular_value, run.max_joint_speed, *run.joint_error]
        )
    return save_csv(file, columns, rows)
