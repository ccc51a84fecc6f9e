"""The command `sigmaik track`."""

from __future__ import annotations

import argparse
import dataclasses
import pathlib

from ._extras import need
from .console import add_arm, terminal
from .experiments import track
from .experiments.methods import SHORT_NAMES, parse_methods
from .experiments.settings import Settings

__all__ = ["add_track"]

_CAMERA = (
    ("--camera-rate", "rate", "HZ", "pictures"),
    ("--noise", "noise", "M", "standard deviation of the marker's place, each axis"),
    ("--rotation-noise", "rotation_noise", "RAD", "of its orientation"),
    ("--dropout", "dropout", "PART", "of the pictures show no marker"),
    ("--delay", "delay", "S", "from the picture to the sample"),
    ("--outliers", "outliers", "PART", "of the samples are elsewhere, or turned over"),
    ("--offset", "offset", "M", "from the marker to the target"),
)
_SETTINGS = (
    ("--rate", "rate", "HZ", "control rate"),
    ("--duration", "duration", "S", "of a target that is not recorded"),
    ("--gain-linear", "gain_linear", "1/S", "position error to velocity"),
    ("--gain-angular", "gain_angular", "1/S", "orientation error to angular velocity"),
    ("--smoothing", "smoothing", "S", "of the stream"),
    ("--posture-gain", "posture_gain", "1/S", "pull towards home, where the arm is redundant"),
    ("--latency", "latency", "S", "of interpolation; by default the delay, and two pictures and a half"),
    ("--max-speed", "max_speed", "M/S", "of the stream"),
    ("--max-angular-speed", "max_angular_speed", "RAD/S", "of the stream"),
    ("--acceleration", "acceleration", "RAD/S²", f"limit of all joints (the arm's, or {track.ACCELERATION:g})"),
    ("--jerk", "jerk", "RAD/S³", f"limit of all joints (the arm's, or {track.JERK:g})"),
)


def add_track(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "An arm follows a target that moves, as a simulated camera sees it: late, noisy, some pictures without it, "
        "some wrong, and none at all for a while. Every rule with the first mode, and every mode with the first rule, "
        "all limits on. Prints tables of errors, delay, jerk and events, and writes time series, the tables and "
        "pictures. The last line on stdout is the last file."
    )
    parser.epilog = (
        "targets: " + "; ".join(f"{name}: {text}" for name, text in track.TARGETS.items())
        + ". modes: " + "; ".join(f"{name}: {text}" for name, text in track.MODES.items())
        + f". methods: {', '.join(SHORT_NAMES)}, with parameters after a colon (dls:damping=0.8)."
    )  # fmt: skip
    arm = parser.add_argument_group("the arm and its target")
    add_arm(arm)
    arm.add_argument(
        "--target",
        default="marker",
        help=f"{', '.join(track.TARGETS)}, or a recording: CSV with columns t, x, y, z, roll, pitch, yaw, or npz with "
        "t (M,) and pose (M, 4, 4) (%(default)s)",
    )
    arm.add_argument(
        "--method",
        action="append",
        metavar="NAME[:PARAMETER=VALUE,…]",
        help="may be repeated; a comma list, or all (all)",
    )
    arm.add_argument("--mode", default="predict,interpolate,hold,raw,true", metavar="LIST", help="some of %(default)s")
    arm.add_argument(
        "--feedforward", choices=("on", "off", "both"), default="both", help="of the target's twist (%(default)s)"
    )
    arm.add_argument("--seed", type=int, default=0, help="of the hand and of the camera (%(default)s)")
    for title, options, defaults in (
        ("the camera", _CAMERA, track.Camera()),
        ("the loop", _SETTINGS, track.TrackSettings()),
    ):
        group = parser.add_argument_group(title)
        for option, name, unit, text in options:
            value = getattr(defaults, name)
            shown = "" if value is None else " (%(default)s)"
            group.add_argument(
                option, dest=f"track_{name}_{title[4:]}", type=float, default=value, metavar=unit, help=text + shown
            )
        if title == "the camera":
            group.add_argument("--no-gap", action="store_true", help="the stream does not stop")
    out = parser.add_argument_group("what is written")
    out.add_argument("--out", default="sigmaik-track", type=pathlib.Path, metavar="DIR", help="(%(default)s)")
    out.add_argument("--format", choices=("npz", "none"), default="npz", help="of the time series (%(default)s)")
    out.add_argument("--no-plot", action="store_true", help="no pictures; the last line is the table's path then")
    parser.set_defaults(run=_track)


def _track(arguments: argparse.Namespace) -> int:
    console = terminal()
    if not arguments.no_plot:
        need("matplotlib")
    given = vars(arguments)
    camera = track.Camera(**{name: given[f"track_{name}_camera"] for _, name, _, _ in _CAMERA})
    if arguments.no_gap:
        camera = dataclasses.replace(camera, gap=None)
    settings = track.TrackSettings(
        seed=arguments.seed, **{name: given[f"track_{name}_loop"] for _, name, _, _ in _SETTINGS}
    )
    modes = arguments.mode.split(",")
    for mode in modes:
        if mode not in track.MODES:
            raise ValueError(f"no mode '{mode}'; there are {', '.join(track.MODES)}")
    methods = parse_methods(arguments.method or ["all"], Settings(rate=settings.rate))
    experiment = track.load_track(arguments.robot, arguments.target, settings, camera, arguments.base, arguments.tip)

    choices = {"on": [True], "off": [False], "both": [True, False]}[arguments.feedforward]

    def feeds(mode: str) -> list[bool]:  # a held sample has no twist that is worth to be fed forward
        return [False] if mode == "raw" else choices

    by_mode = [track.Variant(methods[0], mode, feed) for mode in modes for feed in feeds(mode)]
    by_method = [track.Variant(method, modes[0], feeds(modes[0])[0]) for method in methods]
    variants = list(dict.fromkeys(by_mode + by_method))
    runs = _run_all(experiment, variants)
    twins = [dataclasses.replace(v, outliers=False) for v in by_mode if v.mode != "true"] if camera.outliers else []
    without = dict(
        zip((dataclasses.replace(v, outliers=True) for v in twins), _run_all(experiment, twins), strict=True)
    )
    rows = {v: track.summarize_track(run, without.get(v)) for v, run in zip(variants, runs, strict=True)}
    run_of = dict(zip(variants, runs, strict=True))

    from .experiments.track_table import error_table, event_table, headline, motion_table

    console.print(headline(experiment), highlight=False)
    for table in (error_table, motion_table):
        console.print()
        console.print(table([rows[v] for v in by_method], "method"))
        console.print()
        console.print(table([rows[v] for v in by_mode], "mode"))
    console.print()
    console.print(event_table([rows[v] for v in by_mode]))

    out: pathlib.Path = arguments.out
    stem = f"{experiment.robot}-{experiment.target}"
    if arguments.format != "none":
        for run in runs:
            v = run.variant
            name = f"{v.method.file_name}-{v.mode}{'-feedforward' if v.feedforward else ''}"
            track.save_follow(run, out / f"{stem}-{name}.npz")
        print(f"time series: {len(runs)} files {out / stem}-*.npz")
    last = track.save_track_summary(list(rows.values()), out / f"{stem}.csv")
    if not arguments.no_plot:
        from . import plots_track
        from .plots import save_figure

        print(f"table: {last}")
        figures = {
            "rules": plots_track.time_figure([run_of[v] for v in by_method], by="method"),
            "modes": plots_track.time_figure(
                [run_of[v] for v in by_mode if v.feedforward == feeds(v.mode)[0]], by="mode"
            ),
            "path": plots_track.path_figure(run_of[by_mode[0]]),
        }
        if camera.outliers or not arguments.no_gap:
            shown = [run_of[v] for v in by_mode if v.mode != "true" and v.feedforward == feeds(v.mode)[0]]
            figures["events"] = plots_track.event_figure(shown)
        for name, figure in figures.items():
            last = save_figure(figure, out / f"{stem}-{name}.png")
            if name != list(figures)[-1]:
                print(f"picture: {last}")
    print(last)
    return 0


def _run_all(experiment: track.TrackExperiment, variants: list[track.Variant]) -> list[track.Follow]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (TextColumn("{task.description:<40}"), BarColumn(), TimeRemainingColumn())
    runs = []
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("", total=len(experiment.poses) * len(variants))
        for variant in variants:
            progress.update(task, description=variant.label)
            runs.append(track.follow(experiment, variant, lambda cycles: progress.advance(task, cycles)))
    return runs
