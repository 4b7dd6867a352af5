"""What the tasks of the lesson "Build a robot program" are judged by.

The first part is what the lesson uses, too: it drives a simulated robot with the student's program,
in simulated time and in this process, or as it is launched.
"""

import importlib
import math
import sys
import time

import numpy as np
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import GetParameters
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import BatteryState, LaserScan
from test_msgs.action import Fibonacci

from helpers.checks.bench import STATUS, Bench
from helpers.checks.builds import build, builds
from helpers.checks.planted import planted, run_tests
from helpers.checks.programs import DIED, error_of_launch, started
from helpers.checks.tasks import Tasks, once
from helpers.robot import CORRIDOR, EMPTY, ROOMS, Floor, Pose, Robot
from helpers.ros import ros_session
from helpers.workspace import without_folders

tasks = Tasks()
check = tasks.check

PACKAGE = 'src/patrol_pkg'
SIM = [Parameter('use_sim_time', value=True)]

# --- Driving a robot with the program


def module(workspace, name):
    """Import a module of the package as it is in src now."""
    sys.dont_write_bytecode = True  # two versions of a file within a second would share one
    folder = str(workspace.file(PACKAGE))
    sys.path[:] = [folder, *(path for path in sys.path if path != folder)]
    for known in [known for known in sys.modules if known.split('.')[0] == 'patrol_pkg']:
        del sys.modules[known]
    importlib.invalidate_caches()
    return importlib.import_module(f'patrol_pkg.{name}')


def spun(*nodes):
    """Return an executor with these nodes."""
    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    return executor


def drive(floor, make_node, seconds, start=None):
    """Drive a robot with a node in simulated time, and return the robot."""
    with ros_session():
        robot = Robot(floor, start=start, sim_time=True)
        robot.run(seconds, spun(make_node(parameter_overrides=SIM)))
    return robot


CIRCLE, SNAKE = [(0.3, 0.2)] * 600, [(0.5, 0.9 * math.sin(k / 9)) for k in range(120)]


def estimated(make, commands):
    """Drive a robot by remote control, beside a part of the program that `make(node)` returns.

    Return the part, the robot's true place as seen from its start, and its true yaw.
    """
    with ros_session():
        robot, node = Robot(EMPTY, sim_time=True, seed=3), Node('tested', parameter_overrides=SIM)
        part, executor = make(node), spun(node)
        robot.run(0.2, executor)
        for v, w in commands:
            robot.command(v, w)
            robot.run(0.1, executor)
    return part, (robot.pose.x - EMPTY.start.x, robot.pose.y - EMPTY.start.y), robot.pose.yaw


DEGREES = np.arange(-90.0, 91.0)
LAST = Floor.from_text(
    """
##########
#        #
# >  o A #
#    o   #
##########
""",
    name='two boxes',
)


def steered(workspace, floor, places, seconds):
    """Drive a robot to places with `steer` and its true pose. Return it, and how many are left."""
    logic = module(workspace, 'logic')
    with ros_session():
        robot, left = Robot(floor, sim_time=True), list(places)
        while left and robot.t_s < seconds and not robot.bumps:
            x, y, yaw = robot.pose
            distance = math.dist((x, y), left[0])
            if distance < 0.2:
                left.pop(0)
                continue
            wanted = logic.direction(x, y, yaw, left[0])
            ranges = np.array(robot.record.scans[-1].ranges)
            robot.command(*logic.steer(ranges, np.radians(DEGREES), wanted, distance, 0.5))
            robot.run(0.1)
    return robot, len(left)


class Cable(Node):
    """A cable for the scans that can be unplugged: the node hears `laser`."""

    def __init__(self):
        super().__init__('cable')
        self.plugged = True
        self.laser = self.create_publisher(LaserScan, 'laser', 1)
        self.create_subscription(LaserScan, 'scan', self.on_scan, 1)

    def on_scan(self, scan):
        """Pass a scan on."""
        if self.plugged:
            self.laser.publish(scan)


CUT = ['--ros-args', '-r', 'scan:=laser']
LEVELS = {10: 'debug', 20: 'information', 30: 'warning', 40: 'error', 50: 'fatal'}


class Ear(Node):
    """Keeps what the student's nodes log: level and text."""

    def __init__(self):
        super().__init__('ear')
        self.heard = []
        self.create_subscription(Log, '/rosout', self.on_log, 100)

    def on_log(self, log):
        """Keep a record of the student's node."""
        if log.name in ('tested', 'patrol'):
            self.heard.append((LEVELS[log.level], log.msg))


class Tour:
    """The whole node, a robot in simulated time, a client and a cable. Make it in a session."""

    def __init__(self, workspace, *options, floor=ROOMS, route=(3.5, 0.0, 6.5, 0.0), arguments=()):
        values = [*SIM, *options] + ([Parameter('route', value=list(route))] if route else [])
        self.robot, self.cable, self.ear = Robot(floor, sim_time=True), Cable(), Ear()
        arguments = [*CUT, *arguments]
        patrol = module(workspace, 'patrol').Patrol
        self.node = patrol(parameter_overrides=values, cli_args=arguments)
        self.client, self.result = ActionClient(self.ear, Fibonacci, 'patrol'), None
        self.executor = spun(self.node, self.cable, self.ear)
        self.run(1.0)

    def run(self, seconds, until=lambda: False):
        """Let simulated time go on."""
        return self.robot.run(seconds, self.executor, until=until)

    def send(self, order):
        """Send a goal. Return whether it was accepted."""
        if not self.client.server_is_ready():
            raise RuntimeError('there is no action server')
        sent = self.client.send_goal_async(Fibonacci.Goal(order=order))
        self.run(0.1)
        if not sent.done():
            raise RuntimeError('a goal gets no answer')
        self.handle = sent.result()
        if self.handle.accepted:
            self.result = self.handle.get_result_async()
        return self.handle.accepted

    def ended(self):
        """Return whether the job has ended."""
        return self.result is not None and self.result.done()

    def status(self):
        """Return how the job has ended."""
        return STATUS[self.result.result().status] if self.ended() else 'not ended'

    def speeds(self, since_s):
        """Return the commands since then."""
        commands = self.robot.record.commands
        return [(command.v, command.w) for command in commands if command.t_s > since_s]


def round_tour(workspace):
    """Drive the route of config/rooms.yaml. Return the tour and the number of its places."""
    file = str(workspace.file(f'{PACKAGE}/config/rooms.yaml'))
    with ros_session():
        tour = Tour(workspace, route=None, arguments=['--params-file', file])
        places = len(tour.node.job.places) if hasattr(tour.node, 'job') else 0
        tour.send(places)
        tour.run(90, until=lambda: tour.ended() or tour.robot.bumps)
        tour.outcome = tour.status()
    return tour, places


LAUNCH = 'source install/setup.bash\nexec ros2 launch patrol_pkg patrol.launch.xml '


def launched(workspace, arguments, floor, order, seconds, seed=0):
    """Launch the program beside a robot in simulated time, one scan and one command at a time.

    Return the robot, and how the job ended or why it did not begin.
    """
    with ros_session() as session:
        robot, client = Robot(floor, sim_time=True, seed=seed), Node('client')
        action = ActionClient(client, Fibonacci, 'patrol')
        session.spin(spun(client))
        with workspace.start(LAUNCH + arguments, 'program') as program:
            if problem := _begun(workspace, program, action, robot):
                return robot, problem
            sent = action.send_goal_async(Fibonacci.Goal(order=order))
            session.wait_until(sent.done)
            if not sent.result().accepted:
                return robot, 'the goal is refused'
            ended = sent.result().get_result_async()
            while robot.t_s < seconds and not ended.done() and not robot.bumps:
                before = len(robot.record.commands)
                robot.run(0.1)  # one scan, and then its command
                limit = time.monotonic() + 10
                while len(robot.record.commands) == before and time.monotonic() < limit:
                    time.sleep(0.004)
                    robot.run(0)
                if len(robot.record.commands) == before:
                    return robot, f'a scan had no command. {printed(workspace, program.lines)}'
    return robot, STATUS[ended.result().status] if ended.done() else 'not ended'


def _begun(workspace, program, action, robot):
    """Wait until the launched node is there. Return why it is not, or nothing."""

    def is_ready():
        return action.server_is_ready() and robot.count_subscribers('scan')

    limit, begun_s = time.monotonic() + 30, math.inf
    while not is_ready() and program.running and time.monotonic() < limit:
        time.sleep(0.02)
        text = ' '.join(program.lines)
        if 'process started' in text:
            begun_s = min(begun_s, time.monotonic())
        without = '[patrol-' not in text and time.monotonic() > begun_s + 10
        if DIED in text or without:
            break
    if not is_ready():
        return f'no node patrol with an action came. {printed(workspace, program.lines)}'
    if '[robot-' in ' '.join(program.lines):
        return 'with robot:=false it starts a robot'
    limit = time.monotonic() + 20
    while not robot.count_subscribers('/clock') and time.monotonic() < limit:
        time.sleep(0.02)
    if not robot.count_subscribers('/clock'):
        return 'with sim:=true the node patrol does not hear /clock'
    return ''


def printed(workspace, lines):
    """Return what a launched program printed of its first error, or its last line."""
    text = without_folders('\n'.join(lines), workspace.path)
    last = ['nothing', *(line for line in text.splitlines() if line.strip())][-1]
    return f'ros2 launch printed: {error_of_launch(text) or last}'


CELLAR = Floor.from_text(
    """
###########################
#        #       #        #
#  A   o #   o   #  o  B  #
#                #        #
#    o   #   o            #
#        #       #    o   #
####  #########  ####  ####
#        #       #        #
#   o    #  o    #   o    #
# >              #        #
#     o  #   C   #   D    #
#        #       #        #
###########################
""",
    name='cellar',
)
ON_THE_WAY = [(4.75, 1.75), (6.75, 1.25), (8.0, 2.75), (8.0, 3.75), (9.5, 4.25), (11.75, 5.25)]
ON_THE_WAY += [(10.75, 4.0), (10.75, 2.75), (10.75, 1.25), (10.75, 2.75), (10.75, 4.0)]
ON_THE_WAY += [(9.5, 4.25), (8.0, 4.75), (4.75, 4.75), (1.75, 5.25)]


def write_route_of_cellar(workspace):
    """Write the parameter file of the other floor."""
    x0, y0, _ = CELLAR.start
    route = [float(number) for x, y in ON_THE_WAY for number in (x - x0, y - y0)]
    workspace.write(
        f'{PACKAGE}/config/cellar.yaml',
        f'patrol:\n  ros__parameters:\n    route: {route}\n',
    )


# --- Tasks


@tasks.add(1)
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

    def has_command():
        with ros_session():
            robot = Robot(EMPTY, sim_time=True)
            node = module(workspace, 'patrol').Patrol(parameter_overrides=SIM)
            robot.run(0.1)
            node.command(0.1, 0.5)
            robot.run(0.1)
            commands = [(command.v, command.w) for command in robot.record.commands]
        return commands == [(0.1, 0.5)] or f'command(0.1, 0.5) published {commands or "nothing"}'

    return [
        ('the robot drives at 0.3 m/s', moves, 'on_scan(self, scan): self.command(0.3, 0.0)'),
        ('one command for each scan', one_for_each_scan, 'Publish in the callback of the scan.'),
        ('command(v, w)', has_command, 'twist.linear.x and twist.angular.z'),
    ]


def one_command_a_scan(robot):
    """Return whether as many commands came as scans, or else their numbers."""
    scans, commands = len(robot.record.scans), len(robot.record.commands)
    return scans - 2 <= commands <= scans or f'{commands} commands for {scans} scans'


@tasks.add(2)
def a_program(workspace):
    @once
    def run_main():
        """Run main() in a process of its own, beside a robot."""
        workspace.write('.start.py', 'from patrol_pkg.main import main\nmain()\n')
        with ros_session():
            robot = Robot(EMPTY)
            start = 'PYTHONPATH=src/patrol_pkg exec python -B .start.py'
            with workspace.start(start, 'main') as process:
                robot.run(10, until=lambda: robot.pose.x > 5.4 or not process.running)
        return robot.pose.x > 5.4, process.lines

    def drives():
        driven, lines = run_main()
        return driven or f'the robot stands, and main() says: {(lines or ["nothing"])[-1]}'

    def ends_quietly():
        driven, lines = run_main()
        if not driven:
            return 'not judged: it does not drive'
        return not lines or f'it ends with {lines[-1]}'

    caught = 'except (KeyboardInterrupt, ...): pass'
    return [
        ('the program drives the robot', drives, 'rclpy.spin(Patrol())'),
        ('Ctrl+C ends it, without a traceback', ends_quietly, caught),
    ]


def scanned(**seen):
    """Return ranges: l10=1.5 means that the beam 10 degrees to the left sees 1.5 m; r: right."""
    ranges = np.full(181, math.inf)
    for beam, metres in seen.items():
        ranges[90 + int(beam[1:]) * (1 if beam[0] == 'l' else -1)] = metres
    return ranges


def scene(seen):
    """Say what `scanned` is given: 1.5 m at 10 degrees to the left."""
    sides = {'l': 'left', 'r': 'right'}
    beams = [
        f'{metres:g} m at {int(beam[1:])} degrees to the {sides[beam[0]]}'
        for beam, metres in seen.items()
    ]
    return ' and '.join(beams) or 'nothing in sight'


@tasks.add(3)
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
    broken = 'np.nan_to_num(ranges, nan=0.0, posinf=FAR_M, neginf=0.0), first of all.'
    ahead = [({'l0': 2.0, 'r1': 1.5}, 0, 1.5), ({'l45': 0.5}, 0, 99)]
    ahead += [({'r45': 0.5, 'l9': 2.0}, 0, 99)]
    along = [({'l10': 0.5}, 0, 0.492), ({'l17': 0.5}, 0, 0.478)]
    turned = [({'l45': 0.5}, 45, 0.5), ({'r60': 1.0, 'l0': 0.3}, -60, 1.0), ({'l20': 0.3}, 85, 99)]
    behind = [
        ({'r89': 0.1}, 85, 99),
        ({'l85': 0.3}, -85, 99),
        ({'r90': 0.4, 'l80': 1.0}, 85, 0.996),
    ]
    odd = [({'l3': math.nan}, 0, 0), ({'r70': -math.inf}, 30, 0), ({}, 0, 99)]
    return [
        ('straight on: the nearest in the strip', reaches(*ahead), strip),
        ('measured along the strip, not to the beam', reaches(*along), 'min(along[...])'),
        ('another direction', reaches(*turned), 'cos(angles - heading), sin(angles - heading)'),
        ('what is behind does not count', reaches(*behind), 'along >= 0'),
        ('too near, broken, nothing', reaches(*odd), broken),
        ('near: 0', speeds_are((0.25, 0.5, 0), (0.1, 0.5, 0)), 'max(0.0, ...)'),
        ('far: full speed', speeds_are((1.0, 0.5, 0.5), (99.0, 0.2, 0.2)), 'min(1.0, ...)'),
        (
            'between',
            speeds_are((0.625, 0.5, 0.25), (0.4, 1.0, 0.2)),
            '(reach - STOP) / (SLOW - STOP)',
        ),
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


@tasks.add(4)
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

    hint = (
        'reach(np.array(scan.ranges), angles, 0.0), with angles = angle_min + angle_increment * ...'
    )
    near = stops_at(CORRIDOR, Pose(3.0, 1.25, 1.0), 0.5)
    return [
        ('it stops before the wall', stops_at(CORRIDOR, None, 0.35), hint),
        (
            'it passes a box beside its path, and stops at the next',
            stops_at(HALL, None, 0.35),
            hint,
        ),
        ('it also stops if it starts near a wall', near, hint),
    ]


@tasks.add(5, cpu_s=20)
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


@tasks.add(6)
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


@tasks.add(7, cpu_s=20)
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
        ('no way: it turns', returns(-57, 3, 0.0, 0.9, l0=-math.inf), 'if heading is None:'),
        ('around two boxes', comes_to(LAST, LAST.places['A']), 'free_heading, then cos(heading)'),
        ('through a door', door, 'The speed for straight ahead.'),
    ]


class Asked:
    """A job in a node, a client, and what the client is told. Make it in a session."""

    def __init__(self, workspace):
        route = Parameter('route', value=[1.0, 2.0, 3.0, 4.0])
        self.robot, self.allowed = Robot(EMPTY, sim_time=True), True
        node, client = Node('tested', parameter_overrides=[*SIM, route]), Node('client')
        self.job = module(workspace, 'job').Job(node, lambda: self.allowed)
        self.client, self.executor = ActionClient(client, Fibonacci, 'patrol'), spun(node, client)
        self.robot.run(0.5, self.executor, until=self.client.server_is_ready)

    def ask(self, order):
        """Send a goal. Return whether it was accepted."""
        self.heard, self.ended = [], None
        sent = self.client.send_goal_async(Fibonacci.Goal(order=order), self.hear)
        self.robot.run(0.2, self.executor)
        if not sent.done():
            return 'no answer'
        self.handle = sent.result()
        if self.handle.accepted:
            self.ended = self.handle.get_result_async()
        return 'accepted' if self.handle.accepted else 'refused'

    def hear(self, message):
        """Keep feedback."""
        self.heard.append(list(message.feedback.sequence))

    def result(self):
        """Return how the job ended, and the places of its result."""
        self.robot.run(0.2, self.executor)
        if self.ended is None or not self.ended.done():
            return 'no result'
        answer = self.ended.result()
        return STATUS[answer.status], list(answer.result.sequence)


@tasks.add(8)
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
        ('a cancel, and a new goal', told(cancelled), 'is_cancel_requested in place()'),
        ('aborted', told(broken_off), 'abort(), and self.goal = None'),
    ]


@tasks.add(9)
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
    text = "f'{100 * percentage:.0f} %', and compare it with the last text"
    return [
        (
            'low',
            low([0.9, 0.19, 0.2], [False, False, True, False]),
            'battery.percentage < self.least',
        ),
        ('least_battery', low([0.9, 0.4], [False, False, True], least), 'node.declare_parameter'),
        (
            'no number',
            low([nan, 0.9], [False, True, False]),
            'not battery.percentage >= self.least',
        ),
        ('it says so, once, and warns if it is low', logs, text),
    ]


@tasks.add(10)
def the_watchdog(workspace):
    def watched(*options):
        """1 s with scans, 1.5 s without, 1 s with, 1.5 s without."""
        with ros_session():
            robot, ear = Robot(EMPTY, sim_time=True), Ear()
            node, stops = Node('tested', parameter_overrides=[*SIM, *options]), []
            dog = module(workspace, 'watchdog').Watchdog(node, lambda: stops.append(robot.t_s))
            executor = spun(node, ear)
            robot.run(1, executor)
            early = list(stops)
            for _ in range(2):
                for _ in range(10):
                    dog.seen()
                    last_s = robot.t_s
                    robot.run(0.1, executor)
                robot.run(1.4, executor)
        return early, stops, last_s, ear.heard

    usual = once(watched)
    longer = once(lambda: watched(Parameter('scan_timeout_s', value=0.8)))

    def stops_once():
        early, stops, _, _ = usual()
        if early:
            return 'it stops before the first scan'
        return len(stops) == 2 or f'the scans stop twice, and it calls stop() {len(stops)} times'

    def in_time(timeout_s, drive):
        def test():
            _, stops, last_s, _ = drive()
            if len(stops) < 2:
                return 'stop() is not called'
            age = stops[-1] - last_s
            return timeout_s < age < timeout_s + 0.12 or f'{age:.2f} s after the last scan'

        return test

    def says_so():
        records = usual()[-1]
        return records == [('error', 'No scan comes: I stop')] * 2 or f'it logged {records}'

    clock = 'node.get_clock().now().nanoseconds / 1e9'
    forget = 'After stop(), set the time of the last scan to None.'
    declare = 'node.declare_parameter(...)'
    return [
        ('stop() once, when the scans stop', stops_once, forget),
        ('after 0.3 s', in_time(0.3, usual), clock),
        ('after 0.8 s, if the parameter says so', in_time(0.8, longer), declare),
        ('it says so', says_so, 'node.get_logger().error(...)'),
    ]


@tasks.add(11, cpu_s=20)
def the_whole_node(workspace):
    def toured(story, *options):
        def test():
            with ros_session():
                return story(Tour(workspace, *options))

        return test

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
        tour.cable.plugged, now_s = False, tour.robot.t_s
        tour.run(1)
        stops, still = tour.speeds(now_s + 0.1), tour.robot.pose.x
        if not stops or not tour.robot.stopped:
            return 'it does not stop'
        if ('error', 'No scan comes: I stop') not in tour.ear.heard:
            return 'it does not say so'
        tour.cable.plugged = True
        tour.run(1)
        return tour.robot.pose.x > still + 0.2 or 'it does not go on when the scans are back'

    empty = Parameter('least_battery', value=0.9998)
    rule = 'add_on_set_parameters_callback; get_parameter'
    return [
        (
            'without a goal it stands, with one command for each scan',
            toured(stands),
            'self.command(0.0, 0.0)',
        ),
        ('it visits two places', toured(two_places), 'self.command(*steer(...))'),
        ('a cancel stops it', toured(cancel), 'job.place() is None then.'),
        ('its speed is a parameter', toured(speed), rule),
        ('a low battery ends the job', toured(low_battery, empty), 'self.job.end()'),
        ('without scans it stops, and says so', toured(no_scan), 'self.watchdog.seen()'),
    ]


@tasks.add(12, cpu_s=60, limit_s=90)
def the_route(workspace):
    tour = once(lambda: round_tour(workspace))

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
        poses = drive.robot.record.poses
        missed = [
            name
            for name, place in sorted(ROOMS.places.items())
            if min(math.dist((pose.x, pose.y), place) for pose in poses) > 0.5
        ]
        return not missed or f'it does not come to {", ".join(missed)}'

    hint = 'x - 1.25, y - 1.75 of each place; each number with a point.'
    return [
        ('four rooms, and back', four_rooms, hint),
        ('it comes to each place', every_place, 'C, B and A are places of the route, too.'),
    ]


@tasks.add(13, limit_s=90)
def install_it(workspace):
    it_builds = once(lambda: builds(workspace, 'patrol_pkg'))

    def after_build(test):
        return lambda: test() if it_builds() is True else 'not judged: it does not build'

    def has_programs():
        lines = workspace.terminal(
            'source install/setup.bash\nros2 pkg executables patrol_pkg'
        ).splitlines()
        programs = sorted(line.split()[-1] for line in lines if line.startswith('patrol_pkg '))
        return programs == ['patrol', 'robot'] or f'its programs: {", ".join(programs) or "none"}'

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

    def wants_pytest():
        code = 'import setuptools; setuptools.setup = lambda **given: print(given)\n'
        code += "exec(open('setup.py').read())"
        workspace.write(f'{PACKAGE}/.given.py', code)
        given = workspace.terminal(f'cd {PACKAGE}; python -B .given.py; rm .given.py')
        return 'pytest' in given.partition('extras_require')[2] or 'extras_require has no pytest'

    files = "('share/' + name + '/config', glob('config/*')), and the same for launch"
    return [
        ('it builds', it_builds, "entry_points={'console_scripts': [...]}"),
        ('two programs', after_build(has_programs), "'patrol = patrol_pkg.main:main'"),
        ('its files', after_build(has_files), files),
        ('pytest', after_build(wants_pytest), "extras_require={'test': ['pytest']}"),
    ]


@tasks.add(14, limit_s=90, cpu_s=20)
def one_file_starts_it(workspace):
    def drives_in_step():
        build(workspace, 'patrol_pkg')
        share = 'install/patrol_pkg/share/patrol_pkg/config/'
        for floor in ('short', 'corridor'):
            text = 'patrol:\n  ros__parameters:\n    route: [1.0, 0.0]\n'
            workspace.write(f'{share}{floor}.yaml', text)
        arguments = 'floor:=short robot:=false sim:=true'
        robot, end = launched(workspace, arguments, ROOMS, 1, 8)
        way = robot.pose.x - ROOMS.start.x
        if end != 'SUCCEEDED':
            return end
        return 0.7 < way < 1.1 or f'its route is 1 m long in short.yaml, and it drove {way:.0f} m'

    def starts_both():
        for arguments, floor in (('', 'rooms'), ('floor:=corridor', 'corridor')):
            named = f'with {arguments or "no argument"}'
            text, sim = launched_with_robot(workspace, arguments)
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
        return True

    hint = '<param from="$(dirname)/../config/$(var floor).yaml"/>'
    own = 'if="$(var robot)", $(var floor)'
    return [
        ('the program drives a robot that runs already', drives_in_step, hint),
        ('it starts its own robot on the floor', starts_both, own),
    ]


DRIVES = 'drives on the floor '


def launched_with_robot(workspace, arguments):
    """Launch the program and its own robot. Return what it prints, and patrol's use_sim_time.

    This is None if a program is missing or has died.
    """
    with Bench() as bench, workspace.start(LAUNCH + arguments, 'both') as both:

        def text():
            return '\n'.join(both.lines)

        bench.wait(lambda: DRIVES in text() or DIED in text() or not both.running, 20)
        if started(text()) != ['patrol', 'robot'] or DIED in text():
            return text(), None
        request = GetParameters.Request(names=['use_sim_time'])
        answer = bench.call('/patrol/get_parameters', GetParameters, request, limit_s=10)
        return text(), answer and answer.values[0].bool_value


# --- Tests, and what they test: right programs, and wrong ones


LOGIC = """import math

import numpy as np

HALF_M = 0.16  # the robot's radius is 0.11 m
STOP_M, SLOW_M, FAR_M = 0.25, 1.0, 99.0


def reach(ranges, angles, heading):
    near = np.nan_to_num(ranges, nan=0.0, posinf=FAR_M, neginf=0.0)
    along = near * np.cos(angles - heading)
    across = near * np.sin(angles - heading)
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
    heading = free_heading(ranges, angles, wanted, min(0.5, distance_m))
    if heading is None:
        return 0.0, 0.9
    speed = safe_speed(reach(ranges, angles, 0.0), full_mps)
    return speed * math.cos(heading), 1.5 * heading
"""
WRONG_LOGICS = {
    'is as wide as a street': planted(LOGIC, 'HALF_M = 0.16', 'HALF_M = 1.6'),
    'treats a broken beam as free': planted(LOGIC, 'nan=0.0', 'nan=FAR_M'),
    'never stops': planted(LOGIC, 'max(0.0, (', 'max(0.1, ('),
    'turns the long way round': planted(LOGIC, 'math.remainder(angle, math.tau)', 'angle'),
    'takes the first free direction': planted(LOGIC, 'abs(heading - wanted)', 'heading'),
}


NODE = """import math

import numpy as np
from geometry_msgs.msg import Twist
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from sensor_msgs.msg import LaserScan

from patrol_pkg.battery import Battery
from patrol_pkg.job import Job
from patrol_pkg.logic import direction, steer
from patrol_pkg.watchdog import Watchdog
from patrol_pkg.where import Where


class Patrol(Node):
    def __init__(self, **options):
        super().__init__('patrol', **options)
        self.add_on_set_parameters_callback(self.on_parameters)
        self.declare_parameter('speed', 0.5)
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 1)
        self.where, self.battery = Where(self), Battery(self)
        self.job = Job(self, lambda: not self.battery.low)
        self.watchdog = Watchdog(self, lambda: self.command(0.0, 0.0))
        self.create_subscription(LaserScan, 'scan', self.on_scan, 1)

    def on_parameters(self, parameters):
        for parameter in parameters:
            if parameter.name == 'speed' and not 0 < parameter.value <= 1:
                return SetParametersResult(successful=False, reason='speed: above 0, at most 1')
        return SetParametersResult(successful=True)

    def command(self, v, w):
        twist = Twist()
        twist.linear.x, twist.angular.z = v, w
        self.publisher.publish(twist)

    def on_scan(self, scan):
        self.watchdog.seen()
        if self.battery.low:
            self.job.end()
        x, y, yaw = self.where.x, self.where.y, self.where.yaw
        place = self.job.place()
        if place is not None and math.dist((x, y), place) < 0.2:
            self.job.arrived()
            place = self.job.place()
        if place is None:
            self.command(0.0, 0.0)
            return
        ranges = np.array(scan.ranges)
        angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
        wanted, distance = direction(x, y, yaw, place), math.dist((x, y), place)
        speed = self.get_parameter('speed').value
        self.command(*steer(ranges, angles, wanted, distance, speed))
"""
WRONG_NODES = {
    'drives without a goal': planted(NODE, 'place is None:', 'False:').replace(
        'place = self.job.place()', 'place = self.job.place() or (9.0, 0.0)'
    ),
    'does not look': planted(NODE, 'np.array(scan.ranges)', 'np.full(101, 9.0)'),
    'takes any speed': planted(NODE, 'not 0 < parameter.value <= 1', 'False'),
    'keeps its first speed': planted(NODE, "self.get_parameter('speed').value", '0.5'),
}


def judged_tests(workspace, tests, name, right, wrong, hint):
    """Return the points of tests: they pass for right versions, and fail for each wrong one."""
    runs = once(
        lambda: run_tests(
            workspace, PACKAGE, tests, f'patrol_pkg.{name}', {'yours': '', 'ours': right, **wrong}
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
    'treats a broken beam as free': 'A beam that is nan: reach is 0.',
    'never stops': 'safe_speed of a reach below STOP_M is 0.',
    'turns the long way round': 'direction with a yaw of 3: the angle is between -pi and pi.',
    'takes the first free direction': 'free_heading with nothing in sight is the one wanted.',
    'drives without a goal': 'Without a goal, see(9.0) is answered by (0.0, 0.0).',
    'does not look': 'With a goal, see(0.2) is answered by a speed of 0.0.',
    'takes any speed': 'bench.patrol.set_parameters with speed -0.1 is not successful.',
    'keeps its first speed': 'Set speed to 0.2: see(9.0) is answered by 0.2.',
}


@tasks.add(15, limit_s=90)
def test_the_logic(workspace, tests):
    return judged_tests(
        workspace, tests, 'logic', LOGIC, WRONG_LOGICS, 'Is each line what task 3 says?'
    )


@tasks.add(16, limit_s=90)
def test_the_node(workspace, tests):
    return judged_tests(workspace, tests, 'patrol', NODE, WRONG_NODES, 'What does task 11 say?')
