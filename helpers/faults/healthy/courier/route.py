"""The route: straight on, in the direction in which the robot stood when it was activated."""

import math

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.time import Time

from courier.program import run

GAIN = 4.0  # rad/s for each rad
MAX_TURN = 1.0  # rad/s
MAX_AGE_S = 0.5  # of what it hears
AHEAD_S = 0.1  # two clocks may differ by so much


class Route(LifecycleNode):
    def __init__(self):
        super().__init__('route')
        self.speed = self.declare_parameter('speed', 0.1).value
        self.timer = None

    def on_configure(self, state):
        self.publisher = self.create_publisher(Twist, 'wanted', 1)
        self.create_subscription(Odometry, 'odom', self.on_odom, 1)
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state):
        self.yaw = self.first_yaw = None
        self.timer = self.create_timer(
            0.1, self.want, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        return super().on_activate(state)

    def on_deactivate(self, state):
        self.destroy_timer(self.timer)
        return super().on_deactivate(state)

    def on_odom(self, odom):
        q = odom.pose.pose.orientation
        age_s = (self.get_clock().now() - Time.from_msg(odom.header.stamp)).nanoseconds / 1e9
        if not -AHEAD_S <= age_s <= MAX_AGE_S or not abs(q.z**2 + q.w**2 - 1) < 0.1:
            return  # of another time, or no direction
        self.yaw = 2 * math.atan2(q.z, q.w)

    def want(self):
        if self.yaw is None:  # nobody says where it is: it wants nothing
            return
        if self.first_yaw is None:
            self.first_yaw = self.yaw
        left = math.remainder(self.yaw - self.first_yaw, math.tau)  # so far it has turned
        wanted = Twist()
        wanted.linear.x = self.speed
        wanted.angular.z = max(-MAX_TURN, min(MAX_TURN, -GAIN * left))
        self.publisher.publish(wanted)
        self.yaw = None  # the next one must be new

    def stop(self):
        """Nobody drives by what this node wants alone: the brake stops the robot."""


def main():
    run(Route)
