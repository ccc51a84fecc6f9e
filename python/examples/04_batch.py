"""A hundred thousand problems at once, on every core, without the GIL. The same as 04_batch.cpp."""

import os
import time

import numpy as np

import sigmaik as sk

arm = sk.robots.load("franka_panda")
rng = np.random.default_rng(0)
q = rng.uniform(arm.limits.lower, arm.limits.upper, (100_000, arm.dof))
J = arm.jacobian(q)  # (100000, 6, 7)
twist = rng.normal(size=(100_000, 6))

start = time.perf_counter()
qdot = sk.solve_batch(sk.JParse(), J, twist, threads=os.cpu_count() or 1)
seconds = time.perf_counter() - start
print(f"{len(qdot) / seconds / 1e6:.2f} million solves a second, largest joint speed {np.abs(qdot).max():.1f} rad/s")
