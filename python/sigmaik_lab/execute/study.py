"""The study `sigmaik execute`."""

from __future__ import annotations

import argparse
import pathlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

import sigmaik as sk
from sigmaik._extras import need
from sigmaik_lab.options import add_arm, add_output, open_arm
from sigmaik_lab.physical_arm import PhysicsSettings, add_physical_arm, physics_settings
from sigmaik_lab.report import Csv, Picture, Report
from sigmaik_lab.study import Progress

from .experiment import ExecuteRun, drive, save_executions, variants
from .table import execute_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Executed", "load", "options", "report", "run"]


@dataclass(frozen=True)
class Executed:
    """A plan, and the arm in physics that is to execute the plan."""

    arm: sk.robots.Arm
    plan: sk.planning.Trajectory
    settings: PhysicsSettings


def options(parser: argparse.ArgumentParser) -> None:
    motion = parser.add_argument_group("the motion")
    add_arm(motion, "franka_panda")
    motion.add_argument("--motion", type=int, default=0, metavar="N", help="seed of the two ends (%(default)s)")
    motion.add_argument("--plan", type=pathlib.Path, metavar="FILE", help="a saved trajectory instead")
    motion.add_argument(
        "--time-weight", type=float, default=600.0, help="of the plan's duration against its effort (%(default)g)"
    )
    motion.add_argument(
        "--pace", type=float, default=1.0, help="speed of the motion, as a multiple of the plan's (%(default)g)"
    )
    add_physical_arm(parser.add_argument_group("the arm in physics"))
    add_output(parser, "sigmaik-execute")


def load(args: argparse.Namespace) -> Iterable[Executed]:
    need("mujoco")
    if not 0.0 < args.pace < float("inf"):
        raise ValueError("--pace must be positive and finite")
    settings = physics_settings(args, "torque")
    arm = open_arm(args)
    if args.plan is not None:
        plan = sk.planning.Trajectory.load(args.plan)
    else:
        ends = np.random.default_rng(args.motion)
        start, goal = (arm.chain.random_configuration(ends) for _ in range(2))
        plan = sk.planning.time_optimal(arm.chain, start, goal, time_weight=args.time_weight)
        if plan.status == "failed":
            raise ValueError(f"no plan for --motion {args.motion}")
    return [Executed(arm, plan.retimed(plan.duration / args.pace), settings)]


def run(asked: Executed, progress: Progress) -> list[ExecuteRun]:
    ways = variants(asked.settings)
    progress.expect(len(ways))
    runs = []
    for variant in ways:
        progress.say(variant)
        runs.append(drive(asked.arm.name, asked.arm.chain, asked.plan, variant, asked.settings))
        progress.advance()
    return runs


def report(asked: Executed, runs: list[ExecuteRun]) -> Report:
    def draw() -> Figure:
        from .figure import execution_figure

        return execution_figure(runs)

    stem = f"{asked.arm.name}-execute"
    return Report(
        [execute_table(runs, f"{asked.arm.name}: {asked.plan.duration:.2f} s from rest to rest")],
        [Csv(stem, lambda file: save_executions(runs, file)), Picture(stem, draw)],
    )
