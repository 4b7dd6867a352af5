"""Which scan was heard when: a recording of the robot's scans and one subscription."""

from __future__ import annotations

import functools
import time

from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.time import Time

from helpers.recording import Recording
from helpers.robot import Robot, speeds_of
from helpers.ros import find


class ScanRecording(Recording):
    """A `Recording` of the robot's scans, from now on. Their numbers are those of `robot.record`.

    `depth` is that of the subscription.

    Raises TypeError for anything but a robot and a subscription, ValueError for another topic.
    """

    def __init__(self, robot: Robot, subscription: Subscription) -> None:
        if not isinstance(subscription, Subscription):
            raise TypeError(
                'To see what waits for your node, give its subscription to the scans, as '
                f'node.create_subscription returned it, not {subscription!r}.'
            )
        topics = {publisher.topic_name: publisher for publisher in robot.publishers}
        topic = next(name for name in topics if name.endswith('/scan'))
        if subscription.topic_name != topic:
            raise ValueError(
                f'This subscription hears {subscription.topic_name}: give one that hears {topic}.'
            )
        self.depth = subscription.qos_profile.depth
        self._record = robot.record
        super().__init__(topics[topic], subscription)
        # Of each command of this node: when it was sent, its speeds, and the scan of its callback.
        self.sent: list[tuple[float, float, float, int]] = []
        command = topic.removesuffix('scan') + 'cmd_vel'
        for node in find(Node, robot.context):
            if subscription in node.subscriptions:
                for publisher in node.publishers:
                    if publisher.topic_name == command:
                        self._watch_commands(publisher)

    def _watch_commands(self, publisher) -> None:
        publish = publisher.publish

        @functools.wraps(publish)
        def recorded_publish(message):
            twist = speeds_of(message)
            speeds = twist.linear.x, twist.angular.z
            self.sent.append((time.monotonic(), *speeds, self.runs_here()))
            publish(message)

        publisher.publish = recorded_publish

    def published_earlier_s(self, seq: int) -> float:
        """Return when the robot published a scan: it drives from its beginning on.

        So a scan of just before the recording began may be heard afterwards.
        """
        return self._record.started_s + self._record.scans[seq].t_s

    def number_of(self, message) -> int:
        """Return the number of a scan. It was recorded before it was published."""
        stamp_ns = Time.from_msg(message.header.stamp).nanoseconds
        return next(scan.seq for scan in reversed(self._record.scans) if scan.stamp_ns == stamp_ns)
