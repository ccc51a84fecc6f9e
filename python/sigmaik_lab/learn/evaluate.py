"""Lets policies drive held-out scenes under several rules, and writes what the arm did."""

from __future__ import annotations

import argparse
import pathlib
from collections.abc import Sequence

import sigmaik as sk
from sigmaik._extras import need
from sigmaik_lab import output
from sigmaik_lab.work import add_work, check_work, compute, executor

from .drives import BASELINES
from .rollout import DEMONSTRATOR, Piece, digest, load_rollouts, roll, save_rollouts
from .scene import REGIONS

__all__ = ["HELD_OUT", "RULES", "options", "pieces", "run"]

#: The first seed of held-out scenes. Demonstrations have smaller seeds.
HELD_OUT = 1_000_000
#: The rules of the table; "default" is the library's.
RULES = ("jparse", "default", "stop", "dls", "position_ik")
#: Scenes of a piece of work.
_EACH = 25


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--policy",
        action="append",
        metavar="FILE",
        help=f"may be repeated; '{DEMONSTRATOR}' is the scripted one (all policies of --out, and the demonstrator)",
    )
    parser.add_argument(
        "--rule",
        action="append",
        metavar="NAME",
        help=f"of `sk.methods`, {', '.join(BASELINES)}, default; may be repeated",
    )
    parser.add_argument("--scenes", type=int, default=100, metavar="N", help="held-out scenes (%(default)s)")
    parser.add_argument("--region", choices=REGIONS, default="edge", help="(%(default)s)")
    parser.add_argument("--execute", type=int, default=4, metavar="N", help="actions of a chunk (%(default)s)")
    parser.add_argument("--denoise", type=int, default=10, metavar="N", help="steps of DDIM (%(default)s)")
    parser.add_argument(
        "--noise",
        type=float,
        default=0.5,
        metavar="STD",
        help="of which chunks are made; 1 as in training (%(default)g)",
    )
    parser.add_argument("--max-steps", type=int, default=300, metavar="N", help="actions of a scene (%(default)s)")
    parser.add_argument(
        "--out", type=pathlib.Path, default=pathlib.Path("sigmaik-learn"), metavar="DIR", help="(%(default)s)"
    )
    add_work(parser)


def run(args: argparse.Namespace) -> int:
    need("gymnasium")
    check_work(args)
    for name in ("scenes", "execute", "denoise", "max_steps"):
        if getattr(args, name) < 1:
            raise ValueError(f"--{name.replace('_', '-')} must be positive")
    if not 0.0 <= args.noise <= 1.0:
        raise ValueError("--noise must be from 0 to 1")
    policies = args.policy or [*map(str, sorted(args.out.glob("policy-*.pt"))), DEMONSTRATOR]
    rules = args.rule or list(RULES)
    robot = _check(policies, rules, args.execute)
    seeds = range(HELD_OUT, HELD_OUT + args.scenes)
    more = {name: getattr(args, name) for name in ("region", "execute", "denoise", "noise", "max_steps")}
    folder = args.out / "rollouts"
    work = {_file(folder, piece): piece for piece in pieces(policies, rules, seeds, robot=robot, **more)}
    left = [piece for file, piece in work.items() if not _done(file, piece)]
    names = {piece: file for file, piece in work.items()}
    with output.progress("learn evaluate") as progress, executor(args) as (pool, jobs):
        progress.expect(len(work))
        progress.advance(len(work) - len(left))
        for done in compute(roll, left, pool, jobs):
            file = save_rollouts(done, names[done.piece])
            good = sum(r.success for r in done.rollouts)
            progress.advance()
            progress.say(f"{file.stem}: {good} of {len(done.rollouts)}")
    output.say(f"{len(work)} files in {folder}; `sigmaik learn show` makes a table and a picture of them")
    print(folder)
    return 0


def pieces(policies: Sequence[str], rules: Sequence[str], seeds: Sequence[int], **more: object) -> list[Piece]:
    """All scenes of all policies under all rules. "default" is the library's rule. more: of `Piece`."""
    return [
        Piece(policy, None if rule == "default" else rule, tuple(seeds[k : k + _EACH]), **more)  # type: ignore[arg-type]
        for policy in policies
        for rule in rules
        for k in range(0, len(seeds), _EACH)
    ]


def _check(policies: Sequence[str], rules: Sequence[str], execute: int) -> str:
    """The arm of all policies. ValueError where there are several, or an option is wrong."""
    for rule in rules:
        if rule not in (*BASELINES, "default"):
            sk.methods.parse(rule)
    robots = set()
    for policy in policies:
        if policy == DEMONSTRATOR:
            continue
        need("torch")
        import torch

        from .policy import load_policy

        torch.set_num_threads(1)  # processes that are forked later would wait for this one's threads
        found = load_policy(policy)
        if execute > found.shape.horizon:
            raise ValueError(f"--execute is at most {found.shape.horizon}, the actions of a chunk of {policy}")
        robots.add(found.robot)
    if len(robots) > 1:
        raise ValueError(f"the policies are for several arms: {', '.join(sorted(robots))}")
    return robots.pop() if robots else Piece("", None, ()).robot


def _file(folder: pathlib.Path, piece: Piece) -> pathlib.Path:
    rule = "".join(c if c.isalnum() or c in "-_." else "_" for c in piece.rule or "default")
    name = f"{pathlib.Path(piece.policy).stem}-{rule}-{piece.region}-{piece.seeds[0] - HELD_OUT:04d}.npz"
    return folder / name


def _done(file: pathlib.Path, piece: Piece) -> bool:
    """Whether the file has this piece, by this policy."""
    if not file.exists():
        return False
    found = load_rollouts(file)
    return found.piece == piece and found.digest == digest(piece.policy)
