"""The robots with faults, built and driven. tests/answers/test_faults.py drives all of them."""

import re

import pytest

from helpers.checks.lessons.find_the_fault import found, mended
from helpers.faults import FAULTS, OTHER, drive, take
from helpers.faults.cases import HEALTHY
from helpers.workspace import Workspace


@pytest.fixture(scope='module')
def workspace():
    opened = Workspace('test_faults')
    yield opened
    opened.close()


def results(points):
    """Return for each point whether it is met, or what was found."""
    said = []
    for _, test, _ in points:
        try:
            result = test()
        except Exception as error:
            result = str(error)
        said.append(result if isinstance(result, str) else bool(result))
    return said


def test_the_healthy_package_drives_and_its_tests_pass(workspace):
    fault = FAULTS['deaf_brake']
    robot = take(workspace, fault, 'ada', anew=True)
    assert 'as you got them' in results(mended(robot))[0]
    robot.mend(fault.right[0])
    assert robot.files['ada/brake.py'] == robot.named((HEALTHY / 'courier/brake.py').read_text())
    assert results(mended(robot)) == [True] * 4
    said = workspace.terminal('source install/setup.bash\npython3 -m pytest -q src/ada')
    assert '2 passed' in said
    # What is left as it is stays; what belongs to another fault does not.
    take(workspace, fault, 'ada')
    assert robot.files != robot.given
    take(workspace, FAULTS['unread_limit'], 'ada')
    assert robot.files['ada/brake.py'] != robot.given['ada/brake.py']


@pytest.mark.parametrize(
    ('path', 'text', 'said'),
    [
        ('config/ada.yaml', 'brake: [stop_m: 0.5', 'Error parsing|parse params file'),
        ('config/ada.yaml', 'nothing: 1\n', 'says no stop_m any more'),
        ('launch/bringup.launch.xml', '<launch>', 'no valid XML'),
        ('launch/bringup.launch.xml', None, 'was not found'),
        ('ada/brake.py', 'def main(:\n', 'SyntaxError.* of brake.py'),
        ('ada/brake.py', 'import no_such\n', "No module named 'no_such'.*Line 1 of brake.py"),
    ],
)
def test_what_cannot_run_is_named(workspace, path, text, said):
    robot = take(workspace, FAULTS['deaf_brake'], 'ada', anew=True)
    file = robot.folder / path
    file.unlink() if text is None else file.write_text(text)
    first = results(mended(robot))[0]
    assert re.search(said, first), first
    assert str(workspace.path) not in first


def test_evidence_must_have_been_run(workspace):
    robot = take(workspace, FAULTS['private_topic'], 'bo', anew=True)
    command, line = 'ros2 topic info /wanted', 'Publisher count: 0'
    assert results(found(robot, ..., ..., ...))[:2] == ['no command yet', 'no line yet']
    assert 'no cell with %%terminal has run' in results(found(robot, 'name', command, line))[0]
    workspace.terminal(f'echo "{line}" # {command}')
    assert results(found(robot, 'name', command, line)) == [True] * 4
    assert results(found(robot, 'nam', command, 'count: 0'))[2:] == [
        True,
        "'nam' is none of the kinds",
    ]
    assert 'has printed no line with: count: 7' in results(found(robot, 3, command, 'count: 7'))[1]
    assert results(found(robot, 'qos', command, line))[3] == 'qos: no'


@pytest.mark.parametrize(('name', 'trouble'), [('two_clocks', 'clock'), ('wrong_way', 'push')])
def test_a_drive_can_have_trouble(workspace, name, trouble):
    fault = FAULTS[name]
    robot = take(workspace, fault, 'cleo', anew=True)
    robot.mend(fault.right[0])
    end = drive(robot, OTHER, trouble=trouble)
    assert (end.how, end.braked, end.went_on, end.stands_at_exit) == ('stops', True, True, True)
    assert end.voices == {'cmd_vel': 1, 'wanted': 1}  # who pushes it is no program of the robot
