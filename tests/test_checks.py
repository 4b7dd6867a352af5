"""What a reader reads about a guess and about an exercise."""

import numpy as np
import pandas as pd
import pytest
from support.kernel import Kernel

from helpers.checks.checks import NO_GUESS, check, compare_prediction

AGAIN = ' Try again, or go on with the solution below.'
QUESTION = 'How many of 41 messages are heard?'


@pytest.fixture
def task(request):
    """A number of its own for each test: the tries at a task are counted by its number."""
    return hash(request.node.name)


def told(capsys, *arguments, **options):
    """Return what a prediction prints under its question."""
    compare_prediction(QUESTION, *arguments, **options)
    question, *lines = capsys.readouterr().out.splitlines()
    assert question == QUESTION
    return lines


@pytest.mark.parametrize(
    ('guess', 'outcome', 'said'),
    [
        (20, 20, '20. Verdict: right.'),
        (41, 20, '41. Verdict: too many. The answer is 20.'),
        (np.int64(41), np.int64(20), '41. Verdict: too many. The answer is 20.'),
        (30.5, 9.25, '30.5. Verdict: too high. The answer is 9.25.'),
        (False, np.bool_(True), 'False. Verdict: not that one. The answer is True.'),
        ('a ', 'A', 'a . Verdict: right.'),
        ('B', 'A', 'B. Verdict: not that one. The answer is A.'),
        ([0, 1, 2], (0, 1, 2), '0, 1, 2. Verdict: right.'),
        ([1, 0, 2], [0, 1, 2], '1, 0, 2. Verdict: not those. The answer is 0, 1, 2.'),
        (range(3), pd.Series([0, 1, 2]), '0, 1, 2. Verdict: right.'),
        ([2, 0, 1], {0, 1, 2}, '2, 0, 1. Verdict: right.'),
        ({11, 3, 7}, {7, 3}, '3, 7, 11. Verdict: not those. The answer is 3, 7.'),
        ([[0]], set(), '[0]. Verdict: not those. The answer is none.'),
    ],
)
def test_each_guess_gets_verdict_and_answer(capsys, guess, outcome, said):
    assert told(capsys, guess, outcome) == [f'  Your guess: {said}']


def test_tolerance_keeps_the_text_constant(capsys, monkeypatch):
    assert told(capsys, 41, 20, tolerance=2)[0].endswith('Verdict: too many. Here it was 20.')
    monkeypatch.setattr('helpers.checks.checks._has_student', lambda: False)
    texts = {tuple(told(capsys, 41, measured, tolerance=2)) for measured in range(15, 39)}
    assert texts == {('  Your guess: 41. Verdict: too many.',)}
    verdicts = [
        told(capsys, 20, n, tolerance=2)[0].partition('Verdict: ')[2] for n in range(17, 24)
    ]
    assert verdicts == ['too many.', *['right.'] * 5, 'too few.']


@pytest.mark.parametrize(
    ('guess', 'outcome', 'wanted'),
    [
        ('41', 20, 'a number'),
        (print, 20, 'a number'),
        (1, True, 'True or False'),
        (1, 'A', 'text in quotes'),
        ('012', [0, 1, 2], 'a list or a set'),
    ],
)
def test_a_wrong_kind_of_guess_gets_the_kind(capsys, guess, outcome, wanted):
    assert told(capsys, guess, outcome, because='The queue keeps the last 10.') == [
        f'  Your guess: {guess!r}. Please change it: the answer must be {wanted}.'
    ]


def test_the_reason_follows_only_a_guess(capsys):
    reason = 'The queue keeps the last 10.'
    assert told(capsys, 20, 20, because=reason)[1:] == [f'  {reason}']
    assert told(capsys, 41, 20, because=reason)[1:] == [f'  {reason}']
    for nothing in (None, ...):
        assert told(capsys, nothing, 20, because=reason) == [f'  {NO_GUESS}']


def test_an_outcome_of_no_known_kind_is_refused(capsys):
    with pytest.raises(TypeError, match='^The outcome of a prediction cannot be of type dict[.]$'):
        compare_prediction(QUESTION, 1, {'a': 1})
    assert capsys.readouterr().out == ''


def tried(capsys, task, first=True, second=True):
    """Return what a check of two requirements prints."""
    check(
        task,
        ('the group is Reentrant', first, 'Look at the second argument.'),
        ('no message is lost', lambda: second, 'Count the threads.'),
    )
    return capsys.readouterr().out


def test_hints_appear_at_the_second_wrong_try(capsys, task):
    assert tried(capsys, task, second=False) == (
        f'[ok] the group is Reentrant\n[not yet] no message is lost\nTask {task}: 1 of 2.{AGAIN}\n'
    )
    assert 'Hint' not in tried(capsys, task + 1, second=False)
    assert tried(capsys, task, second=False) == (
        '[ok] the group is Reentrant\n[not yet] no message is lost\n    Hint: Count the threads.\n'
        f'Task {task}: 1 of 2.{AGAIN}\n'
    )


def test_a_second_run_prints_the_same(capsys, task):
    # Starter, then solution, as in a notebook that is run from top to bottom.
    runs = [(tried(capsys, task, second=False), tried(capsys, task)) for _ in range(3)]
    assert runs[0] == runs[1] == runs[2]


class Group:
    def add(self, timer): ...


def test_what_the_code_did_is_said(capsys, task):
    def broken():
        raise RuntimeError(f'no {object()!r}\nmore')

    def late():
        raise TimeoutError('Waited 30 s and more.\nNo publisher: /scans.\nmore')

    def hidden():  # as publish() does for a float in an Int32
        raise SystemError('returned a result with an exception set') from TypeError('a float')

    check(
        task,
        ('2, 4', lambda: 'your node published [1, 2]', ''),
        ('it is built', 'the build failed', ''),
        ('the node exists', broken, ''),
        ('it is heard', late, ''),
        ('it is in a group', lambda: Group.add('a timer'), ''),
        ('it publishes', hidden, ''),
        ('some', [], ''),
        ('equal', np.bool_(True), ''),
    )
    lines = capsys.readouterr().out.splitlines()
    assert lines == [
        '[not yet] 2, 4',
        '    Found: your node published [1, 2]',
        '[not yet] it is built',
        '    Found: the build failed',
        '[not yet] the node exists',
        '    Found: RuntimeError: no <object object>',
        '[not yet] it is heard',
        '    Found: TimeoutError: Waited 30 s and more. No publisher: /scans.',
        '[not yet] it is in a group',
        "    Found: TypeError: Group.add() missing 1 required positional argument: 'timer'. "
        'Did you',
        '          forget () after a class, or write () after a callback?',
        '[not yet] it publishes',
        '    Found: TypeError: a float',
        '[not yet] some',
        '[ok] equal',
        f'Task {task}: 1 of 8.{AGAIN}',
    ]


def test_interrupt_is_no_try(capsys, task):
    def interrupted():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        check(task, ('it ends', interrupted, ''))
    assert 'Hint' not in tried(capsys, task, second=False)


def test_long_lines_are_broken_at_blanks(capsys, task):
    words = ' '.join(f'word{number}' for number in range(40))
    for _ in range(2):
        check(task, (words, lambda: words, words))
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 94
    assert ' '.join(' '.join(lines).split()).count(words) == 5


def test_a_lesson_goes_on_with_the_code_that_passes():
    with Kernel() as kernel:
        kernel.run('from helpers.checks import check')
        checked = "check(1, ('it is 2', lambda: two == 2 or f'it is {two}', 'One and one.'))"
        solution = '%%solution 1\ntwo = 1 + 1'
        assert 'its check has not' in kernel.run('%%solution 1\nthree = 3')
        assert '[not yet]' in kernel.run(f'two = 3\n{checked}')
        assert kernel.run(solution) == '[ok] it is 2\nSolution of task 1: 1 of 1.\n'
        assert kernel.run('two') == ''
        # What the solution gave is not the student's, and stays for the later cells.
        assert "name 'two' is not defined" in kernel.run(checked)
        assert kernel.run('print(two)') == '2\n'
        assert 'All done.' in kernel.run(f'two = 2.0\n{checked}')
        assert 'goes on with your code' in kernel.run(solution)
        assert kernel.run('print(two)') == '2.0\n'


def test_a_name_of_another_part_of_a_check_says_which_cells_to_run():
    part = '# ✔ Check of task 1, part {} of 2\nprint(seconds)'
    with Kernel() as kernel:
        kernel.run('%load_ext helpers.notebook.kernel\nimport helpers.ros.session')
        assert 'Run all parts of this check' in kernel.run(part.format(2))
        assert 'Run all parts' not in kernel.run(part.format(1))


def test_an_int_in_a_float_field_is_an_error():
    with Kernel() as kernel:
        early = 'from geometry_msgs.msg import Vector3\nimport helpers.ros.session\n'
        assert "The 'x' field must be of type 'float'" in kernel.run(f'{early}Vector3(x=1)')
        late = 'from sensor_msgs.msg import Range'
        assert "The 'range' field must" in kernel.run(f'{late}\nRange(range=1)')


def test_a_callback_without_end_gets_a_sentence():
    with Kernel() as kernel:
        kernel.run(ENDLESS)
        twice = "check(1, ('it counts', counts, ''), ('and again', counts, ''))"
        said = kernel.run(f'{twice}\nprint(threading.active_count())')
        ended = 'Found: TimeoutError: it did not end. Is there an endless loop, or a spin()'
        assert ended in said
        assert 'Found: not tried, because the one above did not end' in said
        assert kernel.run('print(threading.active_count())') == said.splitlines()[-1] + '\n'
        assert '[ok]' in kernel.run("loops = False\ncheck(1, ('it counts', counts, ''))")
        waits = "('it waits', threading.Event().wait, '')"
        assert ended in kernel.run(f'check(1, {waits}, limit_s=0.2)')


ENDLESS = """
import threading
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from helpers.checks import check
from helpers.ros import ros_session

loops, counted = True, []

def count():
    while loops:
        pass
    counted.append(1)

def counts():
    with ros_session() as session:
        node, executor = Node('counter'), SingleThreadedExecutor()
        node.create_timer(0.01, count)
        executor.add_node(node)
        session.spin(executor)
        session.wait_until(lambda: counted)
    return True
"""
