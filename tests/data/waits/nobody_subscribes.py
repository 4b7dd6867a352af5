# The program waits for a subscription, and nobody subscribes.
# From: https://github.com/sea-bass/pyrobosim/pull/63
# Says: The program asks again and again for a subscription to /goals.
# Says: nobody subscribes to /goals
import time

import rclpy
from std_msgs.msg import Int32

rclpy.init()
node = rclpy.create_node('planner')
publisher = node.create_publisher(Int32, 'goals', 10)
while rclpy.ok() and publisher.get_subscription_count() < 1:
    time.sleep(0.1)
