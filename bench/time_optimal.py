"""Time-optimal motions with potentials beside IPOPT with MUMPS: the same pairs, one after the other, in one run.

    .venv/bin/python bench/time_optimal.py --pairs 200

Both solve the problem of Beck et al. (2022) as printed, limits of position at the nodes alone, with time weight 600.
IPOPT runs as CasADi calls it, with exact Hessians from compact expressions, tolerance 1e-8, from the straight line at
an even speed; ours looks again on the other sides where the first start still leads through a potential, and that
counts in its time.
"""

from __future__ import annotations

import argparse
import json
import pathlib
from typing import Any

import numpy as np

import sigmaik as sk
from sigmaik.planning import time_optimal
from sigmaik_lab.montecarlo.experiment import MonteCarlo, sample_pair

EQUAL = 1e-4
"""Objectives that differ by less, relatively, are equal."""


def violation(chain: sk.Chain, plan: sk.planning.Trajectory, start: np.ndarray, goal: np.ndarray) -> float:
    """The most by which dynamics, ends or limits at the nodes are broken."""
    h = plan.duration / len(plan.t)
    limits = chain.limits
    q, qdot, qddot = plan.q, plan.qdot, plan.qddot
    return max(
        float(np.max(part))
        for part in (
            np.abs(q[:-1] + h * qdot[:-1] + 0.5 * h * h * qddot[:-1] - q[1:]),
            np.abs(qdot[:-1] + h * qddot[:-1] - qdot[1:]),
            limits.lower - q,
            q - limits.upper,
            np.abs(qdot) - limits.velocity,
            np.abs(qddot) - limits.acceleration,
            np.abs(q[0] - start),
            np.abs(q[-1] - goal),
            np.abs(qdot[[0, -1]]),
        )
    )


def compare(robot: str, pairs: int, weight: float, avoid: str | None) -> dict[str, Any]:
    study = MonteCarlo(robot, pairs, seed=1)
    chain = study.chain()
    rows = []
    for sample in range(pairs):
        start, goal = sample_pair(study, chain, sample)
        row = {}
        for solver in ("sigmaik", "ipopt"):
            plan = time_optimal(
                chain,
                start,
                goal,
                avoid,
                time_weight=weight,
                between_nodes=False,
                restarts=solver == "sigmaik",
                solver=solver,
            )
            solved = plan.status == "optimal"
            broken = violation(chain, plan, start, goal) if plan.status != "failed" else np.nan
            row[solver] = (solved, plan.cost, plan.solve_time, broken, plan.starts)
        rows.append(row)
    both = [r for r in rows if r["sigmaik"][0] and r["ipopt"][0]]
    change = np.array([r["sigmaik"][1] / r["ipopt"][1] - 1.0 for r in both])
    times = {s: 1e3 * np.array([r[s][2] for r in rows]) for s in ("sigmaik", "ipopt")}
    return {
        "robot": robot,
        "pairs": pairs,
        "solved": {s: sum(r[s][0] for r in rows) for s in times},
        "mean objective": {s: float(np.mean([r[s][1] for r in both])) for s in times},
        "better, equal, worse": [
            float(np.mean(change < -EQUAL)),
            float(np.mean(np.abs(change) <= EQUAL)),
            float(np.mean(change > EQUAL)),
        ],
        "largest violation": {s: float(np.nanmax([r[s][3] for r in rows])) for s in times},
        "median ms": {s: float(np.median(t)) for s, t in times.items()},
        "95 % ms": {s: float(np.percentile(t, 95)) for s, t in times.items()},
        "ratio of medians": float(np.median(times["ipopt"]) / np.median(times["sigmaik"])),
        "median ratio, pair by pair": float(np.median(times["ipopt"] / times["sigmaik"])),
        "mean starts": float(np.mean([r["sigmaik"][4] for r in rows])),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=200)
    parser.add_argument("--weight", type=float, default=600.0)
    parser.add_argument("--avoid", choices=("none", "potential", "manipulability"), default="potential")
    parser.add_argument("--robots", default="kuka_lbr_iiwa_14_r820,franka_panda,comau_racer_7_1_4")
    parser.add_argument("--json", type=pathlib.Path, help="where the figures go too")
    arguments = parser.parse_args()
    avoid = None if arguments.avoid == "none" else arguments.avoid
    results = []
    for robot in arguments.robots.split(","):
        result = compare(robot, arguments.pairs, arguments.weight, avoid)
        results.append(result)
        print(f"{robot}, {result['pairs']} pairs, time weight {arguments.weight:g}, avoid {arguments.avoid}")
        for key in ("solved", "mean objective", "largest violation", "median ms", "95 % ms"):
            ours, theirs = (result[key][s] for s in ("sigmaik", "ipopt"))
            print(f"  {key:<28} {ours:12.6g}   IPOPT {theirs:12.6g}")
        better, equal, worse = (100.0 * x for x in result["better, equal, worse"])
        print(f"  objective than IPOPT's       better {better:.1f} %, equal {equal:.1f} %, worse {worse:.1f} %")
        for key in ("ratio of medians", "median ratio, pair by pair", "mean starts"):
            print(f"  {key:<28} {result[key]:12.4g}")
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
