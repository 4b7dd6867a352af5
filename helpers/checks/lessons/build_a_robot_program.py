"""What the tasks of the lesson "Build a robot program" are judged by.

The lesson imports from here what drives a robot with its program, too: robot_program.py.
"""

import contextlib
import math
import os
import re
import signal
import time

import numpy as np
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import GetParameters
from rclpy.action import ActionClient
from rclpy.clock import ClockType
from rclpy.exceptions import InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time
from sensor_msgs.msg import BatteryState

from helpers.checks.bench import STATUS, Bench, must_define, must_have
from helpers.checks.builds import build, builds
from helpers.checks.planted import planted, run_tests
from helpers.checks.points import cached
from helpers.checks.programs import DIED, started
from helpers.checks.robot_program import (
    CELLAR,
    CIRCLE,
    CUT,
    DEGREES,
    ENDS,
    LAST,
    LAUNCH,
    ON_THE_WAY,
    PACKAGE,
    SIM,
    SNAKE,
    Cable,
    Ear,
    Tour,
    action,
    drive,
    driven_live,
    ended_by,
    estimated,
    launched,
    module,
    printed,
    round_tour,
    route_of,
    spun,
    steered,
    write_route_of_cellar,
)
from helpers.checks.tasks import Tasks
from helpers.robot import (
    CORRIDOR,
    EMPTY,
    KIND,
    ROOMS,
    TURTLEBOT3,
    Floor,
    Pose,
    Robot,
)
from helpers.ros import ros_session

__all__ = [
    'CELLAR',
    'CIRCLE',
    'CUT',
    'ENDS',
    'LAST',
    'ON_THE_WAY',
    'SIM',
    'Cable',
    'check',
    'drive',
    'driven_live',
    'ended_by',
    'estimated',
    'launched',
    'module',
    'round_tour',
    'spun',
    'steered',
    'write_route_of_cellar',
]

tasks = Tasks()
check = tasks.check


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


def one_command_a_scan(robot):
    """Return whether as many commands came as scans, or else their numbers."""
    scans, commands = len(robot.record.scans), len(robot.record.commands)
    return scans - 2 <= commands <= scans or f'{commands} commands for {scans} scans'


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


@tasks.add(limit_s=90, cpu_s=60)
def an_action(workspace):
    show = 'source install/setup.bash\nros2 interface show patrol_interfaces/action/Patrol'
    shown = cached(lambda: workspace.terminal(show))
    it_builds = cached(lambda: builds(workspace, 'patrol_interfaces'))

    def has(number, name, right):
        def test():
            if it_builds() is not True:
                return 'not judged: it does not build'
            written = re.sub(r'#.*', '', shown())
            parts = re.split(r'^---$', written, flags=re.MULTILINE)
            found = ' '.join(parts[number].split()) if number < len(parts) else ''
            return found == right or f'the {name} has {found or "nothing"}'

        return test

    return [
        ('it builds', it_builds, 'Three parts, with a line --- between them.'),
        ('the goal', has(0, 'goal', 'int32 places'), 'int32 places'),
        ('the result', has(1, 'result', 'int32[] visited'), 'A list is int32[].'),
        ('the feedback', has(2, 'feedback', 'int32[] visited'), 'A list is int32[].'),
    ]


class Asked:
    """A job in a node, a client, and what the client is told. Make it in a session."""

    def __init__(self, workspace, route=(1.0, 2.0, 3.0, 4.0)):
        given = [Parameter('route', value=list(route))] if route else []
        self.robot, self.allowed = Robot(EMPTY, sim_time=True), True
        node, client = Node('tested', parameter_overrides=[*SIM, *given]), Node('client')
        self.job = module(workspace, 'job').Job(node, lambda: self.allowed)
        self.client, self.executor = ActionClient(client, action(), 'patrol'), spun(node, client)
        self.robot.run(0.5, self.executor, until=self.client.server_is_ready)

    def ask(self, places):
        """Send a goal. Return whether it was accepted."""
        self.heard, self.ended = [], None
        sent = self.client.send_goal_async(action().Goal(places=places), self.hear)
        self.robot.run(0.2, self.executor)
        if not sent.done():
            return 'no answer'
        self.handle = sent.result()
        if self.handle.accepted:
            self.ended = self.handle.get_result_async()
        return 'accepted' if self.handle.accepted else 'refused'

    def hear(self, message):
        """Keep feedback."""
        self.heard.append(list(message.feedback.visited))

    def result(self):
        """Return how the job ended, and the places of its result."""
        self.robot.run(0.2, self.executor)
        if self.ended is None or not self.ended.done():
            return 'no result'
        answer = self.ended.result()
        return STATUS[answer.status], list(answer.result.visited)


@tasks.add
def the_job(workspace):
    def told(story):
        """Return a test: each step of the story says what came, what is right, and of what."""

        def test():
            with ros_session():
                for step, came, right in story(Asked(workspace)):
                    if came != right:
                        return f'{step}: {came}, not {right}'
            return True

        return test

    one, two = (1.0, 2.0), (3.0, 4.0)

    def three_places(asked):
        yield 'place() without a goal', asked.job.place(), None
        yield 'a goal of 3 places', asked.ask(3), 'accepted'
        for number, right in enumerate([one, two, one]):
            yield f'place() after {number} places', asked.job.place(), right
            asked.job.arrived()
            asked.robot.run(0.1, asked.executor)
        yield 'the result after 3 places', asked.result(), ('SUCCEEDED', [0, 1, 2])
        # The last one may come after the result.
        yield 'the feedback after 1 and 2 places', asked.heard[:2], [[0], [0, 1]]
        yield 'place() after the last one', asked.job.place(), None

    def refusals(asked):
        yield 'a goal of 0 places', asked.ask(0), 'refused'
        asked.allowed = False
        yield 'a goal while may_begin() is False', asked.ask(2), 'refused'
        asked.allowed = True
        yield 'a goal of 2 places', asked.ask(2), 'accepted'
        yield 'a second goal at once', asked.ask(2), 'refused'

    def without_route():
        with ros_session():
            answer = Asked(workspace, route=()).ask(1)
        return answer == 'refused' or f'without the parameter route, a goal of 1 place: {answer}'

    def cancelled(asked):
        yield 'a goal of 5 places', asked.ask(5), 'accepted'
        asked.job.arrived()
        asked.handle.cancel_goal_async()
        asked.robot.run(0.2, asked.executor)
        yield 'place() after a cancel', asked.job.place(), None
        yield 'the result after a cancel', asked.result(), ('CANCELED', [0])
        yield 'a new goal of 1 place', asked.ask(1), 'accepted'
        asked.job.arrived()
        yield 'its result', asked.result(), ('SUCCEEDED', [0])

    def broken_off(asked):
        asked.job.end()
        yield 'a goal of 2 places', asked.ask(2), 'accepted'
        asked.job.end()
        yield 'the result after end()', asked.result(), ('ABORTED', [])
        yield 'a new goal', asked.ask(1), 'accepted'

    return [
        (
            'three places',
            told(three_places),
            'The numbers go on: 0, 1, 2. goal.succeed(), and publish feedback.',
        ),
        ('what it refuses', told(refusals), 'GoalResponse.REJECT'),
        ('without a route', without_route, 'not self.places'),
        ('a cancel, and a new goal', told(cancelled), 'is_cancel_requested in place()'),
        ('aborted', told(broken_off), 'abort(), and self.goal = None'),
    ]


@tasks.add
def the_battery(workspace):
    def battery_says(percentages, *options):
        """Send percentages. Return when it was low, and what was logged."""
        with ros_session():
            robot = Robot(EMPTY, namespace='other', sim_time=True)
            node, ear = Node('tested', parameter_overrides=[*SIM, *options]), Ear()
            talker = ear.create_publisher(BatteryState, 'battery_state', 10)
            battery, executor = module(workspace, 'battery').Battery(node), spun(node, ear)
            lows = [battery.low]
            for percentage in percentages:
                robot.run(0.1, executor)
                talker.publish(BatteryState(percentage=percentage))
                robot.run(0.1, executor)
                lows.append(battery.low)
        return [bool(low) for low in lows], ear.heard

    def low(percentages, right, *options):
        def test():
            lows, _ = battery_says(percentages, *options)
            return lows == right or f'low was {lows}'

        return test

    def logs():
        _, records = battery_says([0.871, 0.87, 0.19])
        right = [('information', 'The battery is at 87 %'), ('warning', 'The battery is at 19 %')]
        return records == right or f'it logged {records}'

    least, nan = Parameter('least_battery', value=0.5), math.nan
    full = Parameter('full_battery', value=100.0)
    text = "f'{100 * percentage:.0f} %', and compare it with the last text"
    return [
        (
            'low',
            low([0.9, 0.19, 0.2], [True, False, True, False]),
            'battery.percentage < self.least',
        ),
        ('least_battery', low([0.9, 0.4], [True, False, True], least), 'node.declare_parameter'),
        (
            'no number',
            low([nan, 0.9], [True, True, False]),
            'not battery.percentage >= self.least',
        ),
        (
            'a battery that is full at 100',
            low([90.0, 19.0, 20.0], [True, False, True, False], full),
            'battery.percentage / self.full',
        ),
        ('it says so, once, and warns if it is low', logs, text),
    ]


@tasks.add
def the_watchdog(workspace):
    def made(node, stop):
        dog = module(workspace, 'watchdog').Watchdog(node, stop, 'scan')
        must_define(type(dog), 'now_s', 'seen', 'look')
        return dog

    def told(times, *options):
        """Tell it the time at each look. Return when it stopped, and what was logged."""
        with Bench() as bench:
            now_s, stops = [0.0], []
            node = Node('tested', parameter_overrides=[*options])
            dog = made(node, lambda: stops.append(now_s[0]))
            for timer in node.timers:
                timer.cancel()
            dog.now_s = lambda: now_s[0]
            for at_s, seen in times:
                now_s[0] = at_s
                if seen:
                    dog.seen()
                dog.look()
            bench.wait(lambda: len(bench.log('tested')) >= len(stops))
            return stops, bench.log('tested')

    # Of each time: when, and whether something comes then.
    twice = [(1.0, False), (2.0, True), (2.2, False), (2.4, False), (9.0, False)]
    twice += [(20.0, True), (20.25, True), (20.5, False), (20.6, False), (30.0, False)]

    def stops_at(times, right, *options):
        def test():
            stops, _ = told(times, *options)
            came = ', '.join(f'{at:g}' for at, seen in times if seen)
            stopped = ', '.join(f'{at:g} s' for at in stops) or 'no time'
            wanted = ', '.join(f'{at:g} s' for at in right)
            return stops == right or (
                f'scans come at {came} s, and it stops at {stopped}, not at {wanted}'
            )

        return test

    def says_so():
        _, records = told(twice)
        right = ['[ERROR] [tested]: No scan comes: I stop'] * 2
        return records == right or f'it logged {records}'

    def with_a_stopped_clock():
        with Bench() as bench:
            node, stops = Node('tested', parameter_overrides=SIM), []
            dog = made(node, lambda: stops.append(1))
            bench.spin(node)
            begin = dog.now_s()
            if not bench.wait(lambda: dog.now_s() != begin):
                return 'now_s() stands still: no /clock comes'
            if bench.wait(lambda: stops, 0.5):
                return 'it stops before the first seen()'
            dog.seen()
            if bench.wait(lambda: stops, 10):
                return True
            kinds = {timer.clock.clock_type for timer in node.timers}
            if kinds != {ClockType.STEADY_TIME}:
                return 'its timer does not fire: no /clock comes'
            return 'it does not stop, 10 s after the last scan'

    forget = 'After stop(), set the time of the last seen() to None.'
    steady = 'create_timer(..., clock=self.clock), with Clock(clock_type=ClockType.STEADY_TIME)'
    longer = Parameter('timeout_s', value=0.8)
    late = [(1.0, True), (1.7, False), (1.85, False), (3.0, False)]
    return [
        ('once, when nothing comes for 0.3 s', stops_at(twice, [2.4, 20.6]), forget),
        ('after 0.8 s, if the parameter says so', stops_at(late, [1.85], longer), 'timeout_s'),
        ('it says so', says_so, 'node.get_logger().error(...)'),
        ('even if no /clock comes', with_a_stopped_clock, steady),
    ]


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


def comes_to_each_place(robot):
    """Return whether a robot has come to each place of its floor, or else which ones it missed."""
    missed = [
        name
        for name, place in sorted(robot.floor.places.items())
        if min(math.dist((pose.x, pose.y), place) for pose in robot.record.poses) > 0.5
    ]
    return not missed or f'it does not come to {", ".join(missed)}'


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


@tasks.add(limit_s=90)
def install_it(workspace):
    it_builds = cached(lambda: builds(workspace, 'patrol_pkg'))

    def after_build(test):
        return lambda: test() if it_builds() is True else 'not judged: it does not build'

    def has_programs():
        lines = workspace.terminal(
            'source install/setup.bash\nros2 pkg executables patrol_pkg'
        ).splitlines()
        programs = sorted(line.split()[-1] for line in lines if line.startswith('patrol_pkg '))
        return 'patrol' in programs or f'its programs: {", ".join(programs) or "none"}'

    def has_files():
        # The launch file is the next task: here any file in its folder must be installed.
        launch_file = workspace.file(f'{PACKAGE}/launch/patrol.launch.xml')
        planted_file = workspace.file(f'{PACKAGE}/launch/planted.launch.xml')
        planted_file.write_text('<launch/>\n')
        try:
            workspace.build('patrol_pkg')
        finally:
            planted_file.unlink()
        share = workspace.file('install/patrol_pkg/share/patrol_pkg')
        wanted = ['config/rooms.yaml', 'launch/planted.launch.xml']
        wanted += ['launch/patrol.launch.xml'] if launch_file.exists() else []
        missing = [name for name in wanted if not (share / name).is_file()]
        if 'launch/planted.launch.xml' in missing:
            missing = [name for name in missing if not name.startswith('launch/')]
            missing += ['launch/planted.launch.xml, which the check has put into launch']
        return not missing or f'share/patrol_pkg has no {", no ".join(missing)}'

    def survives_pycache():
        folders = [workspace.file(f'{PACKAGE}/{name}/__pycache__') for name in ('launch', 'config')]
        new = [folder for folder in folders if not folder.exists()]
        for folder in new:
            folder.mkdir(parents=True)
        try:
            return builds(workspace, 'patrol_pkg')
        finally:
            for folder in new:
                folder.rmdir()

    def wants_pytest():
        code = 'import setuptools; setuptools.setup = lambda **given: print(given)\n'
        code += "exec(open('setup.py').read())"
        workspace.write(f'{PACKAGE}/.given.py', code)
        given = workspace.terminal(f'cd {PACKAGE}; python -B .given.py; rm .given.py')
        return 'pytest' in given.partition('extras_require')[2] or 'extras_require has no pytest'

    files = "glob('launch/*launch.[pxy][yma]*') and glob('config/*.yaml')"
    return [
        ('it builds', it_builds, "entry_points={'console_scripts': [...]}"),
        ('the program', after_build(has_programs), "'patrol = patrol_pkg.main:main'"),
        ('its files', after_build(has_files), files),
        ('beside a __pycache__', after_build(survives_pycache), files),
        ('pytest', after_build(wants_pytest), "extras_require={'test': ['pytest']}"),
    ]


@tasks.add(limit_s=90, cpu_s=20)
def one_file_starts_it(workspace):
    def drives_in_step():
        build(workspace, 'patrol_pkg')
        share = 'install/patrol_pkg/share/patrol_pkg/config/'
        for floor in ('short', 'corridor'):
            text = 'patrol:\n  ros__parameters:\n    route: [1.0, 0.0]\n'
            workspace.write(f'{share}{floor}.yaml', text)
        arguments = 'floor:=short robot:=false sim:=true timeout:=60.0'
        robot, end = launched(workspace, arguments, ROOMS, 1, 8)
        way = robot.pose.x - ROOMS.start.x
        if end != 'SUCCEEDED':
            return end
        return 0.7 < way < 1.1 or f'its route is 1 m long in short.yaml, and it drove {way:.0f} m'

    def starts_both():
        for arguments, floor, wait_s in (
            ('', 'rooms', 0.3),
            ('floor:=corridor timeout:=0.7', 'corridor', 0.7),
        ):
            named = f'with {arguments or "no argument"}'
            text, sim, timeout_s = launched_with_robot(workspace, arguments)
            if DRIVES not in text:
                return f'{named} no robot drives. {printed(workspace, text.splitlines())}'
            if started(text) != ['patrol', 'robot']:
                return f'{named} it starts {" and ".join(started(text))}'
            if DIED in text:
                return f'{named} a program dies. {printed(workspace, text.splitlines())}'
            driven = text.partition(DRIVES)[2].partition('.')[0]
            if driven != floor:
                return f'{named} the robot drives on the floor {driven}'
            if sim is not False:
                return f'{named} the parameter use_sim_time of the node patrol is {sim}'
            if timeout_s != wait_s:
                return f'{named} the parameter timeout_s of the node patrol is {timeout_s}'
        return True

    hint = '<param from="$(dirname)/../config/$(var floor).yaml"/>'
    own = 'if="$(var robot)", $(var floor)'
    return [
        ('the program drives a robot that runs already', drives_in_step, hint),
        ('it starts its own robot on the floor', starts_both, own),
    ]


DRIVES = 'drives on the floor '


def launched_with_robot(workspace, arguments):
    """Launch the program and its own robot. Return what it prints, and two parameters of patrol.

    These, use_sim_time and timeout_s, are None if a program is missing or has died.
    """
    command = f'{LAUNCH}patrol.launch.xml {arguments}'
    with Bench() as bench, workspace.start(command, 'both') as both:

        def text():
            return '\n'.join(both.lines)

        bench.wait(lambda: DRIVES in text() or DIED in text() or not both.running, 20)
        if started(text()) != ['patrol', 'robot'] or DIED in text():
            return text(), None, None
        request = GetParameters.Request(names=['use_sim_time', 'timeout_s'])
        answer = bench.call('/patrol/get_parameters', GetParameters, request, limit_s=10)
        if answer is None:
            return text(), None, None
        sim, timeout = answer.values
        return text(), sim.bool_value, timeout.double_value


# --- Tests, and what they test: right programs, and wrong ones


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
        self.where, self.battery = Where(self), Battery(self)
        self.job = Job(self, lambda: not self.battery.low)
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

    def command(self, v, w):
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
        if self.battery.low:
            self.job.end()
        x, y, yaw = self.where.x, self.where.y, self.where.yaw
        place = self.job.place()
        if place is not None and math.dist((x, y), place) < 0.2:
            self.job.arrived()
            place = self.job.place()
        if place is None or not self.is_fresh(scan):
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
        def test():
            if not all(runs()[version].passes for version in ('yours', 'ours')):
                return 'not judged: your tests must first pass for the right ones'
            return runs()[bug].fails or f'pytest: {runs()[bug].says}'

        return test

    kind = 'programs' if name == 'logic' else 'nodes'
    return [
        (f'they pass for two right {kind}', passes_for_right_ones, hint),
        *((f'they fail for one that {bug}', catches(bug), WHAT_TO_TEST[bug]) for bug in wrong),
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
        workspace, tests, 'logic', LOGIC, WRONG_LOGICS, 'Is each line what tasks 3 and 6 say?'
    )


@tasks.add(limit_s=90)
def test_the_node(workspace, tests):
    return judged_tests(workspace, tests, 'patrol', NODE, WRONG_NODES, 'What does task 12 say?')


# --- A TurtleBot 3


@tasks.add
def the_guard(workspace):
    def guarded(story, *options):
        def test():
            with Bench() as bench:
                guard = module(workspace, 'guard').Guard(parameter_overrides=[*options])
                bench.spin(guard)
                return story(bench, bench.hear('cmd_vel', TwistStamped))

        return test

    def wanted(v, w):
        twist = Twist()
        twist.linear.x, twist.angular.z = v, w
        return twist

    def speeds(stamped):
        return [(one.twist.linear.x, one.twist.angular.z) for one in stamped]

    def hands_on(bench, heard):
        before = bench.tester.get_clock().now()
        bench.say('cmd_vel_wanted', wanted(0.2, 0.0), wanted(0.1, -0.5))
        after = bench.tester.get_clock().now()
        if speeds(heard)[:2] != [(0.2, 0.0), (0.1, -0.5)]:
            said = ', '.join(f'{v:g} m/s and {w:g} rad/s' for v, w in speeds(heard))
            return f'of two commands it published {said or "nothing"}'
        for one in heard[:2]:
            if not before <= Time.from_msg(one.header.stamp) <= after:
                return f'a stamp is {one.header.stamp.sec} s: not the time at which it was sent'
        return True

    def stops(bench, heard):
        if bench.wait(lambda: heard, 0.6):
            return 'it publishes before the first command'
        begin = time.monotonic()
        bench.say('cmd_vel_wanted', wanted(0.2, 0.0))
        if not bench.wait(lambda: heard):
            return 'it publishes nothing for a command'
        if not bench.wait(lambda: (0.0, 0.0) in speeds(heard), 10):
            return 'no command comes any more, and it does not stop the robot'
        waited_s = time.monotonic() - begin
        if waited_s < 0.3:
            return f'it stops {waited_s:.2f} s after the last command: timeout_s is 0.3'
        right = '[ERROR] [guard]: No command comes: I stop'
        if not bench.wait(lambda: right in bench.log('guard')):
            return f'it logged {bench.log("guard") or "nothing"}'
        bench.wait(lambda: len(heard) > 2, 0.6)
        return len(heard) == 2 or 'it stops the robot again and again'

    def stops_without_clock(bench, heard):
        bench.say('cmd_vel_wanted', wanted(0.2, 0.0))
        if not bench.wait(lambda: heard):
            return 'it publishes nothing for a command'
        stopped = bench.wait(lambda: (0.0, 0.0) in speeds(heard), 10)
        return stopped or 'with use_sim_time and without /clock it does not stop the robot'

    def can_be_run(bench, heard):
        guard = module(workspace, 'guard')
        if not callable(getattr(guard, 'main', None)):
            return 'there is no main() in guard.py'
        node = guard.Guard()
        must_have(node, 'publisher', 'stop')
        node.stop()
        bench.wait(lambda: heard)
        return speeds(heard) == [(0.0, 0.0)] or f'stop() publishes {speeds(heard) or "nothing"}'

    send = 'TwistStamped(twist=twist), and header.stamp = self.get_clock().now().to_msg()'
    dog = "Watchdog(self, self.stop, 'command'), and its seen() for each command"
    return [
        ('it stamps each command', guarded(hands_on), send),
        ('it stops the robot, once', guarded(stops), dog),
        ('also without /clock', guarded(stops_without_clock, *SIM), dog),
        ('stop() and publisher, for run', guarded(can_be_run), 'self.publisher, stop(), main()'),
    ]


SMALL = Floor.from_text(
    """
##########
#        #
# >   o  #
#        #
##########
""",
    name='small',
)


@tasks.add(limit_s=120, cpu_s=30)
def a_turtlebot(workspace):
    def drives_on_a_new_floor():
        build(workspace, 'patrol_pkg')
        path = 'install/patrol_pkg/share/patrol_pkg/config/small.yaml'
        workspace.write(path, 'patrol:\n  ros__parameters:\n    route: [2.0, 0.5]\n')
        arguments = 'floor:=small robot:=false sim:=true timeout:=60.0'
        robot, end = launched(
            workspace,
            arguments,
            SMALL,
            1,
            40,
            driver=TURTLEBOT3,
            file='turtlebot3.launch.xml',
        )
        fastest = max((command.v for command in robot.record.commands), default=0.0)
        if robot.bumps:
            return 'it hits something'
        if end != 'SUCCEEDED':
            return end
        return fastest < 0.2001 or f'it is told to drive {fastest:.2g} m/s'

    def starts_all():
        command = f'{LAUNCH}turtlebot3.launch.xml timeout:=0.7'
        with Bench() as bench, workspace.start(command, 'all') as program:

            def text():
                return '\n'.join(program.lines)

            bench.wait(lambda: DRIVES in text() or DIED in text() or not program.running, 20)
            if started(text()) != ['guard', 'patrol', 'robot']:
                programs = ' and '.join(started(text())) or 'nothing'
                return f'it starts {programs}. {printed(workspace, program.lines)}'
            for node in ('patrol', 'guard'):
                request = GetParameters.Request(names=['timeout_s'])
                service = f'/{node}/get_parameters'
                answer = bench.call(service, GetParameters, request, limit_s=10)
                if answer is None:
                    return f'the node {node} does not answer. {printed(workspace, program.lines)}'
                timeout_s = answer.values[0].double_value
                if timeout_s != 0.7:
                    return f'with timeout:=0.7 the parameter timeout_s of {node} is {timeout_s}'
        return True

    remap = '<remap from="cmd_vel" to="cmd_vel_wanted"/>, in the node patrol'
    both = '<param name="timeout_s" value="$(var timeout)"/>, in both nodes'
    return [
        ('it drives a TurtleBot 3 on a new floor', drives_on_a_new_floor, remap),
        ('it starts robot, guard and patrol', starts_all, both),
    ]


@tasks.add(limit_s=120, cpu_s=60)
def a_floor_of_your_own(workspace, file):
    path = workspace.file(f'{PACKAGE}/{file}')

    @cached
    def floor():
        return Floor.from_text(path.read_text(encoding='utf-8'), name=path.stem)

    toured = cached(lambda: round_tour(workspace, floor(), path.stem))

    def hits_nothing():
        tour, _ = toured()
        x, y, _ = tour.robot.pose
        return not tour.robot.bumps or f'it hits something at {x:.1f}, {y:.1f}'

    def comes_everywhere():
        tour, _ = toured()
        if not floor().places:
            return 'the floor has no place with a letter'
        return comes_to_each_place(tour.robot)

    def interrupted(by):
        def test():
            route = route_of(path.with_suffix('.yaml'))
            with ros_session():
                numbers = [float(number) for place in route for number in place]
                tour = Tour(workspace, floor=floor(), route=numbers)
                tour.run(1)
                if any(v or w for v, w in tour.speeds(0.2)):
                    return 'without a goal it drives'
                tour.send(len(route))
                tour.run(1)
                if by == 'a cancel':
                    tour.handle.cancel_goal_async()
                else:
                    tour.robot.blind = True
                tour.run(1.5)
                end = tour.robot.record.poses[-1]
                if end.v:
                    return f'after {by} it drives on'
                return end.w == 0 or f'after {by} it turns'

        return test

    hint = 'More places on the route, or a floor with more space.'
    return [
        ('it hits nothing', hits_nothing, hint),
        ('it comes to each place with a letter', comes_everywhere, 'x and y from the start'),
        ('it stands without a goal, and after a cancel', interrupted('a cancel'), 'job.place()'),
        (
            'it stands if the laser is blind',
            interrupted('a blind laser'),
            'steer(*beams(scan), ...)',
        ),
    ]
