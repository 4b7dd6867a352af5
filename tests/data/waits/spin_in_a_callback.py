# spin_until_future_complete() in a callback: the client's group is held.
# From: https://github.com/ros2/rclpy/issues/1313
# Says: execute() waits for the answer of the service look.
# Says: cannot: execute() holds its callback group
# Says: Do not spin in a callback
import rclpy
from rclpy.node import Node
from std_srvs.srv import Trigger


class Server(Node):
    def __init__(self):
        super().__init__('outer')
        self.create_service(Trigger, 'look', self.look)
        self.client = self.create_client(Trigger, 'look')
        self.timer = self.create_timer(0.1, self.execute)

    def look(self, request, response):
        return response

    def execute(self):
        future = self.client.call_async(Trigger.Request())
        rclpy.spin_until_future_complete(self, future)
        print(future.result())


rclpy.init()
rclpy.spin(Server())

# Arrow: execute() > waits for > the answer of the service look
# Arrow: the answer of the service look > look() needs > the group of execute()
# Arrow: the group of execute() > held by > execute()
