# wait_for_service() without a time-out, and nobody serves.
# From: https://github.com/ros2/examples/pull/185
# Says: The program waits for the service add_two_ints to be there.
# Says: It cannot: nobody serves /add_two_ints.
# Says: ros2 service list
import rclpy
from std_srvs.srv import Trigger

rclpy.init()
node = rclpy.create_node('minimal_client')
client = node.create_client(Trigger, 'add_two_ints')
client.wait_for_service()
