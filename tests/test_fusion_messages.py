"""What a message says is what was written into it."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.fusion.messages import from_odometry, table_of
from helpers.robot import odometry_message
from helpers.ros import quaternion, seconds_of, stamp_of, yaw_of

angles = st.floats(-3.1, 3.1)


def rotated(orientation, vector):
    """Return the vector turned by a quaternion: q v q*, by the rule of Rodrigues."""
    axis = np.array([orientation.x, orientation.y, orientation.z])
    return vector + 2 * np.cross(axis, np.cross(axis, vector) + orientation.w * vector)


@settings(max_examples=20)
@given(angles, angles, angles)
def test_orientations_turn_about_x_y_z(roll, pitch, yaw):
    turned = np.array([0.3, -2.0, 1.0])
    for axis, angle in enumerate((roll, pitch, yaw)):
        parts = [0.0, 0.0, 0.0]
        parts[(axis + 1) % 3] = 1.0
        first, second = np.array(parts), np.roll(parts, 1)
        a, b = turned[(axis + 1) % 3], turned[(axis + 2) % 3]
        cos, sin = math.cos(angle), math.sin(angle)
        turned = turned + (cos * a - sin * b - a) * first + (sin * a + cos * b - b) * second
    assert np.allclose(rotated(quaternion(roll, pitch, yaw), np.array([0.3, -2.0, 1.0])), turned)


@settings(max_examples=20)
@given(st.integers(0, 10**12), angles)
def test_stamps_and_yaws_come_back(nanoseconds, yaw):
    stamp = stamp_of(nanoseconds / 1e9)
    assert stamp_of(seconds_of(stamp)) == stamp
    assert seconds_of(stamp) == pytest.approx(nanoseconds / 1e9, abs=1e-6)
    assert yaw_of(quaternion(0, 0, yaw)) == pytest.approx(yaw)


def test_odometry_comes_back():
    assert (stamp_of(0).sec, stamp_of(0.5).nanosec) == (1, 500_000_000)
    pose = np.array([[1.0, 0.2, 0.3], [0.2, 2.0, 0.4], [0.3, 0.4, 3.0]])
    message = odometry_message(2.5, 'map', [1, 2, 0.5, 4, 5, 6, 7, 8], pose, 10 * pose)
    assert message.pose.pose.orientation == quaternion(0, 0, 0.5)
    assert (message.header.frame_id, message.child_frame_id) == ('map', 'base_footprint')
    ((names, values, covariance),) = from_odometry(message)
    assert dict(zip(names, values, strict=True)) == {'vx': 4, 'vy': 5, 'vyaw': 6}
    assert np.allclose(covariance, 10 * pose)
    expected = {'t': 2.5, 'x': 1.0, 'y': 2.0, 'yaw': 0.5, 'var_x': 1.0, 'cov_x_y': 0.2, 'var_y': 2}
    pd.testing.assert_frame_equal(table_of([message]), pd.DataFrame([expected]), check_dtype=False)
    for matrix in (message.pose.covariance, message.twist.covariance):
        full = np.reshape(matrix, (6, 6))
        assert np.allclose(full, full.T)
        assert (np.diag(full)[2:5] < 1e-6).all()  # a robot on a floor is sure of z, roll, pitch
        assert (np.linalg.eigvalsh(full) > 0).all()
