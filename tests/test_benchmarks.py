"""The benchmarks run, and measure what they say. Only an idle machine gives good numbers."""

import importlib
import re
import subprocess
import sys
import time

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook

from benchmarks import __main__ as benchmarks
from benchmarks import checks, latency, lessons, set_up
from benchmarks.table import Row, growth, print_table, seconds


@pytest.mark.parametrize('name', benchmarks.NAMES)
def test_each_name_is_a_benchmark(name):
    module = importlib.import_module(f'benchmarks.{name}')
    assert callable(module.measure)


def test_an_unknown_name_is_refused():
    answer = subprocess.run(
        [sys.executable, '-m', 'benchmarks', 'speed'], capture_output=True, text=True
    )
    assert answer.returncode == 2
    assert 'speed is none of latency, recorder' in answer.stderr


def test_the_table_shows_medians_with_their_spread(capsys):
    rows = [Row('a build', [8, 7, 12], 'one', [4.0]), *growth('{} steps', {10: [2e-6], 1000: [1]})]
    print_table(rows)
    lines = capsys.readouterr().out.splitlines()
    assert [re.split('  +', line) for line in lines[1:]] == [
        ['a build', '8 s (7 to 12)', 'one: 4 s', '2.00'],
        ['1,000 steps', '1 s', '10: 2 us', '500000.00'],
    ]
    assert len({len(line) for line in lines}) == 1


def test_seconds_are_those_of_the_call():
    assert all(each >= 0.02 for each in seconds(lambda: time.sleep(0.02), 3))


def test_a_busy_machine_is_noticed():
    program = subprocess.Popen([sys.executable, '-c', 'while True: pass'])
    try:
        assert benchmarks.busy_cores(0.5) > benchmarks.IDLE_CORES
    finally:
        program.kill()
        program.wait()


def test_what_is_installed_with_a_package_is_found():
    assert {'nbval', 'pytest', 'pluggy', 'ipykernel', 'jupyter-client'} <= set_up.needed_by('nbval')
    assert 'rclpy' not in set_up.needed_by('nbval')


@pytest.mark.parametrize('kind', ['bare', 'session'])
def test_the_latency_of_a_run_is_measured(kind, monkeypatch):
    monkeypatch.setattr(latency, 'MESSAGES', {100: 20})
    assert 1e-6 < latency.in_process(kind, 100) < 1


def test_waiting_is_told_from_computing(tmp_path):
    program = "subprocess.run([sys.executable, '-c', 'sum(range(10**7))'])"
    sources = ['import subprocess, sys, time', 'sum(range(10**7))', 'time.sleep(0.5)', program]
    path = tmp_path / 'lesson.ipynb'
    nbformat.write(new_notebook(cells=[new_code_cell(source) for source in sources]), path)
    waited_s, programs_s = checks.notebook_waits(path)
    assert waited_s > 0.5 + programs_s / 2
    assert programs_s > 0.05


def test_the_packages_of_a_lesson_are_found():
    workspace = lessons.workspace_of('07', 'custom_interfaces', name='test')
    files = {path.name for path in workspace.file('src/custom_interfaces').rglob('*.*')}
    assert files == {'CMakeLists.txt', 'package.xml', 'TurnCamera.srv'}
