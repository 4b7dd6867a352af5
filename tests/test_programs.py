"""What checks say of packages, programs and launches that fail."""

import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from support.processes import segments
from support.waits import START_LIMIT_S

from helpers.checks.errors import Failed
from helpers.checks.programs import launch, line_of, manifest, run_python
from helpers.checks.tasks import Tasks
from helpers.workspace import Workspace, started, wait_until


@pytest.fixture
def workspace(monkeypatch):
    monkeypatch.setattr('helpers.ros.domain.YOUNG_S', 0.0)  # programs that were killed at once
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


TALKS = """import signal, sys, time
print(f'{sys.argv[1]} talks', flush=True)
try:
    time.sleep(60)
except KeyboardInterrupt:
    if sys.argv[1] == 'red':
        raise
"""


@pytest.mark.parametrize('team', ['red', 'blue'])
def test_a_program_talks_until_a_signal_ends_it(workspace, team):
    workspace.write('src/talker.py', TALKS)
    with run_python(workspace, 'src/talker.py', team) as talker:
        assert talker.wait(lambda: talker.says(f'{team} talks'))
        assert not talker.wait(lambda: False, limit_s=0.1)
        assert not talker.has_ended(limit_s=0.1)
        assert talker.end(signal.SIGINT)
    assert talker.failed == (team == 'red')
    if talker.failed:
        assert talker.error == 'KeyboardInterrupt. Line 4 of talker.py: time.sleep(60)'


def test_a_program_that_ends_by_itself_says_its_error(workspace):
    with (
        run_python(workspace, '-c', 'print("I begin"); int("far")') as program,
        pytest.raises(Failed, match=r"^the program ended by itself: ValueError: invalid .* 'far'$"),
    ):
        program.wait(lambda: False)
    assert program.exit_code() == 1


# A signal ends the context between the look and the shutdown of try_shutdown.
SIGNALLED = """import rclpy
rclpy.init()
context = rclpy.get_default_context()

class Signalled:
    def __init__(self, handle):
        self.handle = handle
    def __enter__(self):
        return self.handle.__enter__()
    def __exit__(self, *exception):
        return self.handle.__exit__(*exception)
    def ok(self):
        self.handle.shutdown()
        return True
    def shutdown(self):
        self.handle.shutdown()

context._Context__context = Signalled(context.handle)
rclpy.try_shutdown()
"""

# A student's own: after a signal, shutdown() has nothing to end any more.
ENDED_TWICE = """import rclpy
rclpy.init()
rclpy.get_default_context().handle.shutdown()
rclpy.shutdown()
"""


@pytest.mark.parametrize(
    ('code', 'fails'),
    [(SIGNALLED, False), (ENDED_TWICE, True)],
)
def test_what_rclpy_itself_raises_when_a_signal_comes_is_no_failure(workspace, code, fails):
    workspace.write('program.py', code)
    with run_python(workspace, 'program.py') as program:
        assert program.has_ended(START_LIMIT_S)
    assert program.says('rcl_shutdown already called')
    assert program.failed == fails


TALKS_TO_DDS = """import rclpy, time
rclpy.init()
node = rclpy.create_node("n")
print("up", flush=True)
time.sleep(60)
"""


def test_a_killed_program_leaves_no_shared_memory(workspace):
    with run_python(workspace, '-c', TALKS_TO_DDS) as program:
        assert program.wait(lambda: program.says('up'), START_LIMIT_S)
        held = segments(program.pid)
        assert program.end(signal.SIGKILL)
        assert [Path(file).exists() for file in held] == [True]
    assert [Path(file).exists() for file in held] == [False]


def test_a_program_that_is_killed_by_its_parent_leaves_no_shared_memory(workspace):
    """As a launch does, if a node does not end in time."""
    workspace.write('node.py', TALKS_TO_DDS)
    with workspace.start('python node.py & sleep 60; true', 'both') as both:
        both.wait_for('up', START_LIMIT_S)
        node = psutil.Process(both.pid).children()[0]
        held = segments(node.pid)
        node.kill()
        assert [Path(file).exists() for file in held] == [True]
    assert [Path(file).exists() for file in held] == [False]


def test_a_program_that_a_judge_kills_leaves_no_shared_memory(workspace, tmp_path):
    def judge(_answer):
        def goes_on():
            program = subprocess.Popen([sys.executable, '-c', TALKS_TO_DDS], stdout=subprocess.PIPE)
            program.stdout.readline()
            (tmp_path / 'held').write_text('\n'.join(segments(program.pid)))
            program.kill()
            return program.wait() != 0

        return [('it goes on', goes_on, '')]

    tasks = Tasks()
    tasks.add(judge, name='it', cpu_s=START_LIMIT_S, limit_s=START_LIMIT_S)
    tasks.check('it', None)
    [held] = (tmp_path / 'held').read_text().split()
    assert not Path(held).exists()
