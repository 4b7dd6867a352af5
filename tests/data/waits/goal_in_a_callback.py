# send_goal() in a callback waits for a result that the same thread must bring.
# Says: begin() waits for the answer of the action patrol.
# Says: begin() holds the only thread of its executor
import rclpy
from rclpy.action import ActionClient, ActionServer
from rclpy.node import Node
from test_msgs.action import Fibonacci


class Patrol(Node):
    def __init__(self):
        super().__init__('patrol')
        self.server = ActionServer(self, Fibonacci, 'patrol', self.execute)
        self.client = ActionClient(self, Fibonacci, 'patrol')
        self.timer = self.create_timer(0.5, self.begin)

    def execute(self, goal_handle):
        goal_handle.succeed()
        return Fibonacci.Result()

    def begin(self):
        print(self.client.send_goal(Fibonacci.Goal(order=3)))


rclpy.init()
rclpy.spin(Patrol())

# Arrow: begin() > waits for > the answer of the action patrol
# Arrow: the answer of the action patrol > execute() needs > the only thread
# Arrow: the only thread > held by > begin()
