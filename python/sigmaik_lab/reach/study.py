"""The study `sigmaik reach`."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from sigmaik._extras import need
from sigmaik.methods import NamedMethod
from sigmaik_lab.csv_file import save_rows
from sigmaik_lab.options import (
    add_arm,
    add_methods,
    add_output,
    configuration,
    methods_epilog,
    numbers,
    open_arm,
)
from sigmaik_lab.physical_arm import PhysicsSettings, add_physical_arm, physics_settings
from sigmaik_lab.report import Csv, Picture, Report, Series
from sigmaik_lab.study import Progress

from . import experiment, physics
from .experiment import Experiment, Run
from .files import save_run
from .methods import parse_methods, singular_gain_sweep
from .physics import PhysicsRun
from .physics_table import physics_table
from .settings import SETTINGS
from .summary import summarize
from .table import summary_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Comparison", "load", "options", "report", "run"]

Runs: TypeAlias = list[Run] | list[PhysicsRun]

_SETTINGS = (
    ("--rate", "HZ", "control rate"),
    ("--gain-linear", "1/S", "position error to velocity"),
    ("--gain-angular", "1/S", "orientation error to angular velocity"),
    ("--max-position-error", "M", "longer position errors are shortened to this length"),
    ("--max-orientation-error", "RAD", "longer orientation errors are shortened to this angle"),
    ("--gamma", "Γ", "threshold of J-PARSE and its ablations on σ_i/σ_max"),
    ("--singular-gain", "K", "J-PARSE's gain in singular directions"),
    ("--posture-gain", "1/S", "pull towards the posture"),
    ("--posture-max-speed", "RAD/S", "cap on each joint's posture speed"),
    ("--length-scale", "M", "1 rad weighs as much as this length"),
)


@dataclass(frozen=True)
class Comparison:
    """Methods to compare, without joint speed limits or with, on a kinematic arm, or on one that has mass."""

    experiment: Experiment
    methods: list[NamedMethod]
    held: list[bool]
    physics: PhysicsSettings | None
    stem: str  #: of the files' names


def options(parser: argparse.ArgumentParser) -> None:
    parser.epilog = methods_epilog() + (" Lists that start with a minus need an equals sign: --posture=-0.1,0.2,…")
    arm = parser.add_argument_group("the arm and its way")
    add_arm(arm)
    arm.add_argument(
        "--path",
        default="extended-line",
        help="a name from `sigmaik robots`, or a CSV or JSON file of waypoints: x, y, z [m], roll, pitch, "
        "yaw [rad, fixed axes], duration [s] (%(default)s)",
    )
    arm.add_argument(
        "--setting",
        choices=SETTINGS,
        default="simulated",
        help="gains, cap, posture and time at a waypoint of the paper: "
        + "; ".join(f"{name}: {text}" for name, text in SETTINGS.items())
        + " (%(default)s)",
    )
    arm.add_argument("--start", metavar="Q", help="joint positions to start from: home, zero, or a comma list")
    add_methods(arm)
    arm.add_argument(
        "--gains",
        metavar="LIST",
        help="compare J-PARSE, as published, at these gains in singular directions: 0.5,1,2,4",
    )
    arm.add_argument(
        "--limits",
        choices=("on", "off", "both"),
        default="both",
        help="hold the arm's joint speed limits, or not, as published, or compare (%(default)s)",
    )
    loop = parser.add_argument_group("the loop")
    for option, unit, text in _SETTINGS:
        loop.add_argument(option, type=float, metavar=unit, help=text)
    loop.add_argument("--posture", metavar="Q", help="nominal joint positions: home, zero, or a comma list")
    group = parser.add_argument_group("physics, with the extra sim")
    group.add_argument(
        "--physics",
        nargs="?",
        const="velocity",
        choices=("velocity", "torque"),
        help="run every method once more on an arm with mass, in MuJoCo, and compare: joints driven by velocity "
        "loops (the default), or by computed torque",
    )
    group.add_argument(
        "--feedback",
        choices=("reference", "measured"),
        default="reference",
        help="reference: the drives follow the servo, which reads no measurements; measured: the method reads the "
        "measured joints, and the drives get its joint velocities alone (%(default)s)",
    )
    add_physical_arm(group)
    add_output(parser, "sigmaik-reach", ("npz", "csv"))


def load(args: argparse.Namespace) -> Iterable[Comparison]:
    arm = open_arm(args)
    changes = {name: getattr(args, name) for name in (option[2:].replace("-", "_") for option, _, _ in _SETTINGS)}
    for name in ("start", "posture"):
        text = getattr(args, name)
        if text is not None:
            changes[name] = tuple(configuration(f"--{name}", text, arm.chain, arm.home))
    loaded = experiment.load(args.robot, args.path, base=args.base, tip=args.tip, setting=args.setting, **changes)
    methods = []
    if args.gains:
        methods += singular_gain_sweep(numbers("--gains", args.gains), loaded.settings.gamma)
    if args.method or not methods:
        methods = parse_methods(args.method or ["all"], loaded.settings) + methods
    held = {"on": [True], "off": [False], "both": [False, True]}[args.limits]
    if args.limits == "both" and not np.isfinite(loaded.chain.limits.velocity).any():
        held = [False]
    stem = f"{loaded.robot}-{loaded.path.name}"
    if args.setting != "simulated":
        stem += f"-{args.setting}"
    if args.gains and not args.method:
        stem += "-gains"
    settings = None
    if args.physics:
        need("mujoco")
        settings = physics_settings(args, args.physics, args.feedback)
        stem += f"-{settings.actuation}" + ("-measured" if settings.feedback == "measured" else "")
    return [Comparison(loaded, methods, held, settings, stem)]


def run(comparison: Comparison, progress: Progress) -> Runs:
    c = comparison
    progress.expect(c.experiment.samples * len(c.methods) * len(c.held))

    def all_methods(one: Callable[[NamedMethod, bool], None]) -> None:
        for held in c.held:
            for method in c.methods:
                progress.say(f"{method.label}{', speed limits on' if held else ''}")
                one(method, held)

    if c.physics is None:
        runs: list[Run] = []
        all_methods(lambda method, held: runs.append(experiment.run(c.experiment, method, held, progress.advance)))
        return runs
    settings, physical = c.physics, list[PhysicsRun]()
    all_methods(
        lambda method, held: physical.append(
            physics.run_physics(c.experiment, method, held, settings, progress.advance)
        )
    )
    return physical


def report(comparison: Comparison, runs: Runs) -> Report:
    if comparison.physics is None:
        return _report(comparison, [done for done in runs if isinstance(done, Run)])
    return _report_physics(comparison, comparison.physics, [done for done in runs if isinstance(done, PhysicsRun)])


def _report(c: Comparison, runs: list[Run]) -> Report:
    def draw() -> Figure:
        from .figure import reach_figure

        return reach_figure(runs)

    rows = [row for done in runs for row in summarize(done)]
    tables = [
        text
        for held in sorted({done.velocity_limits for done in runs})
        for text in ("", summary_table(c.experiment, [r for r in rows if r.velocity_limits == held], _title(held)))
    ]
    return Report(
        [_headline(c.experiment), *tables],
        [
            *(_series(c, done) for done in runs),
            Csv(c.stem, lambda file: save_rows(rows, file)),
            Picture(c.stem, draw),
        ],
    )


def _report_physics(c: Comparison, settings: PhysicsSettings, runs: list[PhysicsRun]) -> Report:
    def draw() -> Figure:
        from .physics_figure import physics_figure

        return physics_figure(runs)

    rows = [row for done in runs for row in physics.summarize_physics(done)]
    tables = [
        text
        for held in sorted({row.velocity_limits for row in rows})
        for text in ("", physics_table([r for r in rows if r.velocity_limits == held], _title(held)))
    ]
    return Report(
        [f"{_headline(c.experiment)}\n{_physics_headline(settings)}", *tables],
        [
            *(_series(c, part) for done in runs for part in (done.kinematic, done.physical)),
            Csv(c.stem, lambda file: save_rows(rows, file)),
            Picture(c.stem, draw),
        ],
    )


def _series(c: Comparison, done: Run) -> Series:
    name = done.method.file_name + ("-limits" if done.velocity_limits else "")
    return Series(f"{c.stem}-{name}", lambda file, form: save_run(done, file, form))


def _title(held: bool) -> str:
    return f"joint speed limits {'on' if held else 'off'}"


def _headline(e: Experiment) -> str:
    s = e.settings
    posture = f"posture {s.posture_gain:g}/s" if s.posture_gain else "no posture"
    if s.posture_gain and np.isfinite(s.posture_max_speed):
        posture += f" up to {s.posture_max_speed:g} rad/s"
    return (
        f"{e.robot}, {e.path.name}: {e.path.description or 'no description'}\n"
        f"{e.path.duration:g} s at {s.rate:g} Hz, gains {s.gain_linear:g} and {s.gain_angular:g}/s, "
        f"position error capped at {s.max_position_error:g} m, γ = {s.gamma:g}, {posture}"
    )


def _physics_headline(s: PhysicsSettings) -> str:
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
