"""sigmaik: a Cartesian command goes in, joint velocities come out, at and near singularities.

    import sigmaik as sk

    arm = sk.robots.load("ufactory_xarm7")              # or sk.Chain.from_urdf("arm.urdf")
    servo = sk.Servo(arm, sk.JParse(gamma=0.1), dt=1e-3)
    servo.reset(q)                                      # (n,) [rad or m]
    step = servo.update(target)                         # (4, 4), tip in base; or servo.update_twist([v; ω])
    step.q, step.qdot, step.status

Units are m, rad, s, N·m. Twists and Jacobians are [v; ω], in base axes, at the tip's origin.
"""

from . import indices, planning, robots, sim, singularities
from ._core import (
    AdaptiveDampedLeastSquares,
    AnalyticBranch,
    AnalyticIk,
    Chain,
    ComputedTorque,
    ComputedTorqueStep,
    ConstrainedIk,
    ConstrainedIkStep,
    DampedLeastSquares,
    Dynamics,
    Error,
    Inertia,
    JacobianProjection,
    JacobianSafety,
    JacobianSafetyProjection,
    JointLimits,
    JParse,
    LeastSquaresSolution,
    PseudoInverse,
    Segment,
    SelectivelyDampedLeastSquares,
    Servo,
    ServoStep,
    Solution,
    Spectrum,
    Status,
    VelocitySolver,
    __version__,
    least_squares,
    pose_error,
    rotation_exp,
    rotation_log,
    solve_batch,
)

__all__ = [
    "AdaptiveDampedLeastSquares",
    "AnalyticBranch",
    "AnalyticIk",
    "Chain",
    "ComputedTorque",
    "ComputedTorqueStep",
    "ConstrainedIk",
    "ConstrainedIkStep",
    "DampedLeastSquares",
    "Dynamics",
    "Error",
    "Inertia",
    "JParse",
    "JacobianProjection",
    "JacobianSafety",
    "JacobianSafetyProjection",
    "JointLimits",
    "LeastSquaresSolution",
    "PseudoInverse",
    "Segment",
    "SelectivelyDampedLeastSquares",
    "Servo",
    "ServoStep",
    "Solution",
    "Spectrum",
    "Status",
    "VelocitySolver",
    "__version__",
    "indices",
    "least_squares",
    "planning",
    "pose_error",
    "robots",
    "rotation_exp",
    "rotation_log",
    "sim",
    "singularities",
    "solve_batch",
]
