"""The messages of the robot's sensors, with the frames and units of REP 103, 105 and 145."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence

import numpy as np
import pymap3d
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Image, Imu, LaserScan, NavSatFix, NavSatStatus
from std_msgs.msg import Header

from helpers.robot.drivers import Driver
from helpers.robot.floor import Floor, Pose
from helpers.robot.record import Scan
from helpers.robot.sensors import RANGE_MAX, RANGE_MIN, VARIANCES
from helpers.ros import quaternion, stamp_of

DATUM = (
    10.7769,
    106.7009,
    0.0,
)  # where x, y = 0, 0 is: degrees north and east, m
FULL_V, EMPTY_V, CAPACITY_AH, LASTS_S = 12.6, 11.0, 1.8, 2.5 * 3600  # as the battery of a Waffle
ON_THE_FLOOR = np.ix_([0, 1, 5], [0, 1, 5])  # x, y and yaw of the six
TINY = 1e-9  # the variance of what is zero on a floor: z, roll and pitch
# Nothing but the wheels says where the robot is, so a filter takes their speeds alone.
POSE_COVARIANCE = np.diag([1.0, 1.0, 0.1])
TWIST_COVARIANCE = np.diag([VARIANCES[name] for name in ('vx', 'vy', 'vyaw')])
WIDTH, HEIGHT = 64, 48  # pixels
ACROSS = math.tan(math.radians(62.2) / 2) * np.linspace(1, -1, WIDTH)  # at 1 m, as a Pi's camera
DOWN = ACROSS[0] * HEIGHT / WIDTH * np.linspace(1, -1, HEIGHT)[:, np.newaxis]
CAMERA_M = 0.25  # above the floor
HIGH = {'wall': 1.0, 'box': 0.4, 'nothing': -math.inf}  # m
COLOURS = {'wall': (190, 185, 175), 'box': (200, 120, 50), 'nothing': (0, 0, 0)}
SKY, GROUND = (200, 220, 240), (110, 100, 90)


def odometry_message(
    t: float,
    frame: str,
    state: Sequence[float],
    pose_covariance: np.ndarray,
    twist_covariance: np.ndarray,
) -> Odometry:
    """Return the message of a pose in `frame` and of a speed in base_footprint.

    `state` begins with x, y (m), yaw (rad), vx, vy (m/s) and vyaw (rad/s), in this order.
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


def odometry(
    header: Header, child_frame: str, pose: Pose, readings: dict[str, float], driver: Driver
) -> Odometry:
    """Return where the wheels think that the robot is, in their own frame, and how fast."""
    state = *pose, readings['vx'], 0.0, readings['vyaw']
    message = odometry_message(0.0, header.frame_id, state, POSE_COVARIANCE, TWIST_COVARIANCE)
    message.header, message.child_frame_id = header, child_frame
    if driver.zero_covariance:
        message.pose.covariance = message.twist.covariance = np.zeros(36)
    return message


def imu(header: Header, readings: dict[str, float], driver: Driver) -> Imu:
    """Return what the IMU says. At rest it feels gravity, upwards."""
    message = Imu(header=header, orientation=quaternion(0, 0, readings['imu_yaw']))
    message.angular_velocity.z = readings['imu_vyaw']
    acceleration = message.linear_acceleration
    acceleration.x, acceleration.y, acceleration.z = readings['ax'], readings['ay'], 9.81
    if driver.zero_covariance:
        return message
    message.orientation_covariance = VARIANCES['imu_yaw'] * np.eye(3).ravel()
    message.angular_velocity_covariance = VARIANCES['imu_vyaw'] * np.eye(3).ravel()
    message.linear_acceleration_covariance = VARIANCES['ax'] * np.eye(3).ravel()
    return message


def fix(header: Header, readings: dict[str, float]) -> NavSatFix:
    """Return where GPS thinks that the robot is: x of the floor is east, y is north."""
    message = NavSatFix(header=header)
    message.status.status = NavSatStatus.STATUS_FIX
    message.status.service = NavSatStatus.SERVICE_GPS
    place = pymap3d.enu2geodetic(readings['gps_x'], readings['gps_y'], 0.0, *DATUM)
    message.latitude, message.longitude, message.altitude = map(float, place)
    variances = VARIANCES['gps_x'], VARIANCES['gps_y'], 1.0
    message.position_covariance = np.diag(variances).ravel()
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
    return message


def laser_scan(header: Header, scan: Scan, driver: Driver) -> LaserScan:
    """Return a scan. All its beams are of the same moment."""
    ranges = RANGE_MIN, RANGE_MAX
    if driver.laser == 'ld08':
        ranges = 0.0, 100.0  # not those of the sensor: so says its driver
    return LaserScan(
        header=header,
        angle_min=scan.first,
        angle_max=scan.first + scan.step * (len(scan.ranges) - 1),
        angle_increment=scan.step,
        scan_time=0.1,
        range_min=ranges[0],
        range_max=ranges[1],
        ranges=array('f', scan.ranges.tobytes()),
    )


def battery(header: Header, t_s: float, driver: Driver) -> BatteryState:
    """Return the battery's state: it is empty after two and a half hours."""
    left = max(0.0, 1 - t_s / LASTS_S)
    message = BatteryState(header=header, present=True, design_capacity=CAPACITY_AH)
    message.voltage = EMPTY_V + left * (FULL_V - EMPTY_V)
    message.percentage = 100 * left if driver.battery_percent else left
    if driver.battery_percent:  # such a driver says no more
        return message
    message.charge, message.current = CAPACITY_AH * left, -CAPACITY_AH * 3600 / LASTS_S
    message.capacity = CAPACITY_AH
    message.temperature = math.nan  # not measured
    message.power_supply_status = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    message.power_supply_technology = BatteryState.POWER_SUPPLY_TECHNOLOGY_LIPO
    return message


def picture(header: Header, floor: Floor, pose: Pose) -> Image:
    """Return what a camera sees that looks along `pose`: rgb8, 64 by 48 pixels."""
    angles = np.arctan(ACROSS)
    distance, seen = floor.ranges(pose.x, pose.y, pose.yaw + angles)
    depth = np.maximum(distance * np.cos(angles), 0.05)
    kinds = [floor.walls[number].kind if number >= 0 else 'nothing' for number in seen]
    top = np.array([HIGH[kind] for kind in kinds]) - CAMERA_M
    light = np.clip(1.1 - depth / 8, 0.3, 1.0)[:, np.newaxis]
    colours = light * np.array([COLOURS[kind] for kind in kinds])
    block = (DOWN * depth <= top) & (DOWN * depth >= -CAMERA_M)
    ground = np.where((DOWN > 0)[..., np.newaxis], SKY, GROUND)
    pixels = np.where(block[..., np.newaxis], colours, ground).astype(np.uint8)
    image = Image(header=header, height=HEIGHT, width=WIDTH, encoding='rgb8', step=3 * WIDTH)
    image.data = array('B', pixels.tobytes())
    return image
