"""The points of a task: what their tests may return, and the words of a judge."""

import numpy as np
import pytest

from helpers.checks.errors import Failed, NeverEnds
from helpers.checks.points import all_of, cached, expect, in_turn, judge_points, needs, rows


def sent(*points):
    """Return what the judge sends for these points."""
    messages = []
    judge_points(lambda: [*points], messages.append)
    return messages


@pytest.mark.parametrize('right', [True, np.bool_(True)])
def test_a_point_is_right_or_says_what_was_found(right):
    points = ('it turns', lambda: right, 'Turn.'), ('it stops', lambda: 'it drives on', 'Stop.')
    assert sent(*points) == [
        ('points', [('it turns', 'Turn.'), ('it stops', 'Stop.')]),
        ('point', (True, '', None)),
        ('point', (False, 'it drives on', None)),
    ]


@pytest.mark.parametrize('result', [None, False, 1, '', (), ('a', 'b'), []])
def test_anything_else_is_a_mistake_of_the_check_with_its_line(result):
    def test():
        return result

    kind, said = sent(('it turns', test, ''), ('it stops', lambda: True, ''))[-1]
    line = test.__code__.co_firstlineno
    where = f"at the point 'it turns', the test in line {line} of test_points.py"
    assert kind == 'mistake'
    assert said.startswith(f'{where} returns {result!r}, and it must return True or a text')


@pytest.mark.parametrize(
    ('found', 'right', 'said'),
    [
        (3, 3, True),
        ([1, 2], [1, 2], True),
        (3, 4, 'it returns 3, not 4'),
        ('3', 3, "it returns '3', not 3"),
        ([], [1], 'it returns [], not [1]'),
        (np.float64(0.5), 0.25, 'it returns 0.5, not 0.25'),
        (np.array([1, 2]), [1, 2], 'it returns array([1, 2]), not [1, 2]'),
        (None, 'a text', "it returns None, not 'a text'"),
    ],
)
def test_what_was_found_stands_beside_what_is_right(found, right, said):
    assert expect(found, right, 'it returns') == said


@pytest.mark.parametrize(
    ('found', 'said'),
    [
        (2.0009, True),
        (2.0, True),
        (2.0012, 'it drives 2.001 m, not 2 m'),
        (float('nan'), 'it drives nan m, not 2 m'),
        (None, 'it drives None, not 2 m'),
        (True, 'it drives True, not 2 m'),
    ],
)
def test_what_is_measured_may_differ_a_little(found, said):
    assert expect(found, 2, 'it drives', within=0.001, unit='m') == said


def test_of_several_results_the_first_that_is_not_right_is_said():
    assert all_of(True, np.bool_(True)) is True
    assert all_of(True, 'it drives on', 'it turns') == 'it drives on'
    assert all_of(True, None) is None  # a mistake of the check, which the judge says


def test_in_turn_runs_none_behind_the_first_text():
    run = []

    def test(result):
        run.append(result)
        return result

    tests = [lambda result=result: test(result) for result in (True, 'it drives on', 'it turns')]
    assert in_turn(*tests) == 'it drives on'
    assert run == [True, 'it drives on']
    assert in_turn(lambda: True, lambda: np.bool_(True)) is True


def test_a_point_can_need_an_earlier_one():
    def built():
        return 'there is no setup.py'

    def unlike():
        raise Failed('two of them')

    needs(lambda: True)
    with pytest.raises(Failed, match='^it is not built$'):
        needs(built, 'it is not built')
    with pytest.raises(Failed, match='^it is not built$'):
        needs(unlike, 'it is not built')
    with pytest.raises(Failed, match=r'^there is no setup\.py$'):
        needs(built)


def test_what_never_ends_is_not_waited_for_again():
    def waits():
        raise NeverEnds('a callback does not end')

    with pytest.raises(NeverEnds, match='^a callback does not end$'):
        needs(waits, 'it is not built')


def test_rows_of_a_table_are_points():
    points = rows(
        lambda number, right=0: expect(number, right, 'it is'),
        'Count them.',
        ('two are two', 2, 2),
        ('none is none', 0),
    )
    assert [(what, test(), hint) for what, test, hint in points] == [
        ('two are two', True, 'Count them.'),
        ('none is none', True, 'Count them.'),
    ]


def test_what_several_points_look_at_is_made_once():
    made = []
    build = cached(lambda: made.append(1) or 'built')
    assert (build(), build(), made) == ('built', 'built', [1])

    @cached
    def broken():
        made.append(2)
        raise ValueError('no')

    for _ in range(2):
        with pytest.raises(ValueError, match='no'):
            broken()
    assert made == [1, 2]


def test_a_hint_for_another_mistake_is_not_shown():
    """What an earlier point lacks, and what a judge says so of, is no mistake of this point."""

    def lacks_the_build():
        needs(lambda: 'Line 7: a name is missing')

    def differs():
        raise Failed('the program has ended', hint='')

    points = ('it drives', lacks_the_build, 'Drive.'), ('it stops', differs, 'Stop.')
    assert sent(*points)[1:] == [
        ('point', (False, 'Line 7: a name is missing', '')),
        ('point', (False, 'the program has ended', '')),
    ]
