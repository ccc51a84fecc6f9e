"""What every method makes of one twist close to a singularity. The same as 02_methods.cpp."""

import numpy as np

import sigmaik as sk

arm = sk.robots.load("ufactory_xarm7")
J = arm.jacobian(np.full(arm.dof, 0.02))  # nearly stretched out
twist = np.array([0.1, 0, 0.1, 0, 0, 0])

methods = (
    sk.PseudoInverse(),
    sk.DampedLeastSquares(damping=0.1),
    sk.AdaptiveDampedLeastSquares(),
    sk.SelectivelyDampedLeastSquares(),
    sk.JParse(),
    sk.JacobianProjection(),
    sk.JacobianSafety(),
    sk.JacobianSafetyProjection(),
)
for method in methods:
    s = sk.VelocitySolver(method).solve(J, twist)
    print(
        f"{type(method).__name__:29} {s.status.name:7} fastest joint {np.abs(s.qdot).max():7.3f} rad/s, "
        f"twist missed by {np.linalg.norm(s.achieved_twist - twist):.4f}"
    )
