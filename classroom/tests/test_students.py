"""What a lesson sends to the class that its student has joined."""

import sqlite3
from contextlib import closing

import pytest
from support.processes import running
from support.students import BEGIN, GUESSES, VALUES, in_kernel, kernel, student

from classroom.tests.support.classes import LATER, OTHER, QUESTION, STEP, running_class
from helpers.checks import classroom

TOLD = [41, 0.2, True, 'the way is free', ['C', 'D'], [0, 1, 2], ['a', 1]]


def join(opened, name=''):
    return f'classroom.join_class({opened.address!r}, {opened.code!r}, {name!r})\n'


# --- In a class ----------------------------------------------------------------------------------


def test_only_values_that_a_page_shows_are_sent(opened, tmp_path):
    others = '..., None, object(), "x" * 9999, [[1]], {"A": 1}, float("inf"), 2**99'
    script = f"""
for value in ({others}, *{VALUES!r}):
    assert guess({OTHER!r}, value) is value
guess({QUESTION!r}, 'the last one')
"""
    with kernel(tmp_path, join(opened) + script):
        opened.wait_for(lambda view: view['guesses'][0]['answered'])
    assert [value for _, _, value in opened.events()[:-1]] == TOLD


def test_the_page_gets_guesses_tasks_and_hands(opened, tmp_path):
    script = f"""
guess({QUESTION!r}, 7)
my_secret = guess({QUESTION!r}, 9)
compare_prediction({QUESTION!r}, my_secret, 14)
classroom.tell_task('try_it', True)
classroom.tell_task('try_it', False)
raise_hand()
"""
    with kernel(tmp_path, join(opened, 'Ada') + script) as said:
        view = opened.wait_for(lambda view: view['hands'])
    assert f'You are in the class of {opened.address} on seat' in said
    assert 'called Ada. Sent to it: your guesses' in said
    assert 'Your hand is up.' in said
    assert [hand['name'] for hand in view['hands']] == ['Ada']
    [task] = view['tasks']
    assert (task['solved'], task['tried']) == (1, 0)
    assert opened.bars() == {'9': 1, '14': 0}
    assert opened.view()['guesses'][0]['measured'] == ['14']
    assert opened.events() == [
        ('guess', QUESTION, 7),
        ('guess', QUESTION, 9),
        ('outcome', QUESTION, 14),
        ('task', 'try_it', True),
        ('task', 'try_it', False),
        ('hand', '', True),
    ]


def test_membership_lasts_until_the_student_leaves(opened, tmp_path):
    in_kernel(tmp_path, join(opened))
    in_kernel(tmp_path, f'guess({QUESTION!r}, 2)', JPY_SESSION_NAME='/home/ada/notes.ipynb')
    with kernel(tmp_path, f'guess({QUESTION!r}, 1)'):
        opened.wait_for(lambda view: view['guesses'][0]['answered'])
    assert [value for _, _, value in opened.events()] == [1]
    assert in_kernel(tmp_path, 'leave_class()').endswith('What you sent is deleted.')
    in_kernel(tmp_path, f'guess({QUESTION!r}, 3)')
    assert opened.events() == []
    assert in_kernel(tmp_path, 'leave_class()') == classroom.NOT_JOINED


def test_membership_ends_after_twelve_hours(opened, tmp_path):
    in_kernel(tmp_path, join(opened))
    with closing(sqlite3.connect(tmp_path / 'ros2_notebooks_class.sqlite')) as kept, kept:
        [(until_s,)] = kept.execute('SELECT until_s FROM class')
        kept.execute('UPDATE class SET until_s = ?', (until_s - 12 * 3600,))
    in_kernel(tmp_path, f'guess({QUESTION!r}, 3)')
    assert opened.events() == []
    assert in_kernel(tmp_path, 'leave_class()') == classroom.NOT_JOINED


@pytest.mark.parametrize('elsewhere', [False, True])
def test_a_guess_after_joining_again_is_sent(opened, tmp_path, elsewhere):
    """Also if it is another kernel of the student that leaves and joins."""
    again = f'leave_class()\n{join(opened)}'
    script = f"""
guess({QUESTION!r}, 1)
sys.stdin.readline()
{'' if elsewhere else again}
guess({QUESTION!r}, 2)
sys.stdin.read()
"""
    with running(BEGIN + join(opened) + script, **student(tmp_path)) as process:
        opened.wait_for(lambda view: view['guesses'][0]['answered'])
        if elsewhere:
            in_kernel(tmp_path, again)
        print(file=process.stdin, flush=True)
        opened.wait_for(lambda view: opened.events() == [('guess', QUESTION, 2)])


def test_the_steps_of_the_cells_that_run(opened, tmp_path):
    script = f"""
shell = InteractiveShell.instance()
shell.run_cell('from helpers.checks import *', cell_id={STEP!r})
shell.run_cell('1', cell_id='my own')
shell.run_cell('1', cell_id={LATER!r})
"""
    in_kernel(tmp_path, join(opened))
    begin = 'import sys; from IPython.core.interactiveshell import InteractiveShell\n'
    with kernel(tmp_path, script, begin):
        view = opened.wait_for(lambda view: any(step['here'] for step in view['steps']))
    assert {step['title']: step['here'] for step in view['steps']}['2. Look'] == 1
    assert len(opened.events()) == 1


def test_a_code_that_is_wrong(opened, tmp_path):
    loose = opened.code.replace('-', ' ').upper()
    script = f'join_class("{opened.address}", "blue-otter-lamp")\n'
    said = in_kernel(tmp_path, f'{script}join_class("http://{opened.address}/", {loose!r})')
    assert said.startswith('This is not the code of the class. Compare it with the wall. You are')


# --- When the class does not answer --------------------------------------------------------------


def test_events_survive_a_dead_server_exactly_once(tmp_path):
    """The server is killed in the middle; kernels end and begin; a clock is a year behind."""
    behind = 'import time\nreal = time.time\ntime.time = lambda: real() - 3e7\n'
    first, second, third = (GUESSES.format(n, n + 100, QUESTION) for n in (0, 100, 200))
    ada = tmp_path / 'ada'
    with running_class(tmp_path / 'class') as opened:
        assert 'does not answer' not in in_kernel(ada, join(opened) + first)
        begin = f'{behind}{BEGIN}print("open", flush=True)\n'
        with running(begin + second, **student(ada)) as process:
            assert process.stdout.readline() == 'open\n'
            opened.kill()
            process.communicate()
        with kernel(ada, third) as said:
            assert 'The class does not answer. What you tell is kept for ten minutes.' in said
            opened.start()
            assert 'goes on' in opened.said
            opened.go(1)
            opened.wait_for(lambda view: opened.bars() == {'299': 1})
        assert [value for _, _, value in opened.events()] == list(range(300))

        # The class is over. Late students read it from the next one.
        assert opened.stop().endswith('The class is over. What it was told is deleted.\n')
        assert not list(tmp_path.glob('class/jupyter/class/*'))
        opened.start()
        said = in_kernel(ada, GUESSES.format(0, 100, QUESTION))
        assert 'The class that you joined is over. To tell a new one, join it.' in said
        assert opened.events() == []
    assert in_kernel(ada, 'raise_hand()') == classroom.NOT_JOINED


def test_a_class_that_stays_silent_is_left(tmp_path):
    with running_class(tmp_path / 'class') as opened:
        in_kernel(tmp_path, join(opened))
    script = f"""
import time
classroom.GIVE_UP_S = 0.0
guess({QUESTION!r}, 1)
while classroom._known():
    time.sleep(0.05)
guess({QUESTION!r}, 2)
"""
    assert in_kernel(tmp_path, script).endswith(classroom.OVER)
    assert in_kernel(tmp_path, 'raise_hand()') == classroom.NOT_JOINED
