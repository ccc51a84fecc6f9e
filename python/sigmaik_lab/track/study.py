"""The study `sigmaik track`."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import sigmaik as sk
from sigmaik_lab.csv_file import save_rows
from sigmaik_lab.options import add_arm, add_methods, add_output, choices
from sigmaik_lab.reach.methods import parse_methods
from sigmaik_lab.reach.settings import ReachSettings
from sigmaik_lab.report import Csv, Picture, Report, Series
from sigmaik_lab.study import Progress

from .camera import Camera
from .experiment import ACCELERATION, JERK, MODES, Follow, TrackExperiment, TrackSettings, Variant, follow, load_track
from .files import save_follow
from .summary import summarize_track
from .table import error_table, event_table, headline, motion_table
from .target import TARGETS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Tracking", "load", "options", "report", "run"]

_CAMERA = (
    ("--camera-rate", "rate", "HZ", "pictures"),
    ("--noise", "noise", "M", "standard deviation of the marker's place, each axis"),
    ("--rotation-noise", "rotation_noise", "RAD", "standard deviation of the marker's orientation"),
    ("--dropout", "dropout", "PART", "of the pictures show no marker"),
    ("--delay", "delay", "S", "from the picture to the sample"),
    ("--outliers", "outliers", "PART", "of the samples are elsewhere, or turned over"),
    ("--offset", "offset", "M", "from the marker to the target"),
)
_SETTINGS = (
    ("--rate", "rate", "HZ", "control rate"),
    ("--duration", "duration", "S", "of a target that is not recorded, at its own pace"),
    ("--pace", "pace", "PART", "of the speed of a target that is not recorded; by default 1, or what the arm can do"),
    ("--gain-linear", "gain_linear", "1/S", "position error to velocity"),
    ("--gain-angular", "gain_angular", "1/S", "orientation error to angular velocity"),
    ("--smoothing", "smoothing", "S", "of the stream"),
    ("--posture-gain", "posture_gain", "1/S", "pull towards home, where the arm is redundant"),
    ("--latency", "latency", "S", "of interpolation; by default the delay, and two pictures and a half"),
    ("--max-speed", "max_speed", "M/S", "of the stream"),
    ("--max-angular-speed", "max_angular_speed", "RAD/S", "of the stream"),
    ("--acceleration", "acceleration", "RAD/S²", f"limit of all joints (the arm's, or {ACCELERATION:g})"),
    ("--jerk", "jerk", "RAD/S³", f"limit of all joints (the arm's, or {JERK:g})"),
)


@dataclass(frozen=True)
class Tracking:
    """Every rule with the first mode, and every mode with the first rule."""

    experiment: TrackExperiment
    by_method: list[Variant]
    by_mode: list[Variant]

    @property
    def variants(self) -> list[Variant]:
        """All, each once."""
        return list(dict.fromkeys(self.by_mode + self.by_method))

    @property
    def without_outliers(self) -> list[Variant]:
        """The same modes without wrong samples, where there are wrong samples: the reference for their effect."""
        if not self.experiment.camera.outliers:
            return []
        return [dataclasses.replace(v, outliers=False) for v in self.by_mode if v.mode != "true"]


def options(parser: argparse.ArgumentParser) -> None:
    parser.epilog = (
        "targets: " + "; ".join(f"{name}: {text}" for name, text in TARGETS.items())
        + ". modes: " + "; ".join(f"{name}: {text}" for name, text in MODES.items())
        + f". methods: {', '.join(sk.methods.ALL)}, with parameters after a colon (dls:damping=0.8)."
    )  # fmt: skip
    arm = parser.add_argument_group("the arm and its target")
    add_arm(arm)
    arm.add_argument(
        "--target",
        default="marker",
        help=f"{', '.join(TARGETS)}, or a recording: CSV with columns t, x, y, z, roll, pitch, yaw, or npz with "
        "t (M,) and pose (M, 4, 4) (%(default)s)",
    )
    add_methods(arm)
    arm.add_argument("--mode", default="predict,interpolate,hold,raw,true", metavar="LIST", help="some of %(default)s")
    arm.add_argument(
        "--feedforward", choices=("on", "off", "both"), default="both", help="of the target's twist (%(default)s)"
    )
    arm.add_argument("--seed", type=int, default=0, help="of the hand and of the camera (%(default)s)")
    for title, options, defaults in (
        ("the camera", _CAMERA, Camera()),
        ("the loop", _SETTINGS, TrackSettings()),
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
        else:
            group.add_argument("--no-guide", action="store_true", help="the elbow may change its side")
    add_output(parser, "sigmaik-track", ("npz",))


def load(args: argparse.Namespace) -> Iterable[Tracking]:
    given = vars(args)
    camera = Camera(**{name: given[f"track_{name}_camera"] for _, name, _, _ in _CAMERA})
    if args.no_gap:
        camera = dataclasses.replace(camera, gap=None)
    settings = TrackSettings(
        seed=args.seed, guided=not args.no_guide, **{name: given[f"track_{name}_loop"] for _, name, _, _ in _SETTINGS}
    )
    modes = choices("mode", args.mode, MODES)
    methods = parse_methods(args.method or ["all"], ReachSettings(rate=settings.rate, adaptive=True))
    experiment = load_track(args.robot, args.target, settings, camera, args.base, args.tip)
    wanted = {"on": [True], "off": [False], "both": [True, False]}[args.feedforward]

    def feeds(mode: str) -> list[bool]:  # a held sample has no twist that is worth feeding forward
        return [False] if mode == "raw" else wanted

    by_mode = [Variant(methods[0], mode, feed) for mode in modes for feed in feeds(mode)]
    by_method = [Variant(method, modes[0], feeds(modes[0])[0]) for method in methods]
    return [Tracking(experiment, by_method, by_mode)]


def run(tracking: Tracking, progress: Progress) -> dict[Variant, Follow]:
    e = tracking.experiment
    variants = tracking.variants + tracking.without_outliers
    progress.expect(len(e.poses) * len(variants))
    runs = {}
    for variant in variants:
        progress.say(variant.label)
        runs[variant] = follow(e, variant, progress.advance)
    return runs


def report(tracking: Tracking, runs: dict[Variant, Follow]) -> Report:
    e, by_mode, by_method = tracking.experiment, tracking.by_mode, tracking.by_method
    rows = {v: summarize_track(runs[v], runs.get(dataclasses.replace(v, outliers=False))) for v in tracking.variants}
    by = {"method": [rows[v] for v in by_method], "mode": [rows[v] for v in by_mode]}
    tables = [
        text
        for table in (error_table, motion_table)
        for text in ("", table(by["method"], "method"), "", table(by["mode"], "mode"))
    ]
    stem = f"{e.robot}-{e.target}"
    # A figure has one line for each mode: the run with feed-forward where both were run.
    first: dict[str, Variant] = {}
    for v in by_mode:
        first.setdefault(v.mode, v)
    shown = list(first.values())
    pictures = [
        _picture(f"{stem}-rules", "time_figure", [runs[v] for v in by_method], "method"),
        _picture(f"{stem}-modes", "time_figure", [runs[v] for v in shown], "mode"),
        _picture(f"{stem}-path", "path_figure", runs[by_mode[0]]),
    ]
    if e.camera.outliers or e.camera.gap is not None:
        pictures.append(_picture(f"{stem}-events", "event_figure", [runs[v] for v in shown if v.mode != "true"]))
    return Report(
        [headline(e), *tables, "", event_table(by["mode"])],
        [
            *(_series(stem, runs[v]) for v in tracking.variants),
            Csv(stem, lambda file: save_rows(list(rows.values()), file)),
            *pictures,
        ],
    )


def _series(stem: str, done: Follow) -> Series:
    v = done.variant
    name = f"{v.method.file_name}-{v.mode}{'-feedforward' if v.feedforward else ''}"
    return Series(f"{stem}-{name}", lambda file, _: save_follow(done, file))


def _picture(stem: str, name: str, runs: Follow | Sequence[Follow], *by: str) -> Picture:
    def draw() -> Figure:
        from . import figure

        drawn: Figure = getattr(figure, name)(runs, *by)
        return drawn

    return Picture(stem, draw)
