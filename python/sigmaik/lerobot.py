"""LeRobot's kinematics on a servo that holds all limits.

`RobotKinematics` has the constructor and the methods of `lerobot.model.kinematics.RobotKinematics`, in degrees and
(4, 4) poses, so that LeRobot's processor steps take one in place of the other:

    from sigmaik.lerobot import RobotKinematics, inverse_kinematics_step

    kinematics = RobotKinematics("so101", "flange", [*motors], period=1 / 30)
    q = kinematics.inverse_kinematics(q, pose)             # once a period
    step = inverse_kinematics_step(kinematics, [*motors])  # a ProcessorStep; needs lerobot

LeRobot's own class asks a solver for joint positions, and the arm gets the positions at once. Here each call moves a
`sigmaik.Servo` on by one period. Positions, velocities, accelerations and jerks of what is returned hold the arm's
limits from call to call, at singularities and where the target jumps or is out of reach. The module imports nothing of
lerobot before `inverse_kinematics_step` is called.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import robots
from ._core import Error, Servo, ServoStep, pose_error, rotation_exp
from ._extras import need
from ._types import Array

__all__ = ["RobotKinematics", "inverse_kinematics_step"]

#: [s] at most, of a cycle of the servo.
_CYCLE = 1e-3
#: A weight that is at most this part of the other weight comes after the other.
_AFTER = 0.1
#: Rows of position and of orientation.
_POSITION, _ORIENTATION, _NONE, _ALL = (1, 1, 1, 0, 0, 0), (0, 0, 0, 1, 1, 1), (0,) * 6, (1,) * 6


class RobotKinematics:
    """Forward kinematics, and inverse kinematics within all limits.

    The object has a state: where the servo is, and how fast. Call `inverse_kinematics` once a period, and `reset` where
    a motion begins anew.
    """

    def __init__(
        self,
        urdf_path: str | os.PathLike[str],
        target_frame_name: str | None = "gripper_frame_link",
        joint_names: Sequence[str] | None = None,
        *,
        period: float = 1.0 / 30.0,
        max_lag: float = 30.0,
        **servo: Any,
    ) -> None:
        """urdf_path: a URDF file, or the name of a shipped arm.

        target_frame_name: the tip link; None: the file's only leaf
        joint_names: of the entries of joint positions, in their order: all joints from the root to the tip, and others
            (such as a gripper), which come back as they are; None: the chain's joints, from the root on
        period: [s] > 0, from one call of `inverse_kinematics` to the next
        max_lag: [°] > 0: where a joint's current position is farther from the servo's, the servo starts anew there
        servo: options of `sigmaik.Servo`; by default its own

        Error where the file, a name or an option is wrong, or where a joint is prismatic.
        """
        if not 0.0 < period < math.inf:
            raise Error(f"period must be positive and finite, not {period:g}")
        if not max_lag > 0.0:
            raise Error(f"max_lag must be positive, not {max_lag:g}")
        self._chain = robots.open(os.fspath(urdf_path), None, target_frame_name).chain
        names = self._chain.joint_names
        for segment in self._chain.segments:
            if segment.type == "prismatic":
                raise Error(f"joint '{segment.joint_name}' is prismatic, and has no position in degrees")
        self.joint_names = list(names if joint_names is None else joint_names)
        missing = [name for name in names if name not in self.joint_names]
        if missing:
            raise Error(f"joint_names lacks {', '.join(missing)}; the chain has {', '.join(names)}")
        if len(set(self.joint_names)) < len(self.joint_names):
            raise Error("joint_names has a name twice")
        self.target_frame_name = target_frame_name
        self.period = period
        self._at = np.array([self.joint_names.index(name) for name in names])
        self._cycles = max(1, math.ceil(period / _CYCLE - 1e-9))
        self._max_lag = math.radians(max_lag)
        self._options = servo
        self._servos: dict[tuple[tuple[int, ...], tuple[int, ...]], Servo] = {}
        self._servo = self._with_rows(_ALL, _POSITION)
        self._target: Array | None = None
        self._step: ServoStep | None = None
        self.restarts = 0  #: times that the servo started anew because the arm was elsewhere

    @property
    def step(self) -> ServoStep | None:
        """The servo's last cycle, with status and errors; None before the first call and after `reset`."""
        return self._step

    def reset(self) -> None:
        """The next call of `inverse_kinematics` starts at rest, at the joint positions that the call gets."""
        self._target = self._step = None

    def forward_kinematics(self, joint_pos_deg: ArrayLike) -> Array:
        """The tip's pose (4, 4), from joint positions [°], as many as `joint_names` or more."""
        pose: Array = self._chain.pose(np.radians(self._positions(joint_pos_deg)[self._at]))
        return pose

    def inverse_kinematics(
        self,
        current_joint_pos: ArrayLike,
        desired_ee_pose: ArrayLike,
        position_weight: float = 1.0,
        orientation_weight: float = 0.01,
    ) -> Array:
        """Joint positions [°] for the end of the period that begins now, on the way to a pose (4, 4).

        current_joint_pos: [°] as many as `joint_names` or more. The arm is where the last call sent it, and these
            positions only say where a motion begins, and whether the arm is elsewhere (`max_lag`).
        position_weight, orientation_weight: a weight of 0 drops these rows, and a weight that is at most a tenth of the
            other comes after the other. Weights that are nearer to each other are equal.

        The target goes from the last pose to this one evenly within the period, with its twist as feed-forward; where
        limits allow, the tip is at the pose at the end of the period. Error where a value is not finite, where the pose
        is none, or where no weight is positive.
        """
        given = self._positions(current_joint_pos)
        target = np.array(desired_ee_pose, dtype=np.float64)
        pose_error(target, target)  # Error where this is no pose
        servo = self._with_rows(*_rows(position_weight, orientation_weight))
        q = np.radians(given[self._at])
        if self._target is not None and float(np.abs(q - self._servo.q).max()) > self._max_lag:
            self.restarts += 1
            self._target = None
        if self._target is None:
            servo.reset(q)
            self._target = servo.pose
        elif servo is not self._servo:
            servo.continue_from(self._servo)
        self._servo = servo
        begin, way = self._target, pose_error(self._target, target)
        for cycle in range(1, self._cycles + 1):
            between = target
            if cycle < self._cycles:
                part = cycle / self._cycles
                between = begin.copy()
                between[:3, 3] += part * way[:3]
                between[:3, :3] = rotation_exp(part * way[3:]) @ begin[:3, :3]
            self._step = servo.update(between, way / self.period)
        self._target = target
        given[self._at] = np.degrees(servo.q)
        return given

    def _with_rows(self, mask: tuple[int, ...], exact: tuple[int, ...]) -> Servo:
        key = (mask, exact)
        if key not in self._servos:
            dt = self.period / self._cycles
            options: dict[str, Any] = {"mask": mask, "exact": exact, "soft_start": 0.0} | self._options
            self._servos[key] = Servo(self._chain, dt=dt, **options)
        return self._servos[key]

    def _positions(self, values: ArrayLike) -> Array:
        given = np.array(values, dtype=np.float64)
        if given.ndim != 1 or len(given) < len(self.joint_names):
            raise Error(f"joint positions have the shape {given.shape}, but there are {len(self.joint_names)} joints")
        if not np.isfinite(given[self._at]).all():
            raise Error("joint positions must be finite")
        return given


def _rows(position: float, orientation: float) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The servo's mask and its exact rows."""
    if not (0.0 <= position < math.inf and 0.0 <= orientation < math.inf and position + orientation > 0.0):
        raise Error(
            f"weights must not be negative, and one must be positive, not {position:g} (position) and {orientation:g}"
        )
    if orientation == 0.0:
        return _POSITION, _NONE
    if position == 0.0:
        return _ORIENTATION, _NONE
    if orientation <= _AFTER * position:
        return _ALL, _POSITION
    return _ALL, _ORIENTATION if position <= _AFTER * orientation else _NONE


def inverse_kinematics_step(kinematics: RobotKinematics, motor_names: Sequence[str] | None = None) -> Any:
    """A processor step of LeRobot, from a pose of the tip to joint positions.

    The step takes ee.x, ee.y, ee.z [m], ee.wx, ee.wy, ee.wz (axis times angle [rad]) out of an action, and the measured
    positions NAME.pos [°] out of the observation; NAME.pos come into the action. ee.gripper_pos becomes gripper.pos
    where a motor is called "gripper". Its `reset` is that of the kinematics.

    motor_names: names of the motors, in the order of `kinematics.joint_names`; None: these names

    The step is registered as "sigmaik_inverse_kinematics". MissingPackage where lerobot is not installed.
    """
    need("lerobot")
    motors = list(kinematics.joint_names if motor_names is None else motor_names)
    if len(motors) != len(kinematics.joint_names):
        raise Error(f"there are {len(motors)} motors, but {len(kinematics.joint_names)} joints")
    return _step_class()(kinematics, motors)


@functools.cache
def _step_class() -> Any:
    from lerobot.configs.types import FeatureType, PipelineFeatureType, PolicyFeature
    from lerobot.processor import ProcessorStepRegistry, RobotActionProcessorStep, TransitionKey

    pose = ("x", "y", "z", "wx", "wy", "wz")

    class InverseKinematicsWithinLimits(RobotActionProcessorStep):  # type: ignore[misc]
        kinematics: RobotKinematics
        motor_names: list[str]

        def action(self, action: dict[str, Any]) -> dict[str, Any]:
            place = np.array([float(action.pop(f"ee.{name}")) for name in pose])
            target = np.eye(4)
            target[:3, :3], target[:3, 3] = rotation_exp(place[3:]), place[:3]
            observation = self.transition.get(TransitionKey.OBSERVATION)
            if observation is None:
                raise ValueError("an observation with the joints' positions is needed")
            q = np.array([float(observation[f"{name}.pos"]) for name in self.motor_names])
            q = self.kinematics.inverse_kinematics(q, target)
            for name, value in zip(self.motor_names, q, strict=True):
                if name != "gripper":
                    action[f"{name}.pos"] = float(value)
                elif "ee.gripper_pos" in action:
                    action["gripper.pos"] = float(action.pop("ee.gripper_pos"))
            return action

        def reset(self) -> None:
            self.kinematics.reset()

        def transform_features(self, features: dict[Any, dict[str, Any]]) -> dict[Any, dict[str, Any]]:
            actions = features[PipelineFeatureType.ACTION]
            for name in (*pose, "gripper_pos"):
                actions.pop(f"ee.{name}", None)
            for name in self.motor_names:
                actions[f"{name}.pos"] = PolicyFeature(type=FeatureType.ACTION, shape=(1,))
            return features

    step = dataclasses.dataclass(InverseKinematicsWithinLimits)
    return ProcessorStepRegistry.register("sigmaik_inverse_kinematics")(step)
