"""Predictions and exercises: what is right, what the reader's code did, and a hint.

Both functions print and return None, so that a cell shows their text and nothing else. The text is
the same in every fresh run from top to bottom. Where an exercise is still wrong in a second run of
the same kernel, its hints appear.
"""

from __future__ import annotations

import re
import traceback
from collections.abc import Callable, Set
from numbers import Integral, Real

from helpers import classroom, progress
from helpers.text import wrap

NO_GUESS = 'No guess yet. Write one in the predict cell, run that cell, then run this one again.'

_failed_tries: dict[str, int] = {}  # by title: failed tries since the last try that passed


def compare_prediction(
    question: str,
    guess: object,
    outcome: object,
    tolerance: float = 0,
    because: str | None = None,
) -> None:
    """Print the question, the guess, whether the guess was right, and if not, the right answer.

    The kind of `outcome` decides how a guess is judged:

    - int: 'right', 'too many' or 'too few'; float: 'right', 'too high' or 'too low'.
    - bool or str, such as 'A' out of four choices (upper and lower case are the same): 'right' or
      'not that one'.
    - list or tuple: every item, in order. set: every item, in any order. 'right' or 'not those'.

    Where a measured number moves from run to run, whatever lies within `tolerance` of it is right,
    in its own unit. Choose it wide enough for the slowest machine: then the verdict stays the same.
    The right answer is then not printed.

    `because` is a sentence that explains the outcome. It is printed after any guess, but not
    before there is one. A guess of None, or of the wrong kind, gets a sentence that says what to
    do: it raises nothing, since a reader wrote it.

    Raises TypeError for an outcome of another kind.
    """
    outcome, guess = _plain(outcome), _plain(guess)
    wanted = _kind(outcome)
    if wanted is None:
        raise TypeError(f'The outcome of a prediction cannot be of type {type(outcome).__name__}.')
    print(question)
    if guess is None or guess is ...:
        print(f'  {NO_GUESS}')
        return
    if _kind(guess) != wanted:
        print(f'  Your guess: {guess!r}. Please change it: the answer must be {wanted}.')
        return
    verdict = _verdict(guess, outcome, tolerance)
    answer = '' if verdict == 'right' or tolerance else f' The answer is {_written(outcome)}.'
    print(f'  Your guess: {_written(guess)}. Verdict: {verdict}.{answer}')
    classroom.tell_outcome(question, outcome)
    if because:
        print(f'  {because}')


def check(title: str, *requirements: tuple[str, object | Callable[[], object], str]) -> None:
    """Print for each requirement whether it is met, and if not, what the reader's code did.

    A requirement is `(what_is_right, test, hint)`. `test`, or what it returns where it is a
    function without arguments, says whether the requirement is met: a str says that it is not, and
    what was found instead; everything else is a truth value. If the function raises, its error is
    what was found. So a test is often one line:

        lambda: heard == [2, 4, 42] or f'your node published {heard}'

    What was found must not move from run to run. Hints are shown when the exercise is still wrong
    at the second try. A try that passes starts the counting again. A title such as 'Exercise 1 of
    lesson 02' is kept in the reader's progress when all is right.
    """
    results = [(what, *_run(test), hint) for what, test, hint in requirements]
    met_ones = sum(met for _, met, _, _ in results)
    done = met_ones == len(results)
    tries = _failed_tries[title] = 0 if done else _failed_tries.get(title, 0) + 1
    for what, met, found, hint in results:
        _print(f'[{"ok" if met else "not yet"}] {what}')
        if found:
            _print(f'    Found: {found}')
        if not met and tries > 1:
            _print(f'    Hint: {hint}')
    # Of a solution that passes, nobody should read that the exercise above it is done.
    cheer = ' All done.' if done and not title.startswith('Solution') else ''
    _print(f'{title}: {met_ones} of {len(results)}.{cheer}')
    if done:
        progress.record(title)
    classroom.tell_exercise(title, done)


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


def _run(test: object) -> tuple[bool, str]:
    """Return whether the test is met, and what was found instead, where that is known."""
    try:
        result = test() if callable(test) else test
        return (False, result) if isinstance(result, str) else (bool(result), '')
    except Exception as error:  # whatever a reader's code raises is an answer that is not right
        return False, _found(error)


def _found(error: Exception) -> str:
    """Say in one sentence or two what an error says."""
    if isinstance(error, SystemError) and error.__cause__:  # pybind11 hides a wrong field in one
        error = error.__cause__
    lines = str(error).splitlines()
    if not lines:
        return f'{type(error).__name__} in {traceback.extract_tb(error.__traceback__)[-1].name}()'
    # The second line of a time-out says what was waited for.
    text = ' '.join(lines[: 2 if isinstance(error, TimeoutError) else 1])
    found = re.sub(r' at 0x[0-9a-fA-F]+', '', f'{type(error).__name__}: {text}')
    if re.match(r'[A-Z]\w*\.\w+\(\) missing 1 required positional argument', text):
        found += '. Are () missing after a class, or too many after a callback?'
    return found
