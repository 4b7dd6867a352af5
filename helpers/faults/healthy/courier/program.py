"""How each program of this package begins and ends."""

import signal

import rclpy
from rclpy.signals import SignalHandlerOptions


def run(make_node):
    """Spin a node until Ctrl+C or SIGTERM, and let it stop the robot before its context goes."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    node = make_node()
    try:
        while rclpy.ok():  # Python sees a signal between two of its own lines only
            rclpy.spin_once(node, timeout_sec=0.1)
    except KeyboardInterrupt:
        pass
    finally:
        node.stop()
        rclpy.try_shutdown()
