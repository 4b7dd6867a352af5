# The main thread spins, and the next message comes in a while.
import rclpy
from std_msgs.msg import Int32

rclpy.init()
node = rclpy.create_node('talker')
publisher = node.create_publisher(Int32, 'number', 10)
node.create_timer(8.0, lambda: publisher.publish(Int32()))
node.create_subscription(Int32, 'number', lambda message: None, 10)
print('now', flush=True)
while rclpy.ok():
    rclpy.spin_once(node, timeout_sec=0.2)
