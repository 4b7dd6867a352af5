# A coroutine awaits a slow server; its client has a group of its own.
import time

import rclpy
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger


class Brake(Node):
    def __init__(self):
        super().__init__('brake')
        group = MutuallyExclusiveCallbackGroup()
        self.client = self.create_client(Trigger, 'look', callback_group=group)
        self.timer = self.create_timer(0.1, self.tick)

    async def tick(self):
        await self.client.call_async(Trigger.Request())


def look(request, response):
    print('now', flush=True)
    time.sleep(8)
    return response


rclpy.init()
camera = Node('camera')
camera.create_service(Trigger, 'look', look)
executor = MultiThreadedExecutor(2)
executor.add_node(camera)
executor.add_node(Brake())
executor.spin()
