"""What the tasks of the lesson "Put the sensors on the robot" are judged by."""

import contextlib
import io
import math
from collections import Counter
from difflib import get_close_matches

import numpy as np
import pandas as pd
import yaml
from geometry_msgs.msg import TransformStamped, Vector3
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import LaserScan
from urdf_parser_py.urdf import URDF

from helpers.checks.bench import Bench
from helpers.checks.builds import build, data_files_of
from helpers.checks.errors import Failed
from helpers.checks.tasks import Tasks, once
from helpers.fusion import localize, simulate
from helpers.ros import quaternion

tasks = Tasks()
check = tasks.check

DESCRIPTION = 'src/small_robot/urdf/small_robot.urdf'
MOUNTING = {'base_scan': math.radians(-30), 'imu_link': math.radians(20)}  # as it is described
CROOKED_DEG = 30.0  # by which the IMU of the other robot is turned
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


def crooked_drive():
    """Return the table of a drive of a robot whose IMU is mounted at an angle."""
    return simulate(seed=4, seconds=40, imu_mounting=math.radians(CROOKED_DEG)).measurements


@tasks.add(1)
def three_sensors(workspace, file):
    description = once(lambda: described(workspace, file))

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
            'x is in front, z is up.',
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


@tasks.add(2)
def a_message_for_each_joint(workspace, static_transforms):
    arm = once(lambda: parsed(ARM))

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


@tasks.add(3)
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


@tasks.add(4)
def where_the_beams_end(points):
    def ends_at(x, y, yaw):
        ranges = (1.0, 2.0, 4.0)
        scan = LaserScan(angle_min=-0.5, angle_max=0.5, angle_increment=0.5, ranges=ranges)
        transform = TransformStamped().transform
        transform.translation, transform.rotation = Vector3(x=x, y=y), quaternion(0, 0, yaw)
        found = np.array(points(scan, transform), float)
        if found.shape != (2, 3):
            return f'of three beams it returns numbers of the shape {found.shape}'
        turned = np.array([-0.5, 0.0, 0.5]) + yaw
        right = [x + ranges * np.cos(turned), y + ranges * np.sin(turned)]
        ahead = found[:, 1].round(2).tolist()
        return np.allclose(found, right, atol=1e-5) or f'the beam straight ahead ends at {ahead}'

    return [
        ('not turned', lambda: ends_at(0.0, 0.0, 0.0), 'The starter does this.'),
        ('turned to the left', lambda: ends_at(0.0, 0.0, 1.0), 'angles + yaw_of(...)'),
        (
            'turned to the right, and shifted',
            lambda: ends_at(0.5, -0.2, -0.5),
            'translation.x',
        ),
    ]


@tasks.add(5)
def how_is_it_turned(turned_back, my_angle):
    def turns_back(angle):
        found = turned_back(pd.DataFrame({'imu_yaw': [0.0, 1.0], 'vx': [1.0, 1.0]}), angle)
        right = np.array([0.0, 1.0]) - angle
        same = np.allclose(np.remainder(found['imu_yaw'] - right + 1, math.tau), 1)
        return same or f'with {angle} rad, yaws of 0 and 1 become {found["imu_yaw"].tolist()}'

    def leaves_the_table():
        table = pd.DataFrame({'imu_yaw': [0.0, 1.0], 'vx': [1.0, 1.0]})
        turned_back(table, 0.3)
        yaws = table['imu_yaw'].tolist()
        return yaws == [0.0, 1.0] or (
            f'the table that it was given has other yaws now, {yaws}: a second run turns them again'
        )

    def lies_on_the_fixes():
        if abs(my_angle - CROOKED_DEG) <= 4:
            return True
        side = 'to the left' if my_angle < CROOKED_DEG else 'to the right'
        return f'with {my_angle:g} degrees the path still bends {side}'

    return [
        ('an IMU that is turned to the left', lambda: turns_back(0.3), 'angle, not my_angle.'),
        (
            'an IMU that is turned to the right',
            lambda: turns_back(-1.0),
            "table['imu_yaw'] - angle",
        ),
        (
            'the table that it is given stays as it is',
            leaves_the_table,
            'table.assign(imu_yaw=...) makes a new table.',
        ),
        (
            'the path lies on the fixes',
            lies_on_the_fixes,
            'It bends to the left: a larger angle. To the right: a smaller one.',
        ),
    ]


@tasks.add(6, limit_s=90)
def data_files(workspace):
    pairs = once(lambda: data_files_of(workspace, 'small_robot'))

    @once
    def installed():
        complete_the_package(workspace)
        pairs()  # what is wrong with them is said better than by the build
        build(workspace, 'small_robot', anew=True)
        return workspace.file('install/small_robot/share')

    def is_named(file, folder):
        """Test the pairs, because colcon adds what a package of ROS cannot do without."""
        folders = [place.rstrip('/') for place, files in pairs() if file in files]
        if folder in folders:
            return installed().is_dir()
        return f'{file} goes into {folders[0]}' if folders else f'no pair has the file {file}'

    def is_installed(file):
        name, share = file.split('/')[-1], installed() / 'small_robot'
        if (share / file).is_file():
            return True
        places = sorted(path.relative_to(share).as_posix() for path in share.rglob(name))
        if places:
            return f'{places[0]} is there, not {file}'
        return f'no {file} in the share folder'

    markers = 'share/ament_index/resource_index/packages'
    return [
        ('the URDF', lambda: is_installed('urdf/small_robot.urdf'), 'A folder and a list.'),
        (
            'the YAML',
            lambda: is_installed('config/localization.yaml'),
            'The paths begin at setup.py.',
        ),
        (
            'package.xml',
            lambda: is_named('package.xml', 'share/small_robot'),
            "('share/small_robot', ['package.xml'])",
        ),
        (
            'the marker',
            lambda: is_named('resource/small_robot', markers),
            'ROS finds the package by it.',
        ),
    ]


def complete_the_package(workspace):
    """Write the files of the package that the lesson does not speak of, if they are not there."""
    scripts = '$base/lib/small_robot'
    files = {
        'resource/small_robot': '',
        'small_robot/__init__.py': '',
        'setup.cfg': f'[develop]\nscript_dir={scripts}\n[install]\ninstall_scripts={scripts}\n',
        'config/localization.yaml': '{}\n',
    }
    for name, text in files.items():
        if not workspace.file(f'src/small_robot/{name}').exists():
            workspace.write(f'src/small_robot/{name}', text)


@tasks.add(7, limit_s=90, cpu_s=20)  # each drive takes some seconds of CPU
def fix_three_faults(workspace, settings, StaticBroadcaster):
    drive = once(lambda: drive_by(workspace, StaticBroadcaster, settings, seconds=6))

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
    ]


def drive_by(workspace, StaticBroadcaster, *settings, **options):
    """Let the robot drive past two filters with these settings. Raises Failed if they do not start.

    In one process rclpy refuses a subscription whose type is not that of the topic, and prints a
    page; on a robot the subscription hears nothing. So the types are compared before.
    """
    robot, files = described(workspace), [workspace.file(name) for name in settings]
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


@tasks.add(8, limit_s=90, cpu_s=20)
def let_it_doubt(workspace, settings, start, StaticBroadcaster):
    def drive(**options):
        return drive_by(workspace, StaticBroadcaster, settings, start, **options)

    def starts_at(x, y):
        first_s = drive(start=(x, y, 0.0), seconds=3).first_used_s['ekf_map'].get('odom1', math.inf)
        away = f'{math.hypot(x, y):g} m away'
        return first_s < 2 or f'the fix of the first second is kept out, {away}'

    def stays_sure():
        variances = drive(seconds=1).initial['ekf_map']
        if not variances:
            return 'the filter of map has no initial_estimate_covariance'
        doubts = [name for name, value in variances.items() if value > 1e-3]
        others = sorted({*doubts} - {'x', 'y'})
        return not others or f'it also doubts {", ".join(others)}'

    return [
        (
            '3 m to the east',
            lambda: starts_at(3.0, 0.0),
            '3 m squared are 9 m²; 1.0 is often enough.',
        ),
        ('3 m to the south', lambda: starts_at(0.0, -3.0), 'The second number is y.'),
        ('sure of all the rest', stays_sure, 'Change the first two numbers only.'),
    ]
