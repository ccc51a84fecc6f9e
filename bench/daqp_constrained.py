"""The constrained problem of qp_problem.hpp by DAQP, timed by its own clock: min |J_ω q̇ − ω|² + ε|q̇|², J_v q̇ = v,
|q̇_i| ≤ limit."""

from __future__ import annotations

import json
import statistics
import sys

import daqp
import numpy as np

import sigmaik as sk

TWIST = np.array([0.1, -0.05, 0.2, 0.1, 0.3, -0.2])
LIMIT = 1.0  # rad/s
DAMPING = 1e-6


def main() -> int:
    arm = sk.robots.load("ufactory_xarm7")
    home = np.array([0.0, -0.35, 0.2, 1.05, 0.1, 1.4, 0.0])
    joints = np.arange(7)
    upper = np.concatenate([np.full(7, LIMIT), TWIST[:3]])
    lower = np.concatenate([np.full(7, -LIMIT), TWIST[:3]])
    sense = np.array([0] * 7 + [5] * 3, dtype=np.int32)  # 5: equality
    set_up, solve, worst = [], [], 0.0
    for i in range(1024):
        J = arm.jacobian(home + 0.16 * np.sin(2.0 * np.pi * i / 1024 + joints))
        H = J[3:].T @ J[3:] + DAMPING * np.eye(7)
        x, _, flag, info = daqp.solve(H, -J[3:].T @ TWIST[3:], np.ascontiguousarray(J[:3]), upper, lower, sense)
        ours = sk.least_squares(J[3:], TWIST[3:], C=J[:3], d=TWIST[:3], lower=lower[:7], upper=upper[:7])
        if flag == 1 and ours.status == "optimal":
            worst = max(worst, float(np.abs(J[3:] @ (x - ours.x)).max()))
        set_up.append(info["setup_time"])
        solve.append(info["solve_time"])
    result = {
        "set_up_ns": 1e9 * statistics.median(set_up),
        "solve_ns": 1e9 * statistics.median(solve),
        "largest_difference": worst,  # of the twist [rad/s]: DAQP's has the damping
    }
    json.dump(result, sys.stdout)
    print()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
