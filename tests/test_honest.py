"""Forged answers: what equals everything passes nothing, and a changed judge is noticed."""

import sys
from types import ModuleType

import pytest
from support.kernel import Kernel

from helpers.checks.honest import Untouched

LESSON = """
from helpers.checks.tasks import Tasks
from helpers.checks.points import expect
tasks = Tasks()
check = tasks.check

@tasks.add
def it_is_two(give):
    return [
        ('it returns 2', lambda: expect(give(), 2, 'it returns'), ''),
        ('twice', lambda: [give(), give()] == [2, 2] or 'it does not', ''),
    ]
"""
EQUALS = [
    'class E:\n    def __eq__(self, other): return True\ngive = E',
    'class E(int):\n    def __eq__(self, other): return True\ngive = E',
    'from unittest.mock import ANY\ndef give(): return ANY',
    'def give():\n    class E:\n        def __eq__(self, other): return True\n    return E()',
    "give = type('E', (), {'__eq__': lambda self, other: True})",
]
FORGED = [
    # The two of the review: the worker is replaced, ipykernel's publisher is.
    "import importlib\nsandbox = importlib.import_module('helpers.checks.sandbox')\n"
    'def worker(function, limits, messages, printer, dump):\n'
    '    send = lambda message: messages.send(((5, 5), message))\n'
    "    send(('points', [('a', '')])); send(('point', (True, '', None))); send(None)\n"
    '    import signal; signal.pause()\nsandbox._be_worker = worker',
    'import ipykernel.zmqshell as zmq\nplain = zmq.ZMQDisplayPublisher.publish\n'
    'def publish(self, data, metadata=None, **more):\n    plain(self, data, metadata, **more)\n'
    'zmq.ZMQDisplayPublisher.publish = publish',
    # Others: the judge, what compares, what runs a point, the code of a function, from inside.
    'from dataclasses import replace\ntasks.judges["it_is_two"] = replace(\n'
    '    tasks.judges["it_is_two"], function=lambda give: [("a", lambda: True, "")])',
    'import helpers.checks.points as points\npoints._is_equal = lambda found, right: True\n'
    'points._result = lambda test: True',
    'import helpers.checks.points as points\n'
    'points._result.__code__ = (lambda test: True).__code__',
    'import builtins\nbuiltins.all = lambda points: True',
    'def give():\n    import helpers.checks.points as points\n'
    '    points._result = lambda test: True\n    return 2',
]


@pytest.fixture(scope='module')
def notes(tmp_path_factory):
    return tmp_path_factory.mktemp('progress') / 'progress.txt'


def run(kernel, notes, forgery):
    kernel.run(
        'import os\n'
        f'os.environ["ROS2_NOTEBOOKS_PROGRESS"] = "{notes}"\n'
        'os.environ["JPY_SESSION_NAME"] = "02_lose_messages.ipynb"\n' + LESSON
    )
    kernel.run('def give(): return 3')
    assert kernel.run(forgery) == ''
    said = kernel.run("check('it_is_two', give)")
    return said, [verdict['solved'] for verdict in kernel.verdicts]


@pytest.mark.parametrize('answer', EQUALS)
def test_what_equals_everything_passes_nothing(notes, answer):
    with Kernel() as kernel:
        said, solved = run(kernel, notes, answer)
        assert solved == [False], said
        assert not notes.exists()


def test_a_class_may_say_what_it_is_equal_to(notes):
    answer = (
        'class Two:\n    def __eq__(self, other): return other == 2\n'
        '    def __repr__(self): return "2"\ngive = Two'
    )
    with Kernel() as kernel:
        said, solved = run(kernel, notes, answer)
        assert solved == [True], said
    notes.unlink()


@pytest.mark.parametrize('forgery', FORGED)
def test_a_forged_pass_is_not_recorded(notes, forgery):
    with Kernel() as kernel:
        said, solved = run(kernel, notes, forgery)
        assert solved == [False], said
        assert not notes.exists()


@pytest.mark.parametrize('path', ['alone', 'Box.first', 'Box.last'])
def test_each_function_of_a_judge_is_watched(monkeypatch, path):
    class Box:
        def first(self):
            return 1

        def last(self):
            return 2

    made = ModuleType('helpers.checks.made')
    made.alone, made.Box, Box.__module__ = (lambda: 0), Box, made.__name__
    monkeypatch.setitem(sys.modules, made.__name__, made)
    watch = Untouched()
    assert watch.look() == ''
    owner, _, name = path.rpartition('.')
    monkeypatch.setattr(getattr(made, owner, made), name, lambda *_: 3)
    assert watch.look() == f'{made.__name__}.{path}'
