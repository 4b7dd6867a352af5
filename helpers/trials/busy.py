"""A brake on a busy computer, on which a test that does not wait is flaky."""

from __future__ import annotations

from helpers.trials.planted import TestRun, run_tests
from helpers.workspace import Workspace

PACKAGE = 'src/brake_pkg'

BRAKE = """from geometry_msgs.msg import Twist
from rclpy.node import Node
from sensor_msgs.msg import Range

from brake_pkg.distance import distance
from brake_pkg.speed import safe_speed


class Brake(Node):
    def __init__(self):
        super().__init__('brake')
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 1)
        self.subscription = self.create_subscription(Range, 'range', self.range_callback, 1)

    def range_callback(self, message):
        twist = Twist()
        twist.linear.x = safe_speed(distance(message))
        self.publisher.publish(twist)
"""
BUSY = (
    BRAKE
    + """
import itertools, time
Quick, tests = Brake, itertools.count(1)

class Brake(Quick):
    def __init__(self):
        super().__init__()
        self.other_work_s = 0 if next(tests) % 3 else 0.4

    def range_callback(self, message):
        time.sleep(self.other_work_s)
        super().range_callback(message)
"""
)


def run_busy(workspace: Workspace, tests: str = 'test/test_brake.py') -> TestRun:
    """Run the tests of a brake on a busy computer: in every third test it gets less CPU time."""
    versions = {'busy': BUSY}
    runs = run_tests(workspace, PACKAGE, tests, 'brake_pkg.brake', versions, most_failures=9)
    return runs['busy']
