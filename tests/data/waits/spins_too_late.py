# The line that spins comes after the line that waits.
# Says: The program waits for an Event to be set (heard).
# Says: It cannot: the node listener is in no executor, so nobody spins it
import threading

import rclpy
from std_msgs.msg import Int32


def main():
    rclpy.init()
    node = rclpy.create_node('listener')
    heard = threading.Event()
    node.create_publisher(Int32, 'number', 10).publish(Int32())
    node.create_subscription(Int32, 'number', lambda message: heard.set(), 10)
    heard.wait()
    rclpy.spin(node)


main()
