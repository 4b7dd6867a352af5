# A subscription asks for RELIABLE, and the publisher offers BEST_EFFORT.
# Says: The program spins, and so waits for callbacks.
# Says: hear(), for messages on /scan of the node listener, would be called
# Says: on /scan, the QoS of laser does not match
# Says: ros2 topic info -v
import rclpy
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Int32


def hear(message):
    print(message)


def main():
    rclpy.init()
    laser = rclpy.create_node('laser')
    laser.create_publisher(Int32, 'scan', qos_profile_sensor_data)
    node = rclpy.create_node('listener')
    node.create_subscription(Int32, 'scan', hear, 10)
    rclpy.spin(node)


main()
