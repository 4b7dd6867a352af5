"""The whole node, and its route."""

import math
import time
from collections import Counter

from rclpy.duration import Duration
from rclpy.exceptions import InvalidParameterValueException
from rclpy.parameter import Parameter
from rclpy.time import Time
from sensor_msgs.msg import Imu, LaserScan

from helpers.checks.bench import periods_of
from helpers.checks.lessons.build_a_robot_program.shared import tasks
from helpers.checks.patrols import (
    comes_to_each_place,
    commands_of,
    has_a_timer,
    is_driven_at_most,
    one_command_a_scan,
)
from helpers.checks.points import all_of, cached, expect
from helpers.patrol import PACKAGE, Tour, round_tour, route_of
from helpers.robot import ROOMS
from helpers.ros import ros_session


@tasks.add(cpu_s=20, limit_s=60)
def the_whole_node(workspace):
    def toured(story, *options):
        def test():
            with ros_session():
                return story(Tour(workspace, *options))

        return test

    @cached
    def made():
        """Return which parts a node lacks, the periods of its timers, and how it hears scans."""
        parts = 'where', 'battery', 'frozen', 'job', 'told'
        with ros_session():
            node = Tour(workspace).node
            missing = [name for name in parts if not hasattr(node, name)]
            scans = [one for one in node.subscriptions if one.msg_type is LaserScan]
            kinds = [one.qos_profile.reliability.name for one in scans]
            return missing, periods_of(node), kinds

    def has_parts():
        missing, _, _ = made()
        return not missing or f'it has no attribute {" and no ".join(missing)}'

    def asks_for_the_place():
        _, periods_s, _ = made()
        return has_a_timer(periods_s, 0.1)

    def hears_any_laser():
        _, _, kinds = made()
        return expect(kinds, ['BEST_EFFORT'], 'its subscription of scans is')

    def arrives(tour, places, seconds):
        """Send a goal. Return whether its job succeeds in this time, or where the robot is then."""
        tour.send(places)
        tour.run(seconds, until=lambda: tour.ended() or tour.robot.bumps)
        x, y, _ = tour.robot.pose
        return (tour.status() == 'SUCCEEDED' and not tour.robot.bumps) or (
            f'{tour.status()} at {x:.1f}, {y:.1f}, bumps: {tour.robot.bumps}'
        )

    def stands(tour):
        wrong = sorted({*tour.speeds(0.2)} - {(0.0, 0.0)})
        if wrong or not tour.speeds(0.2):
            return f'it commands {wrong[-1:] or "nothing"}'
        return one_command_a_scan(tour.robot)

    def two_places(tour):
        came = commands_at_arrivals(tour)
        arrived = arrives(tour, 2, 25)
        if arrived is not True:
            return arrived
        x, y, _ = tour.robot.pose
        tour.run(1)
        away_m = math.dist((x, y), ROOMS.places['C'])
        last = commands_of(tour.robot)[came[-1] :][:1] if came else []
        return all_of(
            is_driven_at_most(tour.robot, 0.5, 'the speed is 0.5 at first'),
            away_m <= 0.3 or f'it ends {away_m:.1f} m away from C, at {x:.1f}, {y:.1f}',
            tour.robot.stopped or f'at {x:.1f}, {y:.1f} the job has ended, and it drives on',
            last in ([], [(0.0, 0.0)])
            or f'for the scan at which it has arrived at the last place it commands {last[0]}',
            one_command_a_scan(tour.robot),
        )

    def turns_to_a_place():
        with ros_session():
            tour = Tour(workspace, route=BESIDE)
            arrived = arrives(tour, 1, 20)
            if arrived is not True:
                return arrived
            away_m = math.dist((tour.node.where.x, tour.node.where.y), BESIDE)
        return 0.12 < away_m < 0.2 or f'it has arrived when it was {away_m:.2f} m away, not 0.2 m'

    def cancel(tour):
        tour.send(2)
        tour.run(2)
        tour.handle.cancel_goal_async()
        tour.run(1)
        is_canceled = expect(tour.status(), 'CANCELED', '1 s after the cancel the job is')
        return all_of(is_canceled, tour.robot.stopped or 'after the cancel it drives on')

    def cancel_without_scans(tour):
        tour.send(2)
        tour.run(1)
        tour.cables['scan'].plugged = False
        tour.run(0.2)
        tour.handle.cancel_goal_async()
        tour.wait(tour.ended)
        return expect(tour.status(), 'CANCELED', 'after the cancel the job is')

    def speed(tour):
        def is_set(value):
            return tour.node.set_parameters([Parameter('speed', value=value)])[0].successful

        tour.send(2)
        tour.run(2)
        accepted = [value for value in (-0.1, 0.0, 1.5, math.nan) if is_set(value)]
        if accepted:
            return f'speed {accepted[0]} is accepted'
        refused = [value for value in (1.0, 0.2) if not is_set(value)]
        if refused:
            return f'speed {refused[0]} is refused'
        together = [Parameter('timeout_s', value=60.0), Parameter('speed', value=5.0)]
        if tour.node.set_parameters_atomically(together).successful:
            return 'speed 5.0 is accepted, if another parameter is set with it'
        now_s = tour.robot.t_s
        tour.run(1.5)
        most = max((v for v, _ in tour.speeds(now_s + 0.1)), default=0.0)
        return 0.15 < most < 0.21 or f'with speed 0.2 it drives at {most:.2f} m/s'

    def low_battery(tour):
        tour.send(2)
        tour.run(2.5)
        refused = not tour.send(1)
        return all_of(
            expect(tour.status(), 'ABORTED', 'the battery is low, and the job is'),
            tour.robot.stopped or 'the battery is low, and it drives on',
            refused or 'the battery is low, and it accepts a new goal',
        )

    def no_scan(tour):
        tour.send(2)
        tour.run(2)
        before, limit = len(tour.robot.record.commands), time.monotonic() + 10
        tour.cables['scan'].plugged = False
        tour.run(0.1)  # on a slow computer it may stop already
        if not tour.wait(lambda: (0.0, 0.0) in commands_of(tour.robot)[before:]):
            return 'it does not stop'
        said = 'error', 'No scan comes: I stop'
        while said not in tour.ear.heard and time.monotonic() < limit:
            tour.run(0.02)
        if said not in tour.ear.heard:
            return 'it does not say so'
        tour.cables['scan'].plugged, now_s = True, tour.robot.t_s
        tour.run(1)
        fastest = max((v for v, _ in tour.speeds(now_s)), default=0.0)
        return fastest > 0.1 or 'it does not go on when the scans are back'

    def wrong_stamps(tour):
        tour.send(2)
        for ahead_s, may_drive in (
            *((3.0, False), (-0.8, False), (0.3, False), (-0.6, False)),
            *((0.15, True), (-0.4, True)),
        ):
            # Only those of the scans: wheels and IMU are right, so the node knows where it is.
            tour.cables['scan'].change = lambda scan: scan
            tour.run(0.5)
            tour.cables['scan'].change, now_s = with_stamp(ahead_s), tour.robot.t_s
            tour.run(0.6)
            when = f'{ahead_s:g} s in the future' if ahead_s > 0 else f'{-ahead_s:g} s old'
            drives = any(v or w for v, w in tour.speeds(now_s + 0.2))
            if drives and not may_drive:
                return f'the scans are {when}, and it drives on'
            if may_drive and not drives:
                return f'the scans are only {when}, and it stands'
        return tour.robot.pose.x > ROOMS.start.x + 0.2 or 'it does not drive'

    def begins_when_it_knows():
        with ros_session():
            tour = Tour(workspace, silent=['imu/data'])
            if tour.send(1):
                return 'it takes a goal before the first message of the IMU'
            tour.cables['imu/data'].plugged = True
            tour.run(0.2)
            return tour.send(1) or 'the IMU speaks now, and it refuses a goal'

    def needs_each_sensor(tour):
        tour.send(2)
        for topic in ('odom', 'imu/data'):
            cable = tour.cables[topic]
            for name, change in TROUBLES.items():
                tour.run(0.7, until=lambda: not tour.robot.stopped)
                if tour.robot.stopped:
                    return f'all sensors speak, and it stands: {tour.status()}'
                cable.plugged, cable.change = change is not None, change or cable.change
                tour.run(0.8, until=lambda: tour.robot.stopped)
                tour.run(0.2)
                goes_on = not tour.robot.stopped
                cable.plugged, cable.change = True, lambda message: message
                if goes_on:
                    return f'{topic} {name}, and 1 s later it drives on'
        tour.run(0.7)
        return not tour.robot.stopped or 'all sensors speak again, and it stands'

    def notices_what_hangs(place, *hang):
        """Let one sensor hang after the other, for so many seconds at most."""
        with ros_session():
            tour, told = Tour(workspace, route=place), Counter()
            for topic, limit_s in hang:
                said = 'error', f'{topic.partition("/")[0]} does not change: I stop'
                told[said] += 1
                hangs = f'{topic} hangs' + (' once more' if told[said] > 1 else '')
                cable = tour.cables[topic]
                cable.change = Hangs()
                tour.run(0.5)
                tour.send(1)
                tour.run(0.5)
                cable.change.begins()
                tour.run(limit_s, until=tour.ended)
                if tour.status() != 'ABORTED':
                    return f'{hangs} for {limit_s} s, and the job is {tour.status()}'
                tour.run(0.3)
                if not tour.robot.stopped:
                    return f'{hangs}, the job is ABORTED, and it drives on'
                if not tour.wait(lambda said=said: tour.ear.heard.count(said) >= told[said], 2):
                    return f'{hangs}, and it does not log: {said[1]}'
                cable.change = lambda message: message
        return True

    def each_that_hangs():
        ahead, beside = (6.5, 0.0), (3.0, 3.0)  # to the second it turns first
        return all_of(
            notices_what_hangs(ahead, ('scan', 1.5), ('odom', 3.5), ('scan', 1.5)),
            notices_what_hangs(beside, ('imu/data', 3.5)),
        )

    def wrong_at_the_start():
        with ros_session():
            try:
                Tour(workspace, Parameter('speed', value=5.0))
            except (InvalidParameterValueException, ValueError):
                return True
        return 'it starts with the speed 5.0'

    empty = Parameter('least_battery', value=0.9998)
    soon = Parameter('timeout_s', value=0.3)
    rule = 'add_on_set_parameters_callback; get_parameter'
    zeros, parts = (
        'self.command(0.0, 0.0)',
        'self.told = 0.0, 0.0, and in command: self.told = v, w',
    )
    timer = 'self.create_timer(0.1, self.job.place)'
    laser = 'create_subscription(LaserScan, ..., LASER)'
    fresh = '-0.2 < now_s - seconds(scan.header.stamp) < 0.5'
    steered, none = 'self.command(*steer(...))', 'job.place() is None then.'
    at_once = 'without a goal it stands, with one command for each scan'
    knows = 'self.where.knows(self.get_clock().now().nanoseconds / 1e9)'
    hangs = 'self.frozen.look(now_s, self.told, scan) returns names; then self.job.end()'
    also_without = 'a cancel ends the job also if no scan comes'
    first = 'First the callback, then declare_parameter.'
    return [
        (at_once, toured(stands), zeros),
        ('its parts', has_parts, parts),
        ('the scans of a BEST_EFFORT laser', hears_any_laser, laser),
        ('it visits two places', toured(two_places), steered),
        ('it turns to a place beside its path', turns_to_a_place, steered),
        ('a cancel stops it', toured(cancel), none),
        ('ten times a second it asks for the place', asks_for_the_place, timer),
        (also_without, toured(cancel_without_scans), timer),
        ('its speed is a parameter', toured(speed), rule),
        ('also at the start', wrong_at_the_start, first),
        ('a low battery ends the job', toured(low_battery, empty), 'self.job.end()'),
        ('without scans it stops, and says so', toured(no_scan, soon), 'self.watchdog.seen()'),
        ('it stands if scans are old, or from the future', toured(wrong_stamps), fresh),
        ('it takes a goal if it knows where it is', begins_when_it_knows, knows),
        ('it stands if wheels or IMU are not to be trusted', toured(needs_each_sensor), knows),
        ('a sensor that hangs ends the job', each_that_hangs, hangs),
    ]


BESIDE = 0.2, 1.08  # m from the start: it must turn to the left


def says_nan(message):
    """Return a message of wheels or IMU without numbers."""
    if isinstance(message, Imu):
        message.orientation.z = message.orientation.w = math.nan
    else:
        message.twist.twist.linear.x = math.nan
    return message


def with_stamp(later_s):
    """Return a function that makes the stamp of a message so much later (s)."""

    def change(message):
        stamp = Time.from_msg(message.header.stamp) + Duration(seconds=later_s)
        message.header.stamp = stamp.to_msg()
        return message

    return change


# What becomes of the messages of wheels or IMU. None: they do not come.
TROUBLES = {
    'is silent': None,
    'says NaN': says_nan,
    'has stamps that are 3 s old': with_stamp(-3.0),
    'has stamps that are 3 s ahead': with_stamp(3.0),
}


class Hangs:
    """Repeats the last message of a sensor, with new stamps, from `begins()` on."""

    def __init__(self):
        self.last, self.hangs = None, False

    def begins(self):
        self.hangs = True

    def __call__(self, message):
        if self.hangs and self.last is not None:
            self.last.header.stamp = message.header.stamp
            return self.last
        self.last = message
        return message


def commands_at_arrivals(tour):
    """Return a list to which each `job.arrived()` adds how many commands came before it."""
    came = []
    if job := getattr(tour.node, 'job', None):
        arrived = job.arrived

        def noted():
            came.append(len(tour.robot.record.commands))
            arrived()

        job.arrived = noted
    return came


@tasks.add(cpu_s=60, limit_s=90)
def the_route(workspace):
    tour = cached(lambda: round_tour(workspace))

    def four_rooms():
        drive, places = tour()
        robot = drive.robot
        if robot.bumps or drive.outcome != 'SUCCEEDED':
            visited = len(drive.node.job.visited) if hasattr(drive.node, 'job') else 0
            return f'after {visited} of {places} places: {drive.outcome}'
        rooms = {(pose.x > 4.75, pose.y > 3.25) for pose in robot.record.poses}
        back = math.dist(robot.pose[:2], ROOMS.start[:2])
        text = f'{len(rooms)} of 4 rooms, {back:.1f} m from the start'
        return (len(rooms) == 4 and back < 0.4) or text

    def every_place():
        drive, _ = tour()
        return comes_to_each_place(drive.robot)

    def both_sides():
        x0, y0, _ = ROOMS.start
        route = route_of(workspace.file(f'{PACKAGE}/config/rooms.yaml'))
        missed = [
            f'{x}, {y}'
            for x, y in SIDES
            if not any(math.dist((x - x0, y - y0), place) < 0.3 for place in route)
        ]
        return not missed or f'its route has no place at {missed[0]}, seen from the corner'

    hint = 'x - 1.25, y - 1.75 of each place; each number with a point.'
    return [
        ('four rooms, and back', four_rooms, hint),
        ('it comes to each place', every_place, 'C, B and A are places of the route, too.'),
        ('a place on each side of the two thick doors', both_sides, hint),
    ]


# Half a metre before and behind the middle of the doors that are half a metre thick.
SIDES = (7.5, 2.75), (7.5, 3.75), (2.5, 3.75), (2.5, 2.75)
