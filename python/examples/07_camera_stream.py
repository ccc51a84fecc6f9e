"""Follows a marker that a camera sees at 30 Hz, 50 ms late, now and then wrong, until it stops. The same as
07_camera_stream.cpp."""

import math

import numpy as np

import sigmaik as sk

arm = sk.robots.load("ufactory_xarm7")
servo = sk.Servo(arm, sk.JParse(), dt=1e-3)
servo.reset([0.0, -0.35, 0.0, 1.05, 0.0, 1.4, 0.0])
home = servo.pose
stream = sk.TargetStream()  # predicts; "interpolate" plays late, "hold" stays at the last sample
stream.reset(home)


def marker(time):
    """Where it is: a circle across the arm's plane."""
    pose = home.copy()
    pose[1, 3] += 0.1 * math.sin(time)
    pose[2, 3] += 0.1 * (1.0 - math.cos(time))
    return pose


worst = 0.0
for cycle in range(10000):
    now = 1e-3 * cycle
    if cycle % 33 == 0 and 50 <= cycle < 8000:  # a sample comes; then no more
        seen = marker(now - 0.05)
        if cycle % 495 == 0:
            seen[0, 3] += 0.4  # wrong
        stream.push(now - 0.05, seen)
    target = stream.at(now)
    step = servo.update(target.pose, target.twist)
    # step.q and step.qdot go to the arm
    if 3000 <= cycle < 8000:
        worst = max(worst, float(np.linalg.norm(servo.pose[:3, 3] - marker(now + 1e-3)[:3, 3])))

print(
    f"{stream.counts.accepted} samples, {stream.counts.outliers} refused; at most {1e3 * worst:.1f} mm from the marker"
)
print(f"then {target.status.name}, at {np.linalg.norm(step.qdot):.6f} rad/s")
