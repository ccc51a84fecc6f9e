"""How fast the tool's own way can be: beside the joints' least time, and beside the servo.

A servo without a guide goes to random poses. Of each motion that arrives, three times are compared: that of the servo;
the least time along the same path of the joints, with all limits of velocity and acceleration (TOPP-RA: Pham and Pham,
IEEE T-RO 2018); and the least time in which the joints get to the nearest configuration of the target on a way of their
own. The second time is a bound for each servo that keeps the tool on this way.

    python bench/straight_way.py --robot ufactory_xarm7,ur10 --trials 100
"""

from __future__ import annotations

import argparse
import logging
import warnings

import numpy as np
import toppra
import toppra.algorithm
import toppra.constraint

import sigmaik as sk
from sigmaik_lab.arrival.experiment import joint_time

RATE, SECONDS = 500.0, 5.0
ARRIVED = 1e-3, np.radians(0.5)  # m, rad
NODES = 40  # of the spline through the servo's path: enough for 1e-3 rad, few enough to leave out its jitter


def own_way(arm: sk.Chain, start: np.ndarray, target: np.ndarray) -> np.ndarray | None:
    """(N, n) the servo's configurations until it arrives; None: it does not."""
    servo = sk.Servo(arm, dt=1.0 / RATE)
    servo.reset(start)
    path = [start]
    for _ in range(round(SECONDS * RATE)):
        step = servo.update(target)
        path.append(step.q)
        error = step.pose_error
        if np.linalg.norm(error[:3]) < ARRIVED[0] and np.linalg.norm(error[3:]) < ARRIVED[1]:
            return np.array(path)
    return None


def least_time(arm: sk.Chain, path: np.ndarray) -> float:
    """[s] along a path of the joints, from rest to rest; inf: TOPP-RA finds no motion."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], NODES)
    nodes = np.column_stack([np.interp(at, length, joint) for joint in path.T])
    speed, acceleration = arm.limits.velocity, arm.limits.acceleration
    acceleration = np.where(np.isfinite(acceleration), acceleration, 10.0)  # what the servo assumes
    limits = [
        toppra.constraint.JointVelocityConstraint(np.column_stack([-speed, speed])),
        toppra.constraint.JointAccelerationConstraint(np.column_stack([-acceleration, acceleration])),
    ]
    solver = toppra.algorithm.TOPPRA(
        limits,
        toppra.SplineInterpolator(at, nodes),
        solver_wrapper="seidel",
        gridpoints=np.linspace(0.0, length[-1], 5 * NODES),
    )
    motion = solver.compute_trajectory(0.0, 0.0)
    return float("inf") if motion is None else float(motion.duration)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="ufactory_xarm7,franka_panda,ur10", help="shipped arms (%(default)s)")
    parser.add_argument("--trials", type=int, default=100, help="of each arm (%(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    warnings.simplefilter("ignore", sk.ModelWarning)
    logging.getLogger("toppra").setLevel(logging.CRITICAL)
    print("medians of the motions that arrive [s]\n")
    print(f"{'arm':22} arrive   servo   least on this path   joints' own way")
    for name in options.robot.split(","):
        arm, rng = sk.robots.load(name), np.random.default_rng(options.seed)
        free = np.isinf(arm.limits.lower) | np.isinf(arm.limits.upper)
        lower, upper = np.where(free, -np.pi, arm.limits.lower), np.where(free, np.pi, arm.limits.upper)
        rows = []
        for _ in range(options.trials):
            start, goal = rng.uniform(lower, upper), rng.uniform(lower, upper)
            target = arm.pose(goal)
            path = own_way(arm, start, target)
            if path is None:
                continue
            nearest = sk.PositionIk(arm).solve(target, near=start).q
            rows.append((len(path) / RATE, least_time(arm, path), joint_time(arm, start, nearest)))
        servo, bound, joints = np.median(rows, axis=0)
        share = len(rows) / options.trials
        print(f"{name:22} {share:6.0%} {servo:7.2f} {bound:20.2f} {joints:17.2f}", flush=True)


if __name__ == "__main__":
    main()
