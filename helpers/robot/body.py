"""The body of the robot: how it moves when it is told a speed, by a few lines of arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterable

from helpers.robot.drivers import KIND, Driver
from helpers.robot.floor import Floor, Pose
from helpers.robot.record import Command

RATE_HZ = 50
# Of the course's robot: a TurtleBot 3 Burger is as large, and drives 0.2 m/s, slow to look at.
RADIUS_M, MAX_SPEED, MAX_TURN = KIND.radius_m, KIND.max_speed, KIND.max_turn
# Nav2 drives a TurtleBot 3 with these limits: acc_lim_x and acc_lim_theta of its parameters.
MAX_ACCELERATION = 2.5  # m/s^2
MAX_TURN_ACCELERATION = 3.2  # rad/s^2
FREE_AGAIN_M = 0.005  # so far from what it touched, the next touch is another bump


class Body:
    """A disc on two wheels. It moves 50 times a second, in steps of the same 0.02 s.

    A step changes speed and turning rate towards the last command, as fast as the limits allow. It
    drives an arc with their means over the step: so a straight start or stop is exactly
    v^2 / (2 a) long. Where it would enter a wall it goes as far as to touch it, and stops; it can
    still turn, and drive away. When its drivers no longer count a command, it brakes.

    A step ends outside of all walls. One that only grazes a corner on its way, by less than half a
    millimetre, is free. It does not slide, tip or push: that is the work of a physics engine.
    """

    def __init__(self, floor: Floor, start: Pose | None = None, driver: Driver = KIND) -> None:
        self.floor, self.pose, self.driver = floor, start or floor.start, driver
        if not floor.clearance(self.pose.x, self.pose.y) >= driver.radius_m:
            raise ValueError(
                f'The robot would start in a wall at {self.pose.x:g}, {self.pose.y:g} m: choose a '
                f'start that is {driver.radius_m} m or more from all walls and boxes.'
            )
        self.step_number = 0
        self.v = self.w = self.ax = 0.0
        self.bumps = 0
        self.touching = False
        self.command = Command(-math.inf, 0.0, 0.0)
        self.watched = False  # the watchdog has stopped it
        self._free_m = 0.0  # so far it can go without a look at the walls

    @property
    def t_s(self) -> float:
        """The time of the body (s), from the number of its steps."""
        return self.step_number / RATE_HZ

    def step(self, commands: Iterable[Command] = ()) -> None:
        """Move on by a step. `commands` have arrived since the last one; the last one counts."""
        for t_s, v, w in commands:
            self.command = Command(t_s, self.driver.heard(v), self.driver.heard(w))
            self.watched = False
        now_s, (_, v, w) = self.t_s, self.command
        if now_s - self.command.t_s >= self.driver.timeout_s:
            self.watched, v, w = math.isfinite(self.command.t_s), 0.0, 0.0
        old_v, old_w = self.v, self.w
        self.v = _towards(old_v, _within(v, self.driver.max_speed), MAX_ACCELERATION / RATE_HZ)
        self.w = _towards(old_w, _within(w, self.driver.max_turn), MAX_TURN_ACCELERATION / RATE_HZ)
        self._move((old_v + self.v) / 2, (old_w + self.w) / 2)
        self.ax = (self.v - old_v) * RATE_HZ
        self.step_number += 1

    def _move(self, v: float, w: float) -> None:
        length = abs(v) / RATE_HZ
        if length < self._free_m and not self.touching:
            self._free_m -= length
            self.pose = arc(self.pose, v, w, 1 / RATE_HZ)
            return
        end = arc(self.pose, v, w, 1 / RATE_HZ)
        gap = self.floor.clearance(end.x, end.y) - self.driver.radius_m
        if gap >= 0 or not length:
            self.touching = self.touching and gap < FREE_AGAIN_M
            self.pose, self._free_m = end, max(0.0, gap)
            return
        free, blocked = 0.0, 1.0  # parts of the step
        while (half := (free + blocked) / 2) not in (free, blocked):
            at = arc(self.pose, v, w, half / RATE_HZ)
            if self.floor.clearance(at.x, at.y) >= self.driver.radius_m:
                free = half
            else:
                blocked = half
        at = arc(self.pose, v, w, free / RATE_HZ)
        self.pose, self.v, self._free_m = Pose(at.x, at.y, end.yaw), 0.0, 0.0
        self.bumps += not self.touching
        self.touching = True


def arc(pose: Pose, v: float, w: float, seconds: float) -> Pose:
    """Return where a robot comes with constant speed (m/s) and turning rate (rad/s)."""
    x, y, yaw = pose
    turn = w * seconds
    # The chord of the arc: sin(a) / a times its length, in the direction of its middle.
    half = turn / 2
    chord = v * seconds * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
    return Pose(
        x + chord * math.cos(yaw + half),
        y + chord * math.sin(yaw + half),
        wrapped(yaw + turn),
    )


def wrapped(angle: float) -> float:
    return math.remainder(angle, math.tau)


def _within(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def _towards(value: float, target: float, most: float) -> float:
    left = target - value
    # Ten times a tenth is not one: what is left of rounding is no step of its own.
    return target if abs(left) <= most * (1 + 1e-9) else value + math.copysign(most, left)
