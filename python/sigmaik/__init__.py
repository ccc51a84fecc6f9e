"""sigmaik: a Cartesian command goes in, joint velocities come out, at and near singularities.

    import sigmaik as sk

    arm = sk.robots.load("ufactory_xarm7")              # or sk.Chain.from_urdf("arm.urdf")
    servo = sk.Servo(arm, dt=1e-3)
    servo.reset(q)                                      # (n,) [rad or m]
    step = servo.update(target)                         # (4, 4), tip in base; or servo.update_twist([v; ω])
    step.q, step.qdot, step.status

Units are m, rad, s, N·m. Twists and Jacobians are [v; ω], in base axes, at the tip's origin.
"""

from . import _rules, indices, methods, planning, robots, sim, singularities
from ._core import (
    AnalyticBranch,
    AnalyticIk,
    ArgumentError,
    Chain,
    ComputedTorque,
    ComputedTorqueStep,
    ConstrainedIk,
    ConstrainedIkStep,
    Dynamics,
    Error,
    GuideState,
    Inertia,
    JointLimits,
    LeastSquaresSolution,
    LoopCommand,
    LoopStatistics,
    Method,
    ModelWarning,
    PositionIk,
    PositionIkBranch,
    PositionIkResult,
    PositionIkStatus,
    SampleCounts,
    SampleStatus,
    Segment,
    Servo,
    ServoLoop,
    ServoStep,
    Solution,
    Spectrum,
    Status,
    StreamStatus,
    Target,
    TargetStream,
    VelocitySolver,
    __version__,
    least_squares,
    pose_error,
    rotation_exp,
    rotation_log,
    solve_batch,
)
from ._rules import *  # noqa: F403  # the rules' classes

__all__ = [
    "AnalyticBranch",
    "AnalyticIk",
    "ArgumentError",
    "Chain",
    "ComputedTorque",
    "ComputedTorqueStep",
    "ConstrainedIk",
    "ConstrainedIkStep",
    "Dynamics",
    "Error",
    "GuideState",
    "Inertia",
    "JointLimits",
    "LeastSquaresSolution",
    "LoopCommand",
    "LoopStatistics",
    "Method",
    "ModelWarning",
    "PositionIk",
    "PositionIkBranch",
    "PositionIkResult",
    "PositionIkStatus",
    "SampleCounts",
    "SampleStatus",
    "Segment",
    "Servo",
    "ServoLoop",
    "ServoStep",
    "Solution",
    "Spectrum",
    "Status",
    "StreamStatus",
    "Target",
    "TargetStream",
    "VelocitySolver",
    "__version__",
    "indices",
    "least_squares",
    "methods",
    "planning",
    "pose_error",
    "robots",
    "rotation_exp",
    "rotation_log",
    "sim",
    "singularities",
    "solve_batch",
]
__all__ += _rules.__all__
