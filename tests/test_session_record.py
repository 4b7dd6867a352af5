"""A terminal finds the session of a notebook through a record, which ros2/README.md describes."""

import json
import os
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from support.processes import running
from support.waits import START_LIMIT_S

from helpers.ros.session import ros_session
from helpers.ros.session_record import recorded

VARIABLES = {'ROS_DOMAIN_ID': '7', 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
# A notebook: a session with one node, and one cell after the other.
NOTEBOOK = """
    from helpers.ros.session import ros_session
    import rclpy
    with ros_session() as session:
        node = rclpy.create_node('talker')
        print(session.environment['ROS_DOMAIN_ID'], flush=True)
        input()
    print('closed', flush=True)
    input()
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return the folder of the records, not yet made."""
    monkeypatch.setenv('ROS2_SESSIONS', str(tmp_path / 'sessions'))
    return tmp_path / 'sessions'


def records(folder):
    return {file.name: json.loads(file.read_text()) for file in folder.iterdir()}


def test_a_record_says_who_where_and_since_when(folder, monkeypatch):
    monkeypatch.setenv('JPY_SESSION_NAME', 'lesson.ipynb')
    with recorded(VARIABLES, 'reserved'), recorded(VARIABLES | {'ROS_DOMAIN_ID': '42'}, 'open'):
        written = records(folder)
        assert folder.stat().st_mode & 0o777 == 0o700
    pid = os.getpid()
    assert written.keys() == {f'{pid}.reserved.json', f'{pid}.open.json'}
    record = written[f'{pid}.open.json']
    ticks = os.sysconf('SC_CLK_TCK')
    started = psutil.boot_time() + int(record.pop('start')) / ticks
    assert started == pytest.approx(psutil.Process().create_time(), abs=2 / ticks)
    assert record == {
        'pid': pid,
        'name': 'lesson.ipynb',
        'prefix': sys.prefix,
        'state': 'open',
        'variables': VARIABLES | {'ROS_DOMAIN_ID': '42'},
    }
    assert records(folder) == {}


def test_a_child_keeps_the_record_of_its_parent(folder):
    with recorded(VARIABLES, 'open'):
        child = os.fork()
        if child == 0:
            try:
                with recorded(VARIABLES, 'reserved'):
                    pass
            finally:
                os._exit(len(records(folder)))
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 1
        assert len(records(folder)) == 1


def test_a_session_needs_no_record(folder):
    folder.write_text('A file, where the folder should be.')
    with ros_session():
        pass


def test_a_session_is_recorded_while_it_is_open(folder):
    with ros_session() as session:
        [record] = [record for record in records(folder).values() if record['state'] == 'open']
        assert record['variables'] == session.environment
    assert not [record for record in records(folder).values() if record['state'] == 'open']


def test_the_command_in_a_terminal_finds_it(folder):
    """The format is written and read by code of two packages: this is what both agree on."""
    command = [Path(sys.executable).with_name('ros2'), 'node', 'list']
    terminal = {name: value for name, value in os.environ.items() if name != 'ROS_DOMAIN_ID'}

    def node_list():
        done = subprocess.run(
            command, env=terminal, capture_output=True, text=True, timeout=START_LIMIT_S
        )
        return done.returncode, done.stdout, done.stderr

    with running(NOTEBOOK, JPY_SESSION_NAME='lesson.ipynb') as notebook:
        assert 1 <= int(notebook.stdout.readline()) <= 100
        assert node_list() == (0, '/talker\n', '')
        print(file=notebook.stdin, flush=True)
        assert notebook.stdout.readline() == 'closed\n'
        status, out, err = node_list()
        assert (status, out) == (0, '')
        assert err.startswith('No session is open in lesson.ipynb: run the cell')
        notebook.communicate('\n', timeout=START_LIMIT_S)
        assert records(folder) == {}
        with running(NOTEBOOK) as killed:
            killed.stdout.readline()
            killed.kill()
            killed.wait()
        assert len(records(folder)) == 2
        assert node_list() == (0, '', '')
        assert records(folder) == {}  # the command has removed what the killed one has left
