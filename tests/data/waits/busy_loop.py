# The main thread turns in a loop, and nobody spins.
# Says: The program asks again and again for the answer of the service look.
# Says: the node person is in no executor
import rclpy
from std_srvs.srv import Trigger

rclpy.init()
node = rclpy.create_node('person')
node.create_service(Trigger, 'look', lambda request, response: response)
client = node.create_client(Trigger, 'look')
future = client.call_async(Trigger.Request())
while True:
    if future.done():
        break
