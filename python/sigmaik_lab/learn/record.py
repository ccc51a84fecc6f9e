"""Records demonstrations as a data set."""

from __future__ import annotations

import argparse
import pathlib
from typing import TYPE_CHECKING, Any

import numpy as np

import sigmaik as sk
from sigmaik._extras import need
from sigmaik_lab import output
from sigmaik_lab.report import Table

from .drives import BASELINES
from .episode import FPS, action_names, state_names
from .play import DEMONSTRATORS, Scenes, demonstrate
from .scene import REGIONS, task
from .spaces import IMAGE

if TYPE_CHECKING:
    from sigmaik_lab.study import Progress

    from .dataset import Writer

__all__ = ["options", "record", "run"]

#: The most scenes that step together. An episode does not depend on it.
_WAVE = 23
#: Attempts for each demonstration that is asked for, after which a demonstrator that fails is no longer tried.
_PATIENCE = 4


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--episodes", type=int, default=92, metavar="N", help="that succeed (%(default)s, the paper's)")
    parser.add_argument(
        "--demonstrator", choices=tuple(DEMONSTRATORS), default="scripted", help="steady: without noise (%(default)s)"
    )
    parser.add_argument("--robot", default="ufactory_xarm7", metavar="ARM_OR_URDF", help="(%(default)s)")
    parser.add_argument(
        "--rule", metavar="NAME[:PARAMETER=VALUE,…]", help=f"of `sk.methods`, or {', '.join(BASELINES)} (the library's)"
    )
    parser.add_argument("--region", choices=REGIONS, default="edge", help="(%(default)s)")
    parser.add_argument("--action", choices=("pose", "twist"), default="pose", help="(%(default)s)")
    parser.add_argument("--physics", choices=("kinematic", "mujoco"), default="kinematic", help="(%(default)s)")
    parser.add_argument("--images", action="store_true", help=f"of {IMAGE} pixels a side, drawn by MuJoCo")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the first scene (%(default)s)")
    parser.add_argument(
        "--data", type=pathlib.Path, metavar="DIR", help="where the demonstrations are (DIR of --out/demonstrations)"
    )
    parser.add_argument(
        "--out", type=pathlib.Path, default=pathlib.Path("sigmaik-learn"), metavar="DIR", help="(%(default)s)"
    )


def run(args: argparse.Namespace) -> int:
    need("gymnasium", "pyarrow", *(["mujoco"] if args.images or args.physics == "mujoco" else []))
    if args.episodes < 1 or not 0 <= args.seed < 2**31:
        raise ValueError("--episodes must be positive, and --seed from 0 to 2147483647")
    if args.rule is not None and args.rule not in BASELINES:
        sk.methods.parse(args.rule)
    folder = args.data or args.out / "demonstrations"
    scenes = Scenes(args.robot, args.rule, args.region, args.action, args.physics, args.images)
    with output.progress("learn record") as progress:
        tried = record(scenes, folder, args.episodes, args.seed, args.demonstrator, progress)
    output.say(_table(tried) if tried else f"{folder} has {args.episodes} demonstrations already")
    print(folder)
    return 0


def record(
    scenes: Scenes, folder: pathlib.Path, episodes: int, seed: int, demonstrator: str, progress: Progress
) -> list[dict[str, Any]]:
    """Adds demonstrations that succeed to a data set until the data set has `episodes` of them. Returns what was tried.

    Scenes have the seeds from `seed` on. A run that was interrupted goes on after the last seed in the data set.
    Error where the data set is of other scenes, ValueError where the demonstrator fails too often.
    """
    from .dataset import Writer

    if scenes.physics == "mujoco" or scenes.image:
        from sigmaik_lab.opengl import choose_opengl

        choose_opengl()
    found = task(scenes.robot, scenes.region)
    names = state_names(found.chain.joint_names), action_names(scenes.action)
    writer = Writer(folder, FPS, found.robot, *names, (IMAGE, IMAGE, 3) if scenes.image else None)
    _check(writer, scenes, folder)
    following = max([seed, *(int(scene["seed"]) + 1 for scene in writer.scenes())])
    progress.expect(episodes)
    progress.advance(min(len(writer), episodes))
    tried: list[dict[str, Any]] = []
    while len(writer) < episodes:
        wave = min(_WAVE, episodes - len(writer)) if scenes.together else 1
        for episode, broken in demonstrate(scenes, range(following, following + wave), demonstrator):
            if len(writer) == episodes:
                break
            tried.append({"steps": len(episode.times), "success": episode.success, "broken": broken})
            if episode.success:
                writer.add(episode)
                progress.say(f"seed {episode.scene['seed']}")
                progress.advance()
        following += wave
        failed = sum(not row["success"] for row in tried)
        if failed > _PATIENCE * episodes:
            raise ValueError(f"{failed} of {len(tried)} demonstrations failed; {folder} keeps the {len(writer)} others")
    writer.close()
    return tried


def _check(writer: Writer, scenes: Scenes, folder: pathlib.Path) -> None:
    """Error where the data set has episodes of other scenes."""
    for scene in writer.scenes():
        for name in ("rule", "region", "action", "physics"):
            if scene.get(name) != getattr(scenes, name):
                raise sk.Error(
                    f"{folder} has demonstrations with {name} {scene.get(name)}, not {getattr(scenes, name)}"
                )


def _table(tried: list[dict[str, Any]]) -> Table:
    good = [row for row in tried if row["success"]]
    table = Table("demonstrations: lengths in s, and cycles beyond a limit")
    table.add_numbers("tried", "succeeded", "frames", "shortest", "median", "longest", "broken")
    lengths = np.array([row["steps"] for row in good]) / FPS
    table.add_row(
        str(len(tried)),
        str(len(good)),
        str(sum(row["steps"] for row in good)),
        *(f"{value:.1f}" for value in np.percentile(lengths, [0, 50, 100])),
        str(sum(row["broken"] for row in tried)),
    )
    return table
