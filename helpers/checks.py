"""Predictions and exercises: what is right, what is still missing, and a hint.

Both functions print and return None, so that a cell shows their text and nothing else. The text
holds no measured number, and is the same in every fresh run from top to bottom. Where an exercise
is still wrong in a second run of the same kernel, its hints appear.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Set
from numbers import Integral, Real

from helpers import progress
from helpers.text import wrap

NO_GUESS = 'No guess yet. Write one in the predict cell, run that cell, then run this one again.'

_failed_tries: dict[str, int] = {}  # by title: failed tries since the last try that passed
_passed: dict[str, bool] = {}  # by title: did the last try pass?


def compare_prediction(
    question: str,
    guess: object,
    outcome: object,
    tolerance: float = 0,
    because: str | None = None,
) -> None:
    """Print the question, the guess, and whether the guess was right, but not the outcome.

    The kind of `outcome` decides how a guess is judged:

    - int: 'right', 'too many' or 'too few'; float: 'right', 'too high' or 'too low'. Right is
      whatever lies within `tolerance`, in the unit of the outcome. Choose it wide enough for the
      slowest machine: then the verdict does not change from run to run.
    - bool or str, such as 'A' out of four choices (upper and lower case are the same): 'right' or
      'not that one'.
    - list or tuple: every item, in order. set: every item, in any order. 'right' or 'not those'.

    `because` is a sentence that explains the outcome. It is printed after any guess, but not
    before there is one. A guess of None, or of the wrong kind, gets a sentence that says what to
    do: it raises nothing, since a reader wrote it.

    Raises TypeError for an outcome of another kind, ValueError for a tolerance below 0.
    """
    outcome, guess = _plain(outcome), _plain(guess)
    wanted = _kind(outcome)
    if wanted is None:
        raise TypeError(f'The outcome of a prediction cannot be of type {type(outcome).__name__}.')
    if not tolerance >= 0:
        raise ValueError(f'tolerance must be a number from 0 up, not {tolerance!r}.')
    print(question)
    if guess is None or guess is ...:
        print(f'  {NO_GUESS}')
        return
    if _kind(guess) != wanted or guess != guess:  # NaN is not equal to itself
        print(f'  Your guess: {guess!r}. Please change it: the answer must be {wanted}.')
        return
    print(f'  Your guess: {_written(guess)}. Verdict: {_verdict(guess, outcome, tolerance)}.')
    if because:
        print(f'  {because}')


def check(title: str, *requirements: tuple[str, bool | Callable[[], object], str]) -> None:
    """Print for each requirement whether it is met or missing, then how many are met.

    A requirement is `(what_is_right, test, hint)`. `test` is a truth value, or a function without
    arguments that returns one. If that function raises, the requirement is missing, and its line
    says why. Hints are shown when the exercise is still wrong at the second try. A try that passes
    starts the counting again. See also `passed`. A title such as 'Exercise 1 of lesson 02' is kept
    in the reader's progress when all is right.

    Raises ValueError without requirements, TypeError for one of another form; nothing for a wrong
    answer.
    """
    if not requirements:
        raise ValueError(f'The check {title!r} needs at least one requirement.')
    for requirement in requirements:
        if not isinstance(requirement, tuple) or len(requirement) != 3:
            raise TypeError('A requirement must be a tuple (what_is_right, test, hint).')
    results = [(what, *_run(test), hint) for what, test, hint in requirements]
    met_ones = sum(met for _, met, _, _ in results)
    done = _passed[title] = met_ones == len(results)
    tries = _failed_tries[title] = 0 if done else _failed_tries.get(title, 0) + 1
    for what, met, problem, hint in results:
        _print(f'[{"ok" if met else "missing"}] {what}{problem}')
        if not met and tries > 1:
            _print(f'    Hint: {hint}')
    _print(f'{title}: {met_ones} of {len(results)}.{" All done." if done else ""}')
    if done:
        progress.record(title)


def passed(title: str) -> bool:
    """Return whether the last `check` with this title found everything right."""
    return _passed.get(title, False)


def _print(text: str) -> None:
    print(*wrap(text, rest=' ' * 10), sep='\n')


def _plain(value: object) -> object:
    """Turn what NumPy and pandas return into the Python value that it stands for."""
    return value.tolist() if hasattr(value, 'tolist') else value


def _kind(value: object) -> str | None:
    """Name the kind of a guess or an outcome, as a reader is told it."""
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
        # Not set(guess): what a reader puts into a list need not be hashable.
        guess, outcome = list(guess), list(outcome)
        right = all(item in outcome for item in guess) and all(item in guess for item in outcome)
    else:
        right = list(guess) == list(outcome)
    return 'right' if right else 'not those'


def _written(guess: object) -> str:
    """Write a guess so that it looks the same in every run: a set has no order of its own."""
    if isinstance(guess, Set):
        return ', '.join(sorted(map(str, guess), key=lambda s: (len(s), s)))
    return ', '.join(map(str, guess)) if _kind(guess) == 'a list or a set' else str(guess)


def _run(test: bool | Callable[[], object]) -> tuple[bool, str]:
    """Return whether the test is met, and after an exception the words that report it."""
    try:
        return bool(test() if callable(test) else test), ''
    except Exception as error:  # whatever a reader's code raises is an answer that is not right
        first_line = (str(error).splitlines() or [''])[0]
        reason = re.sub(r' at 0x[0-9a-fA-F]+', '', f'{type(error).__name__}: {first_line}')
        return False, f' ({reason.removesuffix(": ")})'
