# A callback asks for a variable that another callback of its group writes.
# Says: drive() asks again and again for `self.distance` to change.
# Says: hear(), for messages on /distance of the node driver, would change it
# Says: drive() holds its callback group
import time

import rclpy
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float32


class Driver(Node):
    def __init__(self):
        super().__init__('driver')
        self.distance = None
        self.publisher = self.create_publisher(Float32, 'distance', 1)
        self.create_subscription(Float32, 'distance', self.hear, 1)
        self.timer = self.create_timer(0.1, self.drive)

    def hear(self, message):
        self.distance = message.data

    def drive(self):
        while self.distance is None:
            self.publisher.publish(Float32())
            time.sleep(0.05)


rclpy.init()
executor = MultiThreadedExecutor(4)
executor.add_node(Driver())
executor.spin()

# Arrow: drive() > waits for > self.distance to change
# Arrow: self.distance to change > hear() needs > the group of drive()
# Arrow: the group of drive() > held by > drive()
