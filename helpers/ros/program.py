"""A node of ours as a program of its own, beside those of a student."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from helpers.ros.domain import announce_often


def run_program(make_node: Callable[[], Node]) -> None:
    """Initialize rclpy with the arguments of this process, and spin a node until it is ended.

    Raises what `make_node()` raises. No such program drives a robot, so none sends a stop.
    """
    announce_often()
    rclpy.init(args=sys.argv)
    try:
        rclpy.spin(make_node())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # the end that was asked for
    finally:
        # At a signal rclpy shuts down in a thread of its own, also between the question of
        # `try_shutdown`, whether it is done, and its own call: then that is an RCLError.
        with contextlib.suppress(RuntimeError):
            rclpy.try_shutdown()
