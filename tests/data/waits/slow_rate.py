# A slow Rate, in a thread of its own.
import threading

import rclpy

rclpy.init()
node = rclpy.create_node('clockwork')
threading.Thread(target=rclpy.spin, args=[node], daemon=True).start()
rate = node.create_rate(0.1)
print('now', flush=True)
while rclpy.ok():
    rate.sleep()
