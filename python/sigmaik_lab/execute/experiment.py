"""A time-optimal motion in physics: by computed torque, with the payload known and unknown, and by velocity loops."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import sigmaik as sk
from sigmaik._types import Array
from sigmaik.sim import Execution, Simulation, execute
from sigmaik_lab.csv_file import save_csv
from sigmaik_lab.physical_arm import PhysicsSettings, simulation

__all__ = ["ExecuteRun", "drive", "save_executions", "variants"]


@dataclass(frozen=True)
class ExecuteRun:
    """One way to drive the arm along the plan."""

    robot: str
    variant: str  #: one of `variants`
    joint_names: Sequence[str]
    duration: float  #: of the plan [s]
    execution: Execution
    tip_error: Array  #: (N,) from the planned tip to the true one [m]


def variants(settings: PhysicsSettings) -> tuple[str, ...]:
    """The ways to drive the arm: by computed torque, with the payload known or unknown, and by velocity loops."""
    return (*(("payload unknown", "payload known") if settings.payload else ("computed torque",)), "velocity loops")


def drive(
    robot: str, chain: sk.Chain, plan: sk.planning.Trajectory, variant: str, settings: PhysicsSettings
) -> ExecuteRun:
    """Executes the plan. ValueError where the plan failed, or a setting is out of its range."""
    by_torque = variant != "velocity loops"
    arm: Simulation = simulation(chain, settings, "torque" if by_torque else "velocity")
    control = None
    if by_torque:
        payload = sk.Inertia(settings.payload) if variant == "payload known" else None
        control = sk.ComputedTorque(chain, frequency=settings.frequency, payload=payload)
    done = execute(arm, plan, control, position_gain=settings.position_gain)
    tips = chain.pose(done.q)[:, :3, 3] - chain.pose(done.planned)[:, :3, 3]
    return ExecuteRun(robot, variant, chain.joint_names, plan.duration, done, np.linalg.norm(tips, axis=1))


def save_executions(runs: Sequence[ExecuteRun], file: str | pathlib.Path) -> pathlib.Path:
    """The table as CSV, SI units. Returns the file's path."""
    columns = (
        "variant",
        "max_error",
        "rms_error",
        "final_error",
        "max_tip_error",
        "final_tip_error",
        "max_effort",
        "saturated",
    )
    rows = [
        (
            run.variant,
            run.execution.max_error,
            run.execution.rms_error,
            run.execution.final_error,
            float(run.tip_error.max()),
            float(run.tip_error[-1]),
            run.execution.max_effort,
            run.execution.saturated,
        )
        for run in runs
    ]
    return save_csv(file, columns, rows)
