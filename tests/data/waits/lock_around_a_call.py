# A callback calls a service with a lock in its hand, and the server needs that lock.
# Says: drive() waits for the answer of the service state.
# Says: state(), for the service state of the node robot, would answer.
# Says: It cannot: it waits for a lock (self.lock), at line 23
import threading

import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger


class Robot(Node):
    def __init__(self):
        super().__init__('robot', enable_rosout=False)
        self.lock, group = threading.Lock(), ReentrantCallbackGroup()
        self.client = self.create_client(Trigger, 'state', callback_group=group)
        self.create_service(Trigger, 'state', self.state, callback_group=group)
        self.timer = self.create_timer(0.1, self.drive)

    def state(self, request, response):
        with self.lock:
            return response

    def drive(self):
        with self.lock:
            self.client.call(Trigger.Request())


rclpy.init()
executor = MultiThreadedExecutor(4)
executor.add_node(Robot())
executor.spin()

# Arrow: drive() > waits for > the answer of the service state
# Arrow: the answer of the service state > comes from > state()
# Arrow: state() > waits for > a lock (self.lock)
# Arrow: a lock (self.lock) > held by > drive()
