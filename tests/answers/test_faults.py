"""Each fault fails where it is seen, is found by its evidence, and its mends are judged right.

A fault is a folder in helpers/faults: another folder is tested without another test.
"""

import pytest

from helpers.checks.errors import Failed
from helpers.checks.lessons.find_the_fault import found, mended
from helpers.faults import FAULTS, drive, mend, seen, take, wait_until_up
from helpers.faults.drives import end_launches
from helpers.workspace import Workspace

MENDS = [
    (name, kind, number)
    for name, fault in FAULTS.items()
    for kind in ('right', 'wrong')
    for number in range(kind == 'right', len(getattr(fault, kind)))
]  # without the first right one, which is the course's own


@pytest.fixture(scope='module')
def workspace():
    opened = Workspace('test_faults')
    yield opened
    opened.close()


def verdict(points):
    """Return whether all points are met, and what was found in place of the others."""
    texts = []
    for what, test, _ in points:
        try:
            result = test()
        except Failed as error:
            result = str(error)
        if isinstance(result, str) or not result:
            texts.append(f'{what}: {result}')
    return not texts, '\n'.join(texts)


@pytest.mark.parametrize('name', FAULTS)
def test_a_fault_is_seen_found_and_mended(workspace, name):
    fault = FAULTS[name]
    robot = take(workspace, fault, 'ada', anew=True)
    end = drive(robot)
    assert end.how in fault.fails, end.said
    command = 'source install/setup.bash\nros2 launch ada bringup.launch.xml'
    workspace.start(command, 'ada')
    wait_until_up(robot)
    is_found, text = verdict(found(robot, *seen(robot)))
    end_launches(workspace.terminals.values())
    assert is_found, text
    mend(robot)
    is_mended, text = verdict(mended(robot))
    assert is_mended, text


@pytest.mark.parametrize(('name', 'kind', 'number'), MENDS)
def test_a_mend_is_judged(workspace, name, kind, number):
    made = getattr(FAULTS[name], kind)[number]
    robot = take(workspace, FAULTS[name], 'ada', anew=True)
    robot.mend(made)
    is_mended, text = verdict(mended(robot))
    assert is_mended == (kind == 'right'), text
    assert made.says in text
