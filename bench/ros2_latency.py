"""From a twist message to the first joint command that moves, over the loopback interface, and between commands.

Three processes: the node (`sigmaik ros2`), a simulated arm (`sigmaik ros2-arm --exact`), and this client. Each trial
sends a twist to a resting arm, and takes the time until a command with a velocity arrives.

    python bench/ros2_latency.py --trials 100
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np
import rclpy
from geometry_msgs.msg import TwistStamped
from trajectory_msgs.msg import JointTrajectory


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="ufactory_xarm7")
    parser.add_argument("--trials", type=int, default=100)
    options = parser.parse_args()
    os.environ["ROS_DOMAIN_ID"] = str(random.SystemRandom().randrange(1, 100))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    command = [sys.executable, "-m", "sigmaik_lab"]
    processes = [
        subprocess.Popen([*command, "ros2-arm", "--robot", options.robot, "--exact"]),
        subprocess.Popen([*command, "ros2", "--robot", options.robot]),
    ]
    rclpy.init()
    client = rclpy.create_node("latency")
    arrived: list[tuple[float, float]] = []  # (s, largest velocity)

    def take(message: JointTrajectory) -> None:
        arrived.append((time.monotonic(), float(np.abs(message.points[0].velocities).max())))

    client.create_subscription(JointTrajectory, "/servo_node/command", take, 100)
    twists = client.create_publisher(TwistStamped, "/servo_node/delta_twist_cmds", 1)

    def wait(condition: Callable[[], bool], seconds: float = 30.0) -> None:
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                raise SystemExit("no command arrives")
            rclpy.spin_once(client, timeout_sec=0.01)

    try:
        wait(lambda: len(arrived) > 100 and twists.get_subscription_count() > 0)
        latency, gaps = [], []
        for trial in range(options.trials):
            wait(lambda: arrived[-1][1] == 0.0)
            rest = time.monotonic() + random.uniform(0.05, 0.06)  # not in step with the publisher
            wait(lambda at=rest: time.monotonic() > at)
            arrived.clear()
            message = TwistStamped()
            message.header.stamp = client.get_clock().now().to_msg()
            message.twist.linear.z = 0.02 if trial % 2 else -0.02
            sent = time.monotonic()
            twists.publish(message)
            wait(lambda: bool(arrived) and arrived[-1][1] > 0.0)
            latency.append(arrived[-1][0] - sent)
            gaps.extend(np.diff([at for at, _ in arrived]))
        for name, values in (("twist to command", latency), ("between commands", gaps)):
            low, middle, high, worst = 1e3 * np.percentile(values, [5, 50, 95, 100])
            print(f"{name}: 5 % {low:.2f}, median {middle:.2f}, 95 % {high:.2f}, worst {worst:.2f} ms")
    finally:
        for process in processes:
            process.send_signal(signal.SIGTERM)
        for process in processes:
            process.wait(20)
        client.destroy_node()
        rclpy.shutdown()


if __name__ == "__main__":
    main()
