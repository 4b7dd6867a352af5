# A callback takes out of a queue that a callback of its own group fills.
# Says: show() waits for something in a queue that is empty (self.lines).
# Says: hear(), for messages on /line of the node printer, would call lines.put()
# Says: cannot: show() holds its callback group
import queue

import rclpy
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String


class Printer(Node):
    def __init__(self):
        super().__init__('printer')
        self.lines = queue.Queue()
        self.publisher = self.create_publisher(String, 'line', 10)
        self.create_subscription(String, 'line', self.hear, 10)
        self.timer = self.create_timer(0.1, self.show)

    def hear(self, message):
        self.lines.put(message.data)

    def show(self):
        self.publisher.publish(String(data='a line'))
        print(self.lines.get())


rclpy.init()
executor = MultiThreadedExecutor(3)
executor.add_node(Printer())
executor.spin()

# Arrow: show() > waits for > something in a queue that is empty (self.lines)
# Arrow: something in a queue that is empty (self.lines) > hear() needs > the group of show()
# Arrow: the group of show() > held by > show()
