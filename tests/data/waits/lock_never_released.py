# An early return: the lock stays locked, and the next callback waits for it.
# Says: hear() waits for a lock (self.lock; no `with` that runs now holds it
# Says: It cannot: it is hear() itself that waits.
import threading

import rclpy
from rclpy.node import Node
from std_msgs.msg import Int32


class Listener(Node):
    def __init__(self):
        super().__init__('listener')
        self.lock = threading.Lock()
        self.subscription = self.create_subscription(Int32, 'number', self.hear, 10)
        self.publisher = self.create_publisher(Int32, 'number', 10)
        self.timer = self.create_timer(0.1, lambda: self.publisher.publish(Int32()))

    def hear(self, message):
        print('heard')
        # The second time it waits here.
        self.lock.acquire()
        if message.data == 0:
            return
        self.lock.release()


rclpy.init()
rclpy.spin(Listener())

# Arrow: hear() > waits for > a lock (self.lock)
# Arrow: a lock (self.lock) > needs > line 25
# Arrow: line 25 > comes after > hear()
