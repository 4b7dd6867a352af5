"""A ROS session in a kernel: its domain, its threads, its log, and what waits for what."""

from helpers.ros.session import frames, ros_session

__all__ = ['frames', 'ros_session']
