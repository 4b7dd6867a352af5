"""What checks say of packages, programs and launches that fail."""

import pytest

from helpers.checks.errors import Failed
from helpers.checks.programs import launch, line_of, manifest, started, wait_until
from helpers.workspace import Workspace


@pytest.fixture
def workspace():
    workspace = Workspace('test_programs')
    yield workspace
    workspace.close()


def test_a_package_that_cannot_be_read_says_why(workspace):
    with pytest.raises(Failed, match='there is no package src/x'):
        manifest(workspace, 'src/x')
    workspace.write('src/x/package.xml', '<package format="3"><depend>rclpy<depend></package>')
    with pytest.raises(
        Failed, match='cannot be read: The manifest contains invalid XML: mismatched tag: line 1'
    ):
        manifest(workspace, 'src/x')


def test_a_line_of_a_program_comes_or_its_error_does(workspace):
    with workspace.start('echo one; sleep 10', 'echo') as process:
        assert line_of(process, 'one') == 'one'
        with pytest.raises(Failed, match="echo did not print 'two'. Its last lines: one"):
            line_of(process, 'two', 0.2)
    with (
        workspace.start('python -c "import nothing_here"', 'python') as process,
        pytest.raises(Failed, match='python has ended: ModuleNotFoundError'),
    ):
        line_of(process, 'two')


def test_a_launch_is_read_until_it_says_enough_and_its_end_is_no_part(workspace):
    command = "sh -c 'echo hello; exec sleep 100'"
    file = f'<launch><executable cmd="{command}" output="screen"/></launch>'
    workspace.write('hello.launch.xml', file)
    text = launch(workspace, 'hello.launch.xml', lambda text: 'hello' in text)
    assert started(text) == ['sh']
    assert text.endswith('[sh-1] hello')
    assert not workspace.terminals['the launch'].running


def test_waiting_says_whether_it_came():
    assert wait_until(lambda: True, 0)
    assert not wait_until(lambda: False, 0.1)
