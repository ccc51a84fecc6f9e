"""The command `sigmaik execute`."""

from __future__ import annotations

import argparse
import pathlib

import numpy as np

import sigmaik as sk

from ._extras import need
from .cli_physics import add_arm_options, physics_settings
from .console import add_arm, terminal

__all__ = ["add_execute"]


def add_execute(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Plans a time-optimal motion from one random configuration to another, and executes it in MuJoCo: by computed "
        "torque, which knows of no payload, by one that does, and by the joints' velocity loops. Prints tracking "
        "errors and the torques used. The last line on stdout is the last file. Needs the extra sim."
    )
    motion = parser.add_argument_group("the motion")
    add_arm(motion, "franka_panda")
    motion.add_argument("--motion", type=int, default=0, metavar="N", help="seed of the two ends (%(default)s)")
    motion.add_argument("--plan", type=pathlib.Path, metavar="FILE", help="a saved trajectory instead")
    motion.add_argument(
        "--time-weight", type=float, default=600.0, help="of the plan's duration against its effort (%(default)g)"
    )
    motion.add_argument(
        "--pace", type=float, default=1.0, help="the plan's speed, as a part of what it was planned for (%(default)g)"
    )
    add_arm_options(parser.add_argument_group("the arm in physics"))
    out = parser.add_argument_group("what is written")
    out.add_argument("--out", default="sigmaik-execute", type=pathlib.Path, metavar="DIR", help="(%(default)s)")
    out.add_argument("--no-plot", action="store_true", help="no picture; the last line is the table's path then")
    parser.set_defaults(run=_execute)


def _execute(arguments: argparse.Namespace) -> int:
    console = terminal()
    need("mujoco")
    if not arguments.no_plot:
        need("matplotlib")
    if not 0.0 < arguments.pace < float("inf"):
        raise ValueError("--pace must be positive and finite")
    settings = physics_settings(arguments, "torque")

    from .experiments import execute
    from .experiments.execute_table import execute_table

    robot, chain, _, _ = sk.robots.open(arguments.robot, arguments.base, arguments.tip)
    if arguments.plan is not None:
        plan = sk.planning.Trajectory.load(arguments.plan)
    else:
        ends = np.random.default_rng(arguments.motion)
        start, goal = (chain.random_configuration(ends) for _ in range(2))
        plan = sk.planning.time_optimal(chain, start, goal, time_weight=arguments.time_weight)
        if plan.status == "failed":
            raise ValueError(f"no plan for --motion {arguments.motion}")
    plan = plan.retimed(plan.duration / arguments.pace)
    runs = [execute.drive(robot, chain, plan, variant, settings) for variant in execute.variants(settings)]
    console.print(execute_table(runs, f"{robot}: {plan.duration:.2f} s from rest to rest"))
    stem = f"{robot}-execute"
    last = execute.save_executions(runs, arguments.out / f"{stem}.csv")
    if not arguments.no_plot:
        from . import plots, plots_physics

        print(f"table: {last}")
        last = plots.save_figure(plots_physics.execution_figure(runs), arguments.out / f"{stem}.png")
    print(last)
    return 0
