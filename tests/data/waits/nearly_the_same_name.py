# The server has a name with one letter more.
# Says: nobody serves /look (nearly the same name: /looks)
import rclpy
from std_srvs.srv import Trigger

rclpy.init()
node = rclpy.create_node('brake')
camera = rclpy.create_node('camera')
camera.create_service(Trigger, 'looks', lambda request, response: response)
client = node.create_client(Trigger, 'look')
while not client.wait_for_service(timeout_sec=0.5):
    print('waiting again')
