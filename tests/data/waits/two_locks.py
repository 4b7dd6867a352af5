# Two callbacks take two locks, each in another order.
# Says: waits for a lock
# Says: it waits, too, at line
# Says: in the same order
import threading
import time

import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor

rclpy.init()
node = rclpy.create_node('arms')
left, right = threading.Lock(), threading.Lock()
group = ReentrantCallbackGroup()


def take():
    with left:
        time.sleep(0.3)
        with right:
            pass


def give():
    with right:
        time.sleep(0.3)
        with left:
            pass


node.create_timer(0.1, take, callback_group=group)
node.create_timer(0.1, give, callback_group=group)
executor = MultiThreadedExecutor(2)
executor.add_node(node)
executor.spin()

# Arrow: give() > waits for > a lock (left)
# Arrow: a lock (left) > held by > take()
# Arrow: take() > waits for > a lock (right)
# Arrow: a lock (right) > held by > give()
