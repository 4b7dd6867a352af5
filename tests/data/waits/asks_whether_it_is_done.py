# A callback asks in a loop whether the future is done.
# From: https://github.com/cyberbotics/webots_ros2/issues/785
# Says: step() asks again and again for the answer of the service send.
# Says: cannot: step() holds the only thread of its executor; step() holds its callback group.
import time

import rclpy
from rclpy.node import Node
from std_srvs.srv import Trigger


class Plugin(Node):
    def __init__(self):
        super().__init__('plugin')
        self.create_service(Trigger, 'send', lambda request, response: response)
        self.client = self.create_client(Trigger, 'send')
        self.timer = self.create_timer(0.1, self.step)

    def step(self):
        future = self.client.call_async(Trigger.Request())
        while rclpy.ok() and not future.done():
            time.sleep(0.01)


rclpy.init()
rclpy.spin(Plugin())

# Arrow: step() > waits for > the answer of the service send
# Arrow: the answer of the service send > a lambda needs > the only thread
# Arrow: the only thread > held by > step()
