"""Drive a simulated robot with the program that a student writes in lesson 20.

In simulated time and in this process, or as it is launched. The lesson and its checks use it.
"""

import contextlib
import importlib
import math
import os
import signal
import sys
import time
from typing import NamedTuple

import numpy as np
import yaml
from rcl_interfaces.msg import Log
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import LaserScan

from helpers.checks.bench import STATUS
from helpers.checks.builds import build
from helpers.checks.first_error import error_of_launch
from helpers.checks.programs import DIED
from helpers.robot import (
    CORRIDOR,
    EMPTY,
    KIND,
    RATE_HZ,
    ROOMS,
    TURTLEBOT3,
    Floor,
    Robot,
)
from helpers.robot_view import watch
from helpers.ros import ros_session
from helpers.workspace import without_folders

PACKAGE = 'src/patrol_pkg'
SIM = [Parameter('use_sim_time', value=True)]
# A watchdog has a steady clock. Where simulated time passes, a scan may take long to come.
PATIENT = Parameter('timeout_s', value=60.0)

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


def action():
    """Return the student's own action."""
    from patrol_interfaces.action import Patrol

    return Patrol


def drive(floor, make_node, seconds, start=None, driver=KIND, blind_after_s=math.inf):
    """Drive a robot with a node in simulated time, and return the robot."""
    with ros_session():
        robot = Robot(floor, start=start, driver=driver, sim_time=True)
        executor = spun(make_node(parameter_overrides=SIM))
        robot.run(min(seconds, blind_after_s), executor)
        if blind_after_s < seconds:
            robot.blind = True
            robot.run(seconds - blind_after_s, executor)
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
        if 'timeout_s' not in [option.name for option in options]:
            values.append(PATIENT)
        self.robot, self.cable, self.ear = Robot(floor, sim_time=True), Cable(), Ear()
        arguments = [*CUT, *arguments]
        patrol = module(workspace, 'patrol').Patrol
        self.node = patrol(parameter_overrides=values, cli_args=arguments)
        self.client, self.result = ActionClient(self.ear, action(), 'patrol'), None
        self.executor = spun(self.node, self.cable, self.ear)
        self.run(1.0)

    def run(self, seconds, until=lambda: False):
        """Let simulated time go on."""
        return self.robot.run(seconds, self.executor, until=until)

    def wait(self, condition, limit_s=10.0):
        """Let time go on until a condition holds, also that of timers with a clock of their own.

        Return whether it does within `limit_s` seconds.
        """
        limit = time.monotonic() + limit_s
        while not condition() and time.monotonic() < limit:
            time.sleep(0.02)
            self.run(0.02)
        return bool(condition())

    def send(self, places):
        """Send a goal. Return whether it was accepted."""
        if not self.client.server_is_ready():
            raise RuntimeError('there is no action server')
        sent = self.client.send_goal_async(action().Goal(places=places))
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


def round_tour(workspace, floor=ROOMS, file='rooms'):
    """Drive the route of a file in config. Return the tour and the number of its places."""
    path = str(workspace.file(f'{PACKAGE}/config/{file}.yaml'))
    with ros_session():
        tour = Tour(workspace, floor=floor, route=None, arguments=['--params-file', path])
        places = len(tour.node.job.places) if hasattr(tour.node, 'job') else 0
        tour.send(places)
        tour.run(90, until=lambda: tour.ended() or tour.robot.bumps)
        tour.outcome = tour.status()
    return tour, places


def send_goal(session, server, places):
    """Send a goal to another process. Return its handle, or None if no answer comes.

    A server that has not discovered the client yet cannot answer: rmw_fastrtps waits for it as long
    as its writer may block, 0.1 s (rmw_response.cpp), and rclpy does not begin such a goal. On a
    busy computer this happens, so it is sent again.
    """
    for _ in range(5):
        sent = server.send_goal_async(action().Goal(places=places))
        with contextlib.suppress(TimeoutError):
            session.wait_until(sent.done, 5.0)
            return sent.result()
    return None


LAUNCH = 'source install/setup.bash\nexec ros2 launch patrol_pkg '
BEATS = 12  # scans before a goal: in this time the battery says how full it is


def launched(
    workspace,
    arguments,
    floor,
    places,
    seconds,
    seed=0,
    driver=KIND,
    file='patrol.launch.xml',
):
    """Launch the program beside a robot in simulated time, one scan and one command at a time.

    Return the robot, and how the job ended or why it did not begin.
    """
    with ros_session() as session:
        robot, client = Robot(floor, sim_time=True, seed=seed, driver=driver), Node('client')
        server = ActionClient(client, action(), 'patrol')
        session.spin(spun(client))
        with workspace.start(f'{LAUNCH}{file} {arguments}', 'program') as program:

            def beat(limit_s=10.0):
                """Let the robot go on by a scan. Return whether its command came."""
                before = len(robot.record.commands)
                robot.run(0.1)
                limit = time.monotonic() + limit_s
                while len(robot.record.commands) == before and time.monotonic() < limit:
                    time.sleep(0.004)
                    robot.run(0)
                return len(robot.record.commands) > before

            if problem := _begun(workspace, program, server, robot):
                return robot, problem
            # The first scans are lost, as long as the program does not receive them yet.
            beats, limit = 0, time.monotonic() + 30
            while beats < BEATS and time.monotonic() < limit:
                beats += beat(0.5)
            if beats < BEATS:
                return robot, f'a scan had no command. {printed(workspace, program.lines)}'
            goal = send_goal(session, server, places)
            if goal is None or not goal.accepted:
                return robot, 'the goal is refused' if goal else 'the goal gets no answer'
            ended = goal.get_result_async()
            while robot.t_s < seconds and not ended.done() and not robot.bumps:
                if not beat():
                    return robot, f'a scan had no command. {printed(workspace, program.lines)}'
    return robot, STATUS[ended.result().status] if ended.done() else 'not ended'


def _begun(workspace, program, server, robot):
    """Wait until the launched node is there. Return why it is not, or nothing."""

    def is_ready():
        return (
            server.server_is_ready()
            and robot.count_subscribers('scan')
            and robot.count_publishers('cmd_vel')
        )

    limit, begun_s = time.monotonic() + 30, math.inf
    while not is_ready() and program.running and time.monotonic() < limit:
        time.sleep(0.02)
        text = ' '.join(program.lines)
        if 'process started' in text:
            begun_s = min(begun_s, time.monotonic())
        without = '[patrol-' not in text and time.monotonic() > begun_s + 10
        if DIED in text or without:
            break
    if not server.server_is_ready():
        return f'no node patrol with an action came. {printed(workspace, program.lines)}'
    if not is_ready():
        return f'nobody drives the robot. {printed(workspace, program.lines)}'
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


# --- What stops the robot

ENDS = 'Ctrl+C', 'patrol crashes', 'the laser is blind', 'the guard crashes'
QUIET = ['--ros-args', '--disable-rosout-logs']  # which line comes first is an accident
ON_A_TURTLEBOT = [
    *(*QUIET, '-r', 'imu/data:=imu', '-r', 'cmd_vel:=cmd_vel_wanted'),
    *('-p', 'route:=[3.0, 0.0]', '-p', 'speed:=0.2', '-p', 'full_battery:=100.0'),
]
LIMIT_S = 20.0


class Ended(NamedTuple):
    """What a robot did after an end: whether it stands, and how far and how long it went on."""

    robot: Robot
    stands: bool
    metres: float
    seconds: float


def ended_by(workspace, end):
    """Drive a TurtleBot 3 with patrol and guard, end something, and return what the robot did.

    `end` is one of `ENDS`. Without a guard it is watched for two seconds. Raises RuntimeError if
    the robot does not come to drive.
    """
    with ros_session() as session, contextlib.ExitStack() as programs:
        robot, client = Robot(CORRIDOR, driver=TURTLEBOT3), Node('client')
        server = ActionClient(client, action(), 'patrol')
        session.spin(spun(client))
        guard = programs.enter_context(workspace.run('patrol_pkg', 'guard', *QUIET))
        patrol = programs.enter_context(workspace.run('patrol_pkg', 'patrol', *ON_A_TURTLEBOT))

        def drives():
            if server.server_is_ready() and robot.pose.x == CORRIDOR.start.x:
                send_goal(session, server, 1)  # refused, as long as the battery has not spoken
            return robot.record.poses[-1].v > 0.15

        limit_s = robot.t_s + LIMIT_S
        while not drives():
            if robot.t_s > limit_s or not (guard.running and patrol.running):
                lines = [*guard.lines, *patrol.lines, 'nothing'][-1]
                raise RuntimeError(f'The robot does not drive. The programs printed: {lines}')
            robot.run(0.2)
        since_s = robot.t_s
        if end == 'the laser is blind':
            robot.blind = True
        elif end == 'the guard crashes':
            os.kill(guard.pid, signal.SIGKILL)
        else:
            os.kill(patrol.pid, signal.SIGINT if end == 'Ctrl+C' else signal.SIGKILL)
        # It must stand before the other programs end, which stop it, too.
        limit_s = 2.0 if end == 'the guard crashes' else LIMIT_S
        stands = robot.run(limit_s, until=lambda: robot.stopped)
        moves = [step for step in robot.record.poses if step.t_s > since_s and (step.v or step.w)]
    return Ended(robot, stands, sum(step.v for step in moves) / RATE_HZ, len(moves) / RATE_HZ)


def driven_live(workspace, file):
    """Build, and drive a robot on the student's floor with the launched program, in real time.

    `file` is the floor, in the package; its route has the same name. Return the robot.
    """
    path = workspace.file(f'{PACKAGE}/{file}')
    floor = Floor.from_text(path.read_text(encoding='utf-8'), name=path.stem)
    build(workspace, 'patrol_pkg')
    with ros_session() as session:
        robot, client = Robot(floor), Node('client')
        watch(robot)
        server = ActionClient(client, action(), 'patrol')
        session.spin(spun(client))
        arguments = f'patrol.launch.xml floor:={path.stem} robot:=false'
        with workspace.start(LAUNCH + arguments, 'program') as program:
            robot.run(LIMIT_S, until=lambda: server.server_is_ready() or not program.running)
            robot.run(2.0)  # until the battery has spoken
            if not server.server_is_ready():
                print(printed(workspace, program.lines))
                return robot
            places = len(route_of(path.with_suffix('.yaml')))
            goal = send_goal(session, server, places)
            if goal is None or not goal.accepted:
                print('The goal is refused.' if goal else 'The goal gets no answer.')
                return robot
            ended = goal.get_result_async()
            robot.run(120, until=lambda: ended.done() or robot.bumps)
            robot.run(1.0)
    print(STATUS[ended.result().status] if ended.done() else 'not ended', 'bumps:', robot.bumps)
    return robot


def route_of(path):
    """Return the places of a parameter file: x, y (m, from the start)."""
    parameters = yaml.safe_load(path.read_text(encoding='utf-8'))
    (node,) = parameters.values()
    route = node['ros__parameters']['route']
    return list(zip(route[::2], route[1::2], strict=True))


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
