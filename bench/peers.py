"""One control cycle from Python beside the peers that are installed: pip install '.[bench]' for all of them.

A cycle is what a 1 kHz loop does: from the joint positions and a target pose to joint velocities, for the xArm7.
Every candidate gets the same motion; candidates are timed in turn, round by round, so that a machine that changes its
speed does so for all.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.metadata
import json
import time
import warnings
from collections.abc import Callable

import numpy as np

import sigmaik as sk
from sigmaik_lab.arrival.peers import make_peer

CYCLES, ROUNDS = 300, 7
HOME = np.array([0.0, -0.35, 0.2, 1.05, 0.1, 1.4, 0.0])
PATH = HOME + 0.16 * np.sin(2 * np.pi * np.arange(CYCLES)[:, None] / 1024 + np.arange(7))
URDF = sk.robots.path("ufactory_xarm7")
GAIN = 5.0


def sigmaik_servo() -> Callable[[int], object]:
    arm = sk.robots.load("ufactory_xarm7")
    servo = sk.Servo(arm, sk.JParse(), dt=1e-3, posture=HOME, posture_gain=1.0)
    servo.reset(HOME)
    targets = list(arm.pose(PATH))
    return lambda i: servo.update(targets[i]).qdot


def pinocchio_jparse() -> Callable[[int], object]:
    pin = importlib.import_module("pinocchio")
    jparse = importlib.import_module("jparse_robotics").JParseCore(gamma=0.1)
    model = pin.buildModelFromUrdf(str(URDF))
    data = model.createData()
    frame = model.getFrameId("flange")
    targets = [pin.SE3(T) for T in sk.robots.load("ufactory_xarm7").pose(PATH)]

    def cycle(i: int) -> object:
        q = PATH[i]
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacement(model, data, frame)
        J = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        tip = data.oMf[frame]
        error = np.r_[targets[i].translation - tip.translation, pin.log3(targets[i].rotation @ tip.rotation.T)]
        inverse, nullspace = jparse.compute(J, position_dimensions=3, angular_dimensions=3, return_nullspace=True)
        return inverse @ (GAIN * error) + nullspace @ (HOME - q)

    return cycle


def pink_cycle(solver: str, package: str) -> Callable[[int], object]:
    pin = importlib.import_module("pinocchio")
    pink = importlib.import_module("pink")
    tasks = importlib.import_module("pink.tasks")
    importlib.import_module(package)
    model = pin.buildModelFromUrdf(str(URDF))
    configuration = pink.Configuration(model, model.createData(), HOME)
    task = tasks.FrameTask("flange", position_cost=1.0, orientation_cost=1.0)
    posture = tasks.PostureTask(cost=1e-3)
    posture.set_target(HOME)
    targets = [pin.SE3(T) for T in sk.robots.load("ufactory_xarm7").pose(PATH)]

    def cycle(i: int) -> object:
        configuration.update(PATH[i])
        task.set_target(targets[i])
        return pink.solve_ik(configuration, [task, posture], 1e-3, solver=solver, damping=1e-12)

    return cycle


def mink_cycle() -> Callable[[int], object]:
    mujoco = importlib.import_module("mujoco")
    mink = importlib.import_module("mink")
    # MuJoCo folds a link without a mass into its parent, so the tip is named by its last link.
    model = mujoco.MjModel.from_xml_path(str(URDF))
    configuration = mink.Configuration(model, HOME)
    task = mink.FrameTask("link7", "body", position_cost=1.0, orientation_cost=1.0)
    posture = mink.PostureTask(model, cost=1e-3)
    posture.set_target(HOME)
    targets = [mink.SE3.from_matrix(T) for T in sk.robots.load("ufactory_xarm7").pose(PATH)]
    limits = [mink.ConfigurationLimit(model)]

    def cycle(i: int) -> object:
        configuration.update(PATH[i])
        task.set_target(targets[i])
        return mink.solve_ik(configuration, [task, posture], 1e-3, solver="daqp", damping=1e-12, limits=limits)

    return cycle


def driven_peer(name: str) -> Callable[[int], object]:
    """A peer of `sigmaik arrival`, with its settings there. The peer integrates its commands, as our servo does."""
    arm = sk.robots.load("ufactory_xarm7")
    peer = make_peer(name, arm, 1e-3)
    peer.reset(HOME)
    targets = list(arm.pose(PATH))
    return lambda i: peer.update(targets[i])


CANDIDATES: dict[str, tuple[Callable[[], Callable[[int], object]], tuple[str, ...]]] = {
    "sigmaik Servo.update": (sigmaik_servo, ("sigmaik",)),
    "Pinocchio + jparse-robotics": (pinocchio_jparse, ("pin", "jparse-robotics")),
    "PlaCo": (lambda: driven_peer("placo"), ("placo",)),
    "OInK": (lambda: driven_peer("oink"), ("roboplan-oink",)),
    "EmbodiK": (lambda: driven_peer("embodik"), ("embodik",)),
    "Pink, quadprog": (lambda: pink_cycle("quadprog", "quadprog"), ("pin-pink", "quadprog")),
    "Pink, proxqp": (lambda: pink_cycle("proxqp", "proxsuite"), ("pin-pink", "proxsuite")),
    "mink, daqp": (mink_cycle, ("mink", "daqp")),
}


def measure() -> list[dict[str, object]]:
    cycles = {}
    rows: list[dict[str, object]] = []
    for name, (build, _) in CANDIDATES.items():
        try:
            cycles[name] = build()
        except ImportError as missing:
            rows.append({"name": name, "skipped": str(missing)})
    times: dict[str, list[float]] = {name: [] for name in cycles}
    for _ in range(ROUNDS):
        for name, cycle in cycles.items():
            for i in range(CYCLES):
                start = time.perf_counter()
                cycle(i)
                times[name].append(time.perf_counter() - start)
    ours = np.median(times["sigmaik Servo.update"])
    for name, values in times.items():
        us = 1e6 * np.asarray(values[CYCLES:])  # the first round warms up
        packages = {p: importlib.metadata.version(p) for p in CANDIDATES[name][1]}
        rows.append(
            {
                "name": name,
                "p50_us": float(np.median(us)),
                "p99_us": float(np.percentile(us, 99)),
                "ratio": float(np.median(us) / (1e6 * ours)),
                "versions": packages,
            }
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", help="write the figures to this file")
    arguments = parser.parse_args()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        rows = measure()
    print(f"{'one cycle from Python':30} {'p50 µs':>8} {'p99 µs':>8} {'ratio':>7}")
    for row in rows:
        if "skipped" in row:
            print(f"{row['name']:30} not installed ({row['skipped']})")
        else:
            print(f"{row['name']:30} {row['p50_us']:8.2f} {row['p99_us']:8.2f} {row['ratio']:7.1f}")
    if arguments.json:
        with open(arguments.json, "w") as file:
            json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
