"""Of the sensors: what is launched, and what the wheels know."""

import contextlib
import io
import time
from typing import NamedTuple

from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile

from helpers.checks.bench import Bench
from helpers.checks.builds import build
from helpers.checks.errors import Failed
from helpers.checks.lessons.put_the_sensors_on_the_robot.shared import (
    SENSORS,
    SETTINGS,
    sections_of,
    tasks,
    tf_message,
    with_sensors,
)
from helpers.checks.points import cached, expect
from helpers.fusion import VARIANCES
from helpers.ros import stamp_of
from helpers.workspace import DIED, error_of_launch, started, without_folders

FILTERS = ['ekf_map', 'ekf_odom']
# The frames that have a parent when the robot and its filters run.
CHILDREN = {'odom', 'base_footprint', 'base_link', *SENSORS}
# A part of the name that rmw gives to a node whose subscription is discovered before the node.
NOT_KNOWN = 'NODE_NAME_UNKNOWN'
SETTLED_S = 8.0  # so long after their start programs may take to say something


@tasks.add(limit_s=150)
def two_filters(workspace, file):
    @cached
    def seen():
        """Return who publishes and receives what, of which type of frame, when all runs."""
        with_sensors(workspace)
        sections = {str(name).lstrip('/') for name in sections_of(workspace.file(SETTINGS))}
        if missing := sorted({*FILTERS} - sections):
            raise Failed(
                f'localization.yaml has no section {", ".join(missing)}: the task "Fix three '
                'faults" is not solved'
            )
        build(workspace, 'small_robot')
        return watch_launch(workspace, file)

    def has_started():
        right = ['ekf_node', 'ekf_node', 'navsat_transform_node', 'robot']
        return expect(seen().programs, [*right, 'robot_state_publisher'], 'it starts')

    def has_names():
        return expect(sorted(seen().filters), FILTERS, 'the filters are called')

    def receives_imu():
        heard_by = sorted(seen().hear_imu & {*FILTERS})
        return expect(heard_by, FILTERS, 'the filters that subscribe to /imu are')

    def publishes(topic, frame):
        frames = sorted(seen().frames[topic])
        if not frames:
            return f'nobody publishes /{topic}'
        return expect(frames, [frame], f'/{topic} has poses in')

    def is_connected():
        missing = sorted(CHILDREN - seen().children)
        return not missing or f'nobody says where {", ".join(missing)} is'

    node_names = 'name="ekf_odom", name="ekf_map": the YAML has a section for each.'
    imu = '<remap from="imu/data" to="imu"/>, in both.'
    keeps_its_topic = 'Its topic keeps its name, and it has its parameters.'
    other_topic = '<remap from="odometry/filtered" to="odometry/map"/>, in ekf_map.'
    return [
        ('five programs', has_started, 'Two nodes with exec="ekf_node".'),
        ('two names', has_names, node_names),
        ('both receive the IMU', receives_imu, imu),
        (
            'ekf_odom says where it is in odom',
            lambda: publishes('odometry/filtered', 'odom'),
            keeps_its_topic,
        ),
        (
            'ekf_map says where it is in map',
            lambda: publishes('odometry/map', 'map'),
            other_topic,
        ),
        ('one tree', is_connected, '<param from="$(var settings)"/>, in both.'),
    ]


class Launched(NamedTuple):
    """What a launch of the robot and its filters does."""

    programs: list[str]  # that were started, sorted
    filters: set[str]  # the names of nodes that publish a pose of a filter
    hear_imu: set[str]  # the names of nodes
    frames: dict[str, set[str]]  # by topic, of the poses
    children: set[str]  # in /tf and /tf_static


def watch_launch(workspace, file):
    """Launch a file until all runs, and return what it does.

    It waits 30 s at most, and SETTLED_S after the nodes of all programs have been discovered.

    Raises Failed, with the first error that it prints, if it starts nothing.
    """
    command = f'source install/setup.bash\nros2 launch {file}'
    topics = 'odometry/filtered', 'odometry/map'
    discovered_s: list[float] = []
    children: set[str] = set()

    with contextlib.redirect_stdout(io.StringIO()), Bench() as bench:
        late = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        transforms = (
            bench.hear('/tf', tf_message()),
            bench.hear('/tf_static', tf_message(), qos=late),
        )
        poses = {topic: bench.hear(topic, Odometry) for topic in topics}
        own_nodes = len(bench.tester.get_node_names())
        with workspace.start(command, 'the launch') as process:

            def filters():
                found = (bench.tester.get_publishers_info_by_topic(f'/{topic}') for topic in topics)
                return {info.node_name for infos in found for info in infos}

            def hear_imu():
                found = bench.tester.get_subscriptions_info_by_topic('/imu')
                return {info.node_name for info in found}

            def all_runs():
                for messages in transforms:
                    children.update(
                        one.child_frame_id for message in messages for one in message.transforms
                    )
                    messages.clear()
                text = '\n'.join(process.lines)
                if not process.running or DIED in text:
                    return True
                if any(NOT_KNOWN in name for name in filters() | hear_imu()):
                    return False
                if all(poses.values()) and children >= CHILDREN and len(hear_imu()) > 1:
                    return True
                nodes = len(bench.tester.get_node_names()) - own_nodes
                if not discovered_s and 0 < len(started(text)) <= nodes:
                    discovered_s.append(time.monotonic())
                return discovered_s and time.monotonic() - discovered_s[0] > SETTLED_S

            bench.wait(all_runs, 30)
            text = '\n'.join(process.lines)
            launched = Launched(
                started(text),
                filters(),
                hear_imu(),
                {topic: {pose.header.frame_id for pose in heard} for topic, heard in poses.items()},
                set(children),
            )
            process.interrupt()
    if error := error_of_launch(without_folders(text, workspace.path)):
        raise Failed(error)
    return launched


MORE_S = 0.2  # for a message that none on odom has caused


@tasks.add
def say_what_you_know(Covariances):
    def relayed(speed):
        message = Odometry(child_frame_id='base_footprint')
        message.header.frame_id, message.header.stamp = 'odom', stamp_of(2.5)
        message.twist.twist.linear.x = speed
        message.pose.pose.position.x = 2 * speed
        with Bench() as bench:
            heard = bench.hear('odom/known', Odometry)
            bench.spin(Covariances())
            bench.say('odom', message)
            bench.wait(lambda: len(heard) > 1, MORE_S)
        return message, heard

    def comes(speed):
        message, heard = relayed(speed)
        if len(heard) != 1:
            return f'one message on odom, {len(heard)} on odom/known'
        found = heard[0]
        for name in ('header', 'child_frame_id', 'pose'):
            if getattr(found, name) != getattr(message, name):
                return f'{name} has changed'
        return found.twist.twist == message.twist.twist or 'the speeds have changed'

    def has_variances():
        _, heard = relayed(0.5)
        if not heard:
            return 'nothing comes on odom/known'
        right = {0: VARIANCES['vx'], 7: VARIANCES['vy'], 35: VARIANCES['vyaw']}
        found = {
            place: round(float(variance), 12)
            for place, variance in enumerate(heard[0].twist.covariance)
            if abs(variance) > 1e-12
        }
        return expect(found, right, 'the places of twist.covariance that are not zero are')

    first = "message.twist.covariance[0] = VARIANCES['vx']"
    return [
        ('each message comes', lambda: comes(0.5), 'self.publisher.publish(message)'),
        ('another one', lambda: comes(-0.2), 'The message that it receives.'),
        ('three variances', has_variances, first),
    ]
