"""Position only, or any rotation about the tool's axis: fewer task rows, more freedom. The same as
03_position_only.cpp."""

import numpy as np

import sigmaik as sk

arm = sk.robots.load("ufactory_xarm7")
cases = {
    "whole pose": {},
    "position only": {"mask": (1, 1, 1, 0, 0, 0)},
    "free about tool z": {"mask": (1, 1, 1, 1, 1, 0), "frame": "tool"},
}
for name, options in cases.items():
    servo = sk.Servo(arm, sk.JParse(), dt=1e-3, **options)
    servo.reset(np.full(arm.dof, 0.4))
    target = servo.pose
    target[:3, 3] += (-0.1, 0.1, 0.1)
    target[:3, :3] = target[:3, :3] @ sk.rotation_exp([0, 0, 1.0])
    for _ in range(5000):
        step = servo.update(target)
    position, orientation = np.linalg.norm(step.pose_error[:3]), np.linalg.norm(step.pose_error[3:])
    print(f"{name:18} position error {position:.6f} m, orientation error {orientation:.6f} rad")
