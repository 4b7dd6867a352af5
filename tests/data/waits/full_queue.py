# A callback puts into a queue that is full, and the one that takes out has the same thread.
# Says: image() waits for room in a queue that is full (1) (self.images).
# Says: draw(), of a timer of the node viewer, would call images.get()
# Says: cannot: image() holds the only thread of its executor
import queue

import rclpy
from rclpy.node import Node


class Viewer(Node):
    def __init__(self):
        super().__init__('viewer')
        self.images = queue.Queue(maxsize=1)
        self.fast = self.create_timer(0.1, self.image)
        self.slow = self.create_timer(5.0, self.draw)

    def image(self):
        self.images.put('image')

    def draw(self):
        self.images.get()


rclpy.init()
rclpy.spin(Viewer())

# Arrow: image() > waits for > room in a queue that is full (1) (self.images)
# Arrow: room in a queue that is full (1) (self.images) > draw() needs > the only thread
# Arrow: the only thread > held by > image()
