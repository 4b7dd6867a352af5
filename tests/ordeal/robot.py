"""What is beside a program: a robot whose sensors can be troubled, and others that speak."""

from __future__ import annotations

import copy
import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.time import Time
from sensor_msgs.msg import BatteryState, Imu, LaserScan, Range

from helpers.robot import KIND, TURTLEBOT3, Driver, Robot, speeds_of
from helpers.robot.robot import command_type

UNTIMED = KIND.but(name='untimed', command_timeout_s=None)
BASES = {'kind': KIND, 'untimed': UNTIMED, 'turtlebot3': TURTLEBOT3}
REMEMBERED_S = 20.0  # what an old message may be
BEAM = math.radians(5)  # half the width of what a range finder sees

Change = Callable[[Any], Any]  # what a message becomes; None: it is not said


def base_of(name: str, stamped: bool) -> Driver:
    """Return the drivers of a base, with the type of commands that the program publishes."""
    driver = BASES[name]
    return driver if driver is TURTLEBOT3 else driver.but(stamped_commands=stamped)


class TroubledRobot(Robot):
    """A robot between whose sensors and topics something can be changed.

    `changes` has, by topic, what each message becomes. `said` keeps the messages of the last
    `REMEMBERED_S` seconds, with the time (monotonic) of each. It has a range finder as well, for
    programs that hear `range`.
    """

    def __init__(self, *arguments, **options) -> None:
        self.changes: dict[str, Change] = {}
        self.said: dict[str, deque[tuple[float, Any]]] = {}
        super().__init__(*arguments, **options)

    def _make_topics(self) -> None:
        super()._make_topics()
        self._topics['range'] = self._publisher(Range, 'range')

    def _say(self, topic: str, message: Callable) -> None:
        if topic == 'scan':
            self._say('range', self._range)
        publisher = self._topics.get(topic)
        if publisher is None or topic == '/tf':
            return
        if not publisher.get_subscription_count() and topic not in self.changes:
            return
        made, now_s = message(), time.monotonic()
        said = self.said.setdefault(topic, deque())
        said.append((now_s, made))
        while said[0][0] < now_s - REMEMBERED_S:
            said.popleft()
        if topic in self.changes:
            made = self.changes[topic](copy.deepcopy(made))
        if made is not None:
            publisher.publish(made)

    def _range(self) -> Range:
        x, y, yaw = self.pose
        angles = yaw + np.linspace(-BEAM, BEAM, 11)
        ahead = float(self.floor.ranges(x, y, angles)[0].min())
        message = Range(header=self._header('base_scan'), min_range=0.1, max_range=4.0)
        message.range = ahead if ahead <= 4.0 else math.inf
        return message


def spoilt(message: Any) -> Any:
    """Return a message whose numbers are all NaN."""
    nan = math.nan
    match message:
        case LaserScan():
            message.ranges = [nan] * len(message.ranges)
        case Range():
            message.range = nan
        case BatteryState():
            message.percentage = message.voltage = nan
        case Imu():
            turned = message.orientation
            turned.x = turned.y = turned.z = turned.w = nan
            message.angular_velocity.z = nan
        case Odometry():
            turned, place = message.pose.pose.orientation, message.pose.pose.position
            turned.x = turned.y = turned.z = turned.w = place.x = place.y = nan
            message.twist.twist.linear.x = message.twist.twist.angular.z = nan
    return message


def emptied(message: Any) -> Any:
    """Return a message as one is that nobody has filled in, with its header."""
    return type(message)(header=message.header)


def stamped(message: Any, nanoseconds: int) -> Any:
    """Return a message with another stamp."""
    message.header.stamp = Time(nanoseconds=max(0, nanoseconds)).to_msg()
    return message


class Second:
    """A second node that speaks on a topic: a message, again and again, with stamps of now."""

    def __init__(self, robot: Robot, topic: str, message: Any, qos: QoSProfile) -> None:
        self.message = message
        self.node = Node('second', context=robot.context)
        self.publisher = self.node.create_publisher(type(message), topic, qos)
        self.last_s = 0.0

    def speak(self, every_s: float = 0.1) -> None:
        """Say it, if it is time."""
        if time.monotonic() - self.last_s >= every_s:
            self.last_s = time.monotonic()
            if hasattr(self.message, 'header'):
                self.message.header.stamp = self.node.get_clock().now().to_msg()
            self.publisher.publish(self.message)

    def end(self) -> None:
        self.node.destroy_node()


def voice(robot: Robot, v: float) -> Second:
    """Return a second node on `cmd_vel`, which wants to drive at a speed (m/s)."""
    message = command_type(robot.driver)()
    speeds_of(message).linear.x = v
    return Second(robot, 'cmd_vel', message, QoSProfile(depth=1))
