# Several threads, and the client in the group of the callback that calls.
# From: https://github.com/ros2/rclpy/issues/1028
# Says: the answer of the service test_service
# Says: cannot: tick() holds its callback group.
# Says: Give the client a group of its own
import rclpy
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Empty


class Server(Node):
    def __init__(self):
        super().__init__('server')
        self.create_service(Empty, 'test_service', self.serve)

    def serve(self, request, response):
        return response


class Caller(Node):
    def __init__(self):
        super().__init__('caller')
        group = MutuallyExclusiveCallbackGroup()
        self.client = self.create_client(Empty, 'test_service', callback_group=group)
        self.timer = self.create_timer(0.1, self.tick, callback_group=group)

    def tick(self):
        self.client.call(Empty.Request())


rclpy.init()
executor = MultiThreadedExecutor(4)
executor.add_node(Server())
executor.add_node(Caller())
executor.spin()

# Arrow: tick() > waits for > the answer of the service test_service
# Arrow: the answer of the service test_service > the client needs > the group of tick()
# Arrow: the group of tick() > held by > tick()
