# A call in a callback, with a time-out: it holds its thread, but it ends.
import rclpy
from rclpy.node import Node
from std_srvs.srv import Trigger


class Brake(Node):
    def __init__(self):
        super().__init__('brake')
        self.client = self.create_client(Trigger, 'look')
        self.timer = self.create_timer(0.1, self.tick)

    def tick(self):
        print('now', flush=True)
        self.client.call(Trigger.Request(), timeout_sec=8.0)


rclpy.init()
rclpy.spin(Brake())
