"""The command `sigmaik ros2`."""

from __future__ import annotations

import argparse

from sigmaik._extras import need
from sigmaik_lab.options import open_arm
from sigmaik_lab.spinning import add_ros_args, spin

__all__ = ["options", "run"]


def options(parser: argparse.ArgumentParser) -> None:
    arm = parser.add_argument_group("the arm, one of")
    choice = arm.add_mutually_exclusive_group()
    choice.add_argument("--robot", metavar="ARM", help="a shipped arm")
    choice.add_argument("--urdf", metavar="FILE", help="a URDF file")
    choice.add_argument(
        "--description-topic",
        nargs="?",
        const="robot_description",
        metavar="TOPIC",
        help="the URDF comes from a topic (std_msgs/String, transient local; %(const)s)",
    )
    links = parser.add_argument_group("its links")
    links.add_argument("--base", help="base link (the root)")
    links.add_argument("--tip", help="tip link (the only leaf; of a shipped arm: flange)")
    parser.add_argument("--name", default="servo_node", help="of the node (%(default)s)")
    add_ros_args(parser)


def run(args: argparse.Namespace) -> int:
    need("rclpy")
    overrides = {"base": args.base or "", "tip": args.tip or ""}
    words = list(args.ros_args)
    if args.description_topic:
        words += ["-r", f"robot_description:={args.description_topic}"]
    else:
        args.robot = args.robot or args.urdf
        if args.robot is None:
            raise ValueError("one of --robot, --urdf and --description-topic is needed")
        found = open_arm(args)
        overrides["robot_description"] = found.path.read_text(encoding="utf-8")
        overrides["base"], overrides["tip"] = found.chain.base, found.chain.tip

    def make() -> object:
        from sigmaik.ros2.node import ServoNode

        return ServoNode(args.name, **overrides)

    return spin(make, words)
