"""`sigmaik reach --physics`, and the options of arms that have mass, which `sigmaik execute` shares."""

from __future__ import annotations

import argparse
import pathlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

from . import experiments as ex
from ._extras import need

if TYPE_CHECKING:
    from rich.console import Console

    from .experiments.physics import PhysicsRun, PhysicsSettings

__all__ = ["add_arm_options", "add_physics_options", "physics_settings", "reach_in_physics"]


def add_physics_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("physics, with the extra sim")
    group.add_argument(
        "--physics",
        nargs="?",
        const="velocity",
        choices=("velocity", "torque"),
        help="run every method once more on an arm with mass, in MuJoCo, and compare: joints driven by velocity loops "
        "(the default), or by computed torque",
    )
    group.add_argument(
        "--feedback",
        choices=("reference", "measured"),
        default="reference",
        help="reference: the drives follow the servo, which reads no measurements; measured: the method does, and the "
        "drives get its joint velocities alone (%(default)s)",
    )
    add_arm_options(group)


def add_arm_options(group: argparse._ArgumentGroup) -> None:
    """What the arm in physics is like."""
    group.add_argument(
        "--friction",
        type=float,
        default=0.0,
        metavar="PART",
        help="dry friction, as a part of the effort limits, and as much again, viscous, at the speed limits "
        "(%(default)g)",
    )
    for option, unit, text in (
        ("--payload", "KG", "a point mass at the tip, of which the drives do not know"),
        ("--noise", "RAD", "standard deviation of measured positions"),
        ("--velocity-noise", "RAD/S", "and of velocities"),
    ):
        group.add_argument(option, type=float, default=0.0, metavar=unit, help=f"{text} (%(default)g)")
    group.add_argument(
        "--delay", type=int, default=0, metavar="N", help="periods by which measurements are late (%(default)s)"
    )
    group.add_argument(
        "--period",
        type=float,
        default=1e-3,
        metavar="S",
        help="of the drives' commands; physics runs twice as fast (%(default)s)",
    )
    group.add_argument(
        "--frequency", type=float, default=20.0, metavar="RAD/S", help="of the computed torque (%(default)g)"
    )
    group.add_argument("--seed", type=int, default=0, help="of the noise (%(default)s)")


def physics_settings(
    arguments: argparse.Namespace,
    actuation: Literal["velocity", "torque"],
    feedback: Literal["reference", "measured"] = "reference",
) -> PhysicsSettings:
    """What `add_arm_options` has read."""
    from .experiments.physics import PhysicsSettings

    return PhysicsSettings(
        actuation=actuation,
        feedback=feedback,
        period=arguments.period,
        timestep=0.5 * arguments.period,
        frequency=arguments.frequency,
        friction=arguments.friction,
        payload=arguments.payload,
        position_noise=arguments.noise,
        velocity_noise=arguments.velocity_noise,
        delay=arguments.delay,
        seed=arguments.seed,
    )


def reach_in_physics(
    arguments: argparse.Namespace,
    console: Console,
    headline: str,
    experiment: ex.Experiment,
    run_all: Callable[[Callable[[ex.NamedMethod, bool, Callable[[int], None]], PhysicsRun]], list[PhysicsRun]],
    stem: str,
) -> int:
    """What `sigmaik reach --physics` does once its options are read. run_all: calls for every method and speed
    limits."""
    need("mujoco")
    from .experiments import physics
    from .experiments.physics_table import physics_table

    settings = physics_settings(arguments, arguments.physics, arguments.feedback)

    def run(method: ex.NamedMethod, held: bool, progress: Callable[[int], None]) -> physics.PhysicsRun:
        return physics.run_physics(experiment, method, held, settings, progress)

    runs = run_all(run)
    console.print(f"{headline}\n{_headline(settings)}", highlight=False)
    rows = [row for done in runs for row in physics.summarize_physics(done)]
    for held in sorted({row.velocity_limits for row in rows}):
        title = f"joint speed limits {'on' if held else 'off'}"
        console.print()
        console.print(physics_table([r for r in rows if r.velocity_limits == held], title))

    out: pathlib.Path = arguments.out
    stem += f"-{settings.actuation}" + ("-measured" if settings.feedback == "measured" else "")
    if arguments.format != "none":
        for done in runs:
            for part in (done.kinematic, done.physical):
                name = part.method.file_name + ("-limits" if part.velocity_limits else "")
                ex.save_run(part, out / f"{stem}-{name}.{arguments.format}", arguments.format)
        print(f"time series: {2 * len(runs)} files {out / stem}-*.{arguments.format}")
    table = physics.save_physics_summary(rows, out / f"{stem}.csv")
    if arguments.no_plot:
        print(table)
        return 0
    print(f"table: {table}")

    from . import plots, plots_physics

    print(plots.save_figure(plots_physics.physics_figure(runs), out / f"{stem}.png"))
    return 0


def _headline(s: PhysicsSettings) -> str:
    drives = "velocity loops" if s.actuation == "velocity" else f"computed torque at {s.frequency:g} rad/s"
    loop = "the servo's reference" if s.feedback == "reference" else "the method on measured joints"
    parts = [f"in physics: {drives} every {1e3 * s.period:g} ms follow {loop}"]
    if s.friction:
        parts.append(f"friction {100 * s.friction:g} % of effort limits")
    if s.payload:
        parts.append(f"payload {s.payload:g} kg")
    if s.position_noise or s.velocity_noise:
        parts.append(f"noise {s.position_noise:g} rad and {s.velocity_noise:g} rad/s")
    if s.delay:
        parts.append(f"measured {1e3 * s.delay * s.period:g} ms late")
    return ", ".join(parts)
