"""The checks of programs name the first error: its file, its line, its text."""

import pytest

from helpers.checks.errors import Failed
from helpers.checks.programs import launch, line_of, manifest
from helpers.workspace import Workspace, error_in, error_of_launch, started, wait_until

TRACEBACK = """[INFO] [listener]: I begin
Traceback (most recent call last):
  File "/home/you/ws/.start.py", line 3, in <module>
    runpy.run_path('src/hello_pkg/hello_pkg/listener.py')["main"]()
  File "/home/you/ws/src/hello_pkg/hello_pkg/listener.py", line 12, in main
    self.create_subscriber(String, 'topic', self.heard, 10)
    ^^^^^^^^^^^^^^^^^^^^^^
AttributeError: 'Listener' object has no attribute 'create_subscriber'
"""


@pytest.fixture
def workspace():
    workspace = Workspace('test_programs')
    yield workspace
    workspace.close()


def test_the_error_of_a_program_has_text_and_line():
    said = "AttributeError: 'Listener' object has no attribute 'create_subscriber'. "
    said += "Line 12 of listener.py: self.create_subscriber(String, 'topic', self.heard, 10)"
    assert error_in(TRACEBACK.splitlines()) == said
    # In what a terminal of the workspace prints, its folder is left out.
    assert error_in(TRACEBACK.replace('/home/you/ws/src', 'src').splitlines()) == said
    launched = [f'[listener-2] {line}' for line in TRACEBACK.splitlines()]
    mixed = [
        line for pair in zip(launched, ['[robot-1] I drive'] * 9, strict=False) for line in pair
    ]
    assert error_in(mixed) == said


def test_of_several_errors_the_first_one_counts_and_of_a_chain_the_last():
    second = 'Traceback (most recent call last):\nValueError: another one\n'
    assert error_in((TRACEBACK + second).splitlines()).startswith('AttributeError')
    chain = f'{TRACEBACK}\nDuring handling of the above exception, another exception occurred:\n\n'
    assert error_in((chain + second).splitlines()) == 'ValueError: another one'


def test_a_program_without_a_traceback_has_said_its_last_line():
    assert error_in(["Package 'x' not found", '']) == "Package 'x' not found"
    assert error_in([]) == 'it printed nothing'


def test_a_launch_names_its_own_error_or_that_of_the_first_program_that_died():
    assert error_of_launch("a.xml:3: '2' is neither true nor false") == (
        "a.xml:3: '2' is neither true nor false"
    )
    starts = '[INFO] [robot-1]: process started with pid [1]\n'
    assert error_of_launch(starts) == ''
    said = '[robot-1] error: no floor x\n'
    died = '[ERROR] [robot-1]: process has died [pid 1, exit code 2]\n'
    assert error_of_launch(starts + said + died) == 'robot-1 has died. [robot-1] error: no floor x'


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
