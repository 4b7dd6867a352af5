"""The brake: it lets a wanted speed pass while the way ahead is known to be free."""

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float64

from courier.ahead import distance_ahead
from courier.program import run

MAX_AGE_S = 0.5  # of what it hears
AHEAD_S = 0.1  # two clocks may differ by so much
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class Brake(Node):
    def __init__(self):
        super().__init__('brake')
        # Far too careful, until a file says how near it may go.
        self.stop_m = self.declare_parameter('stop_m', 2.0).value
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.wanted, self.wanted_at, self.scan_at = Twist(), None, None
        self.said = ''
        self.publisher = self.create_publisher(TwistStamped, 'cmd_vel', 1)
        self.ages = self.create_publisher(Float64, '~/scan_age', 1)
        self.create_subscription(Twist, 'wanted', self.on_wanted, 1)
        self.create_subscription(LaserScan, 'scan', self.on_scan, NEWEST)
        self.create_timer(0.1, self.watch, clock=self.steady)

    def on_wanted(self, wanted):
        self.wanted, self.wanted_at = wanted, self.steady.now()

    def on_scan(self, scan):
        self.scan_at = self.steady.now()
        self.decide(self.reason_to_stop(scan))

    def watch(self):
        if self.is_old(self.scan_at):
            self.decide('no scan comes')

    def reason_to_stop(self, scan):
        """Return why the robot must not drive, or an empty text."""
        age_s = (self.get_clock().now() - Time.from_msg(scan.header.stamp)).nanoseconds / 1e9
        self.ages.publish(Float64(data=age_s))
        if age_s > MAX_AGE_S:
            return 'the scan is old'
        if age_s < -AHEAD_S:
            return 'the scan is of the future'
        if self.is_old(self.wanted_at):
            return 'nobody says where to go'
        distance = distance_ahead(scan)
        if distance is None:
            return 'the scan does not say what is ahead'
        return 'something is ahead' if distance < self.stop_m else ''

    def is_old(self, since):
        return since is None or self.steady.now() - since > Duration(seconds=MAX_AGE_S)

    def decide(self, reason):
        if reason != self.said:
            self.said = reason
            self.get_logger().info(f'I stop: {reason}' if reason else 'I drive')
        self.command(Twist() if reason else self.wanted)

    def command(self, twist):
        command = TwistStamped(twist=twist)
        command.header.stamp = self.get_clock().now().to_msg()
        self.publisher.publish(command)

    def stop(self):
        self.command(Twist())
        self.publisher.wait_for_all_acked(Duration(seconds=1.0))


def main():
    run(Brake)
