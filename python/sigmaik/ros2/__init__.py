"""A node for ROS 2 with the topics of MoveIt Servo: Cartesian commands in, joint commands out.

    ros2 launch, or: sigmaik ros2 --robot franka_panda

    from sigmaik.ros2.driver import Driver    # frames, time stamps and measured joints around a ServoLoop; no ROS
    from sigmaik.ros2.node import ServoNode   # the node: a managed node of rclpy

The node needs a ROS 2 that is sourced, or the extra "ros2" (wheels of rclpy and the messages). The cycle is the
ServoLoop's, in C++: a Python that is late delays messages and no cycle. `Driver` and `Frames` need numpy alone.
"""

from .driver import Driver, DriverSettings
from .frames import Frames

__all__ = ["Driver", "DriverSettings", "Frames"]
