# A call in the main thread, while nobody spins.
# From: https://github.com/ros2/rclpy/issues/181
# Says: The program waits for the answer of the service add_two_ints.
# Says: the node minimal_client is in no executor, so nobody spins it
# Says: Spin it
import threading

import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger


def main():
    rclpy.init()
    server = rclpy.create_node('server')
    server.create_service(Trigger, 'add_two_ints', lambda request, response: response)
    executor = SingleThreadedExecutor()
    executor.add_node(server)
    threading.Thread(target=executor.spin, daemon=True).start()
    node = rclpy.create_node('minimal_client')
    client = node.create_client(Trigger, 'add_two_ints')
    client.wait_for_service()
    print(client.call(Trigger.Request()))


main()
