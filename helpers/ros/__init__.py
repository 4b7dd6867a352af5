"""A ROS session in a kernel: its domain, its threads, its log, and what is not connected."""

from helpers.ros.connections import NOT_OF_A_LESSON, nearly
from helpers.ros.conversions import START_NS, STATUS, quaternion, seconds_of, stamp_of, yaw_of
from helpers.ros.domain import change_domain_id, remove_dead_segments
from helpers.ros.executors import spin_each, spun
from helpers.ros.fork import fork
from helpers.ros.program import run_program
from helpers.ros.session import (
    Session,
    current_session,
    find,
    graph_environment,
    leave_ros,
    ros_session,
)

__all__ = [
    'NOT_OF_A_LESSON',
    'START_NS',
    'STATUS',
    'Session',
    'change_domain_id',
    'current_session',
    'find',
    'fork',
    'graph_environment',
    'leave_ros',
    'nearly',
    'quaternion',
    'remove_dead_segments',
    'ros_session',
    'run_program',
    'seconds_of',
    'spin_each',
    'spun',
    'stamp_of',
    'yaw_of',
]
