"""How long does `make test` take, against what nobody can avoid?

Not to be avoided are the seconds in which a notebook or a file of tests waits: for the clock of an
experiment, for a compiler, for another program that it has started. Each one runs alone, and what
it waits is its time less the CPU time of its own process. `make test` shares them out to workers,
and cannot be shorter than

- the longest wait of all, since one worker runs it,
- the sum of the waits, divided by the workers,
- the CPU time of the programs that were started, divided by the cores.

The last row compares it with the CPU time of all that `make test` ran, divided by the cores: that
is avoided only where a test computes less.
"""

import ast
import os
import re
import subprocess
import sys
from subprocess import DEVNULL

import nbformat
from nbformat.v4 import new_code_cell

from benchmarks.lessons import FOLDER, ROOT
from benchmarks.table import Row, seconds
from tools.notebooks import execute

CLOCKS = """
import os as _os, time as _time
def _clocks():
    ticks = _os.times()
    children = ticks.children_user + ticks.children_system
    return _time.monotonic() - ticks.user - ticks.system, children
_started = _clocks()
"""
PRINT = 'print([now - then for now, then in zip(_clocks(), _started)])'
TESTS = f'import sys, pytest\n{CLOCKS}\npytest.main([sys.argv[1], "-q"])\n{PRINT}'


def notebook_waits(path) -> list[float]:
    """Return for how long a notebook waits, and the CPU time of what it starts, in seconds."""
    notebook = nbformat.read(path, as_version=4)
    notebook.cells = [new_code_cell(CLOCKS), *notebook.cells, new_code_cell(PRINT)]
    return ast.literal_eval(execute(notebook, FOLDER).cells[-1].outputs[0].text)


def tests_wait(path) -> list[float]:
    """Return the same of a file of tests."""
    answer = subprocess.run(
        [sys.executable, '-c', TESTS, path], cwd=ROOT, capture_output=True, text=True
    )
    return ast.literal_eval(answer.stdout.splitlines()[-1])


def _cpu_of_children_s() -> float:
    times = os.times()
    return times.children_user + times.children_system


def measure() -> list[Row]:
    """Return `make test` against its bounds."""
    workers = int(re.search(r'^WORKERS := (\d+)', (ROOT / 'Makefile').read_text(), re.MULTILINE)[1])
    cores = len(os.sched_getaffinity(0))
    before = _cpu_of_children_s()
    whole = seconds(
        lambda: subprocess.run(['make', 'test'], cwd=ROOT, stdout=DEVNULL, check=True), 1
    )
    cpu_s = _cpu_of_children_s() - before
    waits = [notebook_waits(path) for path in sorted(FOLDER.glob('*.ipynb'))]
    waits += [tests_wait(path) for path in sorted(ROOT.glob('tests/test_*.py'))]
    waiting, programs = zip(*waits, strict=True)
    bounds = {
        'the longest wait': max(waiting),
        f'all waits, {workers} workers': sum(waiting) / workers,
        'programs, all cores': sum(programs) / cores,
        'all CPU time, all cores': cpu_s / cores,
    }
    return [Row('make test', whole, name, [bound]) for name, bound in bounds.items()]
