"""Trains diffusion policies on demonstrations, one for each seed."""

from __future__ import annotations

import argparse
import pathlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sigmaik._extras import need
from sigmaik_lab import output
from sigmaik_lab.report import Table
from sigmaik_lab.work import add_work, check_work, compute, executor

if TYPE_CHECKING:
    from .training import Losses

__all__ = ["Piece", "options", "run", "train"]

#: Steps between two checkpoints.
_EVERY = 250


@dataclass(frozen=True)
class Piece:
    """Some steps of the training of one policy, from its checkpoint on."""

    data: str  #: folder of the data set
    file: str  #: of the policy; the checkpoint lies beside it
    seed: int
    steps: int
    batch: int
    until: int  #: the last step of the piece


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--data", type=pathlib.Path, metavar="DIR", help="the demonstrations (DIR of --out/demonstrations)"
    )
    parser.add_argument("--steps", type=int, default=2500, metavar="N", help="of training (%(default)s)")
    parser.add_argument("--batch", type=int, default=256, metavar="N", help="frames of a step (%(default)s)")
    parser.add_argument("--seed", default="0,1,2", metavar="LIST", help="a policy for each (%(default)s)")
    parser.add_argument("--fresh", action="store_true", help="train anew, and do not go on where a run was interrupted")
    parser.add_argument(
        "--out", type=pathlib.Path, default=pathlib.Path("sigmaik-learn"), metavar="DIR", help="(%(default)s)"
    )
    add_work(parser)


def run(args: argparse.Namespace) -> int:
    need("torch", "pyarrow")
    from . import dataset

    check_work(args)
    seeds = _seeds(args.seed)
    if args.steps < 1 or args.batch < 1:
        raise ValueError("--steps and --batch must be positive")
    data = args.data or args.out / "demonstrations"
    facts = dataset.info(data)
    output.say(
        f"{facts['total_episodes']} demonstrations, {facts['total_frames']} frames, {facts['robot_type']}; "
        f"{args.steps} steps of {args.batch} frames"
    )
    files = {seed: args.out / f"policy-{seed}.pt" for seed in seeds}
    if args.fresh:
        for file in files.values():
            _checkpoint(file).unlink(missing_ok=True)
    ends = [*range(_EVERY, args.steps, _EVERY), args.steps]
    told: dict[int, Losses] = {}
    with output.progress("learn train") as progress, executor(args) as (pool, jobs):
        progress.expect(len(ends) * len(seeds))
        for until in ends:
            pieces = [Piece(str(data), str(files[seed]), seed, args.steps, args.batch, until) for seed in seeds]
            for piece, losses in compute(train, pieces, pool, jobs):
                told[piece.seed] = losses
                progress.advance()
                progress.say(f"seed {piece.seed}, step {losses.step}: noise loss {losses.train:.4f}")
    table = Table("noise loss (mean square of the noise that is not found)", "policy")
    table.add_numbers("steps", "training", "held out", "s")
    for seed, file in files.items():
        last = told[seed]
        table.add_row(file.stem, str(last.step), f"{last.train:.4f}", f"{last.held_out:.4f}", f"{last.seconds:.0f}")
    output.say(table)
    for file in files.values():
        print(file)
    return 0


def train(piece: Piece) -> tuple[Piece, Losses]:
    """Trains from the checkpoint, if there is one, to the piece's last step, and writes the checkpoint and the policy.

    One thread, whatever the number of cores: with another number sums are rounded otherwise, and weights differ.
    """
    import torch

    from . import dataset
    from .training import Trainer, Training

    torch.set_num_threads(1)
    robot = str(dataset.info(piece.data)["robot_type"])
    trainer = Trainer(robot, dataset.read(piece.data), Training(piece.steps, piece.batch, seed=piece.seed))
    file = pathlib.Path(piece.file)
    policy = trainer.run(_checkpoint(file), _EVERY, until=piece.until)
    if piece.until == piece.steps:
        policy.save(file)
    return piece, trainer.losses[-1]


def _checkpoint(file: pathlib.Path) -> pathlib.Path:
    return file.with_suffix(".part")


def _seeds(text: str) -> list[int]:
    parts = [part.strip() for part in text.split(",")]
    if not all(part.isdigit() for part in parts) or len(set(parts)) != len(parts):
        raise ValueError(f"--seed is a comma list of different numbers, not '{text}'")
    return [int(part) for part in parts]
