"""Guesses: what the student expected, and what came out.

    my_guess = guess('How many?', ...)                          the student writes a guess
    compare_prediction('How many?', my_guess, 20)               later: was it right?

The function prints and returns None, so that a cell shows its text and nothing else. The text is
the same in every fresh run from top to bottom.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Set
from numbers import Integral, Real
from typing import TYPE_CHECKING

from IPython import get_ipython
from IPython.display import display

from helpers.checks import classroom, progress
from helpers.checks.portrait import record_of
from helpers.notebook import BEGIN_EMPTY, can_ask

if TYPE_CHECKING:
    from helpers.guesses import Guess

NO_GUESS = 'No guess yet. Write one in place of the three dots, run that cell, then this one again.'


def compare_prediction(
    question: str,
    guess: object,
    outcome: object,
    tolerance: float = 0,
    because: str | None = None,
    table: Mapping[str, str | Mapping[str, str]] | None = None,
) -> None:
    """Print the question, the guess, whether the guess was right, and if not, the right answer.

    The kind of `outcome` decides how a guess is judged:

    - int: 'right', 'too many' or 'too few'; float: 'right', 'too high' or 'too low'.
    - bool or str, such as 'A' out of four choices (upper and lower case are the same): 'right' or
      'not that one'.
    - list or tuple: every item, in order. set: every item, in any order. 'right' or 'not those'.

    If a measured number moves from run to run, whatever lies within `tolerance` of it is right, in
    its own unit. Choose it wide enough for the slowest machine: then the verdict stays the same.
    The right answer is then printed for a student only, not in a run without one.

    For a guess that was made in a picture, `outcome` is what its kind compares: the robot, a point
    or the path to it (n, 2), a number, or what came out of the options. The gap is shown there, in
    one sentence. If cells of a table were ticked, `table` is what has come into them: texts by the
    options, or by row and column, which may be more than were asked about.

    `because` is a sentence that explains the outcome. It is printed after any guess. If there is no
    guess yet, a student is asked for one; a run without a student, as in CI, prints the answer. A
    guess of the wrong kind gets a sentence that says what to do: it raises nothing.

    Raises TypeError for an outcome of another kind.
    """
    # Loaded where a guess was made in a picture, and by nothing else: it is heavy.
    pictures = sys.modules.get('helpers.guesses')
    if pictures and isinstance(guess, pictures.Guess):
        _compare(question, guess, outcome, tolerance, because, table)
        return
    outcome, guess = _plain(outcome), _plain(guess)
    wanted = _kind(outcome)
    if wanted is None:
        raise TypeError(f'The outcome of a prediction cannot be of type {type(outcome).__name__}.')
    print(question)
    if guess is None or guess is ...:
        if _has_student():
            print(f'  {NO_GUESS}')
            return
        if not tolerance:
            print(f'  The answer is {_written(outcome)}.')
        if because:
            print(f'  {because}')
        return
    if _kind(guess) != wanted:
        print(f'  Your guess: {guess!r}. Please change it: the answer must be {wanted}.')
        return
    verdict = _verdict(guess, outcome, tolerance)
    answer = ''
    if verdict != 'right' and not tolerance:
        answer = f' The answer is {_written(outcome)}.'
    elif verdict != 'right' and _has_student():  # it moves, so a saved output does not have it
        answer = f' Here it was {outcome:.4g}.'
    print(f'  Your guess: {_written(guess)}. Verdict: {verdict}.{answer}')
    classroom.tell_outcome(question, outcome)
    if because:
        print(f'  {because}')


def _compare(
    question: str,
    guess: Guess,
    measured: object,
    tolerance: float,
    because: str | None,
    table: Mapping[str, str | Mapping[str, str]] | None,
) -> None:
    """Show the gap between a guess that was made in a picture and what came out."""
    from helpers.guesses import Gap

    print(question)
    try:
        outcome = guess.kind.outcome(_plain(measured), guess.run, tolerance)
    except ValueError:  # a student's own program may do what nobody has thought of
        print(f'  The answer is {_written(_plain(measured))}: it was none of the options.')
        return
    if table is not None:
        outcome['table'] = guess.kind.came(table)
    # In front of a class there may be no guess but those of the class.
    in_class = bool(os.environ.get(BEGIN_EMPTY))
    if guess.value is None:
        if _has_student() and not in_class:
            print(f'  No guess yet. {guess.kind.asks} Then run this cell again.')
            return
        if table is not None or 'path' in outcome or (in_class and guess.run is None):
            display(Gap(guess, outcome))
        elif answer := guess.kind.answer(outcome):
            print(f'  The answer is {answer}.')
    else:
        display(Gap(guess, outcome))
        progress.keep_gap(record_of(guess, outcome))
        classroom.tell_outcome(question, guess.kind.told(_plain(outcome['at'])))
    if because:
        print(f'  {because}')


def _has_student() -> bool:
    """Return whether somebody can answer, as in JupyterLab; in CI nobody can."""
    shell = get_ipython()
    return shell is None or not hasattr(shell, 'kernel') or can_ask(shell.kernel)


def _plain(value: object) -> object:
    """Turn what NumPy and pandas return into the Python value that it stands for."""
    return value.tolist() if hasattr(value, 'tolist') else value


def _kind(value: object) -> str | None:
    """Name the kind of a guess or an outcome, as a sentence to the reader says it."""
    if isinstance(value, bool):
        return 'True or False'
    if isinstance(value, Real):
        return 'a number'
    if isinstance(value, str):
        return 'text in quotes'
    if isinstance(value, list | tuple | range | Set):
        return 'a list or a set'
    return None


def _verdict(guess, outcome, tolerance: float) -> str:
    if isinstance(outcome, bool):
        return 'right' if guess == outcome else 'not that one'
    if isinstance(outcome, Real):
        if abs(guess - outcome) <= tolerance:
            return 'right'
        high, low = ('many', 'few') if isinstance(outcome, Integral) else ('high', 'low')
        return f'too {high if guess > outcome else low}'
    if isinstance(outcome, str):
        same = guess.strip().casefold() == outcome.strip().casefold()
        return 'right' if same else 'not that one'
    if isinstance(outcome, Set):
        # Not as sets: what a reader puts into a list need not be hashable.
        guess, outcome = list(guess), list(outcome)
        right = all(item in outcome for item in guess) and all(item in guess for item in outcome)
    else:
        right = list(guess) == list(outcome)
    return 'right' if right else 'not those'


def _written(value: object) -> str:
    """Write a guess or an answer as it looks in every run: a set has no order of its own."""
    if isinstance(value, Set):
        value = sorted(map(str, value), key=lambda text: (len(text), text))
    if _kind(value) == 'a list or a set':
        return ', '.join(map(str, value)) or 'none'
    return str(value)
