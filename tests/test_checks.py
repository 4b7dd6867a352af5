import numpy as np
import pandas as pd
import pytest

from helpers import checks

QUESTION = 'How many of 41 messages are heard?'


@pytest.fixture(autouse=True)
def fresh_kernel(monkeypatch):
    monkeypatch.setattr(checks, '_failed_tries', {})
    monkeypatch.setattr(checks, '_passed', {})


def verdict(capsys, guess, outcome, **options):
    assert checks.compare_prediction(QUESTION, guess, outcome, **options) is None
    question, line, *_ = capsys.readouterr().out.splitlines()
    assert question == QUESTION
    return line.rpartition('Verdict: ')[2]


@pytest.mark.parametrize(
    ('guess', 'outcome', 'said'),
    [
        (20, 20, 'right.'),
        (41, 20, 'too many.'),
        (11, 20, 'too few.'),
        (np.int64(41), np.int64(20), 'too many.'),
        (2, 9.2, 'too low.'),
        (30.5, 9.2, 'too high.'),
        (True, True, 'right.'),
        (False, np.bool_(True), 'not that one.'),
        ('a ', 'A', 'right.'),
        ('B', 'A', 'not that one.'),
        ([0, 1, 2], (0, 1, 2), 'right.'),
        ([1, 0, 2], [0, 1, 2], 'not those.'),
        ([0, 1, 2], pd.Series([0, 1, 2]), 'right.'),
        (range(3), np.arange(3), 'right.'),
        ([2, 0, 1], {0, 1, 2}, 'right.'),
        ({0, 1}, {0, 1, 2}, 'not those.'),
        ([0, 0, 1], {0, 1, 2}, 'not those.'),
        ([[0]], {0, 1}, 'not those.'),
    ],
)
def test_each_kind_of_guess_gets_its_verdict(capsys, guess, outcome, said):
    assert verdict(capsys, guess, outcome) == said


def test_the_whole_text_of_a_prediction(capsys):
    checks.compare_prediction(QUESTION, 41, 20, because='The queue keeps the last 10.')
    assert capsys.readouterr().out == (
        'How many of 41 messages are heard?\n'
        '  Your guess: 41. Verdict: too many.\n'
        '  The queue keeps the last 10.\n'
    )


def test_text_does_not_move_with_the_measured_number(capsys):
    texts = set()
    for measured in (18, 19, 20, 21, 22):
        for guess in (41, 20):
            checks.compare_prediction(QUESTION, guess, measured, tolerance=2)
        texts.add(capsys.readouterr().out)
    (text,) = texts
    assert 'right' in text
    assert 'too many' in text


def test_tolerance_has_an_end(capsys):
    assert verdict(capsys, 23, 20, tolerance=2) == 'too many.'
    assert verdict(capsys, 17, 20, tolerance=2) == 'too few.'


def test_a_set_is_written_in_order(capsys):
    checks.compare_prediction('Which?', {11, 3, 7}, {3, 7})
    assert 'Your guess: 3, 7, 11.' in capsys.readouterr().out


@pytest.mark.parametrize('guess', [None, ...])
def test_no_guess_gets_a_friendly_sentence_and_no_spoiler(capsys, guess):
    checks.compare_prediction(QUESTION, guess, 20, because='The queue keeps the last 10.')
    assert capsys.readouterr().out == f'{QUESTION}\n  {checks.NO_GUESS}\n'


@pytest.mark.parametrize(
    ('guess', 'outcome', 'wanted'),
    [
        ('41', 20, 'a number'),
        (True, 20, 'a number'),
        (float('nan'), 20, 'a number'),
        (print, 20, 'a number'),
        (pd.DataFrame({'a': [1, 2]}), 20, 'a number'),
        (1, True, 'True or False'),
        (1, 'A', 'text in quotes'),
        ('012', [0, 1, 2], 'a list or a set'),
    ],
)
def test_a_guess_of_the_wrong_kind_is_told_the_right_kind(capsys, guess, outcome, wanted):
    checks.compare_prediction(QUESTION, guess, outcome, because='The queue keeps the last 10.')
    text = capsys.readouterr().out
    assert text.rstrip().endswith(f'Please change it: the answer must be {wanted}.')
    assert 'queue' not in text


@pytest.mark.parametrize('outcome', [None, {'a': 1}, object()])
def test_an_outcome_of_no_known_kind_is_refused(capsys, outcome):
    with pytest.raises(TypeError, match='^The outcome of a prediction cannot be of type .*[.]$'):
        checks.compare_prediction(QUESTION, 1, outcome)
    assert capsys.readouterr().out == ''


@pytest.mark.parametrize('tolerance', [-1, float('nan')])
def test_a_tolerance_below_zero_is_refused(tolerance):
    with pytest.raises(ValueError, match='^tolerance must be a number from 0 up'):
        checks.compare_prediction(QUESTION, 1, 2, tolerance=tolerance)


def exercise(capsys, first=True, second=True, title='Exercise 1'):
    assert (
        checks.check(
            title,
            ('the group is Reentrant', first, 'Look at the second argument.'),
            ('no message is lost', lambda: second, 'Count the threads.'),
        )
        is None
    )
    return capsys.readouterr().out


def test_all_right(capsys):
    assert exercise(capsys) == (
        '[ok] the group is Reentrant\n[ok] no message is lost\nExercise 1: 2 of 2. All done.\n'
    )
    assert checks.passed('Exercise 1') is True


def test_first_wrong_try_says_what_is_missing_without_hint(capsys):
    assert exercise(capsys, second=False) == (
        '[ok] the group is Reentrant\n[missing] no message is lost\nExercise 1: 1 of 2.\n'
    )
    assert checks.passed('Exercise 1') is False


def test_second_wrong_try_gives_hints_of_what_is_missing_only(capsys):
    exercise(capsys, first=False, second=False)
    text = exercise(capsys, second=False)
    assert '[missing] no message is lost\n    Hint: Count the threads.\n' in text
    assert text.count('Hint') == 1


def test_hints_are_counted_for_each_title(capsys):
    exercise(capsys, second=False)
    assert 'Hint' not in exercise(capsys, second=False, title='Exercise 2')
    assert 'Hint' in exercise(capsys, second=False)


def test_a_second_run_in_the_same_kernel_prints_the_same(capsys):
    # Starter, then solution, as in a notebook that is run from top to bottom.
    runs = [(exercise(capsys, second=False), exercise(capsys)) for _ in range(3)]
    assert runs[0] == runs[1] == runs[2]


def test_a_test_that_raises_is_missing_and_says_why_in_one_line(capsys):
    def broken():
        raise RuntimeError(f'no {object()!r}\nmore')

    checks.check(
        'Exercise 1',
        ('the node exists', broken, ''),
        ('it is known', lambda: unknown_name, ''),  # noqa: F821
        ('there is no text', lambda: [][0] == 1 or next(iter([])), ''),
    )
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == '[missing] the node exists (RuntimeError: no <object object>)'
    assert lines[1] == "[missing] it is known (NameError: name 'unknown_name' is not defined)"
    assert lines[2] == '[missing] there is no text (IndexError: list index out of range)'
    assert lines[3].startswith('Exercise 1: 0 of 3.')


def test_an_exception_without_text_and_an_ambiguous_truth(capsys):
    checks.check(
        'Exercise 1',
        ('it ends', lambda: next(iter([])), ''),
        ('all equal', pd.Series([True, True]), ''),
    )
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == '[missing] it ends (StopIteration)'
    assert lines[1].startswith('[missing] all equal (ValueError: The truth value of a Series')


def test_interrupt_is_not_an_answer():
    def interrupted():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        checks.check('Exercise 1', ('it ends', interrupted, ''))
    assert checks._failed_tries == {}


def test_each_test_runs_once(capsys):
    calls = []
    checks.check('Exercise 1', ('called', lambda: calls.append(1) or True, ''))
    assert calls == [1]


def test_numpy_truth_counts(capsys):
    checks.check('Exercise 1', ('equal', np.bool_(True), ''))
    assert '[ok] equal' in capsys.readouterr().out


def test_an_exercise_never_checked_has_not_passed():
    assert checks.passed('Exercise 9') is False


def test_a_try_that_is_wrong_again_has_not_passed(capsys):
    exercise(capsys)
    exercise(capsys, second=False)
    assert checks.passed('Exercise 1') is False


def test_a_check_without_requirements_is_refused():
    with pytest.raises(ValueError, match='^The check .* needs at least one requirement[.]$'):
        checks.check('Exercise 1')


@pytest.mark.parametrize('requirement', [('a', True), 'abc', True])
def test_a_malformed_requirement_is_refused(capsys, requirement):
    with pytest.raises(TypeError, match='^A requirement must be a tuple'):
        checks.check('Exercise 1', ('fine', True, ''), requirement)
    assert capsys.readouterr().out == ''
    assert checks._failed_tries == {}


def test_long_lines_are_broken_at_blanks(capsys):
    words = ' '.join(f'word{number}' for number in range(40))
    checks.check('Exercise 1', (words, False, words))
    checks.check('Exercise 1', (words, False, words))
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 94
    assert ' '.join(' '.join(lines).split()).count(words) == 3
