"""Drives of a robot, as tables: what its sensors said, and what the filter nodes made of it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import pandas as pd
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Imu, NavSatFix

from helpers.fusion.messages import from_odometry, table_of
from helpers.fusion.nodes import DEPTH, EkfNode, NavSatNode
from helpers.robot import EMPTY, KIND, Pose, Robot, trip
from helpers.ros import ros_session, seconds_of


class SensorLog(Node):
    """A node that keeps what the sensors of the robot say, and what a filter makes of it."""

    def __init__(self) -> None:
        super().__init__('sensor_log')
        self.sensors: list = []
        self.estimates: list[Odometry] = []
        for kind, topic in ((Odometry, 'odom'), (Imu, 'imu/data'), (NavSatFix, 'gps/fix')):
            self.create_subscription(kind, topic, self.sensors.append, DEPTH)
        self.create_subscription(Odometry, 'odometry/filtered', self.estimates.append, DEPTH)

    def table(self, from_imu: Callable, from_fix: Callable) -> pd.DataFrame:
        """Return what `fuse` reads, as these functions and `from_odometry` read the messages."""
        readers = {
            Odometry: (from_odometry, {}),
            Imu: (from_imu, {'yaw': 'imu_yaw', 'vyaw': 'imu_vyaw'}),
            NavSatFix: (from_fix, {'x': 'gps_x', 'y': 'gps_y'}),
        }
        rows: dict[float, dict[str, float]] = {}
        for message in self.sensors:
            read, columns = readers[type(message)]
            row = rows.setdefault(seconds_of(message.header.stamp), {})
            for names, values, _ in read(message):
                row |= {columns.get(n, n): value for n, value in zip(names, values, strict=True)}
        table = pd.DataFrame.from_dict(rows, orient='index').sort_index()
        return table.rename_axis('t').reset_index()


class Localized(NamedTuple):
    """A drive past filters: by their names, what `EkfNode` knows of itself; and what is true.

    `estimates` are tables as `table_of` makes them, `truth` has `t` (s), x, y (m) and yaw (rad).
    `frames` has the columns of `plots.frame_tree`; as publisher it has the topic.
    """

    estimates: dict[str, pd.DataFrame]
    truth: pd.DataFrame
    frames: pd.DataFrame
    parts: dict[str, dict[str, list[str]]]
    used: dict[str, dict[str, int]]
    two_d: dict[str, bool]


def localize(
    files: Sequence[str | os.PathLike],
    make_broadcaster: Callable[[], Node],
    seconds: float = 25.0,
    mounting: Mapping[str, float] | None = None,
) -> Localized:
    """Let a robot drive past `ekf_odom`, `ekf_map` and `navsat_transform`, in sim time.

    `files` have their parameters, and the node of `make_broadcaster()` publishes /tf_static.
    """
    from tf2_msgs.msg import TFMessage

    heard: dict[str, list] = {'ekf_odom': [], 'ekf_map': []}
    frames: dict[str, tuple[str, str, str]] = {}

    def note(topic: str) -> Callable:
        return lambda message: frames.update(
            (stamped.child_frame_id, (stamped.header.frame_id, stamped.child_frame_id, topic))
            for stamped in message.transforms
        )

    with ros_session():
        driver = KIND.but(publish_tf=False)  # a filter publishes it
        robot = Robot(
            EMPTY, start=Pose(0, 0, 0), seed=1, sim_time=True, mounting=mounting, driver=driver
        )
        filters = [
            EkfNode(name, *files, remap={'odometry/filtered': f'{name}/odometry'}) for name in heard
        ]
        listener, executor = Node('listener'), SingleThreadedExecutor()
        navsat = NavSatNode('navsat_transform', *files)
        for node in (*filters, navsat, make_broadcaster(), listener):
            executor.add_node(node)
        latched = QoSProfile(depth=DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        listener.create_subscription(TFMessage, '/tf_static', note('/tf_static'), latched)
        listener.create_subscription(TFMessage, '/tf', note('/tf'), DEPTH)
        for name, messages in heard.items():
            listener.create_subscription(Odometry, f'{name}/odometry', messages.append, DEPTH)
        trip(robot, executor, seconds=seconds)
    by_name = dict(zip(heard, filters, strict=True))
    return Localized(
        estimates={name: table_of(messages) for name, messages in heard.items()},
        truth=robot.record.table('poses').rename(columns={'t_s': 't'}),
        frames=pd.DataFrame(list(frames.values()), columns=['parent', 'child', 'publisher']),
        parts={name: node.parts for name, node in by_name.items()},
        used={name: node.used for name, node in by_name.items()},
        two_d={name: node.two_d for name, node in by_name.items()},
    )
