"""The node and the simulated arm as processes of their own, on this machine's loopback."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
import warnings

import numpy as np
import pytest

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # its parser of interface files imports sre_parse
    pytest.importorskip("lark")
rclpy = pytest.importorskip("rclpy")

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import PoseStamped, TwistStamped  # noqa: E402
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402

import sigmaik as sk  # noqa: E402

ROBOT = "ufactory_xarm7"
PATIENCE = 60.0  # s: a loaded machine discovers slowly


class Cell:
    """The node, the arm, and a client of both."""

    def __init__(self, *node_args):
        self.chain, self.home = sk.robots.load(ROBOT), sk.robots.home(ROBOT)
        command = [sys.executable, "-m", "sigmaik_lab"]
        self.arm = subprocess.Popen([*command, "ros2-arm", "--robot", ROBOT, "--exact"])
        self.node_process = subprocess.Popen([*command, "ros2", "--robot", ROBOT, *node_args])
        self.client = rclpy.create_node(f"client_{random.randrange(1 << 30)}")
        self.commands, self.states, self.diagnostics = [], [], []
        subscribe = self.client.create_subscription
        subscribe(JointTrajectory, "/servo_node/command", self.commands.append, 100)
        subscribe(JointState, "/joint_states", self.states.append, 100)
        subscribe(DiagnosticArray, "/diagnostics", self.diagnostics.append, 10)
        self.twists = self.client.create_publisher(TwistStamped, "/servo_node/delta_twist_cmds", 10)
        self.poses = self.client.create_publisher(PoseStamped, "/servo_node/pose_target_cmds", 10)
        self.wait(lambda: self.commands and self.states and self.twists.get_subscription_count() > 0)

    def wait(self, condition, seconds=PATIENCE):
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, "the condition did not come true"
            rclpy.spin_once(self.client, timeout_sec=0.02)

    def repeat(self, send, condition):
        """Sends a command 50 times a second until a condition holds."""
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, "the condition did not come true"
            send()
            self.spin(0.02)

    def spin(self, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            rclpy.spin_once(self.client, timeout_sec=0.01)

    def twist(self, v, frame="", ahead=0.0, stamp=True):
        message = TwistStamped()
        message.header.frame_id = frame
        if stamp:
            message.header.stamp = self.now(ahead)
        linear, angular = message.twist.linear, message.twist.angular
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z = map(float, v)
        self.twists.publish(message)

    def drive(self, v, seconds, frame=""):
        for _ in range(round(seconds * 50)):
            self.twist(v, frame)
            self.spin(0.02)

    def pose(self, pose, frame="", quaternion=None):
        message = PoseStamped()
        message.header.frame_id = frame
        message.header.stamp = self.now()
        p, o = message.pose.position, message.pose.orientation
        p.x, p.y, p.z = map(float, pose[:3, 3])
        o.x, o.y, o.z, o.w = map(float, xyzw(pose[:3, :3]) if quaternion is None else quaternion)
        self.poses.publish(message)

    def now(self, ahead=0.0):
        return (self.client.get_clock().now() + rclpy.duration.Duration(seconds=ahead)).to_msg()

    def call(self, kind, name, request):
        service = self.client.create_client(kind, name)
        self.wait(service.service_is_ready)
        future = service.call_async(request)
        self.wait(future.done)
        return future.result()

    def pause(self, on):
        return self.call(SetBool, "/servo_node/pause_servo", SetBool.Request(data=on))

    def reset_fault(self):
        return self.call(Trigger, "/servo_node/reset_fault", Trigger.Request())

    def set(self, name, text):
        value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=text)
        request = SetParameters.Request(parameters=[Parameter(name=name, value=value)])
        return self.call(SetParameters, "/servo_node/set_parameters", request).results[0]

    def refusal(self):
        """The last refusal that the diagnostics tell."""
        for message in reversed(self.diagnostics):
            for status in message.status:
                for item in status.values:
                    if item.key == "last refusal":
                        return item.value
        return ""

    def q(self):
        return np.array(self.states[-1].position)

    def rests(self):
        """Waits until the arm rests."""
        self.spin(0.3)
        self.wait(lambda: np.abs(self.states[-1].velocity).max() < 1e-6)

    def close(self):
        for process in (self.node_process, self.arm):
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
        for process in (self.node_process, self.arm):
            process.wait(20)
        self.client.destroy_node()


def xyzw(rotation):
    w = np.sqrt(max(0.0, 1.0 + np.trace(rotation))) / 2.0
    if w > 1e-3:
        skew = rotation - rotation.T
        return np.array([skew[2, 1], skew[0, 2], skew[1, 0], 4.0 * w * w]) / (4.0 * w)
    values, vectors = np.linalg.eigh(rotation + rotation.T)
    return np.append(vectors[:, np.argmax(values)], 0.0)


@pytest.fixture(scope="session", autouse=True)
def ros(tmp_path_factory):
    os.environ["ROS_DOMAIN_ID"] = str(random.SystemRandom().randrange(1, 100))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros"))
    os.environ.pop("ROS_LOCALHOST_ONLY", None)
    rclpy.init()
    yield
    rclpy.shutdown()
    shutil.rmtree(os.environ["ROS_LOG_DIR"], ignore_errors=True)


@pytest.fixture(scope="module")
def cell():
    cell = Cell("--ros-args", "-p", "guided:=true")  # so that each test's way home arrives
    yield cell
    cell.close()


@pytest.fixture
def own_cell():
    """A cell for a test that ends its processes."""
    cell = Cell()
    yield cell
    cell.close()
