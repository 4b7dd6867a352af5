"""The faults, as their folders say them. tests/packages/test_robots_with_faults.py drives some."""

import ast
import re
import shutil
import xml.dom.minidom
from itertools import cycle
from types import SimpleNamespace

import pytest
import yaml

from helpers.checks import next_robot, progress
from helpers.faults import (
    CORE,
    FAULTS,
    KINDS,
    OTHERS,
    Case,
    order_of,
    proves,
    take,
    words,
)
from helpers.faults.cases import FILE, edited, read
from helpers.lesson import path_of
from helpers.workspace import Workspace

MENDS = [(fault, mend) for fault in FAULTS.values() for mend in (*fault.right, *fault.wrong)]


class Offline(Workspace):
    """A folder in which nothing runs. A build copies the package."""

    def __init__(self, path):
        self.path, self._parts, self._ran = path, {}, []

    def terminal(self, commands):
        self._ran.append((commands, ''))
        return ''

    def build(self, name, symlink_install):
        shutil.copytree(self.path / 'src' / name, self.path / 'install' / name)
        return SimpleNamespace(ok=True)


def check_syntax(path, text):
    if path.endswith('.py'):
        ast.parse(text)
    elif path.endswith('.yaml'):
        yaml.safe_load(text)
    elif path.endswith('.xml'):
        xml.dom.minidom.parseString(text)


@pytest.mark.parametrize('name', FAULTS)
def test_a_folder_says_all(name):
    fault = FAULTS[name]
    assert {fault.kind, *fault.also} <= {*KINDS}
    assert {*fault.fails} <= {'stands', 'hits', 'stops', 'goes on'}
    assert fault.broken.endswith('.')
    assert fault.hint.endswith(('.', '?'))
    assert len(fault.right) >= 2
    assert len(fault.wrong) >= 3
    assert any(re.search(pair.command, fault.look) for pair in fault.evidence)
    for path, text in fault.files.items():
        check_syntax(path, text)
    for mend in fault.wrong:
        assert bool(mend.sees) != bool(mend.lacks)
        assert mend.says.endswith('.')


@pytest.mark.parametrize(('fault', 'mend'), MENDS)
def test_a_mend_can_be_made_and_is_known(fault, mend, tmp_path):
    robot = Case(Offline(tmp_path), fault, 'ada')
    robot.write(fault.files)
    assert robot.files == robot.given
    robot.mend(mend)
    assert robot.files != robot.given or mend.run
    for path, text in robot.files.items():
        check_syntax(path, text)
    assert mend in robot.wrong_mends() or mend in fault.right


def test_the_core_has_four_and_each_other_one_a_name():
    assert {*CORE.values()} <= {*FAULTS}
    assert len(OTHERS) >= len(FAULTS), 'Add a name to OTHERS in helpers/faults/robots.py.'
    assert len({*CORE, *OTHERS}) == len(CORE) + len(OTHERS)


@pytest.mark.parametrize('name', ['deaf_brake', 'old_build'])
def test_a_robot_whose_build_was_cleaned_is_built_as_it_was_left(name, tmp_path):
    workspace = Offline(tmp_path)
    robot = take(workspace, FAULTS[name], 'eve')
    built = robot.named(next(iter(robot.fault.installed), 'courier/brake.py'))
    installed = workspace.file('install/eve') / built
    before = installed.read_text()
    robot.mend(robot.fault.wrong[0])
    (robot.folder / 'notes.txt').write_text('mine')
    left = robot.files
    shutil.rmtree(tmp_path / 'install')
    assert take(workspace, FAULTS[name], 'eve').files == left != robot.given
    assert installed.exists()
    if robot.fault.installed:  # the old build is its fault
        assert installed.read_text() == before != (robot.folder / built).read_text()


# What a row of the lesson's table prints of each robot, beside what its own `look` prints.
EVIDENCE = [
    (
        'deaf_brake',
        'ros2 topic echo /rosout',
        'msg: New publisher discovered, offering incompatible QoS.',
    ),
    (
        'deaf_brake',
        'grep -n QoS src/courier/courier/brake.py',
        '21:x = QoS(ReliabilityPolicy.RELIABLE)',
    ),
    ('slow_look', 'ros2 topic echo /rosout', "msg: 'I stop: the scan is old'"),
    ('two_clocks', 'ros2 topic echo /rosout', "msg: 'I stop: the scan is of the future'"),
    ('two_clocks', 'cat src/courier/config/courier.yaml', '    use_sim_time: true'),
    ('two_clocks', 'ros2 topic echo --once /cmd_vel', '    sec: 0'),
    ('two_clocks', 'ros2 topic list', '/clock'),
    ('sleeping_route', 'ros2 topic info /wanted', 'Publisher count: 0'),
    (
        'sleeping_route',
        'diff src/ada/config/ada.yaml src/courier/config/courier.yaml',
        '> node_names: [router]',
    ),
    (
        'old_build',
        'python3 -c "import courier; print(courier.__file__)"',
        'install/courier/lib/python3.12/site-packages/courier/__init__.py',
    ),
    (
        'old_build',
        'diff src/courier/courier/ahead.py install/courier/lib/x/courier/ahead.py',
        '< AHEAD_RAD = 1',
    ),
    (
        'plain_twist',
        'diff src/ada/ada/brake.py src/courier/courier/brake.py',
        "> self.create_publisher(Twist, 'cmd_vel', 1)",
    ),
    (
        'wrong_way',
        'diff src/ada/ada/route.py src/courier/courier/route.py',
        '> x = max(-MAX_TURN, min(MAX_TURN, GAIN * left))',
    ),
    (
        'no_number',
        'grep -n variances src/courier/courier/route.py',
        '45: weights = 1.0 / variances',
    ),
    (
        'private_topic',
        'grep -n wanted src/courier/courier/route.py',
        "23: create_publisher(Twist, '~/wanted', 1)",
    ),
]
# A healthy robot prints these, too.
NO_EVIDENCE = [
    ('deaf_brake', 'ros2 topic echo /rosout', "msg: 'I stop: no scan comes'"),
    ('two_clocks', 'ros2 topic echo --once /cmd_vel', '    sec: 1764376000'),
    ('two_clocks', 'ros2 topic echo --once /cmd_vel', '    nanosec: 0'),
    ('sleeping_route', 'ros2 topic info /wanted', 'Subscription count: 1'),
    (
        'old_build',
        'python3 -c "import courier; print(courier.__file__)"',
        'build/courier/courier/__init__.py',
    ),
    ('old_build', 'diff src/ada/ada/ahead.py src/courier/courier/ahead.py', '> x'),
    ('wrong_way', 'cat src/courier/courier/route.py', 'min(MAX_TURN, -GAIN * left)'),
    ('slow_look', 'grep LOOK src/courier/courier/brake.py', 'time.sleep(LOOK_S)'),
]


@pytest.mark.parametrize(
    ('name', 'command', 'line', 'right'),
    [(*case, True) for case in EVIDENCE] + [(*case, False) for case in NO_EVIDENCE],
)
def test_true_evidence_is_accepted_from_each_row(name, command, line, right, tmp_path):
    case = Case(Offline(tmp_path), FAULTS[name], 'courier')
    assert proves(case, command, words(line)) == right


@pytest.mark.parametrize(
    ('said', 'right'),
    [('Publisher count: 2', True), ('count: 2', True), ('Publisher count:', False)],
)
def test_a_part_of_a_line_must_go_as_far_as_what_shows_the_fault(said, right, tmp_path):
    case = Case(Offline(tmp_path), FAULTS['second_voice'], 'dan')
    assert proves(case, 'ros2 topic info /cmd_vel', 'Publisher count: 2', said) == right


@pytest.mark.parametrize('seeds', [[1], [3], range(32)])
def test_after_the_others_all_robots_come_again_each_with_its_fault(seeds, tmp_path, monkeypatch):
    monkeypatch.setenv(progress.FILE_VARIABLE, str(tmp_path / 'progress.txt'))
    monkeypatch.setenv('JPY_SESSION_NAME', str(path_of('find_the_fault')))
    workspace, seeds, came = Offline(tmp_path), cycle(seeds), []
    others = {*FAULTS} - {*CORE.values()}
    rounds = [others, {*FAULTS}, {*FAULTS}]
    for _ in range(sum(map(len, rounds))):
        seed = next(seeds)
        robot = next_robot(workspace, seed)
        assert robot.files == robot.given
        robot.mend(robot.fault.right[0])
        (robot.folder / 'notes.txt').write_text('mine')
        assert next_robot(workspace, seed).files == robot.files  # it is not judged yet
        progress.record('mend_the_next', robot.fault.name)
        progress.record('mend_the_next', robot.fault.name)  # the check is run again
        came.append(robot.fault.name)
    for faults in rounds:
        assert {*came[: len(faults)]} == faults
        del came[: len(faults)]


def test_a_number_tells_in_which_order_the_robots_come():
    order, known = order_of(7), []
    for fault in order:  # UNIVERSITY.md prints the first three
        assert order_of(7, known)[0] == fault
        known.append(fault)


def test_a_file_that_does_not_say_all_is_named(tmp_path):
    (tmp_path / FILE).write_text('kind: qos\nright: []\nwrong: []\nevidence: []\nlook_: x\n')
    with pytest.raises(ValueError, match=f'{tmp_path.name}/{FILE}: .*look_'):
        read(tmp_path)
    with pytest.raises(ValueError, match='has .b. 0 times, not once'):
        edited('a', {'b': 'c'}, 'a file')
    with pytest.raises(ValueError, match='has .b. 2 times, not once'):
        edited('b a b', {'b': 'c'}, 'a file')
