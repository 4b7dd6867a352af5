"""Executors with nodes in them, and threads that spin them: each in one line of a lesson."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node

if TYPE_CHECKING:
    from helpers.ros.session import Session


def spun(*nodes: Node) -> SingleThreadedExecutor:
    """Return an executor with these nodes."""
    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    return executor


def spin_each(session: Session, *nodes: Node, threads: int = 1) -> None:
    """Spin each node in an executor of its own. The first one gets the threads."""
    for number, node in enumerate(nodes):
        many = threads > 1 and number == 0
        executor = MultiThreadedExecutor(threads) if many else SingleThreadedExecutor()
        executor.add_node(node)
        session.spin(executor)
