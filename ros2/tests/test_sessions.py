"""In which domain a command in a terminal is: the records that the README describes."""

import contextlib
import json
import os
import re
import sys
from pathlib import Path

import pytest
from domain_coordinator import domain_id
from processes import python, ros2
from waits import START_LIMIT_S

NODE = """
import sys, rclpy
rclpy.init()
node = rclpy.create_node(sys.argv[1])
print('ready', flush=True)
sys.stdin.read()
"""
# A process that is found, or that was: without a node.
IDLE = "import sys; print('ready', flush=True); sys.stdin.read()"
# A kernel, one of whose cells calls the command.
CELL = """
import subprocess, sys
sys.stdin.readline()
done = subprocess.run([sys.argv[1], 'node', 'list'], capture_output=True, text=True)
print([done.stdout, done.stderr], flush=True)
"""
CHOOSE = r'Choose one, for example with `export ROS_DOMAIN_ID=\d+`\.\n'


class Sessions:
    """Processes that are recorded in a folder."""

    def __init__(self, folder, stack):
        self.folder, self._stack = folder, stack
        self.env = {**os.environ, 'ROS2_SESSIONS': str(folder)}
        self.env.pop('ROS_DOMAIN_ID', None)

    def domain(self):
        return str(self._stack.enter_context(domain_id()))

    def start(self, script, *arguments, **env):
        """Run a script beside, and return the process."""
        return self._stack.enter_context(python(script, *arguments, env=self.env | env))

    def open(self, name, file=None, **fields):
        """Start a node in a domain of its own, with an open session."""
        domain = self.domain()
        process = self.start(NODE, name, ROS_DOMAIN_ID=domain)
        assert process.stdout.readline() == 'ready\n'
        self.record(process, name, domain, 'open', file, **fields)
        return process

    def reserve(self, name, **fields):
        """Start a process that has reserved a domain, and nothing else."""
        process = self.start(IDLE)
        assert process.stdout.readline() == 'ready\n'
        self.record(process, name, self.domain(), 'reserved', **fields)
        return process

    def record(self, process, name, domain, state, file=None, **fields):
        stat = Path(f'/proc/{process.pid}/stat').read_text()
        record = {
            'pid': process.pid,
            'start': stat.rpartition(')')[2].split()[19],
            'name': f'{name}.ipynb',
            'prefix': sys.prefix,
            'state': state,
            'variables': {'ROS_DOMAIN_ID': domain, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'},
        }
        text = json.dumps(record | fields)
        self.folder.joinpath(file or f'{process.pid}.{state}.json').write_text(text)

    def terminal(self, *words, **env):
        """Run `ros2 node list` in a terminal, and return its status and what it prints."""
        with ros2(*(words or ('node', 'list')), env=self.env | env) as command:
            out, err = command.communicate(timeout=START_LIMIT_S)
        return command.returncode, out, err


@pytest.fixture
def sessions(tmp_path):
    with contextlib.ExitStack() as stack:
        yield Sessions(tmp_path, stack)


def test_finds_the_only_open_session(sessions):
    sessions.open('first', file='b.json')
    assert sessions.terminal() == (0, '/first\n', '')
    # They are listed in the order in which they have started, whatever their files are called.
    second = sessions.open('second', file='a.json')
    status, out, err = sessions.terminal()
    assert (status, out) == (1, '')
    assert re.fullmatch(
        r'2 notebooks have an open session: first.ipynb \(\d+\), second.ipynb \(\d+\)\. ' + CHOOSE,
        err,
    )
    second.kill()  # its record stays, and does not count
    second.wait()
    assert sessions.terminal() == (0, '/first\n', '')
    assert [file.name for file in sessions.folder.iterdir()] == ['b.json']


def test_an_open_session_counts_more_than_a_reserved_domain(sessions):
    sessions.reserve('waiting')
    sessions.open('first')
    assert sessions.terminal() == (0, '/first\n', '')


def test_says_that_no_session_is_open(sessions):
    sessions.reserve('first')
    run_the_cell = 'run the cell of the notebook, and type while it runs.\n'
    # The command is in the domain of the notebook: `ros2 topic echo` can wait for its cell.
    assert sessions.terminal() == (0, '', f'No session is open in first.ipynb: {run_the_cell}')
    sessions.reserve('second')
    both = f'No session is open in first.ipynb, second.ipynb: {run_the_cell}'
    assert sessions.terminal() == (1, '', both)


def test_says_why_nobody_is_in_the_domain_that_is_named(sessions):
    before = sessions.domain()  # of a kernel that was restarted since
    assert sessions.terminal(ROS_DOMAIN_ID=before) == (0, '', '')
    sessions.open('first')
    [record] = sessions.folder.iterdir()
    now = json.loads(record.read_text())['variables']['ROS_DOMAIN_ID']
    status, out, err = sessions.terminal(ROS_DOMAIN_ID=before)
    assert (status, out) == (0, '')
    assert err == (
        f'Nobody is in domain {before}, which ROS_DOMAIN_ID names. Open: first.ipynb ({now}). '
        'A notebook whose kernel was restarted has another domain than before: '
        f'`export ROS_DOMAIN_ID={now}`, or `unset ROS_DOMAIN_ID`.\n'
    )
    assert sessions.terminal(ROS_DOMAIN_ID=now) == (0, '/first\n', '')
    # Somebody is there, who needs no record.
    robot = sessions.start(NODE, 'robot', ROS_DOMAIN_ID=before)
    assert robot.stdout.readline() == 'ready\n'
    assert sessions.terminal(ROS_DOMAIN_ID=before) == (0, '/robot\n', '')


def test_prefers_the_sessions_of_its_own_environment(sessions):
    sessions.open('stranger', prefix='/home/me/other/.venv')
    assert sessions.terminal() == (0, '/stranger\n', '')  # there is nothing else
    sessions.reserve('own')
    status, out, err = sessions.terminal()
    assert (status, out) == (0, '')
    assert err.startswith('No session is open in own.ipynb: ')
    sessions.open('first')
    assert sessions.terminal() == (0, '/first\n', '')


def test_a_cell_is_in_the_domain_of_its_kernel(sessions):
    sessions.open('first')
    sessions.open('second')
    domain = sessions.domain()
    robot = sessions.start(NODE, 'robot', ROS_DOMAIN_ID=domain)
    assert robot.stdout.readline() == 'ready\n'
    command = Path(sys.executable).with_name('ros2')
    kernel = sessions.start(CELL, command)
    sessions.record(kernel, 'third', domain, 'open')
    out, err = kernel.communicate('\n', timeout=START_LIMIT_S)
    assert (out, err) == (f'{["/robot" + chr(10), ""]}\n', '')


@pytest.mark.parametrize('state', ['open', 'reserved'])
def test_a_cell_is_told_nothing_about_sessions(state, sessions):
    kernel = sessions.start(CELL, Path(sys.executable).with_name('ros2'))
    sessions.record(kernel, 'third', sessions.domain(), state)
    sessions.open('first')
    out, err = kernel.communicate('\n', timeout=START_LIMIT_S)
    assert (out, err) == ("['', '']\n", '')


def test_passes_over_what_is_no_record(sessions):
    sessions.open('first')
    [good] = sessions.folder.iterdir()
    fields = json.loads(good.read_text())
    for number, text in enumerate(
        [
            '',
            '[]',
            '{"pid": 1}',
            json.dumps(fields | {'variables': {}}),
            json.dumps(fields | {'variables': {'ROS_DOMAIN_ID': 'x'}}),
            json.dumps(fields | {'variables': None}),
            json.dumps({name: value for name, value in fields.items() if name != 'state'}),
        ]
    ):
        sessions.folder.joinpath(f'{number}.json').write_text(text)
    wide = fields['variables'] | {'PATH': '/nowhere', 'LD_PRELOAD': '/nowhere/a.so'}
    sessions.folder.joinpath('wide.json').write_text(json.dumps(fields | {'variables': wide}))
    good.unlink()
    assert sessions.terminal() == (0, '/first\n', '')


def test_without_a_record_it_is_domain_0(sessions):
    _, out, _ = sessions.terminal('doctor')
    assert 'ROS_DOMAIN_ID=0 ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST\n' in out
    assert 'Notebook' not in out
    sessions.open('first')
    _, out, _ = sessions.terminal('doctor')
    assert re.search(r'Notebook +first.ipynb: open session, ROS_DOMAIN_ID=\d+ ROS_AUTO', out)
    assert re.search(r'Nodes there +/first\n', out)
