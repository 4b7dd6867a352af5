"""What a reader reads about a guess."""

import cmath
import math
import os
from dataclasses import replace
from html import unescape

import numpy as np
import pandas as pd
import pytest
from jupyter_client.manager import run_kernel

from helpers.checks import guess
from helpers.checks.guesses import NO_GUESS, compare_prediction
from helpers.checks.progress import FILE_VARIABLE
from helpers.guesses import Level
from helpers.robot import CORRIDOR, EMPTY, ROOMS, DriveRecord, Floor, Pose
from helpers.robot.record import Command, Event, Step
from helpers.robot_view.place import Point

QUESTION = 'How many of 41 messages are heard?'


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
    monkeypatch.setattr('helpers.checks.guesses._has_student', lambda: False)
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


def test_without_a_student_the_answer_is_said_if_it_does_not_move(capsys, monkeypatch):
    monkeypatch.setattr('helpers.checks.guesses._has_student', lambda: False)
    reason = 'The queue keeps the last 10.'
    assert told(capsys, ..., 20, because=reason) == ['  The answer is 20.', f'  {reason}']
    assert told(capsys, ..., 20, tolerance=2, because=reason) == [f'  {reason}']


def test_an_outcome_of_no_known_kind_is_refused(capsys):
    with pytest.raises(TypeError, match='^The outcome of a prediction cannot be of type dict[.]$'):
        compare_prediction(QUESTION, 1, {'a': 1})
    assert capsys.readouterr().out == ''


# Guesses that one makes in a picture

END = 'Where does it end?'
ROWS = {'lost': range(3), 'it stops': bool}
POINT = {'on': ROOMS, 'point': True}


def asked(capsys, *typed, **on):
    """Return the guess, and what its cell prints."""
    made = guess(END, *typed, **on)
    return made, capsys.readouterr().out


@pytest.mark.parametrize(
    ('on', 'typed', 'value', 'said'),
    [
        (CORRIDOR, 1.2, 1.2, 'it stops 1.20 m before the wall.'),
        (CORRIDOR, '0,3 m before the wall', 0.3, 'it stops 0.30 m before the wall.'),
        (CORRIDOR, 'wall', 0.11, 'it hits the wall.'),
        (CORRIDOR, False, 0.11, 'it hits the wall.'),
        (CORRIDOR, 0, 0.11, 'it hits the wall.'),
        (range(42), 14, 14, '14.'),
        (range(42), '14', 14, '14.'),
        (Level(0.0, 2.0, 's'), '0,9 s', 0.9, '0.9 s.'),
        (bool, 'no', 1, 'no.'),
        (bool, False, 1, 'no.'),
        (('A', 'B', 'C'), ' b', 1, 'B.'),
        ({'hits the wall': 'hit', 'stops': 'stop'}, 'Stops', 1, 'stops.'),
        (ROWS, [2, 'no'], [2, 1], 'lost: 2, it stops: no.'),
        (ROWS, {'it stops': True, 'lost': 0}, [0, 0], 'lost: 0, it stops: yes.'),
        (ROWS, '1, yes', [1, 0], 'lost: 1, it stops: yes.'),
        (dict.fromkeys('12', ('A', 'B', '-')), 'B-', [1, 2], '1: B, 2: -.'),
    ],
)
def test_whatever_says_it_is_read(capsys, on, typed, value, said):
    made, printed = asked(capsys, typed, on=on)
    assert made.value == value
    assert printed.endswith(f'You say: {said}\n')


@pytest.mark.parametrize('typed', [{7, 8}, [8, 7], (7, 8), '7, 8', '7 and 8'])
def test_several_options_are_typed_in_any_form(capsys, typed):
    made, _ = asked(capsys, typed, on=range(5, 9), several=2)
    assert made.value == [2, 3]


@pytest.mark.parametrize(
    ('on', 'typed', 'why'),
    [
        ({'on': CORRIDOR}, 'far', "'far' is no place. Typed in place of the dots:"),
        ({'on': CORRIDOR}, 9.0, '9.0 is no place: the robot starts 3.25 m before the wall.'),
        ({'on': CORRIDOR}, True, 'True is no place.'),
        ({'on': range(42)}, 14.5, '14.5 is no answer. Typed in place of the dots: a whole number'),
        ({'on': range(42)}, 42, '42 is not on the axis.'),
        ({'on': bool}, 1, '1 is none of the options. Typed in place of the dots: True or False.'),
        ({'on': ('A', 'B')}, 'C', "'C' is none of the options."),
        ({'on': range(9), 'several': 3}, [1, 2], 'These are 2, and 3 are asked for.'),
        ({'on': ROWS}, [1], '[1] is no answer for 2 rows.'),
        (POINT, 'far', "'far' is no point. Typed in place of the dots: (x, y) in metres"),
        (POINT, (1.0, True), '(1.0, True) is no point.'),
        (POINT, (1.0, 2.0, 3.0), '(1.0, 2.0, 3.0) is no point.'),
        (POINT, (1.0, math.nan), '(1.0, nan) is no point.'),
        (POINT, (99.0, 0.0), '(99.0, 0.0) is not on this floor.'),
        (
            {'on': ROWS},
            [3, True],
            '3 is none of the options. Typed in place of the dots: 0, 1 or 2.',
        ),
    ],
)
def test_a_wrong_form_is_said_at_once(capsys, on, typed, why):
    made, printed = asked(capsys, typed, **on)
    assert made.value is None
    assert why in printed.replace('\n', ' ')


@pytest.mark.parametrize(
    'typed',
    [
        (1.5, -0.5),
        '1.5, -0.5',
        '1,5 -0,5',
        'x 1.5 m, y -0.5 m',
        {'y': -0.5, 'x': '1.5 m'},
        np.array([1.5, -0.5]),
    ],
)
def test_a_point_is_typed_in_any_form(capsys, typed):
    made, printed = asked(capsys, typed, **POINT)
    assert made.value == [1.5, -0.5]
    assert printed.endswith('You say: it is 1.50 m ahead of the start, 0.50 m to its right.\n')


def test_two_numbers_are_a_point_too():
    assert guess(END, 2, 0, **POINT).said() == 'it is 2.00 m ahead of the start.'
    assert guess(END, '0,0', **POINT).said() == 'it is where the robot starts.'
    assert guess(END, '2,1', **POINT).value == [2.0, 1.0]


def test_x_is_ahead_of_the_robot_wherever_it_looks():
    turned = Floor((), (4.0, 4.0), Pose(1.0, 1.0, math.pi / 2))
    kind = guess(END, ..., on=turned, point=True).kind
    assert kind.on_floor(2.0, 0.5) == pytest.approx((0.5, 3.0))
    with pytest.raises(ValueError, match='not on this floor'):
        kind.read((2.0, 1.5))


def test_options_stand_at_their_points():
    points = {'A': (0.5, 0.4), 'B': (4.0, -1.5)}
    kind = guess('Which are taken?', ..., on=[*points], several=True, marks=points).kind
    assert kind.record()['points'] == [(0.5, 0.4), (4.0, -1.5)]
    assert kind.read({'B'}) == [1]


def test_what_may_be_answered_is_visible_before(capsys):
    for on in (CORRIDOR, range(42), bool, ('A', 'B'), ROWS):
        made, printed = asked(capsys, ..., on=on)
        assert made.value is None
        assert made.kind.forms in printed
        assert made.kind.forms in unescape(made._repr_mimebundle_()['text/html'])


def drive(*rows, bump_s=None, **others):
    """Return a drive in the corridor, (t, x, v) of each step."""
    poses = [Step(t_s, x, 1.25, 0.0, v, 0.0) for t_s, x, v in rows]
    events = [] if bump_s is None else [Event(bump_s, 'bump', 'It hit something.')]
    return DriveRecord(CORRIDOR, poses=poses, **{'events': events} | others)


HIT = drive((0, 1.25, 0.5), (6, 4.39, 0.5), bump_s=6)  # the wall is at 4.5
STOOD = drive((0, 1.25, 0.5), (6, 4.0, 0.0))
TOLD = [Command(1.0, 0.5, 0.0)]
WATCHDOG = [Event(1.5, 'watchdog', 'No command came for 0.5 s: it stops.')]
LATE = drive((0, 1.25, 0.5), (6, 4.0, 0.0), commands=TOLD, events=WATCHDOG)


@pytest.mark.parametrize(
    ('typed', 'record', 'said'),
    [
        ('wall', HIT, 'Right: it hit the wall.'),
        (0.6, HIT, 'It is in the wall, 0.49 m further than you said.'),
        (0.5, STOOD, 'Right: it stands 0.50 m before the wall.'),
        (0.9, STOOD, 'It stands 0.50 m before the wall, 0.40 m further than you said.'),
        ('wall', STOOD, 'It stands 0.50 m before the wall, 0.39 m short of what you said.'),
        (
            0.5,
            LATE,
            'Right: it stands 0.50 m before the wall. '
            'After the last command it drove on for 0.5 s: 0.5 s × 0.5 m/s = 0.25 m.',
        ),
        # So near, and yet it hit: that is another answer.
        (0.15, HIT, 'It is in the wall, 0.04 m further than you said.'),
    ],
)
def test_the_gap_to_a_drive_is_one_sentence(capsys, typed, record, said):
    made, _ = asked(capsys, typed, on=CORRIDOR)
    compare_prediction(END, made, record)
    assert capsys.readouterr().out.splitlines()[-1].strip() == said


SIDE = 'It is 2.00 m ahead of the start, 1.00 m to its right'


@pytest.mark.parametrize(
    ('on', 'typed', 'outcome', 'said'),
    [
        ({'on': range(42)}, 41, 14, 'It is 14: you said 41.'),
        ({'on': range(42)}, 14, np.int64(14), 'Right: it is 14.'),
        ({'on': range(42), 'unit': 'scans'}, 41, 1, 'It is 1 scan: you said 40 too many.'),
        ({'on': Level(0.0, 2.0, 's')}, 0.5, 1.1, 'It is 1.1 s: you said 0.6 s too little.'),
        ({'on': bool}, 'yes', np.bool_(False), 'It is no: you said yes.'),
        ({'on': ('A', 'B', 'C'), 'several': True}, {'A', 'B'}, {'B'}, 'It is B: you said A, B.'),
        ({'on': ('A', 'B', 'C'), 'several': True}, set(), set(), 'Right: none.'),
        (POINT, (2, 0), [(0, 0), (2, -1)], f'{SIDE}: 1.00 m from your point.'),
        (POINT, (2, -0.8), np.array([2, -1]), f'{SIDE}: 0.20 m from your point.'),
        (POINT, (2, -0.95), (2, -1), f'Right: i{SIDE[1:]}.'),
        ({'on': ROWS}, [1, 'no'], [2, False], 'lost is 2, and you said 1.'),
        ({'on': ROWS}, [2, 'no'], {'lost': 2, 'it stops': False}, 'Right: lost: 2, it stops: no.'),
    ],
)
def test_the_gap_to_a_number_and_to_options(capsys, on, typed, outcome, said):
    made, _ = asked(capsys, typed, **on)
    compare_prediction(END, made, outcome)
    assert capsys.readouterr().out.splitlines()[-1].strip() == said


@pytest.mark.parametrize(
    ('on', 'outcome', 'said'),
    [({'on': (0.3, 0.5)}, 0.7, '0.7'), ({'on': ROWS}, [1], '1')],
)
def test_what_was_none_of_the_options_is_said(capsys, on, outcome, said):
    made, _ = asked(capsys, ..., **on)
    compare_prediction(END, made, outcome)
    said = f'{END}\n  The answer is {said}: it was none of the options.\n'
    assert capsys.readouterr().out == said


def test_without_a_student_the_answer_is_words_that_never_move(capsys, monkeypatch):
    made, _ = asked(capsys, ..., on=CORRIDOR)
    compare_prediction(END, made, HIT)
    assert 'No guess yet. Put your robot' in capsys.readouterr().out
    monkeypatch.setattr('helpers.checks.guesses._has_student', lambda: False)
    for record, answer in ((HIT, 'in the wall'), (STOOD, 'before the wall')):
        compare_prediction(END, made, record)
        assert capsys.readouterr().out == f'{END}\n  The answer is {answer}.\n'


@pytest.mark.parametrize(
    ('end', 'said'),
    [
        ((2.0, -1.0), 'ahead of the start, to its right'),
        ((-2.0, 0.2), 'behind the start'),
        ((0.1, 1.0), 'to its left'),
        ((0.1, 0.2), 'where the robot starts'),
    ],
)
def test_without_a_student_a_point_is_on_a_side_of_the_robot(capsys, monkeypatch, end, said):
    monkeypatch.setattr('helpers.checks.guesses._has_student', lambda: False)
    shown = []
    monkeypatch.setattr('helpers.checks.guesses.display', shown.append)
    made, _ = asked(capsys, ..., **POINT)
    compare_prediction(END, made, [(0.0, 0.0), end], tolerance=0.3)
    # The site has its picture, through which the browser draws what was guessed there.
    assert str(shown[0]) == f'  The answer is {said}.'
    html = unescape(shown[0]._repr_mimebundle_()['text/html'])
    assert '"path":[[0.0,0.0],' in html


def test_a_line_on_the_way_has_a_name_and_the_way_a_start():
    kind = guess(END, ..., on=CORRIDOR, start=Pose(2.5, 1.25, 0.0), marks={'it breaks': 1.0}).kind
    assert kind.ahead_m == 2.0
    assert (kind.record()['line'], kind.record()['label']) == (1.0, 'it breaks')
    assert ' A line, it breaks, is 1 m before the wall.' in kind.words()
    assert guess(END, ..., on=CORRIDOR, line_m=0.6).kind.record()['label'] == 'limit: 0.6 m'


@pytest.mark.parametrize('degrees', [0, 90, 210])
def test_a_point_is_put_where_the_robot_sees_it(degrees):
    yaw = math.radians(degrees)
    point = Point(replace(EMPTY, start=Pose(2.0, 3.0, yaw)))
    x, y = point.on_floor(1.5, -0.5)
    ahead_and_left = complex(x - 2.0, y - 3.0) * cmath.exp(-1j * yaw)
    assert ahead_and_left == pytest.approx(1.5 - 0.5j)


def test_a_floor_without_a_wall_takes_no_place():
    with pytest.raises(ValueError, match='On the floor empty nothing is ahead'):
        guess(END, ..., on=EMPTY)
    with pytest.raises(TypeError, match='not on 3'):
        guess(END, ..., on=3)


CELL = """
from helpers.checks import guess
from helpers.robot import CORRIDOR
made = guess('Where does it end?', {}, on=CORRIDOR)
print(made.value)
"""


def test_the_next_kernel_knows_what_was_guessed(tmp_path):
    """It is in the file of the student's progress, by lesson and question."""

    def printed(typed, lesson='05_keep_what_is_fresh', **more):
        env = {'JPY_SESSION_NAME': f'/home/ada/notebooks/{lesson}.ipynb', **more}
        env |= {FILE_VARIABLE: str(tmp_path / 'progress.txt')}
        found = []
        with run_kernel(kernel_name='python3', env=os.environ | env) as kernel:
            kernel.execute_interactive(
                CELL.format(typed),
                allow_stdin=True,  # as somebody who watches
                output_hook=lambda one: found.append(one['content'].get('text', '')),
                timeout=60,
            )
        return ''.join(found).strip()

    assert printed('...') == 'None'
    assert printed('1.5') == '1.5'
    assert printed('...') == '1.5'
    assert printed('...', lesson='06_call_a_service_from_a_callback') == 'None'
    assert printed('...', ROS2_NOTEBOOKS_BEGIN_EMPTY='yes') == 'None'  # in front of a class


KINDS = [
    (CORRIDOR, {}, 1.5),
    (EMPTY, {'point': True}, (1.0, -0.5)),
    (range(9), {}, 3),
    (('a', 'b', 'c'), {'several': True}, ['a', 'c']),
    ({'first': ('a', 'b'), 'second': ('a', 'b')}, {}, ['a', 'b']),
]


@pytest.mark.parametrize(('on', 'more', 'typed'), KINDS)
def test_what_is_kept_is_known_again_unless_it_fits_another_kind_only(
    tmp_path, monkeypatch, on, more, typed
):
    """A question may get another kind between two releases."""
    monkeypatch.setenv(FILE_VARIABLE, str(tmp_path / 'progress.txt'))
    monkeypatch.setenv('JPY_SESSION_NAME', 'notebooks/05_keep_what_is_fresh.ipynb')
    monkeypatch.setattr('helpers.checks.guesses.somebody_watches', lambda: True)
    made = guess('What is it?', typed, on=on, **more)
    assert guess('What is it?', ..., on=on, **more).value == made.value
    others = [guess('What is it?', ..., on=one, **its_own) for one, its_own, _ in KINDS]
    assert [one.value for one in others if one.kind != made.kind] == [None] * (len(KINDS) - 1)
