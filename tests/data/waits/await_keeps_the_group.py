# `await` gives the thread back, and not the group.
# Says: tick() awaits the answer of the service look.
# Says: cannot: tick() holds its callback group (an `await` does not give it back).
# Says: Give the client a group of its own
import rclpy
from rclpy.node import Node
from std_srvs.srv import Trigger


class Brake(Node):
    def __init__(self):
        super().__init__('brake')
        self.client = self.create_client(Trigger, 'look')
        self.timer = self.create_timer(0.1, self.tick)

    async def tick(self):
        await self.client.call_async(Trigger.Request())


rclpy.init()
camera = Node('camera')
camera.create_service(Trigger, 'look', lambda request, response: response)
executor = rclpy.executors.SingleThreadedExecutor()
executor.add_node(camera)
executor.add_node(Brake())
executor.spin()

# Arrow: tick() > awaits > the answer of the service look
# Arrow: the answer of the service look > the client needs > the group of tick()
# Arrow: the group of tick() > held by > tick()
