"""Drives in simulated time and in this process: of a part of the program, or of its whole node."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Log
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import Imu, LaserScan

from helpers.patrol.program import PACKAGE, SIM, action, module
from helpers.robot import EMPTY, KIND, ROOMS, Driver, Floor, Pose, Robot
from helpers.ros import STATUS, ros_session, spun
from helpers.workspace import Workspace

# A watchdog has a steady clock. Where simulated time passes, a scan may take long to come.
PATIENT = Parameter('timeout_s', value=60.0)
CIRCLE, SNAKE = [(0.3, 0.2)] * 600, [(0.5, 0.9 * math.sin(k / 9)) for k in range(120)]
DEGREES = np.arange(-90.0, 91.0)
CUT = ['--ros-args', '-r', 'scan:=laser']
CABLES = {'scan': (LaserScan, 'laser'), 'odom': (Odometry, 'wheels'), 'imu/data': (Imu, 'gyro')}
LEVELS = {10: 'debug', 20: 'information', 30: 'warning', 40: 'error', 50: 'fatal'}


def drive(
    floor: Floor,
    make_node: Callable[..., Node],
    seconds: float,
    start: Pose | None = None,
    driver: Driver = KIND,
    blind_after_s: float = math.inf,
) -> Robot:
    """Drive a robot with a node for some seconds of simulated time, and return the robot."""
    with ros_session():
        robot = Robot(floor, start=start, driver=driver, sim_time=True)
        executor = spun(make_node(parameter_overrides=SIM))
        robot.run(min(seconds, blind_after_s), executor)
        if blind_after_s < seconds:
            robot.blind = True
            robot.run(seconds - blind_after_s, executor)
    return robot


def estimated(
    make: Callable[[Node], object], commands: Sequence[tuple[float, float]]
) -> tuple[object, tuple[float, float], float]:
    """Drive a robot by remote control, beside a part of the program that `make(node)` returns.

    A command, 0.1 s long, is m/s and rad/s.

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


def steered(
    workspace: Workspace, floor: Floor, places: Sequence[tuple[float, float]], seconds: float
) -> tuple[Robot, int]:
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
    """A cable from a sensor to the program: for scans, which the program then hears on `laser`.

    It can be unplugged. `change(message)` returns what it carries in place of a message.
    """

    def __init__(self, topic: str = 'scan') -> None:
        kind, end = CABLES[topic]
        super().__init__(f'cable_of_{end}')
        self.plugged, self.change = True, lambda message: message
        self.end = self.create_publisher(kind, end, 1)
        self.create_subscription(kind, topic, self.on_message, 1)

    def on_message(self, message: LaserScan | Odometry | Imu) -> None:
        """Pass a message on."""
        if self.plugged:
            self.end.publish(self.change(message))


class Ear(Node):
    """Keeps what the learner's nodes log: level and text."""

    def __init__(self) -> None:
        super().__init__('ear')
        self.heard = []
        self.create_subscription(Log, '/rosout', self.on_log, 100)

    def on_log(self, log: Log) -> None:
        """Keep a record of a node of the learner."""
        if log.name in ('tested', 'patrol'):
            self.heard.append((LEVELS[log.level], log.msg))


class Tour:
    """The whole node, a robot in simulated time, a client and cables. Make it in a session.

    `cables` has one for each of `scan`, `odom` and `imu/data`; those of `silent` are unplugged.
    """

    def __init__(
        self,
        workspace: Workspace,
        *options: Parameter,
        floor: Floor = ROOMS,
        route: Sequence[float] | None = (3.5, 0.0, 6.5, 0.0),
        arguments: Sequence[str] = (),
        silent: Sequence[str] = (),
    ) -> None:
        values = [*SIM, *options] + ([Parameter('route', value=list(route))] if route else [])
        if 'timeout_s' not in [option.name for option in options]:
            values.append(PATIENT)
        self.robot, self.ear = Robot(floor, sim_time=True), Ear()
        self.cables = {topic: Cable(topic) for topic in CABLES}
        for topic in silent:
            self.cables[topic].plugged = False
        cut = [word for topic, (_, end) in CABLES.items() for word in ('-r', f'{topic}:={end}')]
        arguments = ['--ros-args', *cut, *arguments]
        patrol = module(workspace, 'patrol').Patrol
        self.node = patrol(parameter_overrides=values, cli_args=arguments)
        self.client, self.result = ActionClient(self.ear, action(), 'patrol'), None
        self.executor = spun(self.node, *self.cables.values(), self.ear)
        self.run(1.0)

    def run(self, seconds: float, until: Callable[[], object] = lambda: False) -> bool:
        """Let simulated time go on."""
        return self.robot.run(seconds, self.executor, until=until)

    def wait(self, condition: Callable[[], object], limit_s: float = 10.0) -> bool:
        """Let time go on until a condition holds, also that of timers with a clock of their own.

        Return whether it does within `limit_s` seconds.
        """
        limit = time.monotonic() + limit_s
        while not condition() and time.monotonic() < limit:
            time.sleep(0.02)
            self.run(0.02)
        return bool(condition())

    def send(self, places: int) -> bool:
        """Send a goal. Return whether it was accepted. Raises RuntimeError if no answer comes."""
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

    def ended(self) -> bool:
        """Return whether the job has ended."""
        return self.result is not None and self.result.done()

    def status(self) -> str:
        """Return how the job has ended."""
        return STATUS[self.result.result().status] if self.ended() else 'not ended'

    def speeds(self, since_s: float) -> list[tuple[float, float]]:
        """Return the commands, m/s and rad/s, since then (s, simulated time)."""
        commands = self.robot.record.commands
        return [(command.v, command.w) for command in commands if command.t_s > since_s]


def round_tour(workspace: Workspace, floor: Floor = ROOMS, file: str = 'rooms') -> tuple[Tour, int]:
    """Drive the route of a file in config. Return the tour and the number of its places."""
    path = str(workspace.file(f'{PACKAGE}/config/{file}.yaml'))
    with ros_session():
        tour = Tour(workspace, floor=floor, route=None, arguments=['--params-file', path])
        places = len(tour.node.job.places) if hasattr(tour.node, 'job') else 0
        tour.send(places)
        tour.run(90, until=lambda: tour.ended() or tour.robot.bumps)
        tour.outcome = tour.status()
    return tour, places
