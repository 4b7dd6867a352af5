# wait_for_message() on a topic that nobody publishes.
# Says: The program waits for a message on map.
# Says: It cannot: nobody publishes on /map
# Says: ros2 topic list
import rclpy
from rclpy.wait_for_message import wait_for_message
from std_msgs.msg import Int32

rclpy.init()
node = rclpy.create_node('planner')
wait_for_message(Int32, node, 'map')
