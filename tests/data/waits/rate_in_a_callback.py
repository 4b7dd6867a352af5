# A Rate in a callback: its timer needs the thread that the callback holds.
# From: https://github.com/ros2/geometry2/issues/327
# Says: drive() waits for the next time of a Rate.
# Says: cannot: drive() holds the only thread of its executor.
# Says: use a timer in place of a Rate
import rclpy
from rclpy.node import Node


class Driver(Node):
    def __init__(self):
        super().__init__('driver')
        self.rate = self.create_rate(10)
        self.timer = self.create_timer(0.1, self.drive)

    def drive(self):
        for _ in range(3):
            self.rate.sleep()


rclpy.init()
rclpy.spin(Driver())

# Arrow: drive() > waits for > the next time of a Rate
# Arrow: the next time of a Rate > its timer needs > the only thread
# Arrow: the only thread > held by > drive()
