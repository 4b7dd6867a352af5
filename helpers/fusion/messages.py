"""What a filter reads of messages, and what a table keeps of its own."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd
from nav_msgs.msg import Odometry

from helpers.robot import ON_THE_FLOOR
from helpers.ros import seconds_of, yaw_of


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
