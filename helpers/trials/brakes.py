"""Brakes of a learner that look for long, or ask a camera: is a stop heard meanwhile?"""

from __future__ import annotations

import math
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from types import SimpleNamespace

from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Empty
from std_srvs.srv import Trigger

from helpers.notebook import frames
from helpers.recording import CallbackRecording
from helpers.replay import Replay, replay_calls
from helpers.ros import ros_session


def stop_while_looking(make_brake: Callable[..., Node]) -> tuple[bool, list[int]]:
    """Press stop while the look at scan 0 waits, and 1 to 20 have come.

    Return whether stop was heard, and the numbers of the scans that were looked at.
    """
    gate, stopped, looked_at = threading.Event(), False, []

    def look(scan):
        looked_at.append(round(scan.ranges[90]))
        return 9.0 if gate.wait(timeout=20) else 0.0

    with suppress(TimeoutError), ros_session() as session:
        tester, brake = Node('tester'), make_brake(1, most_s=60, look=look)
        scans = tester.create_publisher(LaserScan, 'scan', 10)
        stop = tester.create_publisher(Empty, 'stop', 10)
        executor = SingleThreadedExecutor()
        executor.add_node(brake)
        session.spin(executor)
        try:
            for number in range(21):
                scan = LaserScan(ranges=[float(number)] * 181)
                scan.header.stamp = tester.get_clock().now().to_msg()
                scans.publish(scan)
                session.wait_until(lambda: looked_at, timeout_s=3)
            stop.publish(Empty())
            session.wait_until_quiet(executor)
            stopped = brake.stopped.is_set()
        finally:
            gate.set()
        session.wait_until(lambda: 20 in looked_at, timeout_s=2)
    return stopped, looked_at


class Camera(Node):
    """A camera that a service lets look. Whatever it sees is a wall, if it is not dust.

    With `hold`, it calls that in place of taking `takes_s` seconds for a picture.
    """

    def __init__(
        self,
        sees: str = 'a wall',
        takes_s: float = 0.1,
        hold: Callable[[], object] | None = None,
    ) -> None:
        super().__init__('camera')
        self.sees, self.hold = sees, hold or partial(time.sleep, takes_s)
        self.asked = self.looks = 0
        self.service = self.create_service(Trigger, 'look', self.look_callback)

    def look_callback(self, request, response):
        """Take a picture, and say what it sees."""
        self.asked += 1
        self.hold()
        self.looks += 1
        response.success, response.message = 'dust' not in self.sees, self.sees
        return response


def scan(distance: float, age_s: float = 0.0) -> LaserScan:
    """Return a scan of now. All its ranges are the same; NaN is a laser that sees nothing."""
    now = Clock(clock_type=ClockType.ROS_TIME).now() - Duration(nanoseconds=round(age_s * 1e9))
    step = math.pi / 180
    message = LaserScan(angle_min=-90 * step, angle_max=90 * step, angle_increment=step)
    message.range_min, message.range_max, message.ranges = 0.12, 8.0, [distance] * 181
    message.header.stamp = now.to_msg()
    return message


def show_a_wall(
    make_brake: Callable[[], Node], make_executor: Callable[[], Executor]
) -> SimpleNamespace:
    """Show one scan of a wall to a brake, wait until nothing happens any more, and look at it."""
    stops = []
    with ros_session() as session:
        brake, camera, tester = make_brake(), Camera(), Node('tester')
        tester.create_subscription(Empty, 'stop', stops.append, 10)
        scans = tester.create_publisher(LaserScan, 'scan', 10)
        recording = CallbackRecording(
            scan_callback=brake.subscription, look_callback=camera.service, client=brake.client
        )
        executor, other = make_executor(), SingleThreadedExecutor()
        for node in (brake, camera):
            executor.add_node(node)
        other.add_node(tester)
        session.spin(executor)
        session.spin(other)
        scans.publish(scan(0.5))
        session.wait_until(lambda: recording.runs['scan_callback'])
        thread_free = session.wait_until_quiet(executor)
        session.wait_until_quiet(other)
        return SimpleNamespace(
            stopped=bool(stops),
            looks=camera.looks,
            thread_free=thread_free,
            group_free=brake.client.callback_group.can_execute(brake.client),
            stacks=stacks_in('scan_callback'),
            replay=replay_of(recording, make_executor),
        )


def stacks_in(function: str) -> list[str]:
    """Return the calls, from this function on, of each thread that is inside it."""
    hidden = {'recorded_call', 'recorded'}  # of the recording
    stacks = []
    for _, frame in frames(threading.enumerate()):
        names = [entry.name for entry in traceback.extract_stack(frame)]
        if function in names:
            calls = names[names.index(function) :]
            stacks.append(' > '.join(name for name in calls if name not in hidden))
    return stacks


def replay_of(recording: CallbackRecording, make_executor: Callable[[], Executor]) -> Replay | None:
    """Return the replay of a recording, with as many threads as its executor has."""
    used = {thread for table in recording.tables().values() for thread in table['thread']}
    threads = 1 if make_executor is SingleThreadedExecutor else max(2, len(used))
    with suppress(ValueError):  # a callback that awaits has none
        return replay_calls(recording, threads)
