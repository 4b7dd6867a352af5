"""The filter nodes read what robot_localization reads, and a turned sensor is turned back."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Imu, LaserScan

from helpers.fusion.nodes import PARTS, EkfNode
from helpers.robot import ROOMS, Robot
from helpers.ros import ros_session, yaw_of


def heard_from_a_robot(**options):
    """Return the first scan and the first message of the IMU."""
    heard = {}
    with ros_session():
        robot, listener = Robot(ROOMS, sim_time=True, noise=False, **options), Node('listener')
        for kind, topic in ((LaserScan, 'scan'), (Imu, 'imu/data')):
            listener.create_subscription(kind, topic, lambda m: heard.setdefault(type(m), m), 10)
        executor = SingleThreadedExecutor()
        executor.add_node(listener)
        robot.run(0.5, executor, until=lambda: len(heard) == 2)
    return heard[LaserScan], heard[Imu]


def test_mounted_sensors_report_in_their_own_frames():
    scan, imu = heard_from_a_robot()
    turned_scan, turned_imu = heard_from_a_robot(
        mounting={'base_scan': math.radians(30), 'imu_link': 0.5}
    )
    assert yaw_of(turned_imu.orientation) == pytest.approx(yaw_of(imu.orientation) + 0.5)
    # The beams of the turned lidar are those of the other one, 30 beams further left.
    assert np.allclose(turned_scan.ranges[:-30], scan.ranges[30:])


def test_unknown_mountings_are_refused():
    with ros_session(), pytest.raises(ValueError, match='mounting can name imu_link, base_scan'):
        Robot(mounting={'imu': 0.5})


def test_covariances_of_another_length_are_refused():
    node = SimpleNamespace(given={'initial_estimate_covariance': [1.0, 2.0]})
    with pytest.raises(ValueError, match=f'needs {len(PARTS)} variances, not 2'):
        EkfNode._variances(node, 'initial_estimate_covariance')
