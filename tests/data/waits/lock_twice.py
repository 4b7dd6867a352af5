# A method takes a lock, and calls a method that takes it as well.
# Says: waits for a lock (self.lock)
# Says: It cannot: it is the same thread, in line 24 of tick()
# Says: threading.RLock()
import threading

import rclpy
from rclpy.node import Node


class Counter(Node):
    def __init__(self):
        super().__init__('counter')
        self.lock = threading.Lock()
        self.count = 0
        self.timer = self.create_timer(0.1, self.tick)

    def add(self):
        with self.lock:
            self.count += 1

    def tick(self):
        with self.lock:
            self.add()


rclpy.init()
rclpy.spin(Counter())

# Arrow: tick() > waits for > a lock (self.lock)
# Arrow: a lock (self.lock) > needs > the end of the with in line 24
# Arrow: the end of the with in line 24 > comes after > tick()
