"""What a reader reads about a guess."""

import numpy as np
import pandas as pd
import pytest

from helpers.checks.guesses import NO_GUESS, compare_prediction

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


def test_an_outcome_of_no_known_kind_is_refused(capsys):
    with pytest.raises(TypeError, match='^The outcome of a prediction cannot be of type dict[.]$'):
        compare_prediction(QUESTION, 1, {'a': 1})
    assert capsys.readouterr().out == ''
