"""Makes a data set of the recordings of `sigmaik teleop`."""

from __future__ import annotations

import argparse
import pathlib
from collections.abc import Iterator

from sigmaik._extras import need
from sigmaik.teleop import Episode as Recording
from sigmaik_lab import output

from . import dataset
from .episode import FPS
from .recordings import action_columns, pieces, state_columns

__all__ = ["options", "run"]


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recordings", type=pathlib.Path, metavar="FOLDER_OR_FILE", help="of `sigmaik teleop` (.npz, or .part files)"
    )
    parser.add_argument("--fps", type=int, default=FPS, metavar="HZ", help="frames a second (%(default)s)")
    parser.add_argument(
        "--action", choices=("pose", "twist"), default="pose", help="the tool a frame later, or the twist (%(default)s)"
    )
    parser.add_argument("--task", default="teleoperation", metavar="TEXT", help="what was done (%(default)s)")
    parser.add_argument(
        "--out", type=pathlib.Path, default=pathlib.Path("sigmaik-recordings"), metavar="DIR", help="(%(default)s)"
    )


def run(args: argparse.Namespace) -> int:
    need("pyarrow")
    if not 1 <= args.fps <= 200:
        raise ValueError(f"--fps must be from 1 to 200, not {args.fps}")
    writer: dataset.Writer | None = None
    with output.progress("learn export") as progress:
        files = list(_files(args.recordings))
        progress.expect(len(files))
        for file in files:
            recording = Recording.load(file)
            if writer is None:
                states, actions = state_columns(recording), action_columns(args.action)
                writer = dataset.Writer(args.out, args.fps, recording.arm.name, states, actions, task=args.task)
                known = {scene.get("recording") for scene in writer.scenes()}
            if recording.arm.name != writer.robot or state_columns(recording) != states:
                raise ValueError(f"{file} is of {recording.arm.name}, and the data set of {writer.robot}")
            progress.say(file.name)
            if file.name not in known:
                for piece in pieces(recording, file.name, args.fps, args.action):
                    writer.add(piece)
            progress.advance()
    if writer is None or not len(writer):
        raise ValueError(f"{args.recordings} has no recording of two frames at {args.fps} Hz")
    writer.close()
    output.say(f"{len(writer)} episodes of {writer.robot} at {args.fps} Hz")
    print(args.out)
    return 0


def _files(path: pathlib.Path) -> Iterator[pathlib.Path]:
    if path.is_dir():
        yield from sorted(path.glob("*.npz"))
    else:
        yield path
