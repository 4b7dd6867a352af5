# A service is called in a callback, and one thread spins.
# From: https://github.com/ros2/rclpy/issues/567
# Says: measure() waits for the answer of the service device.
# Says: line 23: answer = self.client.call(Trigger.Request())
# Says: cannot: measure() holds the only thread of its executor
# Says: call_async()
import rclpy
from rclpy.node import Node
from std_srvs.srv import Trigger


class Checker(Node):
    def __init__(self):
        super().__init__('checker')
        self.create_service(Trigger, 'device', self.device)
        self.client = self.create_client(Trigger, 'device')
        self.timer = self.create_timer(0.1, self.measure)

    def device(self, request, response):
        return response

    def measure(self):
        answer = self.client.call(Trigger.Request())
        print(answer)


rclpy.init()
rclpy.spin(Checker())

# Arrow: measure() > waits for > the answer of the service device
# Arrow: the answer of the service device > device() needs > the only thread
# Arrow: the only thread > held by > measure()
