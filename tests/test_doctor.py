"""The doctor, with real rclpy, and with environments that lack something."""

import os
import re
import shutil
import subprocess
import sys
import venv
from pathlib import Path
from types import SimpleNamespace

import pytest
from rclpy.executors import SingleThreadedExecutor
from support.processes import put

from helpers.machine import doctor

ROOT = Path(__file__).resolve().parent.parent


def run_doctor(python: Path | str = sys.executable, **environment: str):
    return subprocess.run(
        [python, '-m', 'helpers.machine.doctor'],
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=100,
    )


def row_of(table: str, name: str) -> str:
    """Return a row of the printed table, with its wrapped lines joined."""
    return ' '.join(re.search(rf'^{re.escape(name)}.*(\n  .*)*', table, re.MULTILINE)[0].split())


def test_this_machine_is_ready():
    answer = run_doctor()
    assert (answer.returncode, answer.stderr) == (0, ''), answer.stdout
    assert answer.stdout.endswith('\n\nThis machine is ready: 5 of 5 required checks are ok.\n')
    assert row_of(answer.stdout, 'rclpy') == 'rclpy ok 7.1.6'
    assert ' itself ok rmw_fastrtps_cpp: received after ' in row_of(answer.stdout, 'one message')
    assert row_of(answer.stdout, 'domain').endswith(', discovery LOCALHOST')
    assert row_of(answer.stdout, 'C++ compiler').startswith('C++ compiler ok ')


def test_without_rclpy_it_says_what_to_run(tmp_path):
    venv.create(tmp_path)
    answer = run_doctor(tmp_path / 'bin/python')
    assert (answer.returncode, answer.stderr) == (1, '')
    assert row_of(answer.stdout, 'rclpy') == (
        "rclpy NOT OK No module named 'rclpy': start JupyterLab with `make lab`, or source your "
        'ROS 2 installation'
    )
    assert (
        'This machine is not ready: 2 of 5 required checks are ok.\n'
        '- rclpy: start JupyterLab with `make lab`, or source your ROS 2 installation\n'
        '- domain and discovery: make rclpy work first\n'
    ) in answer.stdout
    assert max(map(len, answer.stdout.splitlines())) <= 94


def test_only_a_required_check_decides(tmp_path):
    """A middleware that is not there does not end the doctor."""
    answer = run_doctor(RMW_IMPLEMENTATION='rmw_nowhere_cpp', PATH=str(tmp_path))
    assert answer.returncode == 1
    assert 'run `unset RMW_IMPLEMENTATION`, and' in row_of(answer.stdout, 'rclpy')
    assert row_of(answer.stdout, 'C++ compiler') == (
        'C++ compiler optional none that works: to build packages in the lessons, run '
        '`sudo apt install g++`'
    )
    summary = answer.stdout[answer.stdout.index('This machine is not ready: 2 of 5') :]
    assert 'C++' not in summary


@pytest.mark.parametrize(
    ('end', 'found', 'advice'),
    [
        ('kill -BUS $$', 'ended with a bus error', '/dev/shm is full: run `'),
        (
            'echo "ImportError: librcl_action.so: cannot open shared object file: No" >&2; exit 1',
            'librcl_action.so: cannot open shared object file',
            'start JupyterLab and its kernel from the same environment',
        ),
        ('echo "x.so: undefined symbol: rcl_x" >&2; exit 1', 'undefined symbol: rcl_x', 'start J'),
        ('echo; exit 3', 'ended with 3', 'start J'),
    ],
)
def test_a_failed_import_gets_its_advice(monkeypatch, tmp_path, end, found, advice):
    monkeypatch.setattr(sys, 'executable', str(put(tmp_path, 'python', end)))
    monkeypatch.delitem(sys.modules, 'rclpy')
    row = doctor.check_rclpy()
    assert row.found == found
    assert row.to_do.startswith(advice)


def test_a_message_that_does_not_arrive_is_reported(monkeypatch):
    monkeypatch.setattr(doctor, 'MESSAGE_TIMEOUT_S', 0.2)
    monkeypatch.setattr(SingleThreadedExecutor, 'add_node', lambda executor, node: None)
    row = doctor.check_message()
    assert row.found == 'rmw_fastrtps_cpp: Gave up after 0.2 s.'
    assert row.to_do.startswith('allow UDP on the loopback interface')


def test_full_or_readonly_shared_memory_is_reported(monkeypatch):
    assert doctor.check_shared_memory().to_do == ''
    monkeypatch.setattr(shutil, 'disk_usage', lambda path: SimpleNamespace(free=31 * 2**20))
    row = doctor.check_shared_memory()
    assert row.found == '31 MiB free'
    assert row.to_do.startswith('run `.venv/bin/fastdds shm clean`, remove files from /dev/shm, or')
    assert not row.required
    monkeypatch.undo()
    monkeypatch.setattr(doctor, 'SHARED_MEMORY', Path('/proc/self'))
    assert doctor.check_shared_memory().found == '/proc/self cannot be written'


@pytest.mark.parametrize('compiler', ['[ $1 = --version ] && echo clang 14', 'exit 1'])
def test_a_compiler_that_does_not_work_is_reported(monkeypatch, tmp_path, compiler):
    """It has no standard library, or is of another machine."""
    file = put(tmp_path, 'c++', compiler)
    monkeypatch.setenv('CXX', str(file))
    rows = {row.name: row for row in doctor.check_build_tools()}
    assert rows['C++ compiler'].found == 'none that works'
    assert not rows['C++ compiler'].required
    assert [name for name, row in rows.items() if row.to_do] == ['C++ compiler']
