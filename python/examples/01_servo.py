"""Drives an arm to a pose out of its reach, and back: it stretches out, and returns. The same as 01_servo.cpp."""

import numpy as np

import sigmaik as sk

arm = sk.robots.load("ufactory_xarm7")
servo = sk.Servo(arm, sk.JParse(gamma=0.1), dt=1e-3)
servo.reset(np.full(arm.dof, 0.4))
home = servo.pose
far = home.copy()
far[:3, 3] *= 10.0

for target in (far, home):
    for _ in range(15000):
        step = servo.update(target)
        # step.q and step.qdot go to the arm
    print(
        f"{step.status.name:7} position error {np.linalg.norm(step.pose_error[:3]):.6f} m, "
        f"smallest / largest singular value {step.singular_values[-1] / step.singular_values[0]:.4f}"
    )
