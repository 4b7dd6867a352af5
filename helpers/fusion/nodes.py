"""Two nodes of robot_localization, as far as a lesson uses them, for an environment of wheels.

`EkfNode` and `NavSatNode` read the parameters of `ekf_node` and `navsat_transform_node`, with the
same names and meanings, and do with them what those do for a robot on a floor. Not read: all other
parameters. Not done: what `helpers.fusion.filter` says, and the place of a sensor (only its yaw).
Here the filter is always two-dimensional; that of the package needs `two_d_mode: true`.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from itertools import chain

import numpy as np
import pymap3d
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Imu, NavSatFix, NavSatStatus

from helpers.fusion.filter import STATE, ExtendedKalmanFilter
from helpers.robot import ON_THE_FLOOR, odometry_message
from helpers.ros import quaternion, seconds_of, stamp_of, yaw_of

# The 15 numbers of each `..._config` and covariance, in their order.
PARTS = ('x', 'y', 'z', 'roll', 'pitch', 'yaw', 'vx', 'vy', 'vz', 'vroll', 'vpitch', 'vyaw')
PARTS += ('ax', 'ay', 'az')
DEPTH = 100
# What robot_localization takes in place of a variance that is smaller, such as 0: src/ekf.cpp.
LEAST_VARIANCE = 1e-9


class _Configured(Node):
    """A node whose parameters are those of YAML files: a later one replaces an earlier one."""

    def __init__(
        self, name: str, *files: str | os.PathLike, remap: Mapping[str, str] | None = None
    ) -> None:
        arguments = ['--ros-args', *chain(*(('--params-file', str(file)) for file in files))]
        for topic, other in (remap or {}).items():
            arguments += ['--remap', f'{topic}:={other}']
        super().__init__(
            name, cli_args=arguments, automatically_declare_parameters_from_overrides=True
        )
        self.given = {
            key: parameter.value for key, parameter in self.get_parameters_by_prefix('').items()
        }

    def hear(self, kind: type, topic: str, callback, qos=DEPTH) -> None:
        events = SubscriptionEventCallbacks(use_default_callbacks=False)
        self.create_subscription(kind, topic, callback, qos, event_callbacks=events)


class EkfNode(_Configured):
    """The filter node, with the parameters of `ekf_node` in a YAML file.

    It hears `odomN` (Odometry) and `imuN` (Imu), of which `odomN_config` and `imuN_config` say what
    is used, and `odomN_pose_rejection_threshold` the gate. A variance of 0 in a message becomes
    1e-9. It turns what an IMU says by the yaw of its frame in `base_link_frame`, which it hears on
    /tf_static; without it, it leaves the message out. With messages of `odom0`, `frequency` times a
    second (30), it publishes its estimate on `odometry/filtered`, and on /tf the transform from
    `world_frame` to what is below it.

    By the names of the inputs, such as `odom0`: `parts` are those of the state that it may use, and
    `used` counts the measurements that were used. `two_d` is whether the files ask for a filter of
    two dimensions.
    """

    def __init__(
        self, name: str, *files: str | os.PathLike, remap: Mapping[str, str] | None = None
    ) -> None:
        from tf2_msgs.msg import TFMessage  # there only after provide_tf2_msgs

        super().__init__(name, *files, remap=remap)
        given = self.given
        self.two_d = given.get('two_d_mode', False)
        self._period_s = 1 / given.get('frequency', 30.0)
        self._due_s = -math.inf  # when the next estimate is due
        self.world = given.get('world_frame', 'odom')
        self.base = given.get('base_link_frame', 'base_link')
        initial = self._variances('initial_estimate_covariance')
        noise = self._variances('process_noise_covariance')
        self.ekf = ExtendedKalmanFilter(noise, initial)
        self.parts: dict[str, list[str]] = {}
        self.used: dict[str, int] = {}
        self._parents: dict[str, tuple[str, float]] = {}  # each frame's parent, and its yaw in it
        self._in_odom = 0.0, 0.0, 0.0
        latched = QoSProfile(depth=DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.hear(TFMessage, '/tf_static', self._on_static, latched)
        if self.world == 'map':
            self.hear(TFMessage, '/tf', self._on_tf)
        self._tf = self.create_publisher(TFMessage, '/tf', DEPTH)
        self._odometry = self.create_publisher(Odometry, 'odometry/filtered', DEPTH)
        for key in sorted(given, key=lambda key: (not key.startswith('odom'), key)):
            if re.fullmatch(r'odom\d+', key):
                self._listen(key, Odometry, self._on_odometry)
            elif re.fullmatch(r'imu\d+', key):
                self._listen(key, Imu, self._on_imu)

    def _variances(self, key: str) -> dict[str, float]:
        given = self.given.get(key, ())
        if given and len(given) != len(PARTS):
            raise ValueError(f'{key} needs {len(PARTS)} variances, not {len(given)}.')
        values = dict(zip(PARTS, given, strict=False))
        return {name: value for name, value in values.items() if name in STATE}

    def _listen(self, key: str, kind: type, callback) -> None:
        config = self.given.get(f'{key}_config', [False] * len(PARTS))
        if len(config) != len(PARTS):
            raise ValueError(f'{key}_config needs 15 values, true or false, not {len(config)}.')
        parts = [name for name, on in zip(PARTS, config, strict=True) if on]
        self.parts[key] = parts
        self.used[key] = 0
        gate = self.given.get(f'{key}_pose_rejection_threshold')
        self.hear(kind, self.given[key], lambda message: callback(key, parts, gate, message))

    def _on_odometry(
        self, key: str, parts: list[str], gate: float | None, message: Odometry
    ) -> None:
        pose, twist = message.pose, message.twist
        place, speed = pose.pose.position, twist.twist
        for names, values, covariance, limit in (
            (('x', 'y', 'yaw'), (place.x, place.y, yaw_of(pose.pose.orientation)), pose, gate),
            (('vx', 'vy', 'vyaw'), (speed.linear.x, speed.linear.y, speed.angular.z), twist, None),
        ):
            kept = [number for number, name in enumerate(names) if name in parts]
            matrix = np.reshape(covariance.covariance, (6, 6))[ON_THE_FLOOR]
            self._process(
                key,
                message,
                [names[number] for number in kept],
                [values[number] for number in kept],
                matrix[np.ix_(kept, kept)],
                limit,
            )
        if key == 'odom0' and self.ekf.t is not None and self.ekf.t >= self._due_s - 1e-6:
            next_s = self._due_s + self._period_s
            self._due_s = next_s if next_s > self.ekf.t else self.ekf.t + self._period_s
            self._publish()

    def _on_imu(self, key: str, parts: list[str], gate: float | None, message: Imu) -> None:
        turn = self._yaw_in_base(message.header.frame_id)
        if turn is None:
            return
        felt = message.linear_acceleration
        ax = math.cos(turn) * felt.x - math.sin(turn) * felt.y
        ay = math.sin(turn) * felt.x + math.cos(turn) * felt.y
        acceleration = message.linear_acceleration_covariance
        for name, value, covariance, place in (
            ('yaw', yaw_of(message.orientation) - turn, message.orientation_covariance, 8),
            ('vyaw', message.angular_velocity.z, message.angular_velocity_covariance, 8),
            ('ax', ax, acceleration, 0),
            ('ay', ay, acceleration, 4),
        ):
            if name in parts and covariance[0] >= 0:
                self._process(key, message, [name], [value], [covariance[place]], gate)

    def _process(self, key, message, names, values, covariance, gate) -> None:
        if names:
            t = seconds_of(message.header.stamp)
            covariance = np.array(covariance, float)
            covariance = np.diag(covariance) if covariance.ndim == 1 else covariance.copy()
            np.fill_diagonal(covariance, covariance.diagonal().clip(LEAST_VARIANCE))
            innovation = self.ekf.process(t, names, values, covariance, gate)
            if innovation is None or innovation.accepted:
                self.used[key] += 1

    def _yaw_in_base(self, frame: str) -> float | None:
        """Return by how much a frame is turned in the robot's, or None if nobody says so."""
        ways = []
        for end in (frame, self.base):
            yaw, way = 0.0, {end: 0.0}
            while end in self._parents:
                end, turn = self._parents[end]
                if end in way:  # the frames form a circle
                    break
                yaw += turn
                way[end] = yaw
            ways.append(way)
        common = [end for end in ways[0] if end in ways[1]]
        return ways[0][common[0]] - ways[1][common[0]] if common else None

    def _on_static(self, message) -> None:
        for stamped in message.transforms:
            yaw = yaw_of(stamped.transform.rotation)
            self._parents[stamped.child_frame_id] = stamped.header.frame_id, yaw

    def _on_tf(self, message) -> None:
        for stamped in message.transforms:
            if (stamped.header.frame_id, stamped.child_frame_id) == ('odom', self.base):
                place = stamped.transform.translation
                self._in_odom = place.x, place.y, yaw_of(stamped.transform.rotation)

    def _publish(self) -> None:
        ekf = self.ekf
        covariance = ekf.covariance
        self._odometry.publish(
            odometry_message(ekf.t, self.world, ekf.state, covariance[:3, :3], covariance[3:6, 3:6])
        )
        x, y, yaw = map(float, ekf.state[:3])
        child = self.base
        if self.world == 'map':  # base_footprint has a parent already: say where odom is
            far, left, turn = self._in_odom
            child, yaw = 'odom', yaw - turn
            x -= math.cos(yaw) * far - math.sin(yaw) * left
            y -= math.sin(yaw) * far + math.cos(yaw) * left
        stamped = TransformStamped(child_frame_id=child)
        stamped.header.stamp, stamped.header.frame_id = stamp_of(ekf.t), self.world
        stamped.transform.translation.x, stamped.transform.translation.y = x, y
        stamped.transform.rotation = quaternion(0, 0, yaw)
        self._tf.publish(self._tf.msg_type(transforms=[stamped]))


class NavSatNode(_Configured):
    """The node that turns each fix into a position in `map`, on `odometry/gps`, from `datum`.

    Without `wait_for_datum: true` the datum of the files does not count: it is the first fix.
    """

    def __init__(self, name: str, *files: str | os.PathLike) -> None:
        super().__init__(name, *files)
        self.datum: tuple[float, float, float] | None = None
        if self.given.get('wait_for_datum', False):
            degrees_north, degrees_east, _ = self.given['datum']
            self.datum = degrees_north, degrees_east, 0.0
        self.publisher = self.create_publisher(Odometry, 'odometry/gps', DEPTH)
        self.hear(NavSatFix, 'gps/fix', self._on_fix)

    def _on_fix(self, fix: NavSatFix) -> None:
        if fix.status.status < NavSatStatus.STATUS_FIX:
            return
        place = fix.latitude, fix.longitude, fix.altitude
        self.datum = self.datum or place
        east, north, _ = pymap3d.geodetic2enu(*place, *self.datum)
        covariance = np.eye(3)
        covariance[:2, :2] = np.reshape(fix.position_covariance, (3, 3))[:2, :2]
        state = east, north, 0.0, 0.0, 0.0, 0.0
        message = odometry_message(0.0, 'map', state, covariance, np.eye(3))
        message.header.stamp = fix.header.stamp
        self.publisher.publish(message)
