"""A simulated drive: what imperfect sensors say, and apart from it, what is true."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pandas as pd

from helpers.fusion.filter import STATE
from helpers.robot import RATE_HZ, SLIP_SPEED, VARIANCES, without_noise

GPS_EVERY = 50  # rows


class Drive(NamedTuple):
    """A simulated drive: what the sensors said, and apart from it, what was true."""

    measurements: pd.DataFrame
    truth: pd.DataFrame


def simulate(
    seed: int,
    seconds: float = 120.0,
    *,
    slip: tuple[float, float] | None = None,
    slip_speed: float = SLIP_SPEED,
    imu_mounting: float = 0.0,
) -> Drive:
    """Drive a unicycle for some seconds, and return what its sensors say and what is true.

    The robot starts at 0, 0 towards x, speeds up for two seconds, then swings between forwards and
    backwards, and turns left and right: the path of the drives in tests/data. Wheels and IMU speak
    50 times a second, GPS once. The noise of each column is white and normal with VARIANCES. So GPS
    is off by sigma = 0.5 m along each axis, 0.71 m in the plane; the errors of a real GPS last for
    minutes. The seed decides the noise, nothing else.

    Not all is noise: the wheels report 4 % too much speed, 5 % too much turning and 0.012 rad/s
    besides, the gyro 0.002 rad/s too much. While the wheels slip (`slip`: from, to in s) they
    report `slip_speed` m/s more than the robot moves. The IMU is mounted turned by `imu_mounting`
    rad, and reports in its own frame.

    Returns `Drive(measurements, truth)`. The measurements have the columns that `fuse` reads, and
    `ay`, the IMU's other acceleration (m/s^2), which a turned IMU needs; there is no gravity in
    them. The truth has `t` and the columns of STATE, with the centripetal acceleration as `ay`.
    """
    t = np.arange(round(seconds * RATE_HZ) + 1) / RATE_HZ
    truth = _path(t)
    rng = np.random.default_rng(seed)
    measurements = pd.DataFrame(without_noise(truth, slip_speed * _during(slip, t), imu_mounting))
    sigma = np.sqrt([VARIANCES['ax' if name == 'ay' else name] for name in measurements])
    measurements += rng.normal(0, sigma, measurements.shape)
    measurements['imu_yaw'] = _angle(measurements['imu_yaw'])
    measurements.insert(0, 't', t)
    measurements.loc[np.arange(len(t)) % GPS_EVERY > 0, ['gps_x', 'gps_y']] = np.nan
    return Drive(measurements, truth)


def _during(interval: tuple[float, float] | None, t: np.ndarray) -> np.ndarray:
    """Return which of the times lie in the interval; its end does not."""
    start, end = interval or (math.inf, math.inf)
    return (start <= t) & (t < end)


def _path(t: np.ndarray) -> pd.DataFrame:
    """Return the truth at the times `t`: speed and turning rate are given, the rest integrated."""

    def speed(t):
        return 0.5 * np.minimum(t, 2) + 0.75 * (np.sin(0.4 * t) - math.sin(0.8)) * (t > 2)

    def yaw(t):
        return 0.05 * t + 1.5 * (1 - np.cos(0.2 * t))

    between = (t[1:] + t[:-1]) / 2
    steps = np.diff(t) * speed(between) * np.array([np.cos(yaw(between)), np.sin(yaw(between))])
    x, y = np.concatenate([np.zeros((2, 1)), np.cumsum(steps, axis=1)], axis=1)
    vx, vyaw = speed(t), 0.05 + 0.3 * np.sin(0.2 * t)
    ax = np.where(t <= 2, 0.5, 0.3 * np.cos(0.4 * t))
    columns = x, y, _angle(yaw(t)), vx, np.zeros(len(t)), vyaw, ax, vx * vyaw
    return pd.DataFrame({'t': t} | dict(zip(STATE, columns, strict=True)))


def _angle(radians):
    """Return the same angle between -pi and pi."""
    return radians - math.tau * np.round(radians / math.tau)
