"""What the laser says, where the robot is, and which way is free."""

import math

import numpy as np
from geometry_msgs.msg import Quaternion
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time
from sensor_msgs.msg import Imu

from helpers.checks.bench import Bench
from helpers.checks.lessons.build_a_robot_program.shared import tasks
from helpers.checks.patrols import is_driven_at_most, one_command_a_scan
from helpers.checks.points import all_of, expect
from helpers.patrol import CIRCLE, DEGREES, LAST, SIM, SNAKE, drive, estimated, module, steered
from helpers.robot import CORRIDOR, KIND, ROOMS, Floor, Pose


def scanned(**seen):
    """Return ranges: l10=1.5 means that the beam 10 degrees to the left sees 1.5 m; r: right."""
    ranges = np.full(181, math.inf)
    for beam, metres in seen.items():
        ranges[90 + int(beam[1:]) * (1 if beam[0] == 'l' else -1)] = metres
    return ranges


def scene(seen):
    """Say what `scanned` is given: 1.5 m at 10 degrees to the left."""
    if len(seen) > 6:
        beams = [int(beam[1:]) * (1 if beam[0] == 'l' else -1) for beam in seen]
        return f'nan from {min(beams)} to {max(beams)} degrees (to the left)'
    sides = {'l': 'left', 'r': 'right'}
    beams = [
        f'{metres:g} m at {int(beam[1:])} degrees to the {sides[beam[0]]}'
        for beam, metres in seen.items()
    ]
    return ' and '.join(beams) or 'nothing in sight'


def unknown(first, last):
    """Return what `scanned` takes for beams that are unknown, between two angles (degrees)."""
    return {f'{"l" if k > 0 else "r"}{abs(k)}': math.nan for k in range(first, last + 1)}


@tasks.add
def reach_and_speed(workspace):
    def reaches(*cases):
        for seen, degrees, right in cases:
            what = f'with {scene(seen)}, the reach at {degrees} degrees is'
            found = reach(scanned(**seen), np.radians(DEGREES), degrees, right, what)
            if found is not True:
                return found
        return True

    def reach(ranges, angles, degrees, right, what):
        metres = module(workspace, 'logic').reach(ranges, angles, math.radians(degrees))
        if not isinstance(metres, float | int):
            kind = 'None' if metres is None else f'the type {type(metres).__name__}'
            return f'it returns {kind}, and no number'
        return expect(metres, right, what, within=0.01, unit='m')

    def all_around():
        ranges = np.full(360, 3.0)
        ranges[315] = 0.5
        ranges[100:260] = math.nan
        seen = 'with angles from 0 to 2 pi, 0.5 m at 315 degrees and nan from 100 to 259'
        return all_of(
            *(
                reach(
                    *(ranges, np.radians(np.arange(360.0)), degrees, right),
                    f'{seen}, the reach at {degrees} degrees is',
                )
                for degrees, right in ((-45, 0.5), (0, 3.0), (170, 0.0))
            )
        )

    def speed(*cases):
        function = module(workspace, 'logic').safe_speed
        return all_of(
            *(
                expect(
                    function(metres, full_mps),
                    right,
                    f'safe_speed({metres}, {full_mps}) is',
                    within=0.001,
                    unit='m/s',
                )
                for metres, full_mps, right in cases
            )
        )

    nan, inf = math.nan, math.inf
    blind = unknown(-12, 12)
    ahead = (
        ({'l0': 2.0, 'r1': 1.5}, 0, 1.5),
        ({'l45': 0.5}, 0, 99),
        ({'r45': 0.5, 'l9': 2.0}, 0, 99),
    )
    along = ({'l10': 0.5}, 0, 0.492), ({'l17': 0.5}, 0, 0.478), ({'l50': 0.2}, 0, 0.129)
    turned = ({'l45': 0.5}, 45, 0.5), ({'r60': 1.0, 'l0': 0.3}, -60, 1.0), ({'l20': 0.3}, 85, 99)
    behind = ({'r89': 0.1}, 85, 99), ({'l85': 0.3}, -85, 99), ({'r90': 0.4, 'l80': 1.0}, 85, 0.996)
    odd = ({'r70': -inf}, 10, 0), ({}, 0, 99)
    few = ({'l3': nan}, 0, 99), ({'l0': nan, 'r1': 1.5, 'l2': nan}, 0, 1.5)
    # At 0.5 degrees 40 beams look in the direction: half of them, and one more.
    half = (unknown(-19, 0), 0.5, 99), (unknown(-19, 1), 0.5, 0)
    left = unknown(45, 75)
    many = (blind, 0, 0), (blind, 60, 99), (blind | {'l0': 2.0}, 0, 0), ({}, 180, 0), *half
    many += (left, 60, 0), (left, -60, 99)
    strip = 'along[(along >= 0) & (abs(across) < HALF_M)], and its min(..., default=FAR_M)'
    known = 'known = ~np.isnan(ranges), and then ranges[known], angles[known]'
    share = 'np.mean(known[toward]) is the share of known beams: below 0.5, return 0.0.'
    axes = 'cos(angles - heading), sin(angles - heading)'
    infinite = 'np.nan_to_num(..., posinf=FAR_M, neginf=0.0)'
    around, line = (
        'np.cos(angles - heading) > math.cos(AROUND)',
        '(reach - STOP_M) / (SLOW_M - STOP_M)',
    )
    return [
        ('straight on: the nearest in the strip', lambda: reaches(*ahead), strip),
        ('measured along the strip, not to the beam', lambda: reaches(*along), 'min(along[...])'),
        ('another direction', lambda: reaches(*turned), axes),
        ('what is behind does not count', lambda: reaches(*behind), 'along >= 0'),
        ('too near, nothing', lambda: reaches(*odd), infinite),
        ('single unknown beams do not count', lambda: reaches(*few), known),
        ('too many unknown beams: 0', lambda: reaches(*many), share),
        ('a laser that looks all around', all_around, around),
        ('near: 0', lambda: speed((0.25, 0.5, 0), (0.1, 0.5, 0)), 'max(0.0, ...)'),
        ('far: full speed', lambda: speed((1.0, 0.5, 0.5), (99.0, 0.2, 0.2)), 'min(1.0, ...)'),
        ('between', lambda: speed((0.625, 0.5, 0.25), (0.4, 1.0, 0.2)), line),
    ]


HALL = Floor.from_text(
    """
############
#          #
#    o     #
# >      o #
#          #
############
""",
    name='hall',
)


@tasks.add
def stop_before_a_wall(workspace):
    def driven(floor, seconds, **options):
        return drive(floor, module(workspace, 'patrol').Patrol, seconds, **options)

    def stops_at(floor, near_m, start=None):
        robot = driven(floor, 12, start=start)
        if robot.bumps:
            return 'it hits something'
        ahead = metres_ahead(robot)
        return all_of(
            is_driven_at_most(robot, 0.5, 'the speed is at most 0.5'),
            one_command_a_scan(robot),
            0.2 < ahead < near_m or f'it stands still {ahead:.1f} m from it',
        )

    def stops_blind():
        robot = driven(CORRIDOR, 4, blind_after_s=2)
        if not robot.stopped:
            return 'all beams are nan, and it drives on'
        robot = driven(CORRIDOR, 12, driver=KIND.but(laser='ld08'))
        ahead = metres_ahead(robot)
        return (not robot.bumps and ahead < 0.5) or (
            f'with the laser of a TurtleBot 3 it stands {ahead:.1f} m before the wall'
        )

    hint = 'reach(*beams(scan), 0.0), then safe_speed(..., 0.5)'
    passes = 'it passes a box beside its path, and stops at the next'
    near = 'it also stops if it starts near a wall'
    return [
        ('it stops before the wall', lambda: stops_at(CORRIDOR, 0.35), hint),
        (passes, lambda: stops_at(HALL, 0.35), hint),
        (near, lambda: stops_at(CORRIDOR, 0.5, Pose(3.0, 1.25, 1.0)), hint),
        ('a blind laser, and that of a TurtleBot 3', stops_blind, hint),
    ]


def metres_ahead(robot):
    """Return how far it truly is to what a robot looks at."""
    x, y, yaw = robot.pose
    return robot.floor.ranges(x, y, np.array([yaw]))[0][0]


@tasks.add(cpu_s=20)
def where_am_i(workspace):
    def knows_its_place(commands):
        where, place, yaw = estimated(module(workspace, 'where').Where, commands)
        if abs(math.remainder(where.yaw - yaw, math.tau)) > 0.1:
            return f'at the end its yaw is {where.yaw:.1f}, not {yaw:.1f}'
        error = math.dist((where.x, where.y), place)
        return error < 0.15 or f'at the end it is {error:.1f} m away'

    def looking(degrees, at_s):
        """Return what an IMU says that looks in a direction at a time: both are its own."""
        half = math.radians(degrees) / 2
        imu = Imu(orientation=Quaternion(z=math.sin(half), w=math.cos(half)))
        imu.header.stamp = Time(seconds=at_s).to_msg()
        return imu

    def rolling(mps, at_s):
        """Return what the wheels say at a time of their clock."""
        odom = Odometry()
        odom.twist.twist.linear.x = mps
        odom.header.stamp = Time(seconds=at_s).to_msg()
        return odom

    def told(*steps, scale=1.0):
        """Tell the part messages, one after the other. A step may also be a test of what it says.

        Return the first result of a test that is not True, or the part.
        """
        options = [*SIM, Parameter('wheel_scale', value=scale)]
        with Bench() as bench:
            node = Node('tested', parameter_overrides=options)
            where = module(workspace, 'where').Where(node)
            bench.spin(node)
            for step in steps:
                if callable(step):
                    result = step(where)
                    if result is not True:
                        return result
                else:
                    bench.say('odom' if isinstance(step, Odometry) else 'imu/data', step)
        return where

    def is_at(name, x, y, degrees):
        """Return a test of where it is: m from the start, and how far it has turned."""

        def test(where):
            turned = math.degrees(math.remainder(where.yaw, math.tau))
            found = tuple(round(float(number), 1) + 0.0 for number in (where.x, where.y, turned))
            what = f'{name} it is at x, y, yaw (m, m, degrees) ='
            return expect(found, (x, y, degrees), what)

        return test

    def goes(scale, *stamps_s, counted_s):
        where = told(looking(0, 7), *(rolling(0.5, at_s) for at_s in stamps_s), scale=scale)
        stamps = ', '.join(f'{stamp_s:g}' for stamp_s in stamps_s)
        what = f'odom has 0.5 m/s at {stamps} s by its stamps, wheel_scale is {scale}, and x is'
        return expect(where.x, 0.5 / scale * counted_s, what, within=0.01, unit='m')

    def is_right(result):
        return result if isinstance(result, str) else True

    def counts_from_the_first():
        begins = 'the IMU says 40 degrees at first, and then'
        turned = told(
            looking(40, 7),
            rolling(0.5, 7),
            rolling(0.5, 7.4),
            is_at(f'{begins} 0.2 m straight on:', 0.2, 0.0, 0.0),
            looking(130, 7.4),
            rolling(0.5, 7.8),
            is_at(f'{begins} 130, and 0.2 m on:', 0.2, 0.2, 90.0),
        )
        over = told(
            looking(170, 7),
            looking(-170, 7.1),
            is_at('the IMU says 170 degrees, and then -170:', 0.0, 0.0, 20.0),
        )
        return all_of(is_right(turned), is_right(over))

    def skips_what_is_no_number():
        def of_length(length):
            """Return what an IMU says whose quaternion, of this length, points ahead."""
            imu = looking(0, 7.3)
            imu.orientation.z, imu.orientation.w = 0.0 * length, length
            return imu

        there = 0.0, 0.2, 90.0
        story = told(
            *(looking(90, 7), looking(180, 7), rolling(0.5, 7), rolling(0.5, 7.4)),
            *(of_length(math.nan), is_at('after an orientation of NaN', *there)),
            *(of_length(0.0), is_at('after the orientation 0, 0, 0, 0', *there)),
            *(of_length(0.897), is_at('after z**2 + w**2 = 0.805', *there)),
            *(rolling(math.nan, 7.5), is_at('after wheels that say NaN', *there)),
            *(of_length(0.97), is_at('after z**2 + w**2 = 0.94', 0.0, 0.2, -90.0)),
        )
        return is_right(story)

    def says_whether_it_knows():
        def asked(name, *answers):
            def test(where):
                for now_s, right in answers:
                    found = where.knows(now_s)
                    if bool(found) is not right:
                        return f'{name} knows({now_s}) is {found}'
                return True

            return test

        broken, speed = looking(0, 8.3), 0.1
        broken.orientation.z = broken.orientation.w = math.nan
        ages = (7.1, True), (7.4, True), (7.6, False), (6.85, True), (6.7, False)
        story = told(
            asked('before any message', (7.0, False)),
            *(rolling(speed, 7), asked('without a message of the IMU', (7.1, False))),
            *(looking(3, 7), asked('after messages with the stamp 7.0', *ages)),
            *(looking(3, 7.6), asked('with the stamps odom 7.0 and IMU 7.6', (7.7, False))),
            *(rolling(math.nan, 7.65), asked('and after NaN of the wheels at 7.65', (7.7, False))),
            *(rolling(speed, 7.65), asked('with the stamps odom 7.65, IMU 7.6', (7.7, True))),
            *(rolling(speed, 8.3), asked('with the stamps odom 8.3, IMU 7.6', (8.4, False))),
            *(broken, asked('and after an orientation of NaN at 8.3', (8.4, False))),
            *(looking(3, 7.6), asked('and after the IMU repeats 7.6', (8.4, False))),
            *(looking(3, 8.35), asked('with the stamps odom 8.3, IMU 8.35', (8.4, True))),
        )
        other = told(looking(3, 7), asked('without a message of the wheels', (7.1, False)))
        return all_of(is_right(story), is_right(other))

    stamps = 'The seconds between two stamps, not a fixed time.'
    gap = 'if 0 < now_s - self.odom_s < 0.5: count it'
    scale = 'node.declare_parameter(...).value'
    grows = 'x grows by way * cos(yaw), y by way * sin(yaw).'
    first = 'Keep the first yaw: self.yaw is the yaw of this message minus the first one.'
    skip = 'if not abs(z**2 + w**2 - 1) < 0.1: return; math.isfinite(speed)'
    knows = 'Keep the stamp of the last good message of each topic: all(-0.2 < age < 0.5 ...).'
    return [
        ('a circle', lambda: knows_its_place(CIRCLE[:150]), grows),
        ('a line like a snake', lambda: knows_its_place(SNAKE), stamps),
        (
            'odom comes less often',
            lambda: goes(1.0, 7.0, 7.45, 7.6, 8.05, counted_s=1.05),
            stamps,
        ),
        (
            'half a second of silence does not count',
            lambda: goes(1.0, 7.0, 7.2, 7.8, 7.9, counted_s=0.3),
            gap,
        ),
        (
            'a clock that was set back does not count',
            lambda: all_of(*(goes(1.0, 7.0, 7.2, at_s, counted_s=0.2) for at_s in (7.1, 6.0))),
            gap,
        ),
        (
            'the parameter wheel_scale',
            lambda: goes(2.0, 7.0, 7.1, 7.2, 7.6, counted_s=0.6),
            scale,
        ),
        ('it counts from the first yaw', counts_from_the_first, first),
        ('it skips what is no number', skips_what_is_no_number, skip),
        ('knows(now_s)', says_whether_it_knows, knows),
    ]


@tasks.add
def a_free_heading(workspace):
    def directions():
        function = module(workspace, 'logic').direction
        cases = {(1, 1, 0, (1, 2)): 90, (0, 0, 3, (-1, -0.2)): 19.4}
        cases |= {(2, 0, 1.5, (1, 0)): 94.1, (0, 0, 0, (-1, -0.01)): -179.4}
        cases |= {(0, 2, 0, (1, 3)): 45}
        degrees = [round(math.degrees(function(*arguments)), 1) for arguments in cases]
        right = [*cases.values()]
        return degrees == right or f'{degrees} degrees, not {right}'

    def heads(*cases, things=''):
        function = module(workspace, 'logic').free_heading
        for seen, wanted, far, right in cases:
            heading = function(scanned(**seen), np.radians(DEGREES), math.radians(wanted), far)
            heading = heading if heading is None else round(math.degrees(heading))
            if heading != right:
                there = things or scene(seen)
                return f'with {there}, wanted {wanted} degrees: {heading}, not {right}'
        return True

    box, ahead = dict.fromkeys(unknown(-10, 10), 0.6), 'a box 0.6 m ahead'
    turn = 'math.atan2(dy, dx) - yaw, then math.remainder(angle, math.tau)'
    free = 'reach(...) > far_m'
    return [
        ('direction', directions, turn),
        (
            'nothing in sight',
            lambda: heads(({}, 31, 0.5, 30), ({}, 170, 0.5, 85), ({}, -170, 0.5, -85)),
            'min(free, key=...)',
        ),
        (
            'around a box',
            lambda: heads((box, 8, 0.7, 30), (box, -8, 0.7, -30), things=ahead),
            free,
        ),
        ('a box that is farther away', lambda: heads((box, 8, 0.5, 10), things=ahead), free),
        (
            'no way',
            lambda: heads(({'l0': -math.inf}, 0, 0.5, None)),
            'min(..., default=None)',
        ),
    ]


@tasks.add(cpu_s=20)
def steer_to_a_place(workspace):
    def comes_to(floor, *places):
        robot, left = steered(workspace, floor, places, 15 * len(places))
        if robot.bumps:
            return 'it hits something'
        return not left or f'of {len(places)} places it does not reach {left}'

    def steers(wanted, distance_m, v, w, full_mps=0.5, beams=181, **seen):
        """Ask for degrees and metres; m/s and rad/s are right. See the first `beams` beams."""
        ranges, angles = scanned(**seen)[:beams], np.radians(DEGREES)[:beams]
        function = module(workspace, 'logic').steer
        speeds = function(ranges, angles, math.radians(wanted), distance_m, full_mps)
        found = tuple(round(float(speed), 3) for speed in speeds)
        return expect(found, (v, w), 'it returns')

    def stands_blind():
        cases = (
            ('all beams', steers(0, 3, 0.0, 0.0, **unknown(-90, 90))),
            ('90 of 180 beams', steers(0, 3, 0.0, 0.0, beams=180, **unknown(-90, -1))),
            ('61 of 181 beams', steers(0, 3, 0.5, 0.0, **unknown(-90, -30))),
        )
        return all_of(*(found is True or f'with {which} unknown {found}' for which, found in cases))

    turn = 'Speed times cos(heading), and 1.5 * heading. The heading 0.0 is a heading, too.'
    other = 'The speed for straight ahead, with full_mps: safe_speed(reach(..., 0.0), full_mps).'
    blind = 'np.isnan(ranges).sum(), of len(ranges)'
    near = 'free_heading(..., min(0.5, distance_m))'
    around, door = LAST.places['A'], ((4.75, 1.75), ROOMS.places['C'])
    before = 'a wall at 0.4 m, a place before it'
    beside = 'a wall at 0.4 m, a place beside'
    return [
        ('nothing in sight: straight on', lambda: steers(0, 3, 0.5, 0.0), turn),
        ('nothing in sight: 60 degrees', lambda: steers(60, 3, 0.25, 1.571), turn),
        ('another full speed', lambda: steers(0, 3, 0.2, 0.0, full_mps=0.2), other),
        (
            'a box 0.9 m ahead, on the way to a place',
            lambda: steers(0, 3, 0.433, 0.0, l0=0.9),
            near,
        ),
        (beside, lambda: steers(60, 3, 0.05, 1.571, l0=0.4), 'reach(..., 0.0)'),
        (before, lambda: steers(0, 0.3, 0.1, 0.0, l0=0.4), 'min(0.5, distance_m)'),
        ('a blind laser: it stands', stands_blind, blind),
        ('no way: it turns', lambda: steers(-57, 3, 0.0, 0.9, l0=-math.inf), 'if heading is None:'),
        ('around two boxes', lambda: comes_to(LAST, around), 'free_heading, then cos(heading)'),
        ('through a door', lambda: comes_to(ROOMS, *door), 'The speed for straight ahead.'),
    ]
