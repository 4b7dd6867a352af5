# A loop with a deadline, in a callback.
import time

import rclpy
from rclpy.node import Node
from std_msgs.msg import Int32


class Planner(Node):
    def __init__(self):
        super().__init__('planner')
        self.goal = None
        self.create_subscription(Int32, 'goal', self.hear, 10)
        self.create_timer(0.1, self.plan)

    def hear(self, message):
        self.goal = message.data

    def plan(self):
        print('now', flush=True)
        end = time.monotonic() + 8.0
        while self.goal is None and time.monotonic() < end:
            time.sleep(0.1)


rclpy.init()
rclpy.spin(Planner())
