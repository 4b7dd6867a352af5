# A callback waits for an Event that another callback of the same thread sets.
# Says: plan() waits for an Event to be set (self.has_scan).
# Says: scan(), for messages on /scan of the node planner, would call has_scan.set()
# Says: cannot: plan() holds the only thread of its executor
# Says: Let the callback return
import threading

import rclpy
from rclpy.node import Node
from std_msgs.msg import Int32


class Planner(Node):
    def __init__(self):
        super().__init__('planner')
        self.has_scan = threading.Event()
        self.publisher = self.create_publisher(Int32, 'scan', 1)
        self.subscription = self.create_subscription(Int32, 'scan', self.scan, 1)
        self.timer = self.create_timer(0.1, self.plan)

    def scan(self, message):
        self.has_scan.set()

    def plan(self):
        self.publisher.publish(Int32())
        self.has_scan.wait()


rclpy.init()
rclpy.spin(Planner())

# Arrow: plan() > waits for > an Event to be set (self.has_scan)
# Arrow: an Event to be set (self.has_scan) > scan() needs > the only thread
# Arrow: the only thread > held by > plan()
