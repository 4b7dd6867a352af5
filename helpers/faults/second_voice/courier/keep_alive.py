"""Some bases stop if no command comes for half a second: say the last one again and again."""

from courier.program import run
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node


class KeepAlive(Node):
    def __init__(self):
        super().__init__('keep_alive')
        self.twist = Twist()
        self.publisher = self.create_publisher(TwistStamped, 'cmd_vel', 1)
        self.create_subscription(Twist, 'wanted', self.on_wanted, 1)
        self.create_timer(0.05, self.repeat, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def on_wanted(self, wanted):
        self.twist = wanted

    def repeat(self):
        self.publisher.publish(TwistStamped(twist=self.twist))

    def stop(self):
        self.publisher.publish(TwistStamped())


def main():
    run(KeepAlive)
