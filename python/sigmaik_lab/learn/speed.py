"""Measures how fast many environments step."""

from __future__ import annotations

import argparse
import time

import numpy as np

from sigmaik._extras import need
from sigmaik_lab import output
from sigmaik_lab.report import Table

from .demonstrator import STEADY, Demonstrator
from .episode import FPS

__all__ = ["measure", "options", "run"]

#: Actions with which all environments begin, so that the arms are in motion when the clock starts.
_BEFORE = 5


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--robot", default="ufactory_xarm7", metavar="ARM_OR_URDF", help="(%(default)s)")
    parser.add_argument("--envs", default="1,64,256", metavar="LIST", help="environments (%(default)s)")
    parser.add_argument("--threads", default="1,2", metavar="LIST", help="of the servos (%(default)s)")
    parser.add_argument("--cycle", default="1,10", metavar="LIST", help="of the servo [ms] (%(default)s)")
    parser.add_argument("--seconds", type=float, default=2.0, metavar="S", help="of each measurement (%(default)g)")


def run(args: argparse.Namespace) -> int:
    need("gymnasium")
    if not 0.0 < args.seconds < 1e4:
        raise ValueError("--seconds must be positive")
    table = Table("a second of one or more threads, and a second of one processor")
    table.add_numbers("cycle [ms]", "environments", "threads", "actions", "cycles", "actions, CPU", "cycles, CPU")
    for cycle in _whole("--cycle", args.cycle):
        for envs in _whole("--envs", args.envs):
            for threads in _whole("--threads", args.threads):
                wall, processor = measure(args.robot, envs, threads, 1e-3 * cycle, args.seconds)
                cycles = 1e3 / (FPS * cycle)
                rates = (wall, cycles * wall, processor, cycles * processor)
                table.add_row(str(cycle), str(envs), str(threads), *(f"{rate:.0f}" for rate in rates))
    output.say(table)
    return 0


def measure(robot: str, envs: int, threads: int, dt: float, seconds: float) -> tuple[float, float]:
    """Actions of all environments a second of the clock, and a second of processor time."""
    from .vector import FetchVector

    env = FetchVector(envs, robot, dt=dt, threads=threads)
    states, _ = env.reset(seed=0)
    demonstrators = [Demonstrator(env.task, seed=b, hand=STEADY) for b in range(envs)]
    for _ in range(_BEFORE):
        actions = np.stack([one(state) for one, state in zip(demonstrators, states, strict=True)])
        states, *_ = env.step(actions)
    wall, processor, steps = time.perf_counter(), time.process_time(), 0
    while time.perf_counter() - wall < seconds:
        env.step(actions)
        steps += envs
    return steps / (time.perf_counter() - wall), steps / (time.process_time() - processor)


def _whole(option: str, text: str) -> list[int]:
    """A comma list of positive whole numbers. ValueError where an entry is none."""
    parts = text.split(",")
    if not all(part.strip().isdigit() and int(part) > 0 for part in parts):
        raise ValueError(f"{option} is a comma list of whole numbers, not '{text}'")
    return [int(part) for part in parts]
