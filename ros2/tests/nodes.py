"""Nodes in the process of a test."""

import contextlib
import threading

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions


class Nodes:
    """The nodes of an open rclpy, which spin in a thread."""

    def __init__(self):
        self._executor = SingleThreadedExecutor()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _spin(self):
        while not self._closing.is_set():
            self._executor.spin_once(timeout_sec=0.1)

    def add(self, node):
        """Spin a node, and return it."""
        self._executor.add_node(node)
        return node

    def close(self):
        self._closing.set()
        self._thread.join()
        nodes = self._executor.get_nodes()
        self._executor.shutdown()
        for node in nodes:
            node.destroy_node()


@contextlib.contextmanager
def nodes():
    """Open rclpy in the domain of ROS_DOMAIN_ID, and yield its nodes, none yet."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    opened = Nodes()
    try:
        yield opened
    finally:
        opened.close()
        rclpy.shutdown()
