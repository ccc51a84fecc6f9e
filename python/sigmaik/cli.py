"""The command `sigmaik`: experiments (reach, limits, axis5, montecarlo, reaching, table, cart, track, execute), teleop,
robots and info.

Everything that is asked of a file or an option and is wrong there ends with one line on stderr and exit code
2.
"""

from __future__ import annotations

import argparse
import math
import os
import pathlib
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np

import sigmaik as sk

from . import experiments as ex
from ._extras import need
from ._types import Array
from .cli_cart import add_cart
from .cli_execute import add_execute
from .cli_montecarlo import add_montecarlo
from .cli_physics import add_physics_options, reach_in_physics
from .cli_reaching import add_reaching
from .cli_table import add_table
from .cli_teleop import add_teleop
from .cli_track import add_track
from .console import add_arm, add_links, terminal
from .experiments import axis5

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["main"]
AnyRun = TypeVar("AnyRun")


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command. Returns the exit code: 0, 2 for wrong input, 130 when interrupted."""
    arguments = _parser().parse_args(argv)
    try:
        result: int = arguments.run(arguments)
        sys.stdout.flush()
        return result
    except (ValueError, OSError) as error:
        if isinstance(error, BrokenPipeError):  # `sigmaik robots | head -1`
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        print(f"sigmaik: {_one_line(error)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="sigmaik", description="Velocity inverse kinematics at and near singularities."
    )
    parser.add_argument("--version", action="version", version=f"sigmaik {sk.__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    _add_reach(commands.add_parser("reach", help="drive an arm along a path by one method or several, and compare"))
    _add_axis5(commands.add_parser("axis5", help="drive a KUKA arm by its axis-5 singularity, within limits"))
    _add_limits(commands.add_parser("limits", help="what joint limits cost, and what breaks without them"))
    add_montecarlo(
        commands.add_parser(
            "montecarlo", help="random motions, clear of singularities or not: what it costs and brings"
        )
    )
    add_table(commands.add_parser("table", help="an arm round a table, with the geometry-aware index and without"))
    add_reaching(commands.add_parser("reaching", help="motions along a good geometry-aware index, and others"))
    add_cart(
        commands.add_parser("cart", help="an arm on a cart by its shoulder singularity: four ways to drive the cart")
    )
    add_teleop(commands.add_parser("teleop", help="drive an arm from a page in the browser, through its singularities"))
    add_track(commands.add_parser("track", help="a target that moves, seen by a camera: errors, delay, jerk, events"))
    add_execute(
        commands.add_parser(
            "execute", help="a time-optimal motion in physics, by computed torque and by velocity loops"
        )
    )
    robots = commands.add_parser("robots", help="list the arms that are shipped, and their paths")
    robots.set_defaults(run=_robots)
    _add_info(commands.add_parser("info", help="an arm's joints, limits, reach and singular values"))
    return parser


# --- reach


def _add_reach(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Runs the closed loop, prints a table, and writes the time series, the table and a picture. What is "
        "not given comes from the J-PARSE paper's experiments with that arm. The last line on stdout is the "
        "picture's path."
    )
    parser.epilog = (
        "methods: "
        + "; ".join(f"{name} ({title})" for name, title in ex.SHORT_NAMES.items())
        + ". Parameters follow a colon: dls:damping=0.8, jparse:gain=2,continuous=false. Lists that start "
        "with a minus need an equals sign: --posture=-0.1,0.2,…"
    )
    arm = parser.add_argument_group("the arm and its way")
    add_arm(arm)
    arm.add_argument(
        "--path",
        default="extended-line",
        help="a name from `sigmaik robots`, or a CSV or JSON file of waypoints: x, y, z [m], roll, pitch, "
        "yaw [rad, fixed axes], duration [s] (%(default)s)",
    )
    arm.add_argument("--start", metavar="Q", help="joint positions to start from: home, zero, or a comma list")
    arm.add_argument(
        "--method",
        action="append",
        metavar="NAME[:PARAMETER=VALUE,…]",
        help="may be repeated; a comma list, or all (all)",
    )
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
    for option, unit, text in (
        ("--rate", "HZ", "control rate"),
        ("--gain-linear", "1/S", "position error to velocity"),
        ("--gain-angular", "1/S", "orientation error to angular velocity"),
        ("--max-position-error", "M", "longer position errors are shortened to it"),
        ("--max-orientation-error", "RAD", "longer orientation errors are shortened to it"),
        ("--gamma", "Γ", "threshold of J-PARSE and its ablations on σ_i/σ_max"),
        ("--singular-gain", "K", "J-PARSE's gain in singular directions"),
        ("--posture-gain", "1/S", "pull towards the posture"),
        ("--posture-max-speed", "RAD/S", "cap on each joint's posture speed"),
        ("--length-scale", "M", "1 rad weighs as much as this length"),
    ):
        loop.add_argument(option, type=float, metavar=unit, help=text)
    loop.add_argument("--posture", metavar="Q", help="nominal joint positions: home, zero, or a comma list")
    add_physics_options(parser)
    out = parser.add_argument_group("what is written")
    out.add_argument("--out", default="sigmaik-reach", type=pathlib.Path, metavar="DIR", help="(%(default)s)")
    out.add_argument("--format", choices=("npz", "csv", "none"), default="npz", help="of the time series (%(default)s)")
    out.add_argument("--no-plot", action="store_true", help="no picture; the last line is the table's path then")
    parser.set_defaults(run=_reach)


def _reach(arguments: argparse.Namespace) -> int:
    console = terminal()
    if not arguments.no_plot:
        need("matplotlib")
    # Parsed before anything runs, so that a wrong option is told at once.
    changes = {
        name: getattr(arguments, name)
        for name in (
            "rate",
            "gain_linear",
            "gain_angular",
            "max_position_error",
            "max_orientation_error",
            "gamma",
            "singular_gain",
            "posture_gain",
            "posture_max_speed",
            "length_scale",
        )
    }
    for name in ("start", "posture"):
        text = getattr(arguments, name)
        if text is not None:
            _, chain, home, _ = sk.robots.open(arguments.robot, arguments.base, arguments.tip)
            changes[name] = tuple(_configuration(f"--{name}", text, chain, home))
    experiment = ex.load(arguments.robot, arguments.path, base=arguments.base, tip=arguments.tip, **changes)
    methods = _methods(arguments, experiment.settings)
    held = _limits(arguments.limits, experiment.chain)
    stem = f"{experiment.robot}-{experiment.path.name}"
    if arguments.gains and not arguments.method:
        stem += "-gains"
    if arguments.physics:
        return reach_in_physics(
            arguments,
            console,
            _headline(experiment),
            experiment,
            lambda run: _run_all(experiment, methods, held, run),
            stem,
        )
    runs = _run_all(experiment, methods, held, lambda method, on, progress: ex.run(experiment, method, on, progress))

    from .experiments.table import summary_table

    console.print(_headline(experiment), highlight=False)
    rows = [row for run in runs for row in ex.summarize(run)]
    for limits in sorted({run.velocity_limits for run in runs}):
        title = f"joint speed limits {'on' if limits else 'off'}"
        console.print()
        console.print(summary_table(experiment, [r for r in rows if r.velocity_limits == limits], title))

    out: pathlib.Path = arguments.out
    if arguments.format != "none":
        for run in runs:
            name = run.method.file_name + ("-limits" if run.velocity_limits else "")
            ex.save_run(run, out / f"{stem}-{name}.{arguments.format}", arguments.format)
        print(f"time series: {len(runs)} files {out / stem}-*.{arguments.format}")
    table = ex.save_summary(rows, out / f"{stem}.csv")
    if arguments.no_plot:
        print(table)
        return 0
    print(f"table: {table}")

    from . import plots

    print(plots.save_figure(plots.experiment_figure(runs), out / f"{stem}.png"))
    return 0


def _methods(arguments: argparse.Namespace, settings: ex.Settings) -> list[ex.NamedMethod]:
    methods = []
    if arguments.gains:
        methods += ex.singular_gain_sweep(_numbers("--gains", arguments.gains), settings.gamma)
    if arguments.method or not methods:
        methods = ex.parse_methods(arguments.method or ["all"], settings) + methods
    return methods


def _limits(choice: str, chain: sk.Chain) -> list[bool]:
    if choice == "both" and not np.isfinite(chain.limits.velocity).any():
        return [False]
    return {"on": [True], "off": [False], "both": [False, True]}[choice]


def _run_all(
    experiment: ex.Experiment,
    methods: Sequence[ex.NamedMethod],
    limits: Sequence[bool],
    run: Callable[[ex.NamedMethod, bool, Callable[[int], None]], AnyRun],
) -> list[AnyRun]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    runs = []
    columns = (TextColumn("{task.description:<40}"), BarColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("", total=experiment.samples * len(methods) * len(limits))
        for held in limits:
            for method in methods:
                progress.update(task, description=f"{method.label}{', speed limits on' if held else ''}")
                runs.append(run(method, held, lambda cycles: progress.advance(task, cycles)))
    return runs


def _headline(experiment: ex.Experiment) -> str:
    s = experiment.settings
    posture = f"posture {s.posture_gain:g}/s" if s.posture_gain else "no posture"
    return (
        f"{experiment.robot}, {experiment.path.name}: {experiment.path.description or 'no description'}\n"
        f"{experiment.path.duration:g} s at {s.rate:g} Hz, gains {s.gain_linear:g} and {s.gain_angular:g}/s, "
        f"position error capped at {s.max_position_error:g} m, γ = {s.gamma:g}, {posture}"
    )


# --- axis5


def _add_axis5(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Two experiments on a KUKA KR 6 R900 (Schreiber, Otter, Hirzinger 1999): closed form against "
        "constrained least squares with the position exact, without the error's rate (β = 0), with time "
        "scaling, and with time scaling and all six rows exact. Prints tables, and writes the time series, "
        "the table and pictures. The last line on stdout is the overview picture's path."
    )
    motion = parser.add_argument_group("the motion")
    motion.add_argument(
        "--example",
        type=int,
        choices=axis5.EXAMPLES,
        required=True,
        help="1: there and back, close by the singularity; 2: straight across it",
    )
    for option, unit, text in (
        ("--distance", "M", "from one end of the line to the other (0.2)"),
        ("--duration", "S", "from one end to the other (2, 0.5)"),
        ("--offset", "DEG", "of axis 5 from zero, where it is closest (1), or at the start (0)"),
    ):
        motion.add_argument(option, type=float, metavar=unit, help=text)
    solver = parser.add_argument_group("the samples and the solver")
    for option, unit, text in (
        ("--dt", "S", "from one sample to the next (0.004)"),
        ("--beta", "Β", "weight of the error's change in a sample (5 at 1 ms, ∝ 1/√dt)"),
        ("--gamma", "Γ", "weight of the time scaling (0.005 at 4 ms, ∝ √dt)"),
        ("--max-error", "DEG", "largest orientation error about each axis; inf for any (3)"),
    ):
        solver.add_argument(option, type=float, metavar=unit, help=text)
    solver.add_argument("--iterations", type=int, help="linearisations a sample (2)")
    out = parser.add_argument_group("what is written")
    out.add_argument("--out", default="sigmaik-axis5", type=pathlib.Path, metavar="DIR", help="(%(default)s)")
    out.add_argument("--format", choices=("npz", "csv", "none"), default="npz", help="of the time series (%(default)s)")
    out.add_argument("--no-plots", action="store_true", help="no pictures; the last line is the table's path then")
    parser.set_defaults(run=_axis5)


def _axis5(arguments: argparse.Namespace) -> int:
    console = terminal()
    if not arguments.no_plots:
        need("matplotlib")
    offset = None if arguments.offset is None else math.radians(arguments.offset)
    motion = axis5.motion(arguments.example, arguments.distance, arguments.duration, offset)
    changes = {name: getattr(arguments, name) for name in ("dt", "beta", "gamma", "iterations")}
    if arguments.max_error is not None:
        changes["max_error"] = math.radians(arguments.max_error)
    settings = axis5.Settings(**{name: value for name, value in changes.items() if value is not None})
    tracks = [axis5.run(motion, variant, settings) for variant in axis5.VARIANTS]
    rows = [axis5.summarize(track) for track in tracks]

    console.print(axis5.headline(motion, settings), highlight=False)
    console.print(axis5.summary_table(rows))
    console.print(axis5.smoothness_table(rows))
    out: pathlib.Path = arguments.out
    stem = f"axis5-example{motion.example}"
    if arguments.format != "none":
        for track in tracks:
            axis5.save_track(track, out / f"{stem}-{track.variant}.{arguments.format}", arguments.format)
        print(f"time series: {len(tracks)} files {out / stem}-*.{arguments.format}")
    table = axis5.save_summary(rows, out / f"{stem}.csv")
    if arguments.no_plots:
        print(table)
        return 0
    print(f"table: {table}")

    from . import plots_axis5
    from .plots import save_figure

    for joint in range(6):
        save_figure(plots_axis5.axis_figure(tracks, joint), out / f"{stem}-axis{joint + 1}.png")
    save_figure(plots_axis5.error_figure(tracks), out / f"{stem}-error.png")
    print(f"pictures: {out / stem}-axis1.png to -axis6.png and {stem}-error.png")
    print(save_figure(plots_axis5.overview_figure(tracks), out / f"{stem}.png"))
    return 0


# --- limits


def _add_limits(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Drives an arm beyond its reach, beyond its joint limits, and by random twists, with its limits "
        "held in three ways, clamped joint by joint, and not at all. Prints tables, and writes their figures "
        "as CSV, pictures, and the time series if asked. The last line on stdout is the CSV file's path."
    )
    parser.epilog = "ways: " + "; ".join(f"{name}: {text}" for name, text in ex.VARIANTS.items())
    add_arm(parser)
    parser.add_argument("--method", default="jparse", help="the rule, as for reach (%(default)s)")
    defaults = ex.LimitsSettings()
    for option, kind, unit, text in (
        ("--seed", int, "N", "of directions, starts and twists"),
        ("--rate", float, "HZ", "control rate"),
        ("--trials", int, "N", "directions that the target out of reach is tried in"),
        ("--seconds", float, "S", "of random twists"),
        ("--pace", float, "X", "the other scenarios take X times as long"),
        ("--acceleration", float, "LIMIT", "of all joints, rad/s² or m/s² (the arm's own)"),
        ("--jerk", float, "LIMIT", "of all joints, rad/s³ or m/s³ (the arm's own)"),
    ):
        name = option.removeprefix("--")
        value = getattr(defaults, name)
        shown = text if value is None else f"{text} ({value:g})"
        parser.add_argument(option, type=kind, default=value, metavar=unit, help=shown)
    out = parser.add_argument_group("what is written")
    out.add_argument("--out", default="sigmaik-limits", type=pathlib.Path, metavar="DIR", help="(%(default)s)")
    out.add_argument(
        "--format",
        choices=("npz", "none"),
        default="none",
        help="of the time series, 10 MB each (%(default)s)",
    )
    out.add_argument("--no-plot", action="store_true", help="no pictures")
    parser.set_defaults(run=_run_limits)


def _run_limits(arguments: argparse.Namespace) -> int:
    console = terminal()
    if not arguments.no_plot:
        need("matplotlib")
    names = ("seed", "rate", "trials", "seconds", "pace", "acceleration", "jerk")
    settings = ex.LimitsSettings(**{name: getattr(arguments, name) for name in names})
    experiment = ex.load_limits(arguments.robot, settings, arguments.method, base=arguments.base, tip=arguments.tip)

    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from .experiments.table import broken_table, cost_table, hold_table

    out: pathlib.Path = arguments.out
    rows, pictures = [], []
    stderr = Console(stderr=True)
    columns = (TextColumn("{task.description:<32}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=stderr, transient=True, disable=not stderr.is_terminal) as progress:
        task = progress.add_task("", total=experiment.cycles * len(ex.VARIANTS))
        for scenario, trials in experiment.trials.items():
            stem = f"{experiment.robot}-limits-{scenario.replace(' ', '-')}"
            shown = []
            for variant in ex.VARIANTS:
                progress.update(task, description=f"{scenario}, {variant}")
                traces = [
                    ex.drive(experiment, scenario, trial, variant, lambda n: progress.advance(task, n))
                    for trial in trials
                ]
                rows.append(ex.summarize_limits(traces))
                if arguments.format != "none":
                    ex.save_traces(traces, out / f"{stem}-{variant.replace(' ', '-')}.npz")
                shown.append(traces[ex.shown_trial(scenario, trials)])
            if not arguments.no_plot:
                from . import plots

                window = (0.0, min(15.0, settings.seconds)) if scenario == "teleoperation" else None
                figure = plots.limits_figure(shown, window)
                pictures.append(plots.save_figure(figure, out / f"{stem}.png"))

    text = f"{experiment.robot}, {experiment.method.label}, {settings.rate:g} Hz, seed {settings.seed}"
    console.print(text, highlight=False)
    for scenario in experiment.trials:
        console.print(f"  {scenario}: {ex.SCENARIOS[scenario]}", highlight=False)
    for table in (broken_table(rows), cost_table(rows), hold_table(rows)):
        console.print()
        console.print(table)
    console.print(
        "\nbroken: joints times cycles; by rad or m, or times the limit. limited: cycles in\n"
        "which limits changed the tool's motion; others help: only the joints'. done:\n"
        "part of the rule's twist. direction: from the rule's to the tool's velocity\n"
        "while limited, median and 95 %. turns: rotation not asked for, then, rms.\n"
        "error: at the end of a hold, median.",
        highlight=False,
    )
    if arguments.format != "none":
        print(f"time series: {out / experiment.robot}-limits-*.npz")
    for picture in pictures:
        print(f"picture: {picture}")
    print(ex.save_limits_summary(rows, out / f"{experiment.robot}-limits.csv"))
    return 0


# --- robots


def _robots(_: argparse.Namespace) -> int:
    console = terminal()
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("arm", no_wrap=True)
    table.add_column("joints", justify="right")
    table.add_column("paths of `sigmaik reach`")
    for name in sk.robots.names():
        table.add_row(name, str(sk.robots.load(name).dof), ", ".join(ex.names(name)))
    console.print(table)
    return 0


# --- info


def _add_info(parser: argparse.ArgumentParser) -> None:
    parser.description = "Joints, limits, reach, and the pose and singular values at a configuration."
    parser.add_argument("robot", metavar="ARM_OR_URDF", help="a shipped arm or a URDF file")
    add_links(parser)
    parser.add_argument(
        "--q", metavar="Q", default="home", help="home, zero, or a comma list: --q=-0.1,0.2,… (%(default)s)"
    )
    parser.add_argument(
        "--samples", type=int, default=2000, help="configurations to measure the reach at (%(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of these configurations (%(default)s)")
    parser.set_defaults(run=_info)


def _info(arguments: argparse.Namespace) -> int:
    console = terminal()
    from rich import box
    from rich.table import Table

    name, chain, home, source = sk.robots.open(arguments.robot, arguments.base, arguments.tip)
    q = _configuration("--q", arguments.q, chain, home)
    if arguments.samples < 1 or arguments.seed < 0:
        raise ValueError("--samples must be positive, and --seed not negative")
    text = source.read_text(encoding="utf-8")

    console.print(f"{name}: {chain.dof} joints from '{chain.base}' to '{chain.tip}'", highlight=False)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for head in ("joint", "type"):
        table.add_column(head)
    for head in ("lower", "upper", "speed", "accel.", "effort", "q"):
        table.add_column(head, justify="right", no_wrap=True)
    limits = chain.limits
    for i, joint in enumerate(chain.joint_names):
        values = (limits.lower, limits.upper, limits.velocity, limits.acceleration, limits.effort, q)
        table.add_row(joint, chain.joint_types[i], *(_figure(float(v[i])) for v in values))
    console.print(table)
    console.print("rad, rad/s, rad/s², N·m; m and N for prismatic joints; – is no limit", highlight=False)

    farthest = _sampled_reach(chain, arguments.samples, arguments.seed)
    bound = _reach_bound(text, chain)
    console.print(
        f"\nreach from the base's origin: {farthest:.3f} m at the best of {arguments.samples} random "
        f"configurations, at most {bound:.3f} m (sum of link offsets)",
        highlight=False,
    )
    pose = chain.pose(q)
    console.print(f"\nat q = {arguments.q}, tip in base:", highlight=False)
    for row in pose[:3]:
        console.print("  " + " ".join(f"{v + 0.0:9.4f}" for v in row), highlight=False)
    sigma = np.linalg.svd(chain.jacobian(q), compute_uv=False)
    ratio = sigma[-1] / sigma[0] if sigma[0] > 0.0 else 0.0
    console.print("singular values: " + " ".join(f"{s:.4g}" for s in sigma), highlight=False)
    console.print(f"σ_min/σ_max: {ratio:.4g}", highlight=False)
    m, xi = (float(sk.indices.evaluate(chain, q, index)) for index in ("manipulability", "geometry_aware"))
    console.print(
        f"manipulability: {m:.4g}, condition number: {sk.indices.condition_number(chain.jacobian(q)):.4g}, "
        f"geometry-aware index: {xi:.4g} (k = {sk.indices.reference_scale(chain):.3g})",
        highlight=False,
    )
    _singular_sets(console, chain, q)
    return 0


def _singular_sets(console: Console, chain: sk.Chain, q: Array) -> None:
    sets = sk.singularities.of(chain)
    if sets is None:
        console.print("\nsingular sets: not known; sk.singularities.find searches for them", highlight=False)
        return
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for head in ("singular set", "where"):
        table.add_column(head)
    for head in ("codim.", "√ψ here"):
        table.add_column(head, justify="right")
    described = zip(sets.names, sets.conditions, sets.codimensions, sets.residuals(q), strict=True)
    for name, condition, codimension, psi in described:
        table.add_row(name, condition, str(codimension), f"{math.sqrt(psi):.3f}")
    console.print()
    console.print(table)
    console.print("codimension 1: a wall; 2: there is a way round. √ψ: about the distance, in rad", highlight=False)


def _sampled_reach(chain: sk.Chain, samples: int, seed: int) -> float:
    generator = np.random.default_rng(seed)
    return max(float(np.linalg.norm(chain.pose(chain.random_configuration(generator))[:3, 3])) for _ in range(samples))


def _reach_bound(text: str, chain: sk.Chain) -> float:
    """Sum of the lengths of all joint origins from base to tip [m], and of the travel of prismatic joints."""
    joints = {}
    for joint in ElementTree.fromstring(text).findall("joint"):
        child = joint.find("child")
        if child is not None:
            joints[child.get("link")] = joint
    farthest = np.maximum(np.abs(chain.limits.lower), np.abs(chain.limits.upper))
    travel = dict(zip(chain.joint_names, farthest, strict=True))
    link: str | None = chain.tip
    total = 0.0
    while link != chain.base and link in joints:
        joint = joints[link]
        origin, parent = joint.find("origin"), joint.find("parent")
        xyz = (origin.get("xyz") if origin is not None else None) or "0 0 0"
        total += math.hypot(*(float(x) for x in xyz.split()))
        if joint.get("type") == "prismatic":
            total += float(travel[joint.get("name") or ""])
        link = parent.get("link") if parent is not None else None
    return total


# --- helpers


def _configuration(option: str, text: str, chain: sk.Chain, home: Array) -> Array:
    if text == "home":
        return home
    if text == "zero":
        return np.zeros(chain.dof)
    values = _numbers(option, text)
    if len(values) != chain.dof:
        raise ValueError(f"{option} has {len(values)} values, but the arm has {chain.dof} joints")
    return np.array(values)


def _numbers(option: str, text: str) -> list[float]:
    values = []
    for part in text.split(","):
        try:
            value = float(part)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ValueError(f"{option} is a comma list of numbers; '{part.strip()}' is none")
        values.append(value)
    return values


def _figure(value: float) -> str:
    return "–" if math.isinf(value) else f"{value + 0.0:.3f}"


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return " ".join(str(error).split())


if __name__ == "__main__":
    sys.exit(main())
