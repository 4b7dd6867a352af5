"""Of the sensors: what several tasks of this lesson look at."""

import contextlib
import io
from collections import Counter
from difflib import get_close_matches

import yaml
from urdf_parser_py.urdf import URDF

from helpers.checks.errors import Failed
from helpers.checks.tasks import Tasks

tasks = Tasks()

DESCRIPTION = 'src/small_robot/urdf/small_robot.urdf'
SETTINGS = 'src/small_robot/config/localization.yaml'  # of the filters
SENSORS = ['base_scan', 'gps_link', 'imu_link']


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


def with_sensors(workspace):
    """Return the student's robot. Raises Failed if it has not the sensors of the first task."""
    robot = described(workspace)
    if missing := [link for link in SENSORS if link not in robot.link_map]:
        raise Failed(
            f'your robot has no {", ".join(missing)}: the task "Three sensors" is not solved'
        )
    return robot


def sections_of(file):
    """Return what a YAML file of parameters says, by node. Raises Failed if it cannot be read."""
    try:
        sections = yaml.safe_load(file.read_text(encoding='utf-8')) or {}
    except yaml.MarkedYAMLError as error:
        line = (error.problem_mark or error.context_mark).line + 1
        raise Failed(f'{file.name}, line {line}: {error.problem}') from None
    if not isinstance(sections, dict):
        raise Failed(f'{file.name} holds no sections, but {sections!r}')
    return sections


def tf_message():
    """Return the class TFMessage. The lesson builds its package, so it cannot be imported above."""
    from tf2_msgs.msg import TFMessage

    return TFMessage


def in_text(numbers):
    return ', '.join(f'{number:.2f}' for number in numbers)
