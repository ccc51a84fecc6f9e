"""The node's parameters: names, defaults and descriptions. Names that MoveIt Servo has are MoveIt Servo's."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from sigmaik._core import Error

from .driver import DriverSettings

__all__ = ["PARAMETERS", "COMMAND_TYPES", "OUT_TYPES", "Parameter", "check", "driver_settings"]

OUT_TYPES = ("trajectory_msgs/JointTrajectory", "std_msgs/Float64MultiArray")
COMMAND_TYPES = ("any", "twist", "pose")


class Parameter(NamedTuple):
    default: Any
    text: str
    live: bool = False
    """Whether the parameter may change while the arm is active."""
    choices: tuple[str, ...] = ()
    above: float = -math.inf
    """A number has to be above this value."""


PARAMETERS: dict[str, Parameter] = {
    # the arm
    "robot_description": Parameter("", "the URDF's text; empty: the topic robot_description"),
    "base": Parameter("", "base link; empty: the root"),
    "tip": Parameter("", "tip link; empty: the only leaf"),
    "joint_topic": Parameter("/joint_states", "measured joints come from here"),
    # commands
    "cartesian_command_in_topic": Parameter("~/delta_twist_cmds", "twists (geometry_msgs/TwistStamped)"),
    "pose_command_in_topic": Parameter("~/pose_target_cmds", "poses (geometry_msgs/PoseStamped)"),
    "command_type": Parameter("any", "which commands are followed", True, COMMAND_TYPES),
    "command_in_type": Parameter(
        "speed_units", "of twists: m/s and rad/s, or from -1 to 1", True, ("speed_units", "unitless")
    ),
    "scale.linear": Parameter(0.4, "[m/s] of a unitless 1", True, above=0.0),
    "scale.rotational": Parameter(0.8, "[rad/s] of a unitless 1", True, above=0.0),
    "incoming_command_timeout": Parameter(0.1, "[s] after which a command is stale: the arm stops", True, above=0.0),
    # the servo
    "method": Parameter("jparse", "a rule with parameters: jparse:gamma=0.05", True),
    "guided": Parameter(False, "whether poses are reached through other configurations of the arm", True),
    "gain_linear": Parameter(10.0, "[1/s] from position error to velocity", True, above=0.0),
    "gain_angular": Parameter(10.0, "[1/s] from orientation error to angular velocity", True, above=0.0),
    "rate": Parameter(500.0, "[Hz] of the servo's cycles", above=0.0),
    "max_following_error": Parameter(0.0, "[rad or m] of a joint, beyond which the arm stops; 0: no check"),
    "measure_timeout": Parameter(0.0, "[s] without measured joints, after which the arm stops; 0: no check"),
    # what goes out
    "command_out_topic": Parameter("~/command", "joint commands go there"),
    "command_out_type": Parameter(OUT_TYPES[0], "of joint commands", choices=OUT_TYPES),
    "publish_period": Parameter(0.004, "[s] between joint commands", above=0.0),
    "publish_joint_positions": Parameter(True, "whether commands have positions"),
    "publish_joint_velocities": Parameter(True, "whether commands have velocities"),
    "status_topic": Parameter("~/status", "MoveIt Servo's status codes (std_msgs/Int8)"),
    "autostart": Parameter(True, "whether the node configures and activates itself"),
}


def check(name: str, value: Any) -> None:
    """Error where a parameter's value is none of the allowed ones."""
    parameter = PARAMETERS[name]
    if parameter.choices and value not in parameter.choices:
        raise Error(f"{name} is one of {', '.join(parameter.choices)}, not {value!r}")
    if isinstance(parameter.default, float) and not (math.isfinite(value) and value >= 0.0 and value > parameter.above):
        raise Error(f"{name} = {value:g} is out of its range")


def driver_settings(values: Mapping[str, Any]) -> DriverSettings:
    return DriverSettings(
        method=values["method"],
        rate=values["rate"],
        timeout=values["incoming_command_timeout"],
        guided=values["guided"],
        max_following_error=values["max_following_error"] or None,
        measure_timeout=values["measure_timeout"] or None,
        servo={"gain_linear": values["gain_linear"], "gain_angular": values["gain_angular"]},
    )
