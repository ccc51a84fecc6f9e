"""The study with rendered cameras: an arm that follows a tag which OpenCV finds in MuJoCo's pictures."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sigmaik_lab.csv_file import save_rows
from sigmaik_lab.report import Csv, Film, Picture, Report, Series, Table
from sigmaik_lab.study import Progress

from .experiment import Follow, TrackExperiment, Variant, follow
from .files import save_follow
from .seen_summary import losses, summarize_seen
from .seen_table import lost_table, seen_headline, seen_table, tag_table
from .stage import Eye, Look, Stage, Still, make_stage

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .lens import Lens

__all__ = ["KNOWN", "STATISTICAL", "Seen", "Watching", "report_watching", "run_watching", "watching"]

#: The cameras that render nothing: the random generator's, and none at all, with the target known.
STATISTICAL, KNOWN = "statistical", "known"


@dataclass(frozen=True)
class Watching:
    """Every rendered camera with every rule; the first rule with the statistical camera, and with a known target."""

    hand: TrackExperiment  #: with the statistical camera's frames
    stages: list[Stage]
    variants: list[Variant]
    film: bool


@dataclass(frozen=True)
class Seen:
    """A run, and the pictures that were taken on the way."""

    camera: str
    run: Follow
    looks: list[Look]
    stills: list[Still]


def watching(
    e: TrackExperiment, cameras: list[str], lens: Lens, leave: str, variants: list[Variant], film: bool
) -> Watching:
    """ValueError where the lens is none, or a camera is not known."""
    lens.check()
    return Watching(e, [make_stage(e, camera, lens, leave) for camera in cameras], variants, film)


def run_watching(w: Watching, progress: Progress) -> list[Seen]:
    cycles = len(w.hand.poses)
    # A rendered run takes about ten times as long.
    progress.expect(cycles * (10 * len(w.stages) * len(w.variants) + 2))
    runs: list[Seen] = []
    for stage in w.stages:
        for variant in w.variants:
            progress.say(f"{stage.eye}, {variant.label}")
            runs.append(_watch(stage, variant, w.film and not runs, lambda n: progress.advance(10 * n)))
    first = w.variants[0]
    for camera, variant in ((STATISTICAL, first), (KNOWN, dataclasses.replace(first, mode="true"))):
        progress.say(f"{camera}, {variant.label}")
        runs.append(Seen(camera, follow(w.hand, variant, progress.advance), [], []))
    return runs


def _watch(stage: Stage, variant: Variant, film: bool, advance: Callable[[int], None]) -> Seen:
    eye = Eye(stage, film)
    try:
        run = follow(stage.experiment, variant, advance, eye.look)
    finally:
        eye.close()
    experiment = dataclasses.replace(stage.experiment, frames=tuple(eye.frames))
    return Seen(stage.eye, dataclasses.replace(run, experiment=experiment), eye.looks, eye.stills)


def report_watching(w: Watching, runs: list[Seen]) -> Report:
    rows = [summarize_seen(seen.camera, seen.run, seen.looks) for seen in runs]
    lost = [span for seen in runs for span in losses(seen.camera, seen.run, seen.looks)]
    e = w.hand
    stem = f"{e.robot}-{e.target}-camera"
    files: list[Series | Csv | Picture | Film] = [_series(f"{e.robot}-{e.target}", seen) for seen in runs]
    files.append(Csv(stem, lambda file: save_rows(rows, file)))
    if lost:
        files.append(Csv(f"{stem}-lost", lambda file: save_rows(lost, file)))

    def draw() -> Figure:
        from .seen_figure import seen_figure

        return seen_figure(w.stages[0].lens, runs)

    def film(file: pathlib.Path) -> None:
        from .film import save_film

        save_film(runs[0], file)

    if w.film:
        files += [Film(stem, film), Picture(stem, draw)]
    text: list[str | Table] = [seen_headline(w.stages[0], e), "", tag_table(rows), "", seen_table(rows)]
    if lost:
        text += ["", lost_table(lost)]
    return Report(text, files)


def _series(stem: str, seen: Seen) -> Series:
    v = seen.run.variant
    name = f"{seen.camera}-{v.method.file_name}-{v.mode}{'-feedforward' if v.feedforward else ''}"
    return Series(f"{stem}-{name}", lambda file, _: save_follow(seen.run, file))
