"""What a planner's call from Python costs beside the same call from C++, in one run.

    cmake --build build/release --target sigmaik_bench
    .venv/bin/python bench/planner_calls.py

The arm, the ends and the paths are those of bench/planner_calls.cpp. The two take turns, so that a busy machine slows
both; each figure is the median of the turns.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import statistics
import subprocess
import time
from collections.abc import Callable

import numpy as np

import sigmaik as sk

ROOT = pathlib.Path(__file__).parents[1]


def path(samples: int) -> np.ndarray:
    s = np.linspace(0.0, 1.0, samples)
    return np.column_stack([0.3 + 0.5 * s, 0.2 - 0.5 * s + 0.05 * np.sin(6.0 * s)])


def calls() -> dict[str, Callable[[], object]]:
    arm = sk.robots.load("kuka_lbr_iiwa_14_r820")
    start = np.array([-0.8, 0.6, 0.4, -1.2, 0.3, 0.9, 0.0])
    goal = np.array([0.7, 0.9, -0.3, 1.1, -0.5, 1.2, 0.4])
    long, short = path(5068), path(200)
    return {
        "time_optimal": lambda: sk.planning.time_optimal(
            arm, start, goal, cost=sk.planning.costs.Potential(), time_weight=600.0
        ),
        "gradient": lambda: sk.planning.gradient(arm, start, goal),
        "stochastic": lambda: sk.planning.stochastic(arm, start, goal),
        "cart_motion": lambda: sk.planning.cart_motion(long, 0.5, 0.75, 0.2),
        "cart_motion_plane": lambda: sk.planning.cart_motion_plane(short, (0.0, -0.2), (0.5, 0.1), 0.2),
    }


def python_ms(call: Callable[[], object], seconds: float) -> float:
    call()
    count, times = 0, []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or count < 5:
        begin = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - begin))
        count += 1
    return statistics.median(times)


def core_ms(binary: pathlib.Path, name: str, seconds: float) -> float:
    run = subprocess.run(
        [
            binary,
            f"--benchmark_filter=^planner_call_{name}$",
            "--benchmark_format=json",
            f"--benchmark_min_time={seconds}",
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    return float(json.loads(run.stdout)["benchmarks"][0]["real_time"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release")
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=0.5, help="of each turn")
    arguments = parser.parse_args()
    print(f"{'':20}{'C++ [ms]':>10}{'Python [ms]':>13}{'more [ms]':>11}")
    for name, call in calls().items():
        core, python = [], []
        for _ in range(arguments.turns):
            core.append(core_ms(arguments.build / "sigmaik_bench", name, arguments.seconds))
            python.append(python_ms(call, arguments.seconds))
        a, b = statistics.median(core), statistics.median(python)
        print(f"{name:20}{a:10.3f}{b:13.3f}{b - a:11.3f}")


if __name__ == "__main__":
    main()
