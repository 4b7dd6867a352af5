# A callback takes long, and the others of its thread wait for it.
import time

import rclpy
from rclpy.node import Node


class Robot(Node):
    def __init__(self):
        super().__init__('robot')
        self.timer = self.create_timer(0.1, self.think)
        self.other = self.create_timer(0.1, lambda: None)

    def think(self):
        print('now', flush=True)
        time.sleep(8)


rclpy.init()
rclpy.spin(Robot())
