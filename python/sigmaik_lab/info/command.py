"""The command `sigmaik info`."""

from __future__ import annotations

import argparse
import math
import xml.etree.ElementTree as ElementTree

import numpy as np

import sigmaik as sk
from sigmaik._types import Array
from sigmaik_lab.options import add_arm_argument, configuration, open_arm
from sigmaik_lab.output import say
from sigmaik_lab.report import Table

__all__ = ["options", "run"]


def options(parser: argparse.ArgumentParser) -> None:
    add_arm_argument(parser)
    parser.add_argument(
        "--q", metavar="Q", default="home", help="home, zero, or a comma list: --q=-0.1,0.2,… (%(default)s)"
    )
    parser.add_argument(
        "--samples", type=int, default=2000, help="configurations to measure the reach at (%(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of these configurations (%(default)s)")


def run(args: argparse.Namespace) -> int:
    arm = open_arm(args)
    chain, q = arm.chain, configuration("--q", args.q, arm.chain, arm.home)
    if args.samples < 1 or args.seed < 0:
        raise ValueError("--samples must be positive, and --seed not negative")
    farthest = _sampled_reach(chain, args.samples, args.seed)
    bound = _reach_bound(arm.path.read_text(encoding="utf-8"), chain)
    m, xi = (float(sk.indices.evaluate(chain, q, index)) for index in ("manipulability", "geometry_aware"))
    sigma = np.linalg.svd(chain.jacobian(q), compute_uv=False)

    say(f"{arm.name}: {chain.dof} joints from '{chain.base}' to '{chain.tip}'")
    say(_joints(chain, q))
    say("rad, rad/s, rad/s², N·m; m and N for prismatic joints; – is no limit")
    say(
        f"\nreach from the base's origin: {farthest:.3f} m at the best of {args.samples} random "
        f"configurations, at most {bound:.3f} m (sum of link offsets)"
    )
    say(f"\nat q = {args.q}, tip in base:")
    for row in chain.pose(q)[:3]:
        say("  " + " ".join(f"{v + 0.0:9.4f}" for v in row))
    say("singular values: " + " ".join(f"{s:.4g}" for s in sigma))
    say(f"σ_min/σ_max: {sigma[-1] / sigma[0] if sigma[0] > 0.0 else 0.0:.4g}")
    say(
        f"manipulability: {m:.4g}, condition number: {sk.indices.condition_number(chain.jacobian(q)):.4g}, "
        f"geometry-aware index: {xi:.4g} (k = {sk.indices.reference_scale(chain):.3g})"
    )
    _say_singular_sets(chain, q)
    return 0


def _joints(chain: sk.Chain, q: Array) -> Table:
    table = Table("", "joint", "type")
    table.add_numbers("lower", "upper", "speed", "accel.", "effort", "q")
    limits = chain.limits
    columns = (limits.lower, limits.upper, limits.velocity, limits.acceleration, limits.effort, q)
    for i, joint in enumerate(chain.joint_names):
        table.add_row(joint, chain.joint_types[i], *(_figure(float(column[i])) for column in columns))
    return table


def _say_singular_sets(chain: sk.Chain, q: Array) -> None:
    sets = sk.singularities.of(chain)
    if sets is None:
        say("\nsingular sets: not known; sk.singularities.find searches for them")
        return
    table = Table("", "singular set")
    table.add_column("where", wrap=True)
    table.add_numbers("codim.", "√ψ here")
    for name, condition, codimension, psi in zip(
        sets.names, sets.conditions, sets.codimensions, sets.residuals(q), strict=True
    ):
        table.add_row(name, condition, str(codimension), f"{math.sqrt(psi):.3f}")
    say()
    say(table)
    say("codimension 1: a wall; 2: there is a way round. √ψ: about the distance, in rad")


def _sampled_reach(chain: sk.Chain, samples: int, seed: int) -> float:
    generator = np.random.default_rng(seed)
    return max(float(np.linalg.norm(chain.pose(chain.random_configuration(generator))[:3, 3])) for _ in range(samples))


def _reach_bound(text: str, chain: sk.Chain) -> float:
    """Sum of the lengths of all joint origins from base to tip [m], and of the travel of prismatic joints."""
    joints = {}
    for joint in ElementTree.fromstring(text).findall("joint"):
        child = joint.find("child")
        if child is not None:
            joints[child.get("link")] = joint
    farthest = np.maximum(np.abs(chain.limits.lower), np.abs(chain.limits.upper))
    travel = dict(zip(chain.joint_names, farthest, strict=True))
    link: str | None = chain.tip
    total = 0.0
    while link != chain.base and link in joints:
        joint = joints[link]
        origin, parent = joint.find("origin"), joint.find("parent")
        xyz = (origin.get("xyz") if origin is not None else None) or "0 0 0"
        total += math.hypot(*(float(x) for x in xyz.split()))
        if joint.get("type") == "prismatic":
            total += float(travel[joint.get("name") or ""])
        link = parent.get("link") if parent is not None else None
    return total


def _figure(value: float) -> str:
    return "–" if math.isinf(value) else f"{value + 0.0:.3f}"
