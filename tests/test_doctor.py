"""The doctor, with real rclpy, a real dead process, and environments that lack something."""

import os
import signal
import subprocess
import sys
import threading
import venv
from pathlib import Path

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from helpers import doctor
from helpers.session import destroy_nodes, ros_session
from tools.soak.leftovers import left_in_process, state_of_process

ROOT = Path(__file__).resolve().parent.parent


def run_doctor(python: Path | str = sys.executable, **environment: str):
    return subprocess.run(
        [python, '-m', 'helpers.doctor'],
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=60,
    )


def row_of(table: str, name: str) -> str:
    """Return a row of the printed table, with its wrapped lines joined."""
    lines = table.splitlines()
    first = next(index for index, line in enumerate(lines) if line.startswith(name))
    last = first + 1
    while lines[last].startswith('  '):
        last += 1
    return ' '.join(' '.join(line.split()) for line in lines[first:last])


def test_this_machine_is_ready():
    answer = run_doctor()
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert answer.stderr == ''
    assert answer.stdout.endswith('\nThis machine is ready: 5 of 5 required checks are ok.\n')
    assert row_of(answer.stdout, 'rclpy').endswith(' ok')
    assert 'heard after' in row_of(answer.stdout, 'one message')
    assert 'LOCALHOST' in row_of(answer.stdout, 'domain')


def test_without_rclpy_it_says_what_to_run(tmp_path):
    venv.create(tmp_path)
    answer = run_doctor(tmp_path / 'bin/python')
    assert answer.returncode == 1
    assert answer.stderr == ''
    assert 'make lab' in row_of(answer.stdout, 'rclpy')
    assert "No module named 'rclpy'" in row_of(answer.stdout, 'rclpy')
    assert 'This machine is not ready: 2 of 5 required checks are ok.' in answer.stdout


def test_a_middleware_that_is_not_there_does_not_end_the_doctor():
    answer = run_doctor(RMW_IMPLEMENTATION='rmw_nowhere_cpp')
    assert answer.returncode == 1
    assert 'unset RMW_IMPLEMENTATION' in row_of(answer.stdout, 'rclpy')


def test_only_a_required_check_decides(tmp_path):
    answer = run_doctor(PATH=str(tmp_path), CXX='c++')
    assert answer.returncode == 0
    # CMake comes with the wheels.
    for name in ('C++ compiler', 'browser'):
        assert ' optional: ' in row_of(answer.stdout, name)


def test_the_table_for_the_notebook():
    table = doctor.report()
    assert list(table.columns) == ['check', 'found', 'verdict']
    assert len(table) == 13
    assert (table['verdict'].head(5) == 'ok').all()


def test_show_and_ready(capsys):
    doctor.show()
    assert row_of(capsys.readouterr().out, 'platform').endswith(' ok')
    doctor.ready()
    assert capsys.readouterr().out == 'This machine is ready: 5 of 5 required checks are ok.\n'


def test_the_summary_names_what_is_missing():
    rows = [
        doctor.Check('A', 'nothing', 'get an A'),
        doctor.Check('B', 'something'),
        doctor.Check('C', 'nothing', 'get a C', required=False),
    ]
    assert doctor._summary(rows) == (
        'This machine is not ready: 1 of 2 required checks are ok.\n- A: get an A'
    )


def test_the_message_leaves_an_open_session_as_it_is():
    with ros_session():
        context = rclpy.get_default_context()
        before = set(threading.enumerate())
        assert doctor.check_message().to_do == ''
        assert context.ok()
        assert rclpy.get_default_context() is context
        assert set(threading.enumerate()) == before
        assert 'doctor' not in Node('looker').get_node_names()
    assert doctor.check_message().to_do == ''
    assert not rclpy.ok()


def test_an_interrupted_message_leaves_nothing(monkeypatch):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(SingleThreadedExecutor, 'spin_until_future_complete', interrupted)
    before = state_of_process()
    with pytest.raises(KeyboardInterrupt):
        doctor.check_message()
    assert left_in_process(before, state_of_process()) == []


def test_an_interrupted_clean_up_leaves_nothing(monkeypatch):
    def interrupted(context):
        signal.raise_signal(signal.SIGINT)
        destroy_nodes(context)

    monkeypatch.setattr('helpers.session.destroy_nodes', interrupted)
    before = state_of_process()
    with pytest.raises(KeyboardInterrupt):
        doctor.check_message()
    assert left_in_process(before, state_of_process()) == []


def test_what_the_middleware_raises_is_reported(monkeypatch):
    monkeypatch.setattr('helpers.domain.reserve_domain_id', lambda: -5)
    row = doctor.check_message()
    assert row.required
    assert row.to_do
    assert row.found


def test_a_message_that_does_not_arrive_is_reported(monkeypatch):
    monkeypatch.setattr(doctor, 'MESSAGE_TIMEOUT_S', 0.2)
    monkeypatch.setattr(SingleThreadedExecutor, 'add_node', lambda executor, node: None)
    row = doctor.check_message()
    assert 'not heard within 0.2 s' in row.found
    assert row.to_do


def test_no_free_domain_id_is_reported(monkeypatch):
    def none_left() -> int:
        raise RuntimeError('All of them are in use: close some.')

    monkeypatch.setattr('helpers.domain.reserve_domain_id', none_left)
    assert doctor.check_domain().verdict == 'All of them are in use: close some.'


ROS_PROCESS = """
import re, rclpy
rclpy.init()
node = rclpy.create_node('to_be_killed')
with open('/proc/self/maps') as maps:
    print(*sorted(set(re.findall(r'/dev/shm/fastrtps_[0-9a-f]{16}', maps.read()))), flush=True)
input()
"""


def test_a_segment_is_stale_once_its_process_is_dead():
    process = subprocess.Popen(
        [sys.executable, '-c', ROS_PROCESS],
        env=os.environ | {'ROS_DOMAIN_ID': '110', 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        segments = [Path(name) for name in process.stdout.readline().split()]
        assert segments
        locks = [segment.with_name(f'{segment.name}_el') for segment in segments]
        for lock in locks:
            os.utime(lock, (0, 0))  # old enough to be looked at
        assert not set(segments) & set(doctor.stale_segments())
        process.send_signal(signal.SIGKILL)
        process.wait(timeout=10)
        assert set(segments) <= set(doctor.stale_segments())
        assert 'shm clean' in doctor.check_stale_segments().to_do
        for file in [*segments, *locks]:
            file.unlink()
        assert not set(segments) & set(doctor.stale_segments())
    finally:
        process.kill()
        process.communicate()


def test_little_shared_memory_is_reported(monkeypatch):
    assert doctor.check_shared_memory().to_do == ''
    monkeypatch.setattr(doctor, 'ENOUGH_SHARED_MEMORY_BYTES', 2**60)
    assert '--shm-size' in doctor.check_shared_memory().to_do


def test_shared_memory_that_cannot_be_written_is_reported(monkeypatch):
    monkeypatch.setattr(doctor, 'SHARED_MEMORY', Path('/proc/self'))
    assert 'cannot be written' in doctor.check_shared_memory().found
    assert not doctor.check_shared_memory().required


def test_a_bus_error_means_that_shared_memory_is_full():
    code = 'import os, signal; os.kill(os.getpid(), signal.SIGBUS)'
    trial = doctor._run([sys.executable, '-c', code])
    found, to_do = doctor._why_import_failed(trial)
    assert found == 'ended with a bus error'
    assert to_do.startswith('/dev/shm is full: run')


def test_a_compiler_without_its_library_is_reported(monkeypatch, tmp_path):
    compiler = tmp_path / 'c++'
    compiler.write_text('#!/bin/sh\necho "fatal error: string: No such file" >&2\nexit 1\n')
    compiler.chmod(0o755)
    monkeypatch.setenv('CXX', str(compiler))
    row = doctor.check_compiler()
    assert row.found == 'cannot compile `#include <string>`'
    assert row.to_do
    assert not row.required


def test_pybind11_is_looked_for_where_cmake_looks(monkeypatch, tmp_path):
    assert not doctor.check_pybind11().to_do
    monkeypatch.setattr(doctor, 'PREFIXES', (str(tmp_path),))
    row = doctor.check_pybind11()
    assert row.found == 'none'
    assert 'pybind11-dev' in row.to_do
    assert not row.required


@pytest.mark.parametrize(
    ('told', 'advice'),
    [
        ('ImportError: librcl_action.so: cannot open shared object file: No such', 'same env'),
        ('ImportError: /x/y.so: undefined symbol: rcl_init', 'no other ROS 2 is sourced'),
        ('', 'same env'),
    ],
)
def test_a_failed_import_gets_its_advice(told, advice):
    trial = subprocess.CompletedProcess([], returncode=1, stdout='', stderr=told)
    found, to_do = doctor._why_import_failed(trial)
    assert found
    assert advice in to_do
