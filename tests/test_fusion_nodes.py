"""The filter nodes read what robot_localization reads, and a turned sensor is turned back."""

import math
import os
import subprocess
from types import SimpleNamespace

import numpy as np
import pymap3d
import pytest
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from ros2_command.api import command_of
from sensor_msgs.msg import Imu, LaserScan, NavSatFix, NavSatStatus
from support.nodes import LIMIT_S

from helpers.fusion.filter import ExtendedKalmanFilter
from helpers.fusion.nodes import LEAST_VARIANCE, PARTS, EkfNode, NavSatNode
from helpers.machine import build_environment
from helpers.robot import ROOMS, Robot
from helpers.ros import graph_environment, ros_session, stamp_of, yaw_of


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


def test_a_variance_of_zero_is_the_least_one():
    node = SimpleNamespace(ekf=ExtendedKalmanFilter(), used={'odom0': 0})
    for stamp_s in (1.0, 2.0):
        message = Odometry()
        message.header.stamp = stamp_of(stamp_s)
        names, values = ['vx', 'vy'], [0.5, 0.0]
        EkfNode._process(node, 'odom0', message, names, values, np.zeros((2, 2)), None)
    assert node.used == {'odom0': 2}
    assert node.ekf.covariance[3, 3] == pytest.approx(LEAST_VARIANCE, rel=1e-3)


@pytest.mark.parametrize(
    ('parents', 'yaw'),
    [
        ({'imu': ('plate', 0.5), 'plate': ('base', 0.25)}, 0.75),
        ({'imu': ('plate', 0.5), 'plate': ('imu', -0.5)}, None),
        ({'imu': ('imu', 0.5)}, None),
        ({'imu': ('base', 0.5), 'base': ('plate', 0.0), 'plate': ('base', 0.0)}, 0.5),
    ],
)
def test_the_way_to_the_base_ends_also_in_a_circle(parents, yaw):
    node = SimpleNamespace(_parents=parents, base='base')
    assert EkfNode._yaw_in_base(node, 'imu') == yaw


@pytest.mark.parametrize(
    ('waits', 'x'), [('wait_for_datum: true, ', 100.0), ('wait_for_datum: false, ', 0.0), ('', 0.0)]
)
def test_the_datum_counts_only_with_wait_for_datum(waits, x, tmp_path):
    file = tmp_path / 'navsat.yaml'
    datum = 10.7769, 106.7009, 0.0
    file.write_text(f'navsat: {{ros__parameters: {{{waits}datum: [{datum[0]}, {datum[1]}, 0.0]}}}}')
    latitude, longitude, _ = pymap3d.enu2geodetic(100.0, 0.0, 0.0, *datum)
    with ros_session():
        node, heard = NavSatNode('navsat', file), []
        node.publisher = SimpleNamespace(publish=heard.append)
        fix = NavSatFix(latitude=latitude, longitude=longitude)
        fix.status.status = NavSatStatus.STATUS_FIX
        node._on_fix(fix)
    assert heard[0].pose.pose.position.x == pytest.approx(x, abs=1e-3)


def test_stand_ins_are_packages_with_programs():
    environment = build_environment()
    for package, program in (
        ('robot_localization', 'ekf_node'),
        ('robot_localization', 'navsat_transform_node'),
        ('robot_state_publisher', 'robot_state_publisher'),
    ):
        [file] = command_of(package, program, environment)
        assert os.access(file, os.X_OK)


def test_a_program_says_what_it_lacks(tmp_path):
    command = [*command_of('robot_localization', 'navsat_transform_node', build_environment())]
    file = tmp_path / 'navsat.yaml'
    file.write_text('navsat_transform: {ros__parameters: {wait_for_datum: true}}')
    with ros_session():
        done = subprocess.run(
            [*command, '--ros-args', '--params-file', str(file)],
            env=build_environment() | graph_environment(),
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )
    assert (done.returncode, done.stderr) == (1, "navsat_transform_node: 'datum'\n")
