"""The command `sigmaik ros2-arm`."""

from __future__ import annotations

import argparse

from sigmaik._extras import need
from sigmaik_lab.options import add_arm, configuration, open_arm
from sigmaik_lab.spinning import add_ros_args, spin

__all__ = ["options", "run"]


def options(parser: argparse.ArgumentParser) -> None:
    arm = parser.add_argument_group("the arm")
    add_arm(arm, "franka_panda")
    arm.add_argument("--start", default="home", metavar="JOINTS", help="home, zero, or a comma list (%(default)s)")
    arm.add_argument("--exact", action="store_true", help="the joints do as they are told: no physics, no MuJoCo")
    node = parser.add_argument_group("the node")
    node.add_argument("--rate", type=float, default=250.0, metavar="HZ", help="of /joint_states (%(default)g)")
    node.add_argument(
        "--command-topic",
        default="/servo_node/command",
        metavar="TOPIC",
        help="of trajectory_msgs/JointTrajectory (%(default)s)",
    )
    add_ros_args(parser)


def run(args: argparse.Namespace) -> int:
    need("rclpy", *([] if args.exact else ["mujoco"]))
    if not 1.0 <= args.rate <= 1e3:
        raise ValueError(f"--rate must be from 1 to 1000, not {args.rate:g}")
    found = open_arm(args)
    start = configuration("--start", args.start, found.chain, found.home)
    description = found.path.read_text(encoding="utf-8")

    def make() -> object:
        from sigmaik.ros2.arm import ArmNode

        return ArmNode(
            found.chain,
            start,
            description,
            command_topic=args.command_topic,
            rate=args.rate,
            physics=not args.exact,
        )

    return spin(make, args.ros_args)
