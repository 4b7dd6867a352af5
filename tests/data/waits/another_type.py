# A program in another process publishes another type.
# Says: hear(), for messages on /number of the node listener, would be called
# Says: talker sends std_msgs/msg/Int64, and not std_msgs/msg/Int32
import subprocess
import sys

import rclpy
from std_msgs.msg import Int32

TALKER = """
import rclpy
from std_msgs.msg import Int64
rclpy.init()
node = rclpy.create_node('talker')
node.create_publisher(Int64, 'number', 10)
sys.stdin.read()
"""


def hear(message):
    print(message)


talker = subprocess.Popen([sys.executable, '-c', f'import sys{TALKER}'], stdin=subprocess.PIPE)
rclpy.init()
node = rclpy.create_node('listener')
node.create_subscription(Int32, 'number', hear, 10)
rclpy.spin(node)
