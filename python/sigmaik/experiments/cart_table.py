"""The cart experiment's runs as a table for the terminal, and as CSV. Needs rich, `pip install 'sigmaik[demo]'`."""

from __future__ import annotations

import csv
import pathlib
from collections.abc import Sequence

import numpy as np
from rich.table import Table
from rich.text import Text

from sigmaik.planning.cart import CartMotion

from .cart import METHODS, CartExperiment, CartRun
from .table import titled_table

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
    table = titled_table(f"{e.variant}: {e.samples} samples, radius {1e3 * e.radius:g} mm")
    table.add_column("cart")
    for head in _HEADS:
        table.add_column(head, justify="right", no_wrap=True)
    for run in runs:
        missed = float(np.max(np.abs(run.joint_error[1:])))
        table.add_row(
            METHODS[run.method],
            _red(f"{run.motion.time_inside:.2f}", run.motion.inside > 0),
            f"{1e3 * run.motion.clearance:.1f}",
            f"{1e6 * run.motion.energy:.2f}",
            _red(f"{100.0 * run.followed:.1f}", run.followed < 1.0),
            _red("–" if np.isnan(missed) else f"{missed:.1e}", not missed < 1e-3),
            f"{run.min_singular_value:.4f}",
            f"{run.max_joint_speed:.3f}",
        )
    return table


def save_cart_table(e: CartExperiment, runs: Sequence[CartRun], file: pathlib.Path) -> pathlib.Path:
    """One line per method, m, rad, s."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(
            ["variant", "method", "samples", "iterations", "inside", "time_inside", "clearance", "energy", "followed"]
            + ["task_error", "min_singular_value", "max_joint_speed", "cart_error"]
            + [f"q{k}_error" for k in range(1, 7)]
        )
        for run in runs:
            m = run.motion
            writer.writerow(
                [
                    e.variant,
                    run.method,
                    e.samples,
                    m.iterations if isinstance(m, CartMotion) else m.programs,
                    m.inside,
                    m.time_inside,
                    m.clearance,
                    m.energy,
                    run.followed,
                ]
                + [run.task_error, run.min_singular_value, run.max_joint_speed, *run.joint_error]
            )
    return file


def _red(text: str, bad: bool) -> Text:
    return Text(text, style="red" if bad else "")
