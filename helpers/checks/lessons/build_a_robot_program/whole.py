"""Of the project: the whole node, and its route."""

import math
import time

from rclpy.exceptions import InvalidParameterValueException
from rclpy.parameter import Parameter

from helpers.checks.lessons.build_a_robot_program.shared import (
    comes_to_each_place,
    one_command_a_scan,
    tasks,
)
from helpers.checks.points import cached
from helpers.patrol import Tour, round_tour
from helpers.robot import ROOMS
from helpers.ros import ros_session


@tasks.add(cpu_s=20, limit_s=60)
def the_whole_node(workspace):
    def toured(story, *options):
        def test():
            with ros_session():
                return story(Tour(workspace, *options))

        return test

    def has_parts(tour):
        missing = [name for name in ('battery', 'job') if not hasattr(tour.node, name)]
        return not missing or f'it has no attribute {" and no ".join(missing)}'

    def stands(tour):
        speeds = tour.speeds(0.2)
        if set(speeds) != {(0.0, 0.0)}:
            return f'it commands {sorted(set(speeds))[-1:] or "nothing"}'
        return one_command_a_scan(tour.robot)

    def two_places(tour):
        tour.send(2)
        tour.run(25, until=lambda: tour.ended() or tour.robot.bumps)
        x, y, _ = tour.robot.pose
        fastest = max((v for v, _ in tour.speeds(0.2)), default=0.0)
        if tour.robot.bumps or tour.status() != 'SUCCEEDED':
            return f'{tour.status()} at {x:.1f}, {y:.1f}, bumps: {tour.robot.bumps}'
        if fastest > 0.5001:
            return f'it drives at {fastest:.2g} m/s, and the speed is 0.5 at first'
        tour.run(1)
        if math.dist((x, y), ROOMS.places['C']) > 0.3 or not tour.robot.stopped:
            return f'at {x:.1f}, {y:.1f}'
        return one_command_a_scan(tour.robot)

    def cancel(tour):
        tour.send(2)
        tour.run(2)
        tour.handle.cancel_goal_async()
        tour.run(1)
        return (tour.status() == 'CANCELED' and tour.robot.stopped) or tour.status()

    def cancel_without_scans(tour):
        tour.send(2)
        tour.run(1)
        tour.cable.plugged = False
        tour.run(0.2)
        tour.handle.cancel_goal_async()
        tour.wait(tour.ended)
        return tour.status() == 'CANCELED' or tour.status()

    def speed(tour):
        def is_set(value):
            return tour.node.set_parameters([Parameter('speed', value=value)])[0].successful

        tour.send(2)
        tour.run(2)
        wrong = [value for value in (-0.1, 0.0, 1.5) if is_set(value)]
        if wrong:
            return f'speed {wrong[0]} is accepted'
        if not is_set(0.2):
            return 'speed 0.2 is refused'
        now_s = tour.robot.t_s
        tour.run(1.5)
        most = max(v for v, _ in tour.speeds(now_s + 0.1))
        return 0.15 < most < 0.21 or f'with speed 0.2 it drives at {most:.2f} m/s'

    def low_battery(tour):
        tour.send(2)
        tour.run(2.5)
        refused = not tour.send(1)
        outcome = tour.status(), tour.robot.stopped, refused
        return outcome == ('ABORTED', True, True) or f'ended, stands, refuses: {outcome}'

    def no_scan(tour):
        tour.send(2)
        tour.run(2)
        tour.cable.plugged = False
        tour.run(0.1)
        commands = tour.robot.record.commands
        before, limit = len(commands), time.monotonic() + 10
        stops = tour.wait(lambda: len(commands) > before)
        if not stops or any(commands[before][1:]):
            return 'it does not stop'
        said = 'error', 'No scan comes: I stop'
        while said not in tour.ear.heard and time.monotonic() < limit:
            tour.run(0.02)
        if said not in tour.ear.heard:
            return 'it does not say so'
        tour.cable.plugged, now_s = True, tour.robot.t_s
        tour.run(1)
        fastest = max((v for v, _ in tour.speeds(now_s)), default=0.0)
        return fastest > 0.1 or 'it does not go on when the scans are back'

    def wrong_stamps(tour):
        tour.send(2)
        for ahead_s in (3.0, -0.8):
            tour.robot.clock_ahead_s = 0.0
            tour.run(1)
            tour.robot.clock_ahead_s, now_s = ahead_s, tour.robot.t_s
            tour.run(1)
            if any(v or w for v, w in tour.speeds(now_s + 0.2)):
                when = '3 s in the future' if ahead_s > 0 else '0.8 s old'
                return f'the scans are {when}, and it drives on'
        return tour.robot.pose.x > ROOMS.start.x + 0.2 or 'it does not drive'

    def wrong_at_the_start():
        with ros_session():
            try:
                Tour(workspace, Parameter('speed', value=5.0))
            except (InvalidParameterValueException, ValueError):
                return True
        return 'it starts with the speed 5.0'

    empty = Parameter('least_battery', value=0.9998)
    rule = 'add_on_set_parameters_callback; get_parameter'
    return [
        (
            'without a goal it stands, with one command for each scan',
            toured(stands),
            'self.command(0.0, 0.0)',
        ),
        ('its attributes battery and job', toured(has_parts), 'self.job = Job(...)'),
        ('it visits two places', toured(two_places), 'self.command(*steer(...))'),
        ('a cancel stops it', toured(cancel), 'job.place() is None then.'),
        (
            'a cancel ends the job also if no scan comes',
            toured(cancel_without_scans),
            'self.create_timer(0.1, self.job.place)',
        ),
        ('its speed is a parameter', toured(speed), rule),
        ('also at the start', wrong_at_the_start, 'First the callback, then declare_parameter.'),
        ('a low battery ends the job', toured(low_battery, empty), 'self.job.end()'),
        (
            'without scans it stops, and says so',
            toured(no_scan, Parameter('timeout_s', value=0.3)),
            'self.watchdog.seen()',
        ),
        (
            'it stands if scans are old, or from the future',
            toured(wrong_stamps),
            'self.get_clock().now() - Time.from_msg(scan.header.stamp)',
        ),
    ]


@tasks.add(cpu_s=60, limit_s=90)
def the_route(workspace):
    tour = cached(lambda: round_tour(workspace))

    def four_rooms():
        drive, places = tour()
        robot = drive.robot
        rooms = {(pose.x > 4.75, pose.y > 3.25) for pose in robot.record.poses}
        if robot.bumps or drive.outcome != 'SUCCEEDED':
            visited = len(drive.node.job.visited) if hasattr(drive.node, 'job') else 0
            return f'after {visited} of {places} places: {drive.outcome}'
        back = math.dist(robot.pose[:2], ROOMS.start[:2])
        text = f'{len(rooms)} of 4 rooms, {back:.1f} m from the start'
        return (len(rooms) == 4 and back < 0.4) or text

    def every_place():
        drive, _ = tour()
        return comes_to_each_place(drive.robot)

    hint = 'x - 1.25, y - 1.75 of each place; each number with a point.'
    return [
        ('four rooms, and back', four_rooms, hint),
        ('it comes to each place', every_place, 'C, B and A are places of the route, too.'),
    ]
