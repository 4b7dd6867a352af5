"""Of the sensors: the description, its static transforms, and what they are for."""

import contextlib
import io
import math

import numpy as np
from geometry_msgs.msg import TransformStamped, Vector3
from rclpy.qos import DurabilityPolicy, QoSProfile

from helpers.checks.bench import Bench
from helpers.checks.errors import Failed
from helpers.checks.lessons.put_the_sensors_on_the_robot.shared import (
    SENSORS,
    described,
    in_text,
    parsed,
    tasks,
    tf_message,
    with_sensors,
)
from helpers.checks.points import all_of, cached, expect
from helpers.ros import quaternion

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
        return expect(description().get_root(), 'base_footprint', 'its root is')

    def is_there(link, xyz, yaw):
        robot = description()
        if link not in robot.link_map:
            return f'no link {link}; there are {", ".join(sorted(robot.link_map))}'
        joints = [joint for joint in robot.joints if joint.child == link]
        found = [f'{joint.type}, from {joint.parent}' for joint in joints]
        if found != ['fixed, from base_link']:
            return expect(found, ['fixed, from base_link'], f'the joints to {link} are')
        origin = joints[0].origin
        shift = (origin and origin.xyz) or [0.0, 0.0, 0.0]
        turn = (origin and origin.rpy) or [0.0, 0.0, 0.0]
        place, right = [*shift, *turn], [*xyz, 0.0, 0.0, yaw]
        return np.allclose(place, right, atol=1e-3) or f'xyz and rpy are {place}, not {right}'

    gps, lidar, imu = (0.0, 0.0, 0.3), (0.0, 0.0, 0.1), (0.05, 0.0, 0.03)
    to_the_right = 'rpy is in radians, and to the right is negative.'
    in_front = 'x is in front, z is up; rpy is in radians.'
    return [
        ('one root', has_one_root, 'Look at each parent.'),
        ('GPS', lambda: is_there('gps_link', gps, 0.0), 'xyz="0 0 0.30"'),
        ('lidar', lambda: is_there('base_scan', lidar, -0.5236), to_the_right),
        ('IMU', lambda: is_there('imu_link', imu, 0.3491), in_front),
    ]


@tasks.add
def a_message_for_each_joint(workspace, static_transforms):
    arm = cached(lambda: parsed(ARM))

    def transforms_of(robot):
        made = static_transforms(robot)
        children = [transform.child_frame_id for transform in made]
        for child in children:
            if children.count(child) > 1:
                raise Failed(f'there are {children.count(child)} messages for {child}', hint='')
        return dict(zip(children, made, strict=True))

    def is_transform(robot, parent, child, xyz, rpy):
        transforms = transforms_of(robot)
        if child not in transforms:
            return f'no transform to {child}'
        stamped = transforms[child]
        shift = stamped.transform.translation
        found_shift = [round(metres, 6) for metres in (shift.x, shift.y, shift.z)]
        found, right = four(stamped.transform.rotation), four(quaternion(*rpy))
        # A quaternion and its negative are the same rotation.
        is_same = abs(abs(np.dot(found, right)) - 1) < 1e-6
        return all_of(
            expect(stamped.header.frame_id, parent, f'{child} has the parent'),
            expect(found_shift, [*xyz], f'{child} is shifted by'),
            is_same or f'{child} has the rotation {in_text(found)}, not {in_text(right)}',
        )

    def has_imu():
        """Compare with what the description says, also if the IMU is at a wrong place there."""
        robot = with_sensors(workspace)
        joint = next(joint for joint in robot.joints if joint.child == 'imu_link')
        return is_transform(robot, joint.parent, 'imu_link', joint.origin.xyz, joint.origin.rpy)

    def leaves_wheels_out():
        return 'wheel' not in transforms_of(arm()) or 'there is a transform to wheel'

    one_turn = (1.0, 2.0, 3.0), (0.0, 0.0, 0.5)
    three_turns = (0.0, -1.0, 0.0), (0.1, 0.2, 0.3)
    fields = 'message.transform.translation, message.transform.rotation'
    rpy = 'quaternion(*joint.origin.rpy)'
    return [
        ('a shift and a turn', lambda: is_transform(arm(), 'a', 'b', *one_turn), fields),
        ('a turn about three axes', lambda: is_transform(arm(), 'b', 'c', *three_turns), rpy),
        ('wheels are left out', leaves_wheels_out, "joint.type == 'fixed'"),
        ('the IMU of your robot', has_imu, 'message.header.frame_id = joint.parent'),
    ]


def four(turn):
    """Return the four numbers of a quaternion."""
    return [turn.x, turn.y, turn.z, turn.w]


@tasks.add
def once_is_enough(workspace, StaticBroadcaster):
    def hears(robot, *frames):
        # rclpy would print which policy is incompatible: that is the answer.
        with contextlib.redirect_stdout(io.StringIO()), Bench() as bench:
            late = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            early = bench.hear('/tf_static', tf_message(), qos=late)
            broadcaster = bench.spin(StaticBroadcaster(robot))
            bench.wait(lambda: early, 1.0)
            bench.quiet()
            messages = bench.hear('/tf_static', tf_message(), qos=late)
            bench.wait(lambda: messages, 1.0)
            bench.quiet()
            repeats = any(not timer.is_canceled() for timer in broadcaster.timers)
        heard = [
            sorted(transform.child_frame_id for transform in message.transforms)
            for message in messages
        ]
        return all_of(
            expect(heard, [sorted(frames)], 'the frames in each message that a late node hears:'),
            expect(len(early), 1, 'the number of messages that it publishes is'),
            not repeats or 'it has a timer that publishes again',
        )

    def hears_yours():
        return hears(with_sensors(workspace), 'base_link', *SENSORS)

    when = 'static_transforms(robot), when the node is made'
    profile = 'QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)'
    return [
        ('all frames of one robot', lambda: hears(parsed(ARM), 'b', 'c'), when),
        ('all frames of yours', hears_yours, profile),
    ]


@tasks.add
def from_a_frame_to_its_parent(to_parent):
    def leads(x, y, yaw):
        points = np.array([1.0, 2.0, 0.5]), np.array([0.0, -1.0, 2.0])
        transform = TransformStamped().transform
        transform.translation, transform.rotation = Vector3(x=x, y=y), quaternion(0, 0, yaw)
        found = np.array(to_parent(*points, transform), float)
        if found.shape != (2, 3):
            return f'of three points it returns numbers of the shape {found.shape}, not (2, 3)'
        cos, sin = math.cos(yaw), math.sin(yaw)
        right = np.array([[cos, -sin], [sin, cos]]) @ points + [[x], [y]]
        return np.allclose(found, right, atol=1e-5) or (
            f'with a yaw of {yaw} rad and a shift of {x:g}, {y:g} m, the point 2, -1 becomes '
            f'{in_text(found[:, 1])}, not {in_text(right[:, 1])}'
        )

    turned = 'x cos a - y sin a, x sin a + y cos a: both of the x that the function gets.'
    last = 'The shift is not turned: add it last.'
    return [
        ('not turned, not shifted', lambda: leads(0.0, 0.0, 0.0), 'The starter does this.'),
        ('shifted', lambda: leads(1.5, -0.5, 0.0), 'translation.x is added to each x.'),
        ('turned to the left', lambda: leads(0.0, 0.0, 1.0), turned),
        ('turned to the right, then shifted', lambda: leads(0.5, -0.2, -0.5), last),
    ]
