"""The program of a lesson's nodes: `python node.py MODULE 'Driver(0.5, 0.0)' THREADS`.

It ends as `drive.py` of lesson 01 does: Ctrl+C and SIGTERM let the robot stop first.
"""

import importlib
import signal
import sys
from contextlib import suppress

import rclpy
from rclpy.duration import Duration
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args


def stop(node):
    """Stop the robot as this node can: by its own `stop`, or by a command of zeros."""
    publisher = getattr(node, 'publisher', None)
    if callable(getattr(node, 'stop', None)):
        node.stop()
    elif isinstance(publisher, Publisher) and publisher.topic_name.endswith('cmd_vel'):
        publisher.publish(publisher.msg_type())
        publisher.wait_for_all_acked(Duration(seconds=1))


def main():
    module, call, threads = remove_ros_args(sys.argv)[1:]
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    lesson = importlib.import_module(module)
    node = eval(call, vars(lesson))
    executor = SingleThreadedExecutor()
    if int(threads) > 1:
        executor = MultiThreadedExecutor(num_threads=int(threads))
    executor.add_node(node)
    try:
        while rclpy.ok():
            executor.spin_once(timeout_sec=0.1)
    except KeyboardInterrupt:
        pass
    finally:
        stop(node)
        with suppress(Exception):
            rclpy.try_shutdown()


if __name__ == '__main__':
    main()
