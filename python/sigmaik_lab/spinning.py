"""Running a node of ROS 2 until Ctrl-C or SIGTERM."""

from __future__ import annotations

import argparse
import signal
import threading
from collections.abc import Callable, Sequence
from typing import Any

from .signals import handled_signals

__all__ = ["add_ros_args", "spin"]

_WAIT = 0.1  # [s] until the end is noticed, where no message comes


def add_ros_args(parser: argparse.ArgumentParser) -> None:
    """The option --ros-args, which takes all words that follow."""
    parser.add_argument(
        "--ros-args",
        nargs=argparse.REMAINDER,
        default=[],
        metavar="…",
        help="what follows is for ROS: parameters (-p name:=value), remappings (-r from:=to)",
    )


def spin(make: Callable[[], Any], ros_args: Sequence[str]) -> int:
    """Runs the node that `make` returns, and closes it in the end, while the node can still publish."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    ending = threading.Event()  # and no exception: it could end a callback half way
    rclpy.init(args=["--ros-args", *ros_args] if ros_args else [], signal_handler_options=SignalHandlerOptions.NO)
    try:
        with handled_signals(lambda *_: ending.set(), signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            node = make()
            while not ending.is_set():
                rclpy.spin_once(node, timeout_sec=_WAIT)
            node.close()
            node.destroy_node()
    finally:
        rclpy.try_shutdown()
    return 0
