# The main thread joins a thread that spins, and only afterwards shuts down.
# From: https://github.com/ros2/rclpy/issues/205
# Says: The program waits for the end of the thread spinner.
# Says: it spins an executor, which ends only with rclpy.shutdown()
# Says: before join()
import threading

import rclpy
from rclpy.executors import SingleThreadedExecutor


def main():
    rclpy.init()
    executor = SingleThreadedExecutor()
    executor.add_node(rclpy.create_node('name'))
    thread = threading.Thread(target=executor.spin, name='spinner')
    thread.start()
    thread.join()
    rclpy.shutdown()


main()
