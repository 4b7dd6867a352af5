# The node is in an executor, and the line that spins it is never reached.
# Says: nobody spins the executor of the node listener: line 22 would, but the program is still in line 21
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Int32

heard = []


def main():
    rclpy.init()
    node = rclpy.create_node('listener')
    publisher = node.create_publisher(Int32, 'number', 10)
    node.create_subscription(Int32, 'number', heard.append, 10)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not heard:
        publisher.publish(Int32())
        time.sleep(0.1)
    executor.spin()


main()
