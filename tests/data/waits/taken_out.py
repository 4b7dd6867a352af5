# spin_until_future_complete() in a callback has taken the node out of its executor.
# From: https://github.com/ros2/rclpy/issues/1398
# Says: The program waits for the answer of the service second.
# Says: the node robot is in no executor any more
# Says: executor.add_node(node)
import threading

import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger


class Robot(Node):
    def __init__(self):
        super().__init__('robot')
        group = ReentrantCallbackGroup()
        self.client = self.create_client(Trigger, 'device', callback_group=group)
        self.create_service(Trigger, 'first', self.first, callback_group=group)
        self.create_service(Trigger, 'second', self.second, callback_group=group)

    def first(self, request, response):
        future = self.client.call_async(Trigger.Request())
        rclpy.spin_until_future_complete(self, future)
        return future.result()

    def second(self, request, response):
        return response


def main():
    rclpy.init()
    device, person = Node('device'), Node('person')
    device.create_service(Trigger, 'device', lambda request, response: response)
    executor = MultiThreadedExecutor(4)
    for node in (device, person, Robot()):
        executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    first = person.create_client(Trigger, 'first')
    second = person.create_client(Trigger, 'second')
    first.wait_for_service()
    first.call(Trigger.Request())
    second.call(Trigger.Request())


main()
