"""The student's tests, which test right programs and wrong ones."""

from functools import partial

from helpers.checks.lessons.put_a_program_on_a_robot.shared import tasks
from helpers.checks.points import cached, needs
from helpers.patrol import PACKAGE
from helpers.trials import planted, run_tests

LOGIC = """import math

import numpy as np

HALF_M = 0.16  # the robot's radius is 0.11 m
STOP_M, SLOW_M, FAR_M = 0.25, 1.0, 99.0
AROUND = math.radians(20)


def beams(scan):
    ranges = np.array(scan.ranges)
    outside = (ranges < scan.range_min) | (ranges > scan.range_max) | (ranges == 0)
    ranges[outside & np.isfinite(ranges)] = math.nan
    return ranges, scan.angle_min + scan.angle_increment * np.arange(len(ranges))


def reach(ranges, angles, heading):
    toward = np.cos(angles - heading) > math.cos(AROUND)
    known = ~np.isnan(ranges)
    if not toward.any() or np.mean(known[toward]) < 0.5:
        return 0.0
    metres = np.nan_to_num(ranges[known], posinf=FAR_M, neginf=0.0)
    along = metres * np.cos(angles[known] - heading)
    across = metres * np.sin(angles[known] - heading)
    return float(min(along[(along >= 0) & (np.abs(across) < HALF_M)], default=FAR_M))


def safe_speed(reach_m, full_mps):
    return full_mps * min(1.0, max(0.0, (reach_m - STOP_M) / (SLOW_M - STOP_M)))


HEADINGS = np.radians(np.arange(-85, 86, 5))


def direction(x, y, yaw, place):
    angle = math.atan2(place[1] - y, place[0] - x) - yaw
    return math.remainder(angle, math.tau)


def free_heading(ranges, angles, wanted, far_m):
    free = [heading for heading in HEADINGS if reach(ranges, angles, heading) > far_m]
    return min(free, key=lambda heading: abs(heading - wanted), default=None)


def steer(ranges, angles, wanted, distance_m, full_mps):
    if np.count_nonzero(np.isnan(ranges)) >= len(ranges) / 2:
        return 0.0, 0.0
    heading = free_heading(ranges, angles, wanted, min(0.5, distance_m))
    if heading is None:
        return 0.0, 0.9
    speed = safe_speed(reach(ranges, angles, 0.0), full_mps)
    return speed * math.cos(heading), 1.5 * heading
"""
WRONG_LOGICS = {
    'is as wide as a street': planted(LOGIC, 'HALF_M = 0.16', 'HALF_M = 1.6'),
    'drives if all beams are unknown': planted(
        LOGIC, '0.5:\n        return 0.0', '0.5:\n        return FAR_M'
    ),
    'stops at one unknown beam': planted(LOGIC, 'np.mean(known[toward]) < 0.5', 'not known.all()'),
    'never stops': planted(LOGIC, 'max(0.0, (', 'max(0.1, ('),
    'turns the long way round': planted(LOGIC, 'math.remainder(angle, math.tau)', 'angle'),
    'takes the first free direction': planted(LOGIC, 'abs(heading - wanted)', 'heading'),
}
# Right in another way than the solution: what a node does is tested, not how.
NODE = """import math

from geometry_msgs.msg import Twist
from patrol_pkg.battery import Battery
from patrol_pkg.frozen import Frozen
from patrol_pkg.job import Job
from patrol_pkg.logic import beams, direction, steer
from patrol_pkg.watchdog import Watchdog
from patrol_pkg.where import Where
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from sensor_msgs.msg import LaserScan

LASER = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class Patrol(Node):
    def __init__(self, **options):
        super().__init__('patrol', **options)
        self.add_on_set_parameters_callback(self.judge)
        self.add_post_set_parameters_callback(self.take)
        self.speed = self.declare_parameter('speed', 0.5).value
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 1)
        self.told = 0.0, 0.0
        self.where, self.battery, self.frozen = Where(self), Battery(self), Frozen(self)
        self.job = Job(self, lambda: self.where.knows(self.now_s()) and not self.battery.low)
        self.watchdog = Watchdog(self, self.stop, 'scan')
        self.create_subscription(LaserScan, 'scan', self.on_scan, LASER)
        self.create_timer(0.1, self.job.place)

    def judge(self, parameters):
        speeds = [parameter.value for parameter in parameters if parameter.name == 'speed']
        if all(0 < speed <= 1 for speed in speeds):
            return SetParametersResult(successful=True)
        return SetParametersResult(successful=False, reason='speed: above 0, at most 1')

    def take(self, parameters):
        for parameter in parameters:
            if parameter.name == 'speed':
                self.speed = parameter.value

    def now_s(self):
        return self.get_clock().now().nanoseconds / 1e9

    def command(self, v, w):
        self.told = v, w
        twist = Twist()
        twist.linear.x, twist.angular.z = v, w
        self.publisher.publish(twist)

    def stop(self):
        self.command(0.0, 0.0)

    def is_fresh(self, scan):
        age = self.get_clock().now() - Time.from_msg(scan.header.stamp)
        return -0.2 < age.nanoseconds / 1e9 < 0.5

    def on_scan(self, scan):
        self.watchdog.seen()
        hanging = self.frozen.look(self.now_s(), self.told, scan)
        for sensor in hanging:
            self.get_logger().error(f'{sensor} does not change: I stop')
        if self.battery.low or hanging:
            self.job.end()
        x, y, yaw = self.where.x, self.where.y, self.where.yaw
        place = self.job.place()
        if place is not None and math.dist((x, y), place) < 0.2:
            self.job.arrived()
            place = self.job.place()
        if place is None or not self.is_fresh(scan) or not self.where.knows(self.now_s()):
            self.stop()
            return
        wanted, distance = direction(x, y, yaw, place), math.dist((x, y), place)
        self.command(*steer(*beams(scan), wanted, distance, self.speed))
"""
WRONG_NODES = {
    'drives without a goal': planted(NODE, 'place is None or', 'False or').replace(
        'place = self.job.place()', 'place = self.job.place() or (9.0, 0.0)'
    ),
    # All beams are long ones for it: it must drive on, and not end in an error.
    'does not look': planted(
        NODE,
        'wanted, distance =',
        'scan.ranges = [9.0] * len(scan.ranges)\n        wanted, distance =',
    ),
    'takes any speed': planted(NODE, '0 < speed <= 1', 'True'),
    'trusts an old scan': planted(NODE, ' or not self.is_fresh(scan)', ''),
    'keeps its first speed': planted(NODE, 'self.speed = parameter.value', 'pass'),
}


def judged_tests(workspace, tests, name, right, wrong, hint):
    """Return the points of tests: they pass for right versions, and fail for each wrong one."""
    runs = cached(
        lambda: run_tests(
            workspace,
            PACKAGE,
            tests,
            f'patrol_pkg.{name}',
            {'yours': '', 'ours': right, **wrong},
            sourced=True,
        )
    )

    def passes_for_right_ones():
        for version in ('yours', 'ours'):
            if not runs()[version].passes:
                return f'with {version} pytest: {runs()[version].says}'
        return True

    def catches(bug):
        needs(passes_for_right_ones, 'not judged: your tests must first pass for the right ones')
        return runs()[bug].fails or f'pytest: {runs()[bug].says}'

    kind = 'programs' if name == 'logic' else 'nodes'
    return [
        (f'they pass for two right {kind}', passes_for_right_ones, hint),
        *(
            (f'they fail for one that {bug}', partial(catches, bug), WHAT_TO_TEST[bug])
            for bug in wrong
        ),
    ]


WHAT_TO_TEST = {
    'is as wide as a street': 'Something 0.5 m beside the strip: reach is far.',
    'drives if all beams are unknown': 'All beams are nan: reach is 0.',
    'stops at one unknown beam': 'One beam is nan, and nothing is in sight: reach is far.',
    'never stops': 'safe_speed of a reach below STOP_M is 0.',
    'turns the long way round': 'direction with a yaw of 3: the angle is between -pi and pi.',
    'takes the first free direction': 'free_heading with nothing in sight is the one wanted.',
    'drives without a goal': 'Without a goal, see(9.0) is answered by (0.0, 0.0).',
    'does not look': 'With a goal, see(0.2) is answered by a speed of 0.0.',
    'trusts an old scan': 'With a goal, see(9.0, age_s=2.0) is answered by a speed of 0.0.',
    'takes any speed': 'bench.patrol.set_parameters with speed -0.1 is not successful.',
    'keeps its first speed': 'Set speed to 0.2: see(9.0) is answered by 0.2.',
}


@tasks.add(limit_s=90)
def test_the_logic(workspace, tests):
    return judged_tests(
        workspace,
        tests,
        'logic',
        LOGIC,
        WRONG_LOGICS,
        'Is each line what the tasks of reach and of free_heading say?',
    )


@tasks.add(limit_s=90)
def test_the_node(workspace, tests):
    return judged_tests(
        workspace, tests, 'patrol', NODE, WRONG_NODES, 'What does the task of the whole node say?'
    )
