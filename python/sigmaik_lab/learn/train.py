"""Trains diffusion policies on demonstrations, one for each seed."""

from __future__ import annotations

import argparse
import pathlib

from sigmaik._extras import need
from sigmaik_lab import output
from sigmaik_lab.report import Table

__all__ = ["options", "run"]


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--data", type=pathlib.Path, metavar="DIR", help="the demonstrations (DIR of --out/demonstrations)"
    )
    parser.add_argument("--steps", type=int, default=3000, metavar="N", help="of training (%(default)s)")
    parser.add_argument("--batch", type=int, default=256, metavar="N", help="frames of a step (%(default)s)")
    parser.add_argument("--seed", default="0", metavar="LIST", help="a policy for each (%(default)s)")
    parser.add_argument("--threads", type=int, metavar="N", help="of torch (one for each core)")
    parser.add_argument(
        "--fresh", action="store_true", help="train anew, in place of going on where a run was interrupted"
    )
    parser.add_argument(
        "--out", type=pathlib.Path, default=pathlib.Path("sigmaik-learn"), metavar="DIR", help="(%(default)s)"
    )


def run(args: argparse.Namespace) -> int:
    need("torch", "pyarrow")
    from . import dataset
    from .training import Losses, Trainer, Training

    seeds = _seeds(args.seed)
    if args.steps < 1 or args.batch < 1 or (args.threads is not None and args.threads < 1):
        raise ValueError("--steps, --batch and --threads must be positive")
    if args.threads is not None:
        import torch

        torch.set_num_threads(args.threads)
    folder = args.data or args.out / "demonstrations"
    robot, episodes = str(dataset.info(folder)["robot_type"]), dataset.read(folder)
    frames = sum(len(episode.times) for episode in episodes)
    output.say(f"{len(episodes)} demonstrations, {frames} frames, {robot}; {args.steps} steps of {args.batch} frames")
    table = Table("noise loss", "policy")
    table.add_numbers("steps", "training", "held out", "s")
    files = []
    with output.progress("learn train") as progress:
        progress.expect(args.steps * len(seeds))
        for seed in seeds:
            file = args.out / f"policy-{seed}.pt"
            checkpoint = file.with_suffix(".part")
            if args.fresh:
                checkpoint.unlink(missing_ok=True)
            trainer = Trainer(robot, episodes, Training(steps=args.steps, batch=args.batch, seed=seed))
            done = 0

            def told(losses: Losses, seed: int = seed) -> None:
                nonlocal done
                progress.say(f"seed {seed}: loss {losses.train:.4f}, held out {losses.held_out:.4f}")
                progress.advance(losses.step - done)
                done = losses.step

            policy = trainer.run(checkpoint, report=told)
            files.append(policy.save(file))
            last = trainer.losses[-1]
            table.add_row(file.stem, str(last.step), f"{last.train:.4f}", f"{last.held_out:.4f}", f"{last.seconds:.0f}")
    output.say(table)
    for file in files:
        print(file)
    return 0


def _seeds(text: str) -> list[int]:
    seeds = [int(part) for part in text.split(",") if part.strip().isdigit()]
    if len(seeds) != len(text.split(",")) or len(set(seeds)) != len(seeds):
        raise ValueError(f"--seed is a comma list of different numbers, not '{text}'")
    return seeds
