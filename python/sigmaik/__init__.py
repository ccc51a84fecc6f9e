"""sigmaik: a Cartesian command goes in, joint velocities come out, at and near singularities.

    import sigmaik as sk

    arm = sk.robots.load("ufactory_xarm7")              # or sk.Chain.from_urdf("arm.urdf")
    servo = sk.Servo(arm, dt=1e-3)
    servo.reset(q)                                      # (n,) [rad or m]
    step = servo.update(target)                         # (4, 4), tip in base; or servo.update_twist([v; ω])
    step.q, step.qdot, step.status

Units are m, rad, s, N·m. Twists and Jacobians are [v; ω], in base axes, at the tip's origin.
"""

import importlib
from typing import TYPE_CHECKING

from . import _environments, _rules, indices, methods, planning, robots, sim, singularities
from ._core import (
    ActionChunks,
    ActionStatus,
    ActionTarget,
    AnalyticBranch,
    AnalyticIk,
    ArgumentError,
    Capsule,
    Chain,
    ChunkCounts,
    ChunkStatus,
    Collisions,
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
    LinkCapsule,
    LoopCommand,
    LoopFault,
    LoopFaultKind,
    LoopState,
    LoopStatistics,
    LoopToken,
    Method,
    ModelWarning,
    Obstacle,
    PositionIk,
    PositionIkBranch,
    PositionIkResult,
    PositionIkStatus,
    SampleCounts,
    SampleStatus,
    Segment,
    Servo,
    ServoBatch,
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

if TYPE_CHECKING:
    from . import models

__all__ = [
    "ActionChunks",
    "ActionStatus",
    "ActionTarget",
    "AnalyticBranch",
    "AnalyticIk",
    "ArgumentError",
    "Capsule",
    "Chain",
    "ChunkCounts",
    "ChunkStatus",
    "Collisions",
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
    "LinkCapsule",
    "LoopCommand",
    "LoopFault",
    "LoopFaultKind",
    "LoopState",
    "LoopStatistics",
    "LoopToken",
    "Method",
    "ModelWarning",
    "Obstacle",
    "PositionIk",
    "PositionIkBranch",
    "PositionIkResult",
    "PositionIkStatus",
    "SampleCounts",
    "SampleStatus",
    "Segment",
    "Servo",
    "ServoBatch",
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
    "models",
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

_environments.register()


def __getattr__(name: str) -> object:
    if name == "models":  # reads XML, and is seldom needed
        return importlib.import_module(".models", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
