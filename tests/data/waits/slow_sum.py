# A callback computes.
import rclpy


def work():
    print('now', flush=True)
    total = 0
    for i in range(10**9):
        total += i
    return total


rclpy.init()
node = rclpy.create_node('worker')
node.create_timer(0.1, work)
rclpy.spin(node)
