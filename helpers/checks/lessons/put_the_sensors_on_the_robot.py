"""What the tasks of the lesson "Put the sensors on the robot" are judged by."""

import contextlib
import io
import math
import time
from collections import Counter
from difflib import get_close_matches
from typing import NamedTuple

import numpy as np
import yaml
from geometry_msgs.msg import Transform, TransformStamped, Vector3
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import LaserScan
from urdf_parser_py.urdf import URDF

from helpers.checks.bench import Bench
from helpers.checks.builds import build
from helpers.checks.errors import Failed
from helpers.checks.points import cached
from helpers.checks.tasks import Tasks
from helpers.fusion import VARIANCES, localize
from helpers.ros import quaternion, seconds_of, stamp_of, yaw_of
from helpers.workspace import DIED, error_of_launch, started, without_folders

tasks = Tasks()
check = tasks.check

SETTINGS = 'src/small_robot/config/localization.yaml'  # of the filters

DESCRIPTION = 'src/small_robot/urdf/small_robot.urdf'
MOUNTING = {'base_scan': math.radians(-30), 'imu_link': math.radians(20)}  # as it is described
# A part of the name that rmw gives to a node whose subscription is discovered before the node.
NOT_KNOWN = 'NODE_NAME_UNKNOWN'
SETTLED_S = 8.0  # so long after their start programs may take to say something
# The frames that have a parent when the robot and its filters run.
CHILDREN = {'odom', 'base_footprint', 'base_link', 'gps_link', 'base_scan', 'imu_link'}
# What is said on the topics of the robot. A subscription of another type hears nothing.
TYPES = {'odom': 'Odometry', 'imu/data': 'Imu', 'gps/fix': 'NavSatFix', 'odometry/gps': 'Odometry'}

ARM = """<robot name="arm">
<link name="a"/><link name="b"/><link name="c"/><link name="wheel"/>
<joint name="ab" type="fixed"><parent link="a"/><child link="b"/>
<origin xyz="1 2 3" rpy="0 0 0.5"/></joint>
<joint name="bc" type="fixed"><parent link="b"/><child link="c"/>
<origin xyz="0 -1 0" rpy="0.1 0.2 0.3"/></joint>
<joint name="turning" type="continuous"><parent link="a"/><child link="wheel"/>
<origin xyz="0 0 0" rpy="0 0 0"/></joint></robot>"""


@tasks.add
def three_sensors(workspace, file):
    description = cached(lambda: described(workspace, file))

    def has_one_root():
        root = description().get_root()
        return root == 'base_footprint' or f'its root is {root}'

    def is_there(link, xyz, yaw):
        robot = description()
        if link not in robot.link_map:
            return f'no link {link}; there are {", ".join(sorted(robot.link_map))}'
        joints = [joint for joint in robot.joints if joint.child == link]
        if [(joint.parent, joint.type) for joint in joints] != [('base_link', 'fixed')]:
            found = ', '.join(f'{joint.type}, from {joint.parent}' for joint in joints)
            return f'its joints: {found or "none"}'
        origin = joints[0].origin
        shift = (origin and origin.xyz) or [0, 0, 0]
        turn = (origin and origin.rpy) or [0, 0, 0]
        right = np.allclose([*shift, *turn], [*xyz, 0, 0, yaw], atol=1e-3)
        return right or f'xyz and rpy are {[*shift, *turn]}'

    radians = 'rpy is in radians, and to the right is negative.'
    return [
        ('one root', has_one_root, 'Look at each parent.'),
        ('GPS', lambda: is_there('gps_link', (0, 0, 0.3), 0), 'xyz="0 0 0.30"'),
        ('lidar', lambda: is_there('base_scan', (0, 0, 0.1), -0.5236), radians),
        (
            'IMU',
            lambda: is_there('imu_link', (0.05, 0, 0.03), 0.3491),
            'x is in front, z is up; rpy is in radians.',
        ),
    ]


def described(workspace, file=DESCRIPTION):
    """Return the robot of a URDF. Raises Failed if robot_state_publisher would refuse it."""
    try:
        robot = parsed(workspace.file(file).read_text(encoding='utf-8'))
    except SyntaxError as error:  # that of XML, too
        raise Failed(f'{file.split("/")[-1]} is no XML: {error.msg}') from None
    for kind, things in (('links', robot.links), ('joints', robot.joints)):
        name, count = Counter(thing.name for thing in things).most_common(1)[0]
        if count > 1:
            raise Failed(f'{count} {kind} have the name {name}')
    links = set(robot.link_map)
    for joint in robot.joints:
        for link in {joint.parent, joint.child} - links:
            near = [f' Nearly the same: {name}.' for name in get_close_matches(link, links, 1)]
            raise Failed(
                f'{joint.name} names the link {link}, which does not exist.{"".join(near)}'
            )
    return robot


def parsed(text):
    """Return the robot of a URDF, without what its parser prints."""
    with contextlib.redirect_stderr(io.StringIO()):
        return URDF.from_xml_string(text.encode())


@tasks.add
def a_message_for_each_joint(workspace, static_transforms):
    arm = cached(lambda: parsed(ARM))

    def transforms_of(robot):
        return {transform.child_frame_id: transform for transform in static_transforms(robot)}

    def is_transform(robot, parent, child, xyz, rpy):
        transforms = transforms_of(robot)
        if child not in transforms:
            return f'no transform to {child}'
        stamped, right_turn = transforms[child], quaternion(*rpy)
        if stamped.header.frame_id != parent:
            return f'{child} has the parent {stamped.header.frame_id!r}'
        shift, turn = stamped.transform.translation, stamped.transform.rotation
        if not np.allclose((shift.x, shift.y, shift.z), xyz, atol=1e-6):
            return f'{child} is shifted by {shift.x:g}, {shift.y:g}, {shift.z:g}'
        # A quaternion and its negative are the same rotation.
        same = abs(sum(getattr(turn, axis) * getattr(right_turn, axis) for axis in 'xyzw'))
        numbers = ', '.join(f'{getattr(turn, axis):.3f}' for axis in 'xyzw')
        return abs(same - 1) < 1e-6 or f'{child} has another rotation: {numbers}'

    def leaves_wheels_out():
        return 'wheel' not in transforms_of(arm()) or 'there is a transform to wheel'

    return [
        (
            'a shift and a turn',
            lambda: is_transform(arm(), 'a', 'b', (1, 2, 3), (0, 0, 0.5)),
            'message.transform.translation, message.transform.rotation',
        ),
        (
            'a turn about three axes',
            lambda: is_transform(arm(), 'b', 'c', (0, -1, 0), (0.1, 0.2, 0.3)),
            'quaternion(*joint.origin.rpy)',
        ),
        ('wheels are left out', leaves_wheels_out, "joint.type == 'fixed'"),
        (
            'the IMU of your robot',
            lambda: is_transform(
                described(workspace), 'base_link', 'imu_link', (0.05, 0, 0.03), (0, 0, 0.3491)
            ),
            'message.header.frame_id = joint.parent',
        ),
    ]


@tasks.add
def once_is_enough(workspace, StaticBroadcaster):
    def hears(robot, *frames):
        from tf2_msgs.msg import TFMessage  # the lesson has built it

        # rclpy would print which policy is incompatible: that is the answer.
        with contextlib.redirect_stdout(io.StringIO()), Bench() as bench:
            broadcaster = bench.spin(StaticBroadcaster(robot))
            bench.quiet()
            late = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            messages = bench.hear('/tf_static', TFMessage, qos=late)
            bench.wait(lambda: messages, 1.0)
            bench.quiet()
            repeats = any(not timer.is_canceled() for timer in broadcaster.timers)
        heard = [
            sorted(transform.child_frame_id for transform in message.transforms)
            for message in messages
        ]
        if heard != [sorted(frames)]:
            return f'a late node hears {heard or "nothing"}'
        return not repeats or 'it has a timer that publishes again'

    profile = 'QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)'
    return [
        (
            'all frames of one robot',
            lambda: hears(parsed(ARM), 'b', 'c'),
            'static_transforms(robot), when the node is made',
        ),
        (
            'all frames of yours',
            lambda: hears(described(workspace), 'base_link', 'base_scan', 'gps_link', 'imu_link'),
            profile,
        ),
    ]


@tasks.add
def from_a_frame_to_its_parent(to_parent):
    def leads(x, y, yaw):
        points = np.array([1.0, 2.0, 0.5]), np.array([0.0, -1.0, 2.0])
        transform = TransformStamped().transform
        transform.translation, transform.rotation = Vector3(x=x, y=y), quaternion(0, 0, yaw)
        found = np.array(to_parent(*points, transform), float)
        if found.shape != (2, 3):
            return f'of three points it returns numbers of the shape {found.shape}'
        cos, sin = math.cos(yaw), math.sin(yaw)
        right = np.array([[cos, -sin], [sin, cos]]) @ points + [[x], [y]]
        if np.allclose(found, right, atol=1e-5):
            return True
        one = ', '.join(f'{value:.2f}' for value in found[:, 1])
        return (
            f'with a yaw of {yaw} rad and a shift of {x:g}, {y:g} m, the point 2, -1 becomes '
            f'{one}, not {right[0, 1]:.2f}, {right[1, 1]:.2f}'
        )

    turned = 'x cos a - y sin a, x sin a + y cos a: both of the x that the function gets.'
    return [
        ('not turned, not shifted', lambda: leads(0.0, 0.0, 0.0), 'The starter does this.'),
        ('shifted', lambda: leads(1.5, -0.5, 0.0), 'translation.x is added to each x.'),
        ('turned to the left', lambda: leads(0.0, 0.0, 1.0), turned),
        (
            'turned to the right, then shifted',
            lambda: leads(0.5, -0.2, -0.5),
            'The shift is not turned: add it last.',
        ),
    ]


@tasks.add(limit_s=90, cpu_s=20)  # each drive takes some seconds of CPU
def fix_three_faults(workspace, StaticBroadcaster):
    drive = cached(lambda: drive_by(workspace, StaticBroadcaster, SETTINGS, seconds=6))

    def uses(name, sensor, *parts):
        if sensor not in drive().parts[name]:
            return f'{name} has no {sensor}; it has {", ".join(drive().parts[name]) or "nothing"}'
        found = drive().parts[name][sensor]
        if set(found) != set(parts):
            return f'{name} uses of {sensor}: {", ".join(found) or "nothing"}'
        return drive().used[name][sensor] > 0 or f'{name} has used no message of {sensor}'

    def both_use(sensor, *parts):
        found = [uses(name, sensor, *parts) for name in ('ekf_odom', 'ekf_map')]
        return next((result for result in found if result is not True), True)

    def holds_on_a_robot():
        flat = [name for name, is_flat in drive().two_d.items() if is_flat is not True]
        if flat:
            return f'two_d_mode is not true for {", ".join(flat)}'
        given = yaml.safe_load(workspace.file(SETTINGS).read_text(encoding='utf-8'))
        section = given.get('navsat_transform') or given.get('/navsat_transform') or {}
        waits = (section.get('ros__parameters') or {}).get('wait_for_datum')
        return waits is True or 'navsat_transform has no wait_for_datum: true'

    def is_parent(parent, child):
        found = drive().frames.set_index('child')['parent'].get(child)
        return found == parent or f'{child} has the parent {found}'

    def odom_has_no_gps():
        others = set(drive().parts['ekf_odom']) - {'odom0', 'imu0'}
        return not others or 'the pose in odom would jump'

    speeds = 'vx', 'vy', 'vyaw'
    return [
        (
            'both use the speeds of the wheels',
            lambda: both_use('odom0', *speeds),
            'It was right.',
        ),
        (
            'both use yaw and vyaw of the IMU',
            lambda: both_use('imu0', 'yaw', 'vyaw'),
            'Two faults: a topic, and one of the 15 places.',
        ),
        (
            'the filter of map uses GPS',
            lambda: uses('ekf_map', 'odom1', 'x', 'y'),
            'Its section must have the name of the node.',
        ),
        ('the filter of odom does not', odom_has_no_gps, 'GPS is for ekf_map only.'),
        (
            'odom → base_footprint',
            lambda: is_parent('odom', 'base_footprint'),
            'base_link_frame',
        ),
        ('map → odom', lambda: is_parent('map', 'odom'), 'world_frame of ekf_map'),
        (
            'what a robot needs',
            holds_on_a_robot,
            'two_d_mode and wait_for_datum were right.',
        ),
    ]


def drive_by(workspace, StaticBroadcaster, *SETTINGS, **options):
    """Let the robot drive past two filters with these SETTINGS. Raises Failed if they do not start.

    In one process rclpy refuses a subscription whose type is not that of the topic, and prints a
    page; on a robot the subscription hears nothing. So the types are compared before.
    """
    robot, files = described(workspace), [workspace.file(name) for name in SETTINGS]
    for file in files:
        compare_types(file)
    return localize(files, lambda: StaticBroadcaster(robot), mounting=MOUNTING, **options)


def compare_types(file):
    try:
        sections = yaml.safe_load(file.read_text(encoding='utf-8')) or {}
    except yaml.MarkedYAMLError as error:
        line = (error.problem_mark or error.context_mark).line + 1
        raise Failed(f'{file.name}, line {line}: {error.problem}') from None
    if not isinstance(sections, dict):
        raise Failed(f'{file.name} holds no sections, but {sections!r}')
    for name, section in sections.items():
        parameters = section.get('ros__parameters') if isinstance(section, dict) else None
        for key, topic in (parameters if isinstance(parameters, dict) else {}).items():
            wanted = {'odom': 'Odometry', 'imu': 'Imu'}.get(key.rstrip('0123456789'))
            if wanted is None or not key[-1].isdecimal():
                continue
            if not isinstance(topic, str):
                raise Failed(f'{name}: {key} is {topic!r}, not the name of a topic')
            on_topic = TYPES.get(topic.removeprefix('/'), wanted)
            if on_topic != wanted:
                raise Failed(
                    f'{name}: {key} hears {wanted} messages, and {topic} has {on_topic} messages'
                )


@tasks.add
def between_two_transforms(between):
    def goes(old, new, part, right):
        found = between(transform_of(*old), transform_of(*new), part)
        if not isinstance(found, Transform):
            return f'it returns {type(found).__name__}, not a Transform'
        x, y, yaw = found.translation.x, found.translation.y, yaw_of(found.rotation)
        same = math.isclose(math.remainder(yaw - right[2], math.tau), 0, abs_tol=1e-6)
        if same and np.allclose((x, y), right[:2], atol=1e-6):
            return True
        way = f'{part:g} of the way from x, y, yaw = {old} to {new}'
        return f'{way} is {x:.2f}, {y:.2f}, {yaw:.2f}, not {right[0]:g}, {right[1]:g}, {right[2]:g}'

    def leaves_both():
        old, new = transform_of(1.0, 2.0, 0.1), transform_of(3.0, 4.0, 0.3)
        between(old, new, 0.5)
        kept = (old, new) == (transform_of(1.0, 2.0, 0.1), transform_of(3.0, 4.0, 0.3))
        return kept or 'it changes the transforms that it gets'

    short = 'math.remainder(turn, math.tau), before you take a part of it.'
    return [
        (
            'half of the way',
            lambda: goes((1.0, 2.0, 0.0), (2.0, 4.0, 0.4), 0.5, (1.5, 3.0, 0.2)),
            'start.x + part * (end.x - start.x)',
        ),
        (
            'a quarter, back and to the right',
            lambda: goes((2.0, 0.0, 0.6), (-2.0, 1.0, -1.4), 0.25, (1.0, 0.25, 0.1)),
            'part * turn, as well.',
        ),
        (
            'over pi, to the left',
            lambda: goes((0.0, 0.0, 3.0), (0.0, 0.0, 3.2 - math.tau), 0.5, (0.0, 0.0, 3.1)),
            short,
        ),
        (
            'over pi, to the right',
            lambda: goes((0.0, 0.0, -3.1), (0.0, 0.0, 3.1), 0.0, (0.0, 0.0, -3.1)),
            short,
        ),
        ('both stay as they are', leaves_both, 'Make a new Vector3.'),
    ]


def transform_of(x, y, yaw):
    return Transform(translation=Vector3(x=x, y=y), rotation=quaternion(0, 0, yaw))


def stamped_at(t, x, y, yaw, child='base_footprint', parent='odom'):
    stamped = TransformStamped(child_frame_id=child, transform=transform_of(x, y, yaw))
    stamped.header.frame_id, stamped.header.stamp = parent, stamp_of(t)
    return stamped


@tasks.add
def look_it_up(Buffer):
    KEPT = (0.5, 1.0, 0.0, 0.0), (0.75, 2.0, 0.0, 0.4), (1.25, 4.0, 1.0, 0.0)

    def filled():
        buffer = Buffer()
        for kept in KEPT:
            buffer.add(stamped_at(*kept))
            buffer.add(stamped_at(*kept[:1], 7.0, 7.0, 0.7, child='wheel'))
        return buffer

    def finds(t, *right, child='base_footprint'):
        found = filled().lookup(child, t)
        if not isinstance(found, Transform):
            return f'at {t:g} s it returns {type(found).__name__}, not a Transform'
        values = found.translation.x, found.translation.y, yaw_of(found.rotation)
        if np.allclose(values, right, atol=1e-6):
            return True
        shown = ', '.join(f'{value:.2f}' for value in values)
        return f'of {child} at {t:g} s it returns x, y, yaw = {shown}, not {right}'

    def refuses(t, where, other):
        try:
            filled().lookup('base_footprint', t)
        except Exception as error:
            if type(error).__name__ != 'ExtrapolationException':
                raise
            text = str(error)
            if f'into the {where}' not in text:
                return f'at {t:g} s it says: {text}'
            wanted = f'{t:.6f}', f'{other:.6f}'
            return all(number in text for number in wanted) or f'it names other times: {text}'
        times = ', '.join(f'{kept[0]:g}' for kept in KEPT)
        return f'transforms of {times} s, asked for {t:g} s: it raises nothing'

    return [
        (
            'at a stamp',
            lambda: finds(0.75, 2.0, 0.0, 0.4),
            'kept[bisect_left(times, t)].transform',
        ),
        ('at the newest', lambda: finds(1.25, 4.0, 1.0, 0.0), 'Only t > times[-1] is too late.'),
        ('at the oldest', lambda: finds(0.5, 1.0, 0.0, 0.0), 'Only t < times[0] is too early.'),
        (
            'between the first two',
            lambda: finds(0.55, 1.2, 0.0, 0.08),
            'part is (t - before) / (after - before), in times.',
        ),
        ('between the last two', lambda: finds(1.0, 3.0, 0.5, 0.2), 'between(old, new, part)'),
        ('another child', lambda: finds(1.0, 7.0, 7.0, 0.7, child='wheel'), 'transforms[child]'),
        (
            'in the future',
            lambda: refuses(1.5, 'future', 1.25),
            'raise ExtrapolationException(FUTURE.format(t, times[-1]))',
        ),
        (
            'in the past',
            lambda: refuses(0.25, 'past', 0.5),
            'raise ExtrapolationException(PAST.format(t, times[0]))',
        ),
    ]


@tasks.add
def keep_it_until_its_transform_is_there(PatientMapper, in_robot):
    def scan_at(t, length=1.0):
        scan = LaserScan(angle_increment=0.1, range_min=0.1, range_max=8.0, ranges=[length])
        scan.header.stamp = stamp_of(t)
        return scan

    def tf(mapper, t, x):
        mapper.tf_callback(transforms([stamped_at(t, x, 0.0, 0.0)]))

    def transforms(stamped):
        from tf2_msgs.msg import TFMessage  # the lesson has built it

        return TFMessage(transforms=stamped)

    def found_by(steps):
        with Bench() as bench:
            mapper = bench.spin(PatientMapper())
            counts = []
            for step in steps:
                step(mapper)
                counts.append(len(mapper.found))
        return mapper, counts

    def counts_are(steps, right, said):
        counts = found_by(steps)[1]
        return counts == right or f'{said}: after each message it has placed {counts}, not {right}'

    def at_once():
        steps = [
            lambda m: tf(m, 1.0, 0.0),
            lambda m: tf(m, 2.0, 1.0),
            lambda m: m.scan_callback(scan_at(1.5)),
        ]
        return counts_are(steps, [0, 0, 1], 'transforms of 1 and 2 s, a scan of 1.5 s')

    def later():
        steps = [
            lambda m: tf(m, 1.0, 0.0),
            lambda m: m.scan_callback(scan_at(1.5)),
            lambda m: tf(m, 2.0, 1.0),
            lambda m: tf(m, 3.0, 2.0),
        ]
        return counts_are(steps, [0, 0, 1, 1], 'transform of 1 s, scan of 1.5 s, transforms of 2 '
                                               'and 3 s')  # fmt: skip

    def at_its_place():
        steps = [
            lambda m: tf(m, 1.0, 0.0),
            lambda m: m.scan_callback(scan_at(1.5)),
            lambda m: tf(m, 2.0, 1.0),
        ]
        mapper, counts = found_by(steps)
        if counts[-1] != 1:
            return 'the scan is not placed'
        x = float(np.ravel(mapper.found[0])[0])
        right = 0.5 + float(np.ravel(in_robot(scan_at(1.5)))[0])
        return abs(x - right) < 1e-6 or f'the scan is placed at x = {x:.2f}, not {right:.2f}'

    def others_wait():
        steps = [
            lambda m: tf(m, 1.0, 0.0),
            lambda m: m.scan_callback(scan_at(1.2)),
            lambda m: m.scan_callback(scan_at(1.4)),
            lambda m: m.scan_callback(scan_at(2.5)),
            lambda m: tf(m, 2.0, 1.0),
            lambda m: tf(m, 3.0, 2.0),
        ]
        said = 'scans of 1.2, 1.4 and 2.5 s wait, then come transforms of 2 and 3 s'
        return counts_are(steps, [0, 0, 0, 0, 2, 3], said)

    def not_for_ever():
        steps = [lambda m: tf(m, 1.0, 0.0)]
        for number in range(15):
            steps.append(lambda m, t=2 + number / 10: m.scan_callback(scan_at(t)))
        mapper, _ = found_by(steps)
        stamps = [round(seconds_of(scan.header.stamp), 1) for scan in mapper.waiting]
        right = [round(2 + number / 10, 1) for number in range(5, 15)]
        if stamps == right:
            return True
        return f'of 15 scans without a transform, {len(stamps)} wait, those of {stamps} s'

    return [
        ('a scan whose transform is there', at_once, 'scan_callback calls try_again.'),
        (
            'a scan that is too early',
            later,
            'except ExtrapolationException: it goes into a new list.',
        ),
        ('it is placed where the robot was', at_its_place, 'self.place(scan)'),
        (
            'the others go on waiting',
            others_wait,
            'A try for each scan. A loop skips some if its list changes meanwhile.',
        ),
        ('at most ten wait, the newest', not_for_ever, 'self.waiting = too_early[-AT_MOST:]'),
    ]


@tasks.add(limit_s=150)
def two_filters(workspace, file):
    @cached
    def seen():
        """Return who publishes and receives what, of which type of frame, when all runs."""
        build(workspace, 'small_robot')
        return watch_launch(workspace, file)

    def has_started():
        programs = seen().programs
        right = ['ekf_node', 'ekf_node', 'navsat_transform_node', 'robot']
        right += ['robot_state_publisher']
        return programs == right or f'it starts {", ".join(programs) or "nothing"}'

    def has_names():
        filters = sorted(seen().filters)
        return filters == ['ekf_map', 'ekf_odom'] or (
            f'the filters are called {", ".join(filters) or "nothing"}'
        )

    def receives_imu():
        names = seen().hear_imu & {'ekf_odom', 'ekf_map'}
        missing = sorted({'ekf_odom', 'ekf_map'} - names)
        return not missing or f'{", ".join(missing)} does not subscribe to /imu'

    def publishes(topic, frame):
        frames = sorted(seen().frames[topic])
        if not frames:
            return f'nobody publishes /{topic}'
        return frames == [frame] or f'/{topic} has poses in {", ".join(frames)}'

    def is_connected():
        missing = sorted(CHILDREN - seen().children)
        return not missing or f'nobody says where {", ".join(missing)} is'

    return [
        ('five programs', has_started, 'Two nodes with exec="ekf_node".'),
        (
            'two names',
            has_names,
            'name="ekf_odom", name="ekf_map": the YAML has a section for each.',
        ),
        ('both receive the IMU', receives_imu, '<remap from="imu/data" to="imu"/>, in both.'),
        (
            'ekf_odom says where it is in odom',
            lambda: publishes('odometry/filtered', 'odom'),
            'Its topic keeps its name, and it has its parameters.',
        ),
        (
            'ekf_map says where it is in map',
            lambda: publishes('odometry/map', 'map'),
            '<remap from="odometry/filtered" to="odometry/map"/>, in ekf_map.',
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
    from tf2_msgs.msg import TFMessage  # the lesson has built it

    command = f'source install/setup.bash\nros2 launch {file}'
    topics = 'odometry/filtered', 'odometry/map'
    discovered_s: list[float] = []
    children: set[str] = set()

    def hear_frames(messages):
        for message in messages:
            children.update(one.child_frame_id for one in message.transforms)
        messages.clear()

    with contextlib.redirect_stdout(io.StringIO()), Bench() as bench:
        late = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        transforms = bench.hear('/tf', TFMessage), bench.hear('/tf_static', TFMessage, qos=late)
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
                    hear_frames(messages)
                text = '\n'.join(process.lines)
                if any(NOT_KNOWN in name for name in filters() | hear_imu()):
                    return not process.running or DIED in text
                if all(poses.values()) and children >= CHILDREN and len(hear_imu()) > 1:
                    return True
                nodes = len(bench.tester.get_node_names()) - own_nodes
                if not discovered_s and 0 < len(started(text)) <= nodes:
                    discovered_s.append(time.monotonic())
                settled = discovered_s and time.monotonic() - discovered_s[0] > SETTLED_S
                return settled or not process.running or DIED in text

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
        covariance = heard[0].twist.covariance
        right = np.zeros(36)
        right[[0, 7, 35]] = VARIANCES['vx'], VARIANCES['vy'], VARIANCES['vyaw']
        wrong = [
            f'{place}: {covariance[place]:g}'
            for place in range(36)
            if not math.isclose(covariance[place], right[place], abs_tol=1e-12)
        ]
        return not wrong or f'of the 36 numbers these are wrong: {", ".join(wrong)}'

    return [
        ('each message comes', lambda: comes(0.5), 'self.publisher.publish(message)'),
        ('another one', lambda: comes(-0.2), 'The message that it receives.'),
        ('three variances', has_variances, "message.twist.covariance[0] = VARIANCES['vx']"),
    ]
