"""The study `sigmaik track`."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import sigmaik as sk
from sigmaik._extras import need
from sigmaik_lab.csv_file import save_rows
from sigmaik_lab.options import add_arm, add_methods, add_output, choices
from sigmaik_lab.reach.methods import parse_methods
from sigmaik_lab.reach.settings import ReachSettings
from sigmaik_lab.report import Csv, Picture, Report, Series
from sigmaik_lab.study import Progress

from .camera import Camera
from .experiment import ACCELERATION, JERK, MODES, Follow, TrackExperiment, TrackSettings, Variant, follow, load_track
from .files import save_follow
from .lens import Lens
from .rendered import Seen, Watching, report_watching, run_watching, watching
from .stage import EYES, LEAVES
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
#: Of a rendered camera: an option, a field of `Lens`, a unit, a text.
_LENS = (
    ("--view", "view", "°", "from the picture's lower edge to its upper edge"),
    ("--exposure", "exposure", "S", "of a picture"),
    ("--tag-size", "tag", "M", "side of the tag's black square"),
    ("--tilt", "tilt", "°", "of the tag, from the direction to the camera"),
)
_STATISTICAL = "statistical"
#: Defaults that differ where the camera is rendered. The offset is that of the statistical camera beside it.
_RENDERED = {"duration": 16.0, "offset": 0.3}
#: [s] for which the hand takes the tag out of view, and the part of the duration at which it begins.
_LEAVE = (0.8, 2.0)
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
    arm.add_argument(
        "--camera",
        default=_STATISTICAL,
        metavar="LIST",
        help=f"{_STATISTICAL}: samples of a random generator; or pictures of MuJoCo, with a tag that OpenCV finds, "
        "in place of them: " + "; ".join(f"{name}: {text}" for name, text in EYES.items()) + " (%(default)s)",
    )
    for title, options, defaults in (
        ("the camera", _CAMERA, Camera()),
        ("the loop", _SETTINGS, TrackSettings()),
    ):
        group = parser.add_argument_group(title)
        for option, name, unit, text in options:
            value = getattr(defaults, name)
            shown = "" if value is None else " (%(default)s)"
            if name in _RENDERED:
                value, shown = None, f" ({value:g}; {_RENDERED[name]:g} with a rendered camera)"
            group.add_argument(
                option, dest=f"track_{name}_{title[4:]}", type=float, default=value, metavar=unit, help=text + shown
            )
        if title == "the camera":
            group.add_argument(
                "--no-gap", action="store_true", help="the stream does not stop; the hand does not leave"
            )
        else:
            group.add_argument("--no-guide", action="store_true", help="the elbow may change its side")
    group = parser.add_argument_group("a rendered camera")
    group.add_argument("--pixels", default="424x240", metavar="WxH", help="of a picture (%(default)s)")
    leaves = "; ".join(f"{name}: {text}" for name, text in LEAVES.items())
    group.add_argument(
        "--leave", choices=LEAVES, default="turn", help=f"how the hand interrupts: {leaves} (%(default)s)"
    )
    for option, name, unit, text in _LENS:
        group.add_argument(
            option, dest=f"track_{name}_lens", type=float, default=getattr(Lens(), name), metavar=unit,
            help=text + " (%(default)s)",
        )  # fmt: skip
    add_output(parser, "sigmaik-track", ("npz",))


def load(args: argparse.Namespace) -> Iterable[Tracking | Watching]:
    given = vars(args)
    rendered = args.camera != _STATISTICAL
    values = {name: given[f"track_{name}_camera"] for _, name, _, _ in _CAMERA}
    values |= {name: given[f"track_{name}_loop"] for _, name, _, _ in _SETTINGS if name in _RENDERED}
    for name, value in _RENDERED.items():
        if values[name] is None:
            values[name] = value if rendered else getattr(Camera if name == "offset" else TrackSettings, name)
    duration = values.pop("duration")
    camera = Camera(**values)
    if rendered:
        camera = dataclasses.replace(camera, gap=_LEAVE)
    if args.no_gap:
        camera = dataclasses.replace(camera, gap=None)
    others = {name: given[f"track_{name}_loop"] for _, name, _, _ in _SETTINGS if name != "duration"}
    settings = TrackSettings(seed=args.seed, guided=not args.no_guide, duration=duration, **others)
    modes = choices("mode", args.mode, MODES)
    spoken = args.method or ["jparse" if rendered else "all"]
    methods = parse_methods(spoken, ReachSettings(rate=settings.rate, adaptive=True))
    wanted = {"on": [True], "off": [False], "both": [True, False]}[args.feedforward]

    def feeds(mode: str) -> list[bool]:  # a held sample has no twist that is worth feeding forward
        return [False] if mode == "raw" else wanted

    by_method = [Variant(method, modes[0], feeds(modes[0])[0]) for method in methods]
    if rendered:
        cameras, lens, film = choices("camera", args.camera, EYES), _lens(args), not args.no_plot
        need("mujoco", "cv2", *(["PIL"] if film else []))
        experiment = load_track(args.robot, args.target, settings, camera, args.base, args.tip)
        return [watching(experiment, cameras, lens, args.leave, by_method, film)]
    experiment = load_track(args.robot, args.target, settings, camera, args.base, args.tip)
    by_mode = [Variant(methods[0], mode, feed) for mode in modes for feed in feeds(mode)]
    return [Tracking(experiment, by_method, by_mode)]


def _lens(args: argparse.Namespace) -> Lens:
    width, _, height = args.pixels.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise ValueError(f"--pixels is WIDTHxHEIGHT, such as 424x240, and not '{args.pixels}'")
    lens = Lens(int(width), int(height), **{name: vars(args)[f"track_{name}_lens"] for _, name, _, _ in _LENS})
    lens.check()
    return lens


def run(work: Tracking | Watching, progress: Progress) -> dict[Variant, Follow] | list[Seen]:
    if isinstance(work, Watching):
        return run_watching(work, progress)
    e = work.experiment
    variants = work.variants + work.without_outliers
    progress.expect(len(e.poses) * len(variants))
    runs = {}
    for variant in variants:
        progress.say(variant.label)
        runs[variant] = follow(e, variant, progress.advance)
    return runs


def report(work: Tracking | Watching, runs: dict[Variant, Follow] | list[Seen]) -> Report:
    if isinstance(work, Watching):
        assert isinstance(runs, list)
        return report_watching(work, runs)
    assert isinstance(runs, dict)
    return _report(work, runs)


def _report(tracking: Tracking, runs: dict[Variant, Follow]) -> Report:
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
