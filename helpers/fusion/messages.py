"""Messages of a drive on a floor: what the lessons write and read of them, and do not teach."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
from builtin_interfaces.msg import Time as Stamp
from geometry_msgs.msg import Quaternion
from nav_msgs.msg import Odometry
from rclpy.time import Time

START_NS = 1_000_000_000  # the stamp of second 0 of a drive
ON_THE_FLOOR = np.ix_([0, 1, 5], [0, 1, 5])  # x, y and yaw of the six
TINY = 1e-9  # the variance of what is zero on a floor: z, roll and pitch


def stamp_of(t: float) -> Stamp:
    """Return the stamp of a time of the drive (s)."""
    return Time(nanoseconds=START_NS + round(t * 1e9)).to_msg()


def seconds_of(stamp: Stamp) -> float:
    """Return the time of the drive (s) of a stamp."""
    return (Time.from_msg(stamp).nanoseconds - START_NS) / 1e9


def quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return an orientation, from three angles (rad): about x first, then y, then z."""
    cr, cp, cy = (math.cos(angle / 2) for angle in (roll, pitch, yaw))
    sr, sp, sy = (math.sin(angle / 2) for angle in (roll, pitch, yaw))
    return Quaternion(
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
        w=cr * cp * cy + sr * sp * sy,
    )


def yaw_of(orientation: Quaternion) -> float:
    """Return the yaw (rad) of a robot on a floor, whose roll and pitch are zero."""
    return 2 * math.atan2(orientation.z, orientation.w)


def odometry_message(
    t: float,
    frame: str,
    state: Sequence[float],
    pose_covariance: np.ndarray,
    twist_covariance: np.ndarray,
) -> Odometry:
    """Return the message of a pose in `frame` and of a speed in base_footprint.

    `state` begins with x, y (m), yaw (rad), vx, vy (m/s) and vyaw (rad/s), in the order of STATE.
    The covariances (3, 3) are those of the first and of the last three.
    """
    x, y, yaw, vx, vy, vyaw = map(float, state[:6])
    message = Odometry(child_frame_id='base_footprint')
    message.header.stamp, message.header.frame_id = stamp_of(t), frame
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation = quaternion(0, 0, yaw)
    message.twist.twist.linear.x, message.twist.twist.linear.y = vx, vy
    message.twist.twist.angular.z = vyaw
    message.pose.covariance = _six_by_six(pose_covariance)
    message.twist.covariance = _six_by_six(twist_covariance)
    return message


def _six_by_six(covariance: np.ndarray) -> np.ndarray:
    """Return the covariance of x, y, yaw (3, 3) as a message has it: 36 numbers, row by row."""
    full = TINY * np.eye(6)
    full[ON_THE_FLOOR] = covariance
    return full.ravel()


def from_odometry(message: Odometry) -> list[tuple[tuple, tuple, np.ndarray]]:
    """Return what `ExtendedKalmanFilter.process` takes of a message of the wheels: the speeds."""
    twist = message.twist.twist
    covariance = np.reshape(message.twist.covariance, (6, 6))[ON_THE_FLOOR]
    return [(('vx', 'vy', 'vyaw'), (twist.linear.x, twist.linear.y, twist.angular.z), covariance)]


def table_of(messages: Iterable[Odometry]) -> pd.DataFrame:
    """Return the poses of messages: t (s), x, y (m), yaw (rad), var_x, cov_x_y, var_y (m^2)."""
    rows = []
    for message in messages:
        pose, covariance = message.pose.pose, message.pose.covariance
        place = pose.position.x, pose.position.y, yaw_of(pose.orientation)
        t = seconds_of(message.header.stamp)
        rows.append((t, *place, covariance[0], covariance[1], covariance[7]))
    return pd.DataFrame(rows, columns=['t', 'x', 'y', 'yaw', 'var_x', 'cov_x_y', 'var_y'])
