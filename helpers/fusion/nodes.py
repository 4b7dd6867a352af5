"""The nodes of lesson 13, for the lesson after it: a robot, a filter node, and a drive with both.

Lesson 13 writes and explains them; here they stand as they do there, and a test compares the two.
"""

import math
import threading
from bisect import insort
from functools import partial
from operator import itemgetter

import numpy as np
import pandas as pd
import pymap3d
from geometry_msgs.msg import Quaternion, Vector3
from nav_msgs.msg import Odometry
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import Imu, NavSatFix, NavSatStatus

from helpers import fusion
from helpers.fusion import fuse
from helpers.session import ros_session


def quaternion(roll, pitch, yaw):
    """Return the orientation as a message, from three angles in radians."""
    cr, cp, cy = (math.cos(angle / 2) for angle in (roll, pitch, yaw))
    sr, sp, sy = (math.sin(angle / 2) for angle in (roll, pitch, yaw))
    return Quaternion(
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
        w=cr * cp * cy + sr * sp * sy,
    )


def yaw_of(orientation):
    """Return the yaw of a robot on a floor, in radians."""
    return 2 * math.atan2(orientation.z, orientation.w)


def nanoseconds(stamp):
    """Return the time of a stamp, a message, as one number."""
    return Time.from_msg(stamp).nanoseconds


ON_THE_FLOOR = np.ix_([0, 1, 5], [0, 1, 5])  # x, y and yaw of the six


def six_by_six(covariance):
    """Write the covariance of x, y, yaw (3, 3) as a message has it: 36 numbers."""
    full = 1e-9 * np.eye(6)
    full[ON_THE_FLOOR] = covariance
    return full.ravel()


def odometry_message(stamp, frame, state, pose_covariance, twist_covariance):
    """Return an `Odometry` message. `state` begins with x, y, yaw, vx, vy, vyaw."""
    x, y, yaw, vx, vy, vyaw = map(float, state[:6])
    message = Odometry(child_frame_id='base_footprint')
    message.header.stamp, message.header.frame_id = stamp, frame
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation = quaternion(0, 0, yaw)
    message.twist.twist.linear.x, message.twist.twist.linear.y = vx, vy
    message.twist.twist.angular.z = vyaw
    message.pose.covariance = six_by_six(pose_covariance)
    message.twist.covariance = six_by_six(twist_covariance)
    return message


VARIANCES = fusion.VARIANCES  # simulate makes its noise with them, so they are true


def imu_message(stamp, row):
    """Return the `Imu` message of a row of `measurements`."""
    message = Imu(orientation=quaternion(0, 0, row.imu_yaw))
    message.header.stamp, message.header.frame_id = stamp, 'imu_link'
    message.angular_velocity.z = row.imu_vyaw
    message.linear_acceleration = Vector3(x=row.ax, y=row.ay, z=9.81)
    message.orientation_covariance = VARIANCES['imu_yaw'] * np.eye(3).ravel()
    message.angular_velocity_covariance = VARIANCES['imu_vyaw'] * np.eye(3).ravel()
    message.linear_acceleration_covariance = VARIANCES['ax'] * np.eye(3).ravel()
    return message


DATUM = (10.7769, 106.7009, 0.0)  # degrees north, degrees east, metres


def fix_message(stamp, row):
    """Return the `NavSatFix` message of a row of `measurements` in which GPS gave a fix."""
    message = NavSatFix()
    message.header.stamp, message.header.frame_id = stamp, 'gps_link'
    message.status.status = NavSatStatus.STATUS_FIX
    message.status.service = NavSatStatus.SERVICE_GPS
    message.latitude, message.longitude, message.altitude = pymap3d.enu2geodetic(
        row.gps_x, row.gps_y, 0.0, *DATUM
    )
    message.position_covariance = np.diag([VARIANCES['gps_x'], VARIANCES['gps_y'], 1.0]).ravel()
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
    return message


START_NS, DEPTH = 1_000_000_000, 10


class RobotNode(Node):
    """Publishes the rows of `measurements`, a table of `simulate`."""

    def __init__(self, measurements):
        super().__init__('robot')
        self.rows = list(measurements.itertuples())
        wheels = fuse(measurements, ('odom',))
        self.poses = wheels[['x', 'y', 'yaw']].to_numpy()
        self.pose_covariances = fusion.covariances(wheels, ('x', 'y', 'yaw'))
        self.twist_covariance = np.diag([VARIANCES[name] for name in ('vx', 'vy', 'vyaw')])
        self.odometry_publisher = self.create_publisher(Odometry, 'odom', DEPTH)
        self.imu_publisher = self.create_publisher(Imu, 'imu/data', DEPTH)
        self.gps_publisher = self.create_publisher(NavSatFix, 'gps/fix', DEPTH)

    def publish_row(self, number):
        """Publish what the sensors said in this row."""
        row = self.rows[number]
        stamp = Time(nanoseconds=START_NS + round(row.t * 1e9)).to_msg()
        state = (*self.poses[number], row.vx, 0.0, row.vyaw)
        covariances = self.pose_covariances[number], self.twist_covariance
        self.odometry_publisher.publish(odometry_message(stamp, 'odom', state, *covariances))
        self.imu_publisher.publish(imu_message(stamp, row))
        if not math.isnan(row.gps_x):
            self.gps_publisher.publish(fix_message(stamp, row))


def from_odometry(message, turned):
    """Return what the filter takes of a message: names, values and covariance of each part."""
    twist = message.twist.twist
    covariance = np.reshape(message.twist.covariance, (6, 6))[ON_THE_FLOOR]
    return [(('vx', 'vy', 'vyaw'), (twist.linear.x, twist.linear.y, twist.angular.z), covariance)]


def from_fix(message, turned):
    """Return the position in metres from DATUM, or nothing where there is no fix."""
    if message.status.status < NavSatStatus.STATUS_FIX:
        return []
    position = message.latitude, message.longitude, message.altitude
    east, north, _ = pymap3d.geodetic2enu(*position, *DATUM)
    covariance = np.reshape(message.position_covariance, (3, 3))[:2, :2]
    return [(('x', 'y'), (east, north), covariance)]


def from_imu(message, turned):
    """Return what is measured, of an IMU that is mounted turned by so many radians."""
    force = message.linear_acceleration
    ax = math.cos(turned) * force.x - math.sin(turned) * force.y
    parts = [
        ('yaw', yaw_of(message.orientation) - turned, message.orientation_covariance, 8),
        ('vyaw', message.angular_velocity.z, message.angular_velocity_covariance, 8),
        ('ax', ax, message.linear_acceleration_covariance, 0),
    ]
    return [
        ((name,), (value,), (covariance[place],))
        for name, value, covariance, place in parts
        if covariance[0] != -1
    ]


SENSORS = {
    'odom': (Odometry, 'odom', from_odometry),
    'imu': (Imu, 'imu/data', from_imu),
    'gps': (NavSatFix, 'gps/fix', from_fix),
}


QUIET = SubscriptionEventCallbacks(use_default_callbacks=False)


class SensorNode(Node):
    """Hears sensors, keys of SENSORS, and passes on to `take` what they said, sorted by stamp.

    `mounting` gives for a frame by how many radians the sensor is turned.
    """

    def __init__(self, name, sensors, depth, mounting):
        super().__init__(name)
        self.sensors, self.mounting = sensors, mounting or {}
        self.waiting, self.newest = [], 0
        self.sensor_group = MutuallyExclusiveCallbackGroup()
        for rank, sensor in enumerate(sensors):
            kind, topic, read = SENSORS[sensor]
            callback = partial(self.sensor_callback, rank, read)
            options = {'callback_group': self.sensor_group, 'event_callbacks': QUIET}
            self.create_subscription(kind, topic, callback, depth, **options)

    def sensor_callback(self, rank, read, message):
        """Put a message in its place, and pass on what is older than the newest stamp."""
        stamp = nanoseconds(message.header.stamp)
        turned = self.mounting.get(message.header.frame_id, 0.0)  # radians
        insort(self.waiting, (stamp, rank, read(message, turned)), key=itemgetter(0, 1))
        self.newest = max(self.newest, stamp)
        while self.waiting[0][0] < self.newest:
            stamp, _, readings = self.waiting.pop(0)
            self.take(stamp, readings, last=stamp < self.waiting[0][0])


class FilterNode(SensorNode):
    """Fuses what it hears, and publishes the pose in `frame` on the topic `output`."""

    def __init__(
        self, name='ekf', sensors=('odom', 'imu', 'gps'), depth=DEPTH, mounting=None,
        frame='odom', output='odometry/filtered', process_noise=None,
    ):  # fmt: skip
        super().__init__(name, sensors, depth, mounting)
        self.frame, self.output = frame, output
        self.ekf = fusion.ExtendedKalmanFilter(process_noise)
        self.publisher = self.create_publisher(Odometry, output, DEPTH)

    def take(self, stamp, readings, last):
        """Fuse the readings of a message; after the last one of a stamp publish the estimate."""
        for reading in readings:
            self.ekf.process((stamp - START_NS) / 1e9, *reading)
        if last:
            self.publish_estimate(Time(nanoseconds=stamp).to_msg())

    def publish_estimate(self, stamp):
        """Publish pose, speed, and the covariances of both."""
        blocks = self.ekf.covariance[:3, :3], self.ekf.covariance[3:6, 3:6]
        self.publisher.publish(odometry_message(stamp, self.frame, self.ekf.state, *blocks))


class SteppedFilter(FilterNode):
    """Tells when it has heard a message, so that the simulated robot can wait for it."""

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self.heard = threading.Semaphore(0)

    def sensor_callback(self, *arguments):
        """Hear a message, and tell so."""
        super().sensor_callback(*arguments)
        self.heard.release()


def table_of(messages):
    """Return the poses of `Odometry` messages: t (s), x, y (m), yaw (rad), and variances (m^2)."""
    rows = []
    for message in messages:
        t = (nanoseconds(message.header.stamp) - START_NS) / 1e9
        pose, covariance = message.pose.pose, message.pose.covariance
        place = pose.position.x, pose.position.y, yaw_of(pose.orientation)
        rows.append((t, *place, covariance[0], covariance[1], covariance[7]))
    return pd.DataFrame(rows, columns=['t', 'x', 'y', 'yaw', 'var_x', 'cov_x_y', 'var_y'])


def drive(measurements, *make_filters, prepare=None):
    """Let the robot drive past some filters. Return what each of them published, as a table.

    `prepare` may add subscriptions to the node that listens, and returns nodes that run as well.
    """
    with ros_session() as session:
        robot, listener = RobotNode(measurements), Node('listener')
        filters = [make_filter() for make_filter in make_filters]
        others = prepare(listener) if prepare else []  # for lesson 14
        arrived = [[] for _ in filters]
        executor = SingleThreadedExecutor()
        for node in (listener, *filters, *others):
            executor.add_node(node)
        for node, messages in zip(filters, arrived, strict=True):
            listener.create_subscription(Odometry, node.output, messages.append, len(measurements))
        session.spin(executor)
        for number, row in enumerate(robot.rows):
            robot.publish_row(number)
            spoken = {'odom', 'imu'} if math.isnan(row.gps_x) else {'odom', 'imu', 'gps'}
            for node in filters:
                for _ in spoken & set(node.sensors):
                    session.wait_until(lambda: node.heard.acquire(timeout=0.1))  # noqa: B023
        # The last row waits in the filter for a newer stamp.
        session.wait_until(lambda: all(len(m) == len(measurements) - 1 for m in arrived))
    return [table_of(messages) for messages in arrived]
