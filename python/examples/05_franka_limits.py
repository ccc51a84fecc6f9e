"""A 1 kHz loop whose every command a Franka Panda's controller accepts: targets and twists jump, and what it
checks is checked here. The same as 05_franka_limits.cpp.
"""

import sys

import numpy as np

import sigmaik as sk

DT = 1e-3

# Positions from the URDF, the rest from libfranka's rate_limiting.h.
arm = sk.robots.load("franka_panda").with_limits(
    velocity=[2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61],
    acceleration=[15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0],
    jerk=[7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0],
)
servo = sk.Servo(arm, sk.JParse(), dt=DT)
servo.reset(sk.robots.home("franka_panda"))
start = servo.pose
rng = np.random.default_rng(0)
steps = []

# Poses that jump, every third far out of reach.
for jump in range(1, 41):
    target = start.copy()
    target[:3, 3] += rng.normal(scale=0.3, size=3)
    if jump % 3 == 0:
        target[:3, 3] *= 5.0
    target[:3, :3] = target[:3, :3] @ sk.rotation_exp([rng.normal(), 0.0, 0.0])
    steps += [servo.update(target) for _ in range(500)]

# Twists that jump, four times in a second.
for _ in range(80):
    twist = rng.normal(size=6)
    steps += [servo.update_twist(twist) for _ in range(250)]

# The key is let go: how long until all joints stand?
speed, cycles = np.abs(steps[-1].qdot).max(), 0
while np.abs(steps[-1].qdot).max() > 1e-9 and cycles < 5000:
    steps.append(servo.update_twist(np.zeros(6)))
    cycles += 1

# The controller differentiates the commands, and stops the arm where one goes too far.
q = np.array([step.q for step in steps])
qdot = np.array([step.qdot for step in steps])
acceleration = np.diff(qdot, axis=0, prepend=0.0) / DT
jerk = np.diff(acceleration, axis=0, prepend=0.0) / DT
limits = arm.limits
middle, half = (limits.upper + limits.lower) / 2, (limits.upper - limits.lower) / 2
ratios = {
    "position": np.abs(q - middle) / half,
    "velocity": np.abs(qdot) / limits.velocity,
    "acceleration": np.abs(acceleration) / limits.acceleration,
    "jerk": np.abs(jerk) / limits.jerk,
}
violations = sum(int(np.sum(~(ratio <= 1 + 1e-6))) for ratio in ratios.values())  # 1e-6: rounding of the differences
limited = sum(step.status == sk.Status.LIMITED for step in steps)
print(f"{len(steps)} cycles, {limited} limited, {violations} violations")
print("peaks, of the limits: " + ", ".join(f"{name} {ratio.max():.4f}" for name, ratio in ratios.items()))
print(f"an abrupt stop from {speed:.2f} rad/s took {cycles} ms")
sys.exit(0 if violations == 0 else 1)
