"""The node: topics, services and parameters of MoveIt Servo around a Driver."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from sigmaik._core import Chain, Error, LoopCommand, LoopState, Status
from sigmaik._extras import need

need("rclpy")

import rclpy.lifecycle  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue  # noqa: E402
from geometry_msgs.msg import PoseStamped, TwistStamped  # noqa: E402
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult  # noqa: E402
from rclpy.duration import Duration  # noqa: E402
from rclpy.lifecycle import TransitionCallbackReturn  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import Float64MultiArray, Int8, String  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint  # noqa: E402

from .driver import Driver  # noqa: E402
from .frames import rotation_of  # noqa: E402
from .parameters import OUT_TYPES, PARAMETERS, check, driver_settings  # noqa: E402

__all__ = ["MOVEIT_STATUS", "ServoNode"]

#: MoveIt Servo's status codes: invalid, no warning, decelerating for a singularity, joint bound.
MOVEIT_STATUS = {Status.OK: 0, Status.HOLDING: 0, Status.DAMPED: 1, Status.LIMITED: 6, Status.BAD_INPUT: -1}

_DIAGNOSTICS = 0.5  # [s] between diagnostics
_NEWEST = 1  # depth of a command's queue: a command replaces the one before
_PATIENCE = 5.0  # [s] between two warnings of the same kind


class ServoNode(rclpy.lifecycle.LifecycleNode):  # type: ignore[misc]
    """A managed node around one arm.

    unconfigured → (configure: robot description) → inactive → (activate: measured joints) → active. With the parameter
    `autostart` the node takes both steps by itself, as soon as their inputs are there.
    """

    def __init__(self, name: str = "servo_node", **overrides: Any) -> None:
        """overrides: defaults of parameters, by their names (with _ in place of a dot)"""
        super().__init__(name, enable_communication_interface=True)
        for key, parameter in PARAMETERS.items():
            default = overrides.pop(key.replace(".", "_"), parameter.default)
            descriptor = ParameterDescriptor(description=parameter.text)
            self.declare_parameter(key, type(parameter.default)(default), descriptor)
        if overrides:
            raise Error(f"there are no parameters {', '.join(sorted(overrides))}")
        for key in PARAMETERS:
            check(key, self._value(key))
        self.driver: Driver | None = None
        self._description = str(self._value("robot_description"))
        self._latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._interfaces: list[Any] = []
        self._state = "unconfigured"
        self._published = -1
        self.add_on_set_parameters_callback(self._set_parameters)
        self.create_subscription(String, "robot_description", self._take_description, self._latched)
        self._starter = self.create_timer(0.05, self._start)

    def _value(self, name: str) -> Any:
        return self.get_parameter(name).value

    def _values(self) -> dict[str, Any]:
        return {name: self._value(name) for name in PARAMETERS}

    # --- life

    def _take_description(self, message: Any) -> None:
        if not self._description:
            self._description = message.data

    def _start(self) -> None:
        """Autostart: each step as soon as its input is there."""
        if not self._value("autostart"):
            return
        if self._state == "unconfigured" and self._description:
            self.trigger_configure()
            if self._state == "unconfigured":  # the description is of no use, and the reason is in the log
                self._starter.cancel()
        elif self._state == "inactive" and self.driver is not None and self.driver.ready:
            self.trigger_activate()
            self._starter.cancel()

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        try:
            if not self._description:
                raise Error("there is no robot description yet")
            chain = Chain.from_urdf(self._description, self._value("base") or None, self._value("tip") or None)
            self.driver = Driver(chain, self._description, driver_settings(self._values()))
        except ValueError as error:
            self.get_logger().error(f"not configured: {error}")
            return TransitionCallbackReturn.FAILURE
        self._connect()
        self._state = "inactive"
        self.get_logger().info(f"{chain.dof} joints from {chain.base} to {chain.tip}: {', '.join(chain.joint_names)}")
        return super().on_configure(state)

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        try:
            assert self.driver is not None
            self.driver.activate()
        except ValueError as error:
            self.get_logger().error(f"not active: {error}")
            return TransitionCallbackReturn.FAILURE
        self._state = "active"
        return super().on_activate(state)

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        if not self._bring_to_rest():
            self.get_logger().error("the arm does not rest yet")
            return TransitionCallbackReturn.FAILURE
        self._state = "inactive"
        return super().on_deactivate(state)

    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:
        self._disconnect()
        self.driver = None
        self._state = "unconfigured"
        return super().on_cleanup(state)

    def on_shutdown(self, state: Any) -> TransitionCallbackReturn:
        self.close()
        return super().on_shutdown(state)

    def close(self) -> None:
        """Stops the arm, and ends the loop."""
        self._bring_to_rest()

    def _bring_to_rest(self) -> bool:
        """Publishes the commands of the stop, to the last one."""
        driver = self.driver
        if driver is None or not driver.active:
            return True
        driver.pause()
        while driver.state == LoopState.STOPPING:
            self._publish()
            time.sleep(self._value("publish_period"))
        self._publish()
        return driver.deactivate()

    # --- topics and services

    def _connect(self) -> None:
        subscribe, serve = self.create_subscription, self.create_service
        self._out_type = OUT_TYPES.index(self._value("command_out_type"))
        message = (JointTrajectory, Float64MultiArray)[self._out_type]
        self._commands = self.create_publisher(message, self._value("command_out_topic"), 10)
        self._status = self.create_publisher(Int8, self._value("status_topic"), 10)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._interfaces = [
            (self.destroy_publisher, self._commands),
            (self.destroy_publisher, self._status),
            (self.destroy_publisher, self._diagnostics),
            (self.destroy_subscription, subscribe(JointState, self._value("joint_topic"), self._measure, 10)),
            (
                self.destroy_subscription,
                subscribe(TwistStamped, self._value("cartesian_command_in_topic"), self._twist, _NEWEST),
            ),
            (
                self.destroy_subscription,
                subscribe(PoseStamped, self._value("pose_command_in_topic"), self._pose, _NEWEST),
            ),
            (self.destroy_service, serve(SetBool, "~/pause_servo", self._pause)),
            (self.destroy_service, serve(Trigger, "~/reset_fault", self._reset_fault)),
            (self.destroy_timer, self.create_timer(self._value("publish_period"), self._publish)),
            (self.destroy_timer, self.create_timer(_DIAGNOSTICS, self._diagnose)),
        ]

    def _disconnect(self) -> None:
        for destroy, interface in self._interfaces:
            destroy(interface)
        self._interfaces = []

    def _measure(self, message: Any) -> None:
        if self.driver is not None:
            self.driver.measure(message.name, message.position, message.velocity)

    def _age(self, message: Any) -> float:
        """[s] of a message; 0 where the message has no stamp."""
        stamp = message.header.stamp
        if stamp.sec == 0 and stamp.nanosec == 0:
            return 0.0
        now = self.get_clock().now().nanoseconds
        return float(1e-9 * (now - (stamp.sec * 1_000_000_000 + stamp.nanosec)))

    def _wanted(self, kind: str) -> bool:
        return self._value("command_type") in ("any", kind)

    def _twist(self, message: Any) -> None:
        if self.driver is None or not self._wanted("twist"):
            return
        v, w = message.twist.linear, message.twist.angular
        twist = np.array([v.x, v.y, v.z, w.x, w.y, w.z])
        if self._value("command_in_type") == "unitless":
            twist[:3] *= self._value("scale.linear")
            twist[3:] *= self._value("scale.rotational")
        if not self.driver.twist(twist, message.header.frame_id, self._age(message)):
            self._say_refused("twist")

    def _pose(self, message: Any) -> None:
        if self.driver is None or not self._wanted("pose"):
            return
        p, o = message.pose.position, message.pose.orientation
        pose = np.eye(4)
        pose[:3, 3] = p.x, p.y, p.z
        pose[:3, :3] = _rotation_of(np.array([o.x, o.y, o.z, o.w]))
        if not self.driver.pose(pose, message.header.frame_id, self._age(message)):
            self._say_refused("pose")

    def _say_refused(self, what: str) -> None:
        assert self.driver is not None
        self.get_logger().warning(
            f"{what} refused: {self.driver.last_refusal}", throttle_duration_sec=_PATIENCE, skip_first=False
        )

    def _pause(self, request: Any, response: Any) -> Any:
        try:
            if self.driver is None or not self.driver.active:
                raise Error("the arm is not active")
            if request.data:
                self.driver.pause()
            else:
                self.driver.resume()
            response.success, response.message = True, "paused" if request.data else "goes on"
        except ValueError as error:
            response.success, response.message = False, str(error)
        return response

    def _reset_fault(self, request: Any, response: Any) -> Any:
        fault = "" if self.driver is None else self.driver.fault
        response = self._pause(SetBool.Request(data=False), response)
        if response.success:
            response.message = f"was: {fault}" if fault else "there was no fault"
        return response

    def _set_parameters(self, parameters: list[Any]) -> SetParametersResult:
        try:
            values = self._values()
            for parameter in parameters:
                if parameter.name not in PARAMETERS:
                    continue
                check(parameter.name, parameter.value)
                if not PARAMETERS[parameter.name].live and self._state == "active":
                    raise Error(f"{parameter.name} can change only while the node is not active")
                values[parameter.name] = parameter.value
            if self.driver is not None and any(parameter.name in PARAMETERS for parameter in parameters):
                settings = driver_settings(values)
                if settings != self.driver.settings:
                    self.driver.change(settings)
        except (ValueError, TypeError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    # --- what goes out

    def _publish(self) -> None:
        """The newest cycle's command, once."""
        driver = self.driver
        sample = None if driver is None else driver.newest()
        if driver is None or sample is None or sample["cycle"] == self._published:
            return
        self._published = sample["cycle"]
        positions = sample["q"].tolist() if self._value("publish_joint_positions") else []
        velocities = sample["qdot"].tolist() if self._value("publish_joint_velocities") else []
        if self._out_type == 1:
            self._commands.publish(Float64MultiArray(data=positions or velocities))
        else:
            message = JointTrajectory(joint_names=list(driver.chain.joint_names))
            message.header.stamp = self.get_clock().now().to_msg()
            point = JointTrajectoryPoint(positions=positions, velocities=velocities)
            point.time_from_start = Duration(seconds=self._value("publish_period")).to_msg()
            message.points = [point]
            self._commands.publish(message)
        self._status.publish(Int8(data=MOVEIT_STATUS[Status(int(sample["status"]))]))

    def _diagnose(self) -> None:
        driver = self.driver
        if driver is None:
            return
        sample, state = driver.newest(), driver.state
        level, text = DiagnosticStatus.OK, state.name.lower()
        values = {"state": text, "refused commands": str(driver.refused)}
        if driver.last_refusal:
            values["last refusal"] = driver.last_refusal
        if driver.fault:
            level, text = DiagnosticStatus.ERROR, driver.fault
        elif sample is not None and state != LoopState.DISABLED:
            values["command"] = LoopCommand(int(sample["command"])).name.lower()
            values["status"] = Status(int(sample["status"])).name.lower()
            values["scale"] = f"{float(sample['scale']):.3f}"
            if sample["command"] == LoopCommand.STALE:
                level, text = DiagnosticStatus.WARN, "the last command is stale"
        status = DiagnosticStatus(level=level, name=f"{self.get_name()}: servo", message=text)
        status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def _rotation_of(xyzw: Any) -> Any:
    """(3, 3) of a quaternion; not finite where the quaternion is not of length 1 within 1e-3, so that it is refused."""
    length = float(np.linalg.norm(xyzw))
    if not math.isfinite(length) or abs(length - 1.0) > 1e-3:
        return np.full((3, 3), np.nan)
    return rotation_of(xyzw / length)
