"""Of the project: a node that drives and stops, where it is, and which way is free."""

import contextlib
import math
import os
import signal

import numpy as np
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.parameter import Parameter

from helpers.checks.lessons.build_a_robot_program.shared import (
    one_command_a_scan,
    tasks,
)
from helpers.checks.points import cached
from helpers.patrol import (
    CIRCLE,
    DEGREES,
    LAST,
    SIM,
    SNAKE,
    drive,
    estimated,
    module,
    steered,
)
from helpers.robot import CORRIDOR, EMPTY, KIND, ROOMS, Floor, Pose, Robot
from helpers.ros import ros_session, spun


@tasks.add
def a_node_that_drives(workspace):
    def moves():
        robot = drive(CORRIDOR, module(workspace, 'patrol').Patrol, 3)
        way = robot.pose.x - CORRIDOR.start.x
        speeds = {(command.v, command.w) for command in robot.record.commands}
        if not speeds:
            return 'no command came in 3 s'
        if speeds != {(0.3, 0.0)}:
            return f'it commands (linear.x, angular.z) = {sorted(speeds)[0]}'
        return 0.7 < way < 0.9 or f'in 3 s it drove {way:.1f} m'

    def one_for_each_scan():
        return one_command_a_scan(drive(EMPTY, module(workspace, 'patrol').Patrol, 2))

    def has_methods():
        with ros_session():
            robot = Robot(EMPTY, sim_time=True)
            node = module(workspace, 'patrol').Patrol(parameter_overrides=SIM)
            robot.run(0.1)
            node.command(0.1, 0.5)
            robot.run(0.1)
            node.stop()
            robot.run(0.1)
            commands = [(command.v, command.w) for command in robot.record.commands]
        right = [(0.1, 0.5), (0.0, 0.0)]
        return commands == right or (
            f'command(0.1, 0.5) and stop() published {commands or "nothing"}'
        )

    def hears_any_laser():
        driver = KIND.but(laser='ld08')
        robot = drive(CORRIDOR, module(workspace, 'patrol').Patrol, 1, driver=driver)
        return bool(robot.record.commands) or 'it receives nothing from a laser that is BEST_EFFORT'

    return [
        ('the robot drives at 0.3 m/s', moves, 'on_scan(self, scan): self.command(0.3, 0.0)'),
        ('one command for each scan', one_for_each_scan, 'Publish in the callback of the scan.'),
        ('command(v, w), stop()', has_methods, 'twist.linear.x and twist.angular.z'),
        ('the scans of a BEST_EFFORT laser', hears_any_laser, 'create_subscription(..., LASER)'),
    ]


FAILS = """from patrol_pkg import main, patrol
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan


class Fails(patrol.Patrol):
    def __init__(self, **options):
        super().__init__(**options)
        self.scans = 0
        self.create_subscription(LaserScan, 'scan', self.fail, qos_profile_sensor_data)

    def fail(self, scan):
        self.scans += 1
        if self.scans > 15:
            raise RuntimeError('planted')


main.run(Fails)
"""
WITH_INTERFACES = '[ -f install/setup.bash ] && source install/setup.bash\n'
MAIN_ENDS = {'interrupted': signal.SIGINT, 'terminated': signal.SIGTERM, 'failed': None}


def how_it_ended(robot, drove, program, by_itself):
    """Return what the program printed if the robot stands after it, or else what is wrong."""
    lines = program.lines
    if not drove:
        return f'the robot stands, and main() says: {(lines or ["nothing"])[-1]}'
    if by_itself:
        return 'it ends by itself'
    if program.running:
        return 'it does not end'
    if not robot.stopped:
        last = robot.record.commands[-1]
        return f'it ends, and the robot drives on: the last command is {last.v:g} m/s'
    return lines


@tasks.add(limit_s=120, cpu_s=20)
def a_program(workspace):
    @cached
    def run_all():
        """Run main() three times, each beside a base that keeps its last command, and end it."""
        workspace.write('.start.py', 'from patrol_pkg.main import main\nmain()\n')
        workspace.write('.fails.py', FAILS)
        start = WITH_INTERFACES + 'PYTHONPATH=src/patrol_pkg:$PYTHONPATH exec python -B '
        robots, programs = {}, {}
        with ros_session() as session, contextlib.ExitStack() as stack:
            for end in MAIN_ENDS:
                driver = KIND.but(command_timeout_s=None)
                robots[end] = Robot(EMPTY, namespace=end, driver=driver)
                file = '.start.py' if MAIN_ENDS[end] else '.fails.py'
                command = f'{start}{file} --ros-args -r __ns:=/{end}'
                programs[end] = stack.enter_context(workspace.start(command, end))

            def drives(end):
                return robots[end].pose.x > EMPTY.start.x + 0.05

            def each(condition, limit_s):
                with contextlib.suppress(TimeoutError):
                    session.wait_until(lambda: all(condition(end) for end in MAIN_ENDS), limit_s)

            each(lambda end: drives(end) or not programs[end].running, 30)
            ended = {end: not program.running for end, program in programs.items()}
            for end, number in MAIN_ENDS.items():
                if number is not None and drives(end) and not ended[end]:
                    os.kill(programs[end].pid, number)
            each(lambda end: not drives(end) or not programs[end].running, 30)
            each(lambda end: not drives(end) or robots[end].stopped, 1)
            return {
                end: how_it_ended(
                    robots[end],
                    drives(end),
                    programs[end],
                    by_itself=ended[end] and number is not None,
                )
                for end, number in MAIN_ENDS.items()
            }

    def stands(end):
        return lambda: True if isinstance(run_all()[end], list) else run_all()[end]

    def ends_quietly():
        lines = run_all()['interrupted']
        if not isinstance(lines, list):
            return f'not judged: {lines}'
        return not lines or f'it ends with {lines[-1]}'

    stop = 'In finally: node.stop(), before rclpy.try_shutdown().'
    handlers = 'rclpy.init(signal_handler_options=SignalHandlerOptions.NO)'
    return [
        ('after Ctrl+C the robot stands', stands('interrupted'), handlers),
        ('without a traceback', ends_quietly, 'except KeyboardInterrupt: pass'),
        (
            'after SIGTERM it stands',
            stands('terminated'),
            'signal.signal(signal.SIGTERM, signal.default_int_handler)',
        ),
        ('after an error in a callback it stands', stands('failed'), stop),
    ]


def scanned(**seen):
    """Return ranges: l10=1.5 means that the beam 10 degrees to the left sees 1.5 m; r: right."""
    ranges = np.full(181, math.inf)
    for beam, metres in seen.items():
        ranges[90 + int(beam[1:]) * (1 if beam[0] == 'l' else -1)] = metres
    return ranges


def scene(seen):
    """Say what `scanned` is given: 1.5 m at 10 degrees to the left."""
    if len(seen) > 6:
        return 'nan from 12 degrees on the right to 12 on the left'
    sides = {'l': 'left', 'r': 'right'}
    beams = [
        f'{metres:g} m at {int(beam[1:])} degrees to the {sides[beam[0]]}'
        for beam, metres in seen.items()
    ]
    return ' and '.join(beams) or 'nothing in sight'


@tasks.add
def reach_and_speed(workspace):
    def reaches(*cases):
        def test():
            function = module(workspace, 'logic').reach
            for seen, degrees, right in cases:
                metres = function(scanned(**seen), np.radians(DEGREES), math.radians(degrees))
                if not isinstance(metres, float | int):
                    kind = 'None' if metres is None else f'the type {type(metres).__name__}'
                    return f'it returns {kind}, and no number'
                if not abs(metres - right) < 0.01:
                    return (
                        f'with {scene(seen)}, the reach at {degrees} degrees is {metres:.2f}, '
                        f'not {right:.2f}'
                    )
            return True

        return test

    def speeds_are(*cases):
        def test():
            function = module(workspace, 'logic').safe_speed
            speeds = [float(function(*arguments)) for *arguments, _ in cases]
            right = [speed for *_, speed in cases]
            return bool(np.allclose(speeds, right)) or f'{speeds}, not {right}'

        return test

    strip = 'along[(along >= 0) & (abs(across) < HALF_M)], and its min(..., default=FAR_M)'
    unknown = 'known = ~np.isnan(ranges), and then ranges[known], angles[known]'
    share = 'np.mean(known[toward]) is the share of known beams: below 0.5, return 0.0.'
    ahead = [({'l0': 2.0, 'r1': 1.5}, 0, 1.5), ({'l45': 0.5}, 0, 99)]
    ahead += [({'r45': 0.5, 'l9': 2.0}, 0, 99)]
    along = [({'l10': 0.5}, 0, 0.492), ({'l17': 0.5}, 0, 0.478)]
    turned = [({'l45': 0.5}, 45, 0.5), ({'r60': 1.0, 'l0': 0.3}, -60, 1.0), ({'l20': 0.3}, 85, 99)]
    behind = [
        ({'r89': 0.1}, 85, 99),
        ({'l85': 0.3}, -85, 99),
        ({'r90': 0.4, 'l80': 1.0}, 85, 0.996),
    ]
    odd = [({'r70': -math.inf}, 10, 0), ({}, 0, 99)]
    few = [({'l3': math.nan}, 0, 99), ({'l0': math.nan, 'r1': 1.5, 'l2': math.nan}, 0, 1.5)]
    blind = {f'{side}{degrees}': math.nan for side in 'lr' for degrees in range(13)}
    many = [(blind, 0, 0), (blind, 60, 99), (blind | {'l0': 2.0}, 0, 0), ({}, 180, 0)]

    def all_around():
        function = module(workspace, 'logic').reach
        angles = np.radians(np.arange(360.0))
        ranges = np.full(360, 3.0)
        ranges[315] = 0.5
        ranges[100:260] = math.nan
        for degrees, right in ((-45, 0.5), (0, 3.0), (170, 0.0)):
            metres = function(ranges, angles, math.radians(degrees))
            if not abs(metres - right) < 0.01:
                return (
                    'with angles from 0 to 2 pi, 0.5 m at 315 degrees and nan from 100 to 259, the '
                    f'reach at {degrees} degrees is {metres:.2f}, not {right:.2f}'
                )
        return True

    return [
        ('straight on: the nearest in the strip', reaches(*ahead), strip),
        ('measured along the strip, not to the beam', reaches(*along), 'min(along[...])'),
        ('another direction', reaches(*turned), 'cos(angles - heading), sin(angles - heading)'),
        ('what is behind does not count', reaches(*behind), 'along >= 0'),
        ('too near, nothing', reaches(*odd), 'np.nan_to_num(..., posinf=FAR_M, neginf=0.0)'),
        ('single unknown beams do not count', reaches(*few), unknown),
        ('too many unknown beams: 0', reaches(*many), share),
        (
            'a laser that looks all around',
            all_around,
            'np.cos(angles - heading) > math.cos(AROUND)',
        ),
        ('near: 0', speeds_are((0.25, 0.5, 0), (0.1, 0.5, 0)), 'max(0.0, ...)'),
        ('far: full speed', speeds_are((1.0, 0.5, 0.5), (99.0, 0.2, 0.2)), 'min(1.0, ...)'),
        (
            'between',
            speeds_are((0.625, 0.5, 0.25), (0.4, 1.0, 0.2)),
            '(reach - STOP_M) / (SLOW_M - STOP_M)',
        ),
    ]


TURTLEBOT3_LASER = KIND.but(laser='ld08')
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
    def stops_at(floor, start, near_m):
        def test():
            robot = drive(floor, module(workspace, 'patrol').Patrol, 12, start=start)
            ahead = floor.ranges(*robot.pose[:2], np.array([robot.pose.yaw]))[0][0]
            fastest = max((command.v for command in robot.record.commands), default=0.0)
            if robot.bumps:
                return 'it hits something'
            if fastest > 0.5001:
                return f'it drives at {fastest:.2g} m/s: more than 0.5'
            return 0.2 < ahead < near_m or f'it stands still {ahead:.1f} m from it'

        return test

    def stops_blind():
        patrol = module(workspace, 'patrol').Patrol
        robot = drive(CORRIDOR, patrol, 4, blind_after_s=2)
        if not robot.stopped:
            return 'all beams are nan, and it drives on'
        robot = drive(CORRIDOR, patrol, 12, driver=TURTLEBOT3_LASER)
        ahead = CORRIDOR.ranges(*robot.pose[:2], np.array([robot.pose.yaw]))[0][0]
        return (not robot.bumps and ahead < 0.5) or (
            f'with the laser of a TurtleBot 3 it stands {ahead:.1f} m before the wall'
        )

    hint = 'reach(*beams(scan), 0.0), then safe_speed(..., 0.5)'
    near = stops_at(CORRIDOR, Pose(3.0, 1.25, 1.0), 0.5)
    return [
        ('it stops before the wall', stops_at(CORRIDOR, None, 0.35), hint),
        (
            'it passes a box beside its path, and stops at the next',
            stops_at(HALL, None, 0.35),
            hint,
        ),
        ('it also stops if it starts near a wall', near, hint),
        ('a blind laser, and that of a TurtleBot 3', stops_blind, hint),
    ]


@tasks.add(cpu_s=20)
def where_am_i(workspace):
    def knows(commands):
        def test():
            where, place, yaw = estimated(module(workspace, 'where').Where, commands)
            error = math.dist((where.x, where.y), place)
            if abs(math.remainder(where.yaw - yaw, math.tau)) > 0.1:
                return 'its yaw is wrong'
            return error < 0.15 or f'at the end it is {error:.1f} m away'

        return test

    def driven(scale, period_s=0.1):
        """Drive straight on. Return the true way, and x. The wheels report at another rate, too."""
        with ros_session():
            robot = Robot(EMPTY, sim_time=True, noise=False)
            options = [*SIM, Parameter('wheel_scale', value=scale)]
            node = Node('tested', parameter_overrides=options, cli_args=THINNED)
            where = module(workspace, 'where').Where(node)
            executor = spun(node, Thinner(period_s))
            robot.run(0.2, executor)
            for _ in range(20):
                robot.command(0.5)
                robot.run(0.1, executor)
        return robot.pose.x - EMPTY.start.x, where.x

    def scale_is_used():
        way, x = driven(2.0)
        text = f'with wheel_scale = 2 it drove {way:.1f} m, and x is {x:.1f} m'
        return abs(x - way / 2) < 0.05 or text

    def stamps_are_used():
        way, x = driven(1.0, period_s=0.2)
        text = f'with odom every 0.2 s it drove {way:.1f} m, and x is {x:.1f} m'
        return abs(x - way) < 0.15 or text

    stamps = 'The seconds between two stamps, not a fixed time.'
    return [
        ('a circle', knows(CIRCLE[:150]), 'x grows by way * cos(yaw), y by way * sin(yaw).'),
        ('a line like a snake', knows(SNAKE), stamps),
        ('odom comes less often', stamps_are_used, stamps),
        ('the parameter wheel_scale', scale_is_used, 'node.declare_parameter(...).value'),
    ]


THINNED = ['--ros-args', '-r', 'odom:=thin_odom']


class Thinner(Node):
    """Passes odometry on, at most once in a period."""

    def __init__(self, period_s):
        super().__init__('thinner')
        self.period_s, self.last_s = period_s, -math.inf
        self.publisher = self.create_publisher(Odometry, 'thin_odom', 10)
        self.create_subscription(Odometry, 'odom', self.on_odom, 10)

    def on_odom(self, odom):
        """Pass a message on if the last one is old enough."""
        now_s = odom.header.stamp.sec + odom.header.stamp.nanosec / 1e9
        if now_s > self.last_s + self.period_s - 0.01:
            self.last_s = now_s
            self.publisher.publish(odom)


@tasks.add
def a_free_heading(workspace):
    def directions():
        function = module(workspace, 'logic').direction
        cases = [((1, 1, 0, (1, 2)), 90), ((0, 0, 3, (-1, -0.2)), 19.4)]
        cases += [((2, 0, 1.5, (1, 0)), 94.1), ((0, 0, 0, (-1, -0.01)), -179.4)]
        degrees = [round(math.degrees(function(*arguments)), 1) for arguments, _ in cases]
        right = [angle for _, angle in cases]
        return degrees == right or f'{degrees} degrees, not {right}'

    def headings(*cases):
        def test():
            function = module(workspace, 'logic').free_heading
            for seen, wanted, far, right in cases:
                heading = function(scanned(**seen), np.radians(DEGREES), math.radians(wanted), far)
                heading = heading if heading is None else round(math.degrees(heading))
                if heading != right:
                    things = scene(seen) if len(seen) < 2 else 'a box 0.6 m ahead'
                    return f'with {things}, wanted {wanted} degrees: {heading}, not {right}'
            return True

        return test

    box = {f'{side}{degrees}': 0.6 for side in 'lr' for degrees in range(11)}
    turn = 'math.atan2(dy, dx) - yaw, then math.remainder(angle, math.tau)'
    nothing = headings(({}, 31, 0.5, 30), ({}, 170, 0.5, 85))
    around = headings((box, 8, 0.7, 30), (box, -8, 0.7, -30))
    no_way = headings(({'l0': -math.inf}, 0, 0.5, None))
    return [
        ('direction', directions, turn),
        ('nothing in sight', nothing, 'min(free, key=...)'),
        ('around a box', around, 'reach(...) > far_m'),
        ('a box that is farther away', headings((box, 8, 0.5, 10)), 'reach(...) > far_m'),
        ('no way', no_way, 'min(..., default=None)'),
    ]


@tasks.add(cpu_s=20)
def steer_to_a_place(workspace):
    def comes_to(floor, *places):
        def test():
            robot, left = steered(workspace, floor, places, 15 * len(places))
            if robot.bumps:
                return 'it hits something'
            return not left or f'of {len(places)} places it does not reach {left}'

        return test

    def returns(wanted, distance_m, *right, full_mps=0.5, **seen):  # degrees, m; m/s and rad/s
        def test():
            steer = module(workspace, 'logic').steer
            angles = np.radians(DEGREES)
            v, w = steer(scanned(**seen), angles, math.radians(wanted), distance_m, full_mps)
            answer = round(float(v), 3), round(float(w), 3)
            return answer == right or f'it returns {answer}, not {right}'

        return test

    turn = 'Speed times cos(heading), and 1.5 * heading. The heading 0.0 is a heading, too.'
    other = 'The speed for straight ahead, with full_mps: safe_speed(reach(..., 0.0), full_mps).'
    door = comes_to(ROOMS, (4.75, 1.75), ROOMS.places['C'])
    unknown = {f'{side}{degrees}': math.nan for side in 'lr' for degrees in range(91)}
    on_the_right = {f'r{degrees}': math.nan for degrees in range(30, 91)}

    def stands_blind():
        blind = returns(0, 3, 0.0, 0.0, **unknown)()
        if blind is not True:
            return f'with all beams unknown {blind}'
        partly = returns(0, 3, 0.5, 0.0, **on_the_right)()
        return partly is True or f'with 61 of 181 beams unknown {partly}'

    return [
        ('nothing in sight: straight on', returns(0, 3, 0.5, 0.0), turn),
        ('nothing in sight: 60 degrees', returns(60, 3, 0.25, 1.571), turn),
        ('another full speed', returns(0, 3, 0.2, 0.0, full_mps=0.2), other),
        ('a wall at 0.4 m, a place beside', returns(60, 3, 0.05, 1.571, l0=0.4), 'reach(..., 0.0)'),
        (
            'a wall at 0.4 m, a place before it',
            returns(0, 0.3, 0.1, 0, l0=0.4),
            'min(0.5, distance_m)',
        ),
        ('a blind laser: it stands', stands_blind, 'np.isnan(ranges).sum(), of len(ranges)'),
        ('no way: it turns', returns(-57, 3, 0.0, 0.9, l0=-math.inf), 'if heading is None:'),
        ('around two boxes', comes_to(LAST, LAST.places['A']), 'free_heading, then cos(heading)'),
        ('through a door', door, 'The speed for straight ahead.'),
    ]
