"""Stamps, orientations, the ends of goals: what lessons read of messages, and do not teach."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from action_msgs.msg import GoalStatus
from rclpy.time import Time

if TYPE_CHECKING:
    from builtin_interfaces.msg import Time as Stamp
    from geometry_msgs.msg import Quaternion

START_NS = 1_000_000_000  # the stamp of second 0 of a drive
# How a goal of an action has ended:
STATUS = {
    GoalStatus.STATUS_SUCCEEDED: 'SUCCEEDED',
    GoalStatus.STATUS_CANCELED: 'CANCELED',
    GoalStatus.STATUS_ABORTED: 'ABORTED',
}


def stamp_of(t: float) -> Stamp:
    """Return the stamp of a time of the drive (s)."""
    return Time(nanoseconds=START_NS + round(t * 1e9)).to_msg()


def seconds_of(stamp: Stamp) -> float:
    """Return the time of the drive (s) of a stamp."""
    return (Time.from_msg(stamp).nanoseconds - START_NS) / 1e9


def quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return an orientation, from three angles (rad): about x first, then y, then z."""
    from geometry_msgs.msg import Quaternion

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
