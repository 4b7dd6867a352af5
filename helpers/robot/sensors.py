"""What the robot's sensors say: the truth, with the errors of `helpers.fusion.simulate`."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from helpers.fusion.drives import SLIP_SPEED, said
from helpers.fusion.settings import chosen
from helpers.fusion.tables import VARIANCES
from helpers.robot.body import RATE_HZ, Body, arc
from helpers.robot.floor import Pose

ANGLES = np.radians(np.arange(-90.0, 91.0))  # of the beams: right, ahead (number 90), left
RANGE_MIN, RANGE_MAX = 0.1, 8.0  # m; the robot that touches a wall sees it at 0.11 m
LASER_SIGMA = 0.01  # m
EXACT = {'vx': 'vx', 'vyaw': 'vyaw', 'imu_yaw': 'yaw', 'imu_vyaw': 'vyaw', 'ax': 'ax', 'ay': 'ay'}
EXACT |= {'gps_x': 'x', 'gps_y': 'y'}
SIGMA = np.sqrt([VARIANCES['ax' if name == 'ay' else name] for name in EXACT])


class Sensors:
    """The sensors. The seed decides their errors: those of step k are those of row k of `simulate`.

    `slip` (from, to in s) is when the wheels slip, as in `simulate`. Without noise, the sensors
    have no errors at all. `mounting` says by which yaw (rad) the frames `imu_link` and `base_scan`
    are turned on the robot. `odometry` is where the wheels think that the robot is, from its start.
    """

    def __init__(
        self,
        seed: int,
        noise: bool,
        slip: tuple[float, float] | None,
        mounting: Mapping[str, float] | None = None,
    ) -> None:
        mounting = chosen('mounting', mounting, ('imu_link', 'base_scan'))
        self._imu_yaw, self._laser_yaw = mounting.get('imu_link', 0), mounting.get('base_scan', 0)
        self._noise, self._slip = noise, slip or (math.inf, math.inf)
        self._rng, self._laser_rng = np.random.default_rng(seed), np.random.default_rng([seed, 1])
        self._said: dict[str, float] = {}
        self.odometry = Pose(0.0, 0.0, 0.0)

    def read(self, body: Body) -> dict[str, float]:
        """Return what wheels, IMU and GPS say after a step of the body: a row of `simulate`."""
        x, y, yaw = body.pose
        truth = {'x': x, 'y': y, 'yaw': yaw, 'vx': body.v, 'vyaw': body.w, 'ax': body.ax}
        truth['ay'] = body.v * body.w
        if self._noise:
            slipping = SLIP_SPEED * (self._slip[0] <= body.t_s < self._slip[1])
            values = said(truth, slipping, self._imu_yaw)
            for name, error in zip(EXACT, self._rng.normal(0, SIGMA).tolist(), strict=True):
                values[name] += error
        else:
            values = {name: truth[of] for name, of in EXACT.items()}
            turned = said(truth, imu_mounting=self._imu_yaw)
            values |= {name: turned[name] for name in ('imu_yaw', 'ax', 'ay')}
        if self._said:  # as the body moves: with the means over the step
            v, w = ((values[name] + self._said[name]) / 2 for name in ('vx', 'vyaw'))
            self.odometry = arc(self.odometry, v, w, 1 / RATE_HZ)
        self._said = values
        return values

    def scan(self, body: Body) -> np.ndarray:
        """Return the ranges (181,), float32. As REP 117 has it, too far is inf, too near -inf."""
        x, y, yaw = body.pose
        ranges, _ = body.floor.ranges(x, y, yaw + self._laser_yaw + ANGLES)
        if self._noise:
            ranges = ranges + self._laser_rng.normal(0, LASER_SIGMA, len(ANGLES))
        ranges[ranges > RANGE_MAX] = np.inf
        ranges[ranges < RANGE_MIN] = -np.inf
        return ranges.astype(np.float32)
