"""Of the sensors: the parameters of two filters."""

import math
import re
from functools import partial

from helpers.checks.errors import Failed
from helpers.checks.lessons.put_the_sensors_on_the_robot.shared import (
    SETTINGS,
    sections_of,
    tasks,
    with_sensors,
)
from helpers.checks.points import all_of, cached, expect
from helpers.fusion import localize

MOUNTING = {'base_scan': math.radians(-30), 'imu_link': math.radians(20)}  # as it is described
# What is said on the topics of the robot, and what a filter hears with its parameter odom0 or imu0.
TYPES = {'odom': 'Odometry', 'imu/data': 'Imu', 'gps/fix': 'NavSatFix', 'odometry/gps': 'Odometry'}
HEARD = {'odom': 'Odometry', 'imu': 'Imu'}


@tasks.add(limit_s=90, cpu_s=20)  # each drive takes some seconds of CPU
def fix_three_faults(workspace, StaticBroadcaster):
    @cached
    def drive():
        robot, file = with_sensors(workspace), workspace.file(SETTINGS)
        compare_types(file)
        return localize([file], partial(StaticBroadcaster, robot), seconds=6, mounting=MOUNTING)

    def uses(name, sensor, *parts):
        of_filter = drive().parts[name]
        if sensor not in of_filter:
            return f'{name} has no {sensor}; it has {", ".join(of_filter) or "nothing"}'
        right_parts = expect(sorted(of_filter[sensor]), sorted(parts), f'{name} uses of {sensor}:')
        has_used = drive().used[name][sensor] > 0
        return all_of(right_parts, has_used or f'{name} has used no message of {sensor}')

    def both_use(sensor, *parts):
        return all_of(uses('ekf_odom', sensor, *parts), uses('ekf_map', sensor, *parts))

    def odom_has_no_gps():
        others = sorted(set(drive().parts['ekf_odom']) - {'odom0', 'imu0'})
        return not others or f'ekf_odom also has {", ".join(others)}: its pose would jump'

    def is_parent(parent, child):
        found = drive().frames.set_index('child')['parent'].get(child)
        return expect(found, parent, f'{child} has the parent')

    def holds_on_a_robot():
        flat = [name for name, is_flat in drive().two_d.items() if is_flat is not True]
        sections = sections_of(workspace.file(SETTINGS))
        section = sections.get('navsat_transform') or sections.get('/navsat_transform') or {}
        waits = (section.get('ros__parameters') or {}).get('wait_for_datum') is True
        return all_of(
            not flat or f'two_d_mode is not true for {", ".join(flat)}',
            waits or 'navsat_transform has no wait_for_datum: true',
        )

    two_faults = 'Two faults: a topic, and one of the 15 places.'
    section_name = 'Its section must have the name of the node.'
    both_right = 'two_d_mode and wait_for_datum were right.'
    return [
        (
            'both use the speeds of the wheels',
            lambda: both_use('odom0', 'vx', 'vy', 'vyaw'),
            'It was right.',
        ),
        ('both use yaw and vyaw of the IMU', lambda: both_use('imu0', 'yaw', 'vyaw'), two_faults),
        ('the filter of map uses GPS', lambda: uses('ekf_map', 'odom1', 'x', 'y'), section_name),
        ('the filter of odom does not', odom_has_no_gps, 'GPS is for ekf_map only.'),
        ('odom → base_footprint', lambda: is_parent('odom', 'base_footprint'), 'base_link_frame'),
        ('map → odom', lambda: is_parent('map', 'odom'), 'world_frame of ekf_map'),
        ('what a robot needs', holds_on_a_robot, both_right),
    ]


def compare_types(file):
    """Raise Failed if a filter would subscribe to a topic with another type than that of the topic.

    On a robot it hears nothing. In one process rclpy refuses it, and prints a page.
    """
    for name, section in sections_of(file).items():
        parameters = section.get('ros__parameters') if isinstance(section, dict) else None
        for key, topic in (parameters if isinstance(parameters, dict) else {}).items():
            sensor = re.fullmatch(r'(odom|imu)\d+', str(key))
            if not sensor:
                continue
            if not isinstance(topic, str):
                raise Failed(f'{name}: {key} is {topic!r}, not the name of a topic')
            heard = HEARD[sensor[1]]
            said = TYPES.get(topic.removeprefix('/'), heard)
            if said != heard:
                raise Failed(
                    f'{name}: {key} hears {heard} messages, and {topic} has {said} messages'
                )
