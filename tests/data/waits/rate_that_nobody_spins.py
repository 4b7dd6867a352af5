# A Rate in the main thread, as in ROS 1: nobody spins its timer.
# From: https://github.com/ros2/ros2_documentation/pull/4132
# Says: The program waits for the next time of a Rate.
# Says: line 17 of main(): rate.sleep()
# Says: the node talker is in no executor, so nobody spins it
import rclpy
from std_msgs.msg import Int32


def main():
    rclpy.init()
    node = rclpy.create_node('talker')
    publisher = node.create_publisher(Int32, 'number', 10)
    rate = node.create_rate(2)
    while rclpy.ok():
        publisher.publish(Int32(data=1))
        rate.sleep()


main()
