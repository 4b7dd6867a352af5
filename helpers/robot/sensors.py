"""What the robot's sensors say: the truth, with their errors.

Wheels and gyro are wrong in the same way each time, and each sensor has its noise. `simulate` of
`helpers.fusion` makes whole tables of the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from helpers.notebook import chosen
from helpers.robot.body import RATE_HZ, Body, arc, wrapped
from helpers.robot.drivers import KIND, Driver
from helpers.robot.floor import Pose

# The variance of the noise of each number, per axis. `vy` is never measured: wheels that cannot
# move sideways say 0.
VARIANCES = {
    'vx': 0.0025,
    'vy': 0.01,
    'vyaw': 0.0025,
    'imu_yaw': 0.0004,
    'imu_vyaw': 0.0001,
    'ax': 0.01,
    'gps_x': 0.25,
    'gps_y': 0.25,
}
# What the wheels say: so many times the speed, so many times the turning rate, and so much more.
WHEEL_SCALE = 1.04
TURN_SCALE = 1.05
TURN_BIAS = 0.012  # rad/s
GYRO_BIAS = 0.002  # rad/s
SLIP_SPEED = 0.5  # m/s, what the wheels say too much while they slip
ANGLES = np.radians(np.arange(-90.0, 91.0))  # of the beams: right, ahead (number 90), left
# Of an LDS-02: 2300 measurements a second, here in about ten turns a second; it varies by 2 %. So a
# scan has 226 to 235 beams; on other robots 240 to 260 were counted.
LD08_MEASUREMENTS_HZ, LD08_TURN_HZ, LD08_VARIES = 2300, 10.0, 0.02
LD08_RANGE_MIN, LD08_RANGE_MAX = 0.16, 8.0  # m
LD08_LOST = 0.02  # so many beams of a scan do not come back, from what is dark or shiny: a guess
RANGE_MIN, RANGE_MAX = 0.1, 8.0  # m; the robot that touches a wall sees it at 0.11 m
LASER_SIGMA = 0.01  # m
EXACT = {'vx': 'vx', 'vyaw': 'vyaw', 'imu_yaw': 'yaw', 'imu_vyaw': 'vyaw', 'ax': 'ax', 'ay': 'ay'}
EXACT |= {'gps_x': 'x', 'gps_y': 'y'}
SIGMA = np.sqrt([VARIANCES['ax' if name == 'ay' else name] for name in EXACT])


def without_noise(truth: Mapping, slipping=0.0, imu_mounting: float = 0.0) -> dict:
    """Return what the sensors would say without noise, of a moment (numbers) or of many (columns).

    `truth` has x, y, yaw, vx, vyaw, ax and ay; `slipping` is what the wheels say too much (m/s).
    """
    cos, sin = math.cos(imu_mounting), math.sin(imu_mounting)
    return {
        'vx': WHEEL_SCALE * truth['vx'] + slipping,
        'vyaw': TURN_SCALE * truth['vyaw'] + TURN_BIAS,
        'imu_yaw': truth['yaw'] + imu_mounting,
        'imu_vyaw': truth['vyaw'] + GYRO_BIAS,
        'ax': cos * truth['ax'] + sin * truth['ay'],
        'ay': cos * truth['ay'] - sin * truth['ax'],
        'gps_x': truth['x'],
        'gps_y': truth['y'],
    }


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
        driver: Driver = KIND,
    ) -> None:
        self._driver = driver
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
            values = without_noise(truth, slipping, self._imu_yaw)
            for name, error in zip(EXACT, self._rng.normal(0, SIGMA).tolist(), strict=True):
                values[name] += error
        else:
            values = {name: truth[of] for name, of in EXACT.items()}
            turned = without_noise(truth, imu_mounting=self._imu_yaw)
            values |= {name: turned[name] for name in ('imu_yaw', 'ax', 'ay')}
        if self._said:  # as the body moves: with the means over the step
            v, w = ((values[name] + self._said[name]) / 2 for name in ('vx', 'vyaw'))
            if self._driver.odometry_by_imu:
                w = wrapped(values['imu_yaw'] - self._said['imu_yaw']) * RATE_HZ
            self.odometry = arc(self.odometry, v, w, 1 / RATE_HZ)
        self._said = values
        return values

    def scan(self, body: Body) -> tuple[np.ndarray, float, float]:
        """Return the ranges (beams,), float32, the angle of the first, and from beam to beam (rad).

        From the laser 'half' there are 181 beams: as REP 117 has it, too far is inf, too near -inf.
        From 'ld08' they go all around, as many as there are, and what does not come back is NaN.
        """
        if self._driver.laser == 'ld08':
            return self._ld08(body)
        ranges = self._measured(body, ANGLES)
        ranges[ranges > RANGE_MAX] = np.inf
        ranges[ranges < RANGE_MIN] = -np.inf
        return ranges.astype(np.float32), float(ANGLES[0]), math.radians(1)

    def _ld08(self, body: Body) -> tuple[np.ndarray, float, float]:
        turn_hz, first = LD08_TURN_HZ, 0.0
        if self._noise:
            turn_hz *= 1 + self._laser_rng.uniform(-LD08_VARIES, LD08_VARIES)
        step = math.tau * turn_hz / LD08_MEASUREMENTS_HZ
        if self._noise:
            first = self._laser_rng.uniform(0, step)
        angles = np.arange(first, math.tau, step)
        ranges = self._measured(body, angles)
        ranges[(ranges < LD08_RANGE_MIN) | (ranges > LD08_RANGE_MAX)] = np.nan
        if self._noise:
            ranges[self._laser_rng.random(len(angles)) < LD08_LOST] = np.nan
        return ranges.astype(np.float32), first, step

    def _measured(self, body: Body, angles: np.ndarray) -> np.ndarray:
        x, y, yaw = body.pose
        ranges, _ = body.floor.ranges(x, y, yaw + self._laser_yaw + angles)
        if self._noise:
            ranges = ranges + self._laser_rng.normal(0, LASER_SIGMA, len(angles))
        return ranges
