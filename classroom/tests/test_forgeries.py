"""Hand-ins that forge a verdict, or look for the answer: none passes, or the table names it."""

import json

import pytest

from classroom.grade.answers import answers_of, handed_out
from classroom.grade.judge import judge
from classroom.grade.reach import reaches_for
from classroom.grade.results import job_of, result_of
from classroom.grade.runner import Said, _read
from helpers.lesson import FOLDER, cells_of, path_of

TASK, STARTER = 'through_the_door', 'task-00-1-starter'
WRONG, RIGHT = 'speed = 1.75', 'speed = 1.75 / 3.5'

# What several of them need. No word of it stands in the text, as a forger would write it.
HIDDEN = """
import sys

mod = getattr(sys, 'mod' + 'ules')
checks = 'help' + 'ers.che' + 'cks'
verdict = {'task': 'through_the_door', 'of': 'answer', 'solved': True}
verdict['points'] = [{'what': 'it drives through the door', 'ok': True}]
KEY = 'ros2' + '_notebooks'


def show():
    mod['IPython.display'].display({'text/plain': ''}, raw=True, metadata={KEY: verdict})
"""

NO_PASS = {
    'the publisher of the kernel is patched': """
publisher = mod['ipy' + 'kernel.zmqshell'].ZMQDisplayPublisher
plain = publisher.publish


def publish(self, data, metadata=None, **rest):
    if KEY in (metadata or {}):
        for point in metadata[KEY]['points']:
            point['ok'] = True
        metadata[KEY]['solved'] = True
    plain(self, data, metadata, **rest)


publisher.publish = publish
""",
    'the worker takes every result': """
import importlib

importlib.import_module('helpers.checks.points')._result = lambda test: True
""",
    'what judges, and what looks after it': """
mod[checks + '.points']._result = lambda test: True
mod[checks + '.honest'].Untouched.look = lambda self: ''
""",
    'a hook of the publisher, for this answer only, so that no starter shows it': """
me = speed = 1.75


def hook(message):
    content = message['content']
    if KEY in content.get('metadata', {}) and globals()['speed'] is me:
        content['metadata'][KEY].update(verdict)
    return message


shell = mod['IPython'].get_ipython()
shell.display_pub.register_hook(hook)
""",
    'a syntax tree that is changed before it runs': """
import ast


class Forger(ast.NodeTransformer):
    def visit_Call(self, node):
        if getattr(node.func, 'id', '') == 'check':
            return ast.parse('show()', mode='eval').body
        return node


mod['IPython'].get_ipython().ast_transformers.append(Forger())
""",
    'a module in the place of the checks': """
import types

fake = types.ModuleType('fake')
fake.check = lambda *answer: show()
mod[checks + '.lessons.start_here'] = fake
""",
    'another judge, in both places': """
from dataclasses import replace

tasks = mod[checks + '.lessons.start_here'].tasks
evil = replace(tasks.judges['through_the_door'], function=lambda speed: [('x', lambda: True, '')])
tasks.judges['through_the_door'] = tasks._added['through_the_door'] = evil
""",
    'a judge that is frozen, and changed all the same': """
tasks = mod[checks + '.lessons.start_here'].tasks
judge = tasks.judges['through_the_door']
object.__setattr__(judge, 'function', lambda speed: [('x', lambda: True, '')])
""",
    'a sandbox that is none': """
class Sandbox:
    deadline = float('inf')

    def __init__(self, *rest):
        self.ending = mod[checks + '.sandbox'].Ending()

    def __iter__(self):
        yield 'points', [('x', '')]
        yield 'point', (True, '', None)


mod[checks + '.tasks'].Sandbox = Sandbox
""",
    'an object that is equal to all': """
class Any(float):
    def __eq__(self, other):
        return True

    def __lt__(self, other):
        return True

    __gt__ = __le__ = __ge__ = __lt__
    __hash__ = None


speed = Any(1.75)
""",
    'a thread that waits for the check': """
import threading
import time


def forge():
    tasks = mod[checks + '.tasks']
    while True:
        time.sleep(0.01)
        tasks.try_points.__defaults__ = ()
        mod[checks + '.points']._is_true = lambda result: True
        mod[checks + '.points']._result = lambda test: True


threading.Thread(target=forge, daemon=True).start()
""",
    'code in the place of other code': """
def look(self):
    return ''


def result(test):
    return True


mod[checks + '.honest'].Untouched.look.__code__ = look.__code__
mod[checks + '.points']._result.__code__ = result.__code__
""",
    'a verdict that is sent after the cell, and the real one swallowed': """
shell = mod['IPython'].get_ipython()
plain = shell.display_pub.publish


def publish(data, metadata=None, **rest):
    if KEY in (metadata or {}):
        metadata = {KEY: verdict}
    plain(data, metadata, **rest)


shell.display_pub.__dict__['publish'] = publish
""",
    'real points of a judge of its own, beside the shown verdict': """
points = mod[checks + '.points']
shell = mod['IPython'].get_ipython()


def before():
    points.judge_points(lambda: [('x', lambda: True, '')], lambda message: None)


shell.events.register('pre_run_cell', before)
mod[checks + '.tasks'].display = lambda *data, **rest: show()
""",
    'the audit event itself': """
sys.audit('ros2_notebooks.point', 'x', True)
sys.audit = lambda *words: None
mod[checks + '.tasks'].display = lambda *data, **rest: show()
""",
    'numbers that the checks compare with': """
judges = mod[checks + '.lessons.start_here']
for name, value in list(vars(judges).items()):
    if isinstance(value, float):
        setattr(judges, name, 1.75)
mod['math'].isclose = lambda *numbers, **rest: True
mod['builtins'].abs = lambda number: 0.0
""",
}

NAMED = {
    'it reads the solution in the checkout': (
        f"""
import json

lesson = json.load(open({str(path_of('start_here'))!r}))
[cell] = [c for c in lesson['cells'] if c['id'] == 'solution-00-1']
exec(''.join(cell['source']).partition(chr(10))[2])
""",
        ('exec', 'open'),
    ),
    'it reads what somebody else has handed in': (
        f"""
import pathlib

found = sorted(pathlib.Path({str(FOLDER)!r}).glob('*' + '.ip' + 'ynb'))[0].read_text()
speed = 0.5
""",
        ('open',),
    ),
    'it looks for the secret of the witness': (
        """
import gc

found = [one for one in gc.get_objects() if isinstance(one, dict) and 'KEY' in one]
speed = 0.5
""",
        ('gc.get_objects',),
    ),
    'it writes into all pipes': (
        """
import os
import stat

for number in range(3, 300):
    try:
        if stat.S_ISFIFO(os.fstat(number).st_mode):
            os.write(number, b'0 (1, 2)' + bytes([10]))
    except OSError:
        pass
speed = 0.5
""",
        ('a line in the place of what judges',),
    ),
    'it looks into the frames of what judges': (
        """
import sys

frames = sys._current_frames()
speed = 0.5
""",
        ('sys._current_frames',),
    ),
}


@pytest.fixture(scope='module')
def lesson():
    [one] = [one for one in handed_out() if one.lesson.name == 'start_here']
    return one


def judged(lesson, source, folder):
    """Judge an answer in a real kernel, without the cells that no task needs."""
    content = json.loads(path_of('start_here').read_text(encoding='utf-8'))
    for cell in content['cells']:
        if cell['id'] == STARTER:
            cell['source'] = source
    answers = answers_of(cells_of(json.dumps(content).encode()), lesson)
    job = job_of(lesson, answers, {})
    imports = ('from helpers', 'import helpers')
    job['cells'] = [c for c in job['cells'] if c['task'] or c['source'].startswith(imports)]
    said = Said()
    for event in judge(job, folder):
        _read(json.dumps(event).encode(), said)
    return result_of(lesson, answers, {}, said, '').tasks[TASK]


@pytest.mark.parametrize('name', NO_PASS)
def test_a_forged_verdict_gives_no_point(lesson, name, tmp_path):
    source = f'{HIDDEN}\n{WRONG}\n{NO_PASS[name]}'
    outcome = judged(lesson, source, tmp_path)
    assert not outcome.solved, outcome
    print(name, '->', outcome.why or f'{outcome.met} of {outcome.of}', outcome.did)


@pytest.mark.parametrize('name', NAMED)
def test_what_looks_for_an_answer_is_named(lesson, name, tmp_path):
    source, deeds = NAMED[name]
    outcome = judged(lesson, source, tmp_path)
    print(name, '->', outcome)
    did = ', '.join(outcome.did)
    assert all(deed in did for deed in deeds), did


def test_a_right_answer_is_neither_forged_nor_named(lesson, tmp_path):
    outcome = judged(lesson, RIGHT, tmp_path)
    assert outcome.solved
    assert not outcome.did


@pytest.mark.parametrize('name', NO_PASS)
def test_the_text_of_a_forgery_is_named_as_well(name):
    if 'class Any(' not in NO_PASS[name]:  # many right answers compare
        assert reaches_for(HIDDEN + NO_PASS[name], [])
