"""Guesses: what the student expected, and what came out.

    my_guess = guess('How many?', ...)                          the student writes a guess
    my_place = guess('Where does it end?', ..., on=CORRIDOR)    or sets it in the picture
    compare_prediction('How many?', my_guess, 20)               later: was it right?

A comparison prints and returns None, so that a cell shows its text and nothing else. The text is
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
from helpers.notebook import BEGIN_EMPTY, can_ask, somebody_watches, wrap

if TYPE_CHECKING:
    from helpers.guesses import Guess, Kind
    from helpers.robot import Pose

NO_GUESS = 'No guess yet. Write one in place of the three dots, run that cell, then this one again.'
ONE_ANSWER = (
    'A guess is one answer after the question: write 0.65 with a point, and several answers as a '
    "list, such as ['A', 'B']. Change it and run the cell again."
)
NONE_IS_NO_GUESS = (
    'None is no guess: write a number, True or False, or a text in quotes in its place, and run '
    'the cell again.'
)


def guess(
    question: str,
    *answers: object,
    on: object = None,
    several: bool | int = False,
    unit: str = '',
    line_m: float | None = None,
    marks: Mapping[str, float | tuple[float, float]] | None = None,
    start: Pose | None = None,
    point: bool = False,
) -> object:
    """Return the answer that a student gives to a question; `...` if there is none yet.

    It says that it was taken. If there is a class, it is told in the background. The class counts
    the last guess of each student, of questions that the lesson has. An answer is a number, True or
    False, a text, or a few of them in a list, a tuple or a set.

    `on` is what one answers on, and then the cell shows it, and the result is a `Guess`, which
    changes with what one sets there, or what one types in place of the dots:

    - a floor: your robot stands where you put it, in front of a wall, on its way from `start`;
      `line_m` (m) draws a line, or one of `marks` that has a name;
    - a floor, and `point`: a point (x ahead of the robot, y to its left, in m), beside `marks`;
    - a range, or a pair such as (0, 2) with a `unit`: a line on an axis, which also shows `marks`;
    - `bool`, a tuple, or a dict of words and values: options, of which one is chosen, `several`
      (True), or just so many (a number); they stand at the points (x, y in m) of `marks`;
    - a dict of such options: a row for each, and one is chosen in each row.

    What is no answer gets a sentence at once. Raises TypeError for another `on`.
    """
    if on is not None:
        kind = _kind_of(on, several, unit, line_m, marks, start, point)
        return _guess_on(kind, question, *(answers or [...]))
    if len(answers) != 1:
        print(*wrap(ONE_ANSWER), sep='\n')
        return ...
    [value] = answers
    if value is None:
        print(*wrap(NONE_IS_NO_GUESS), sep='\n')
    elif value is not ...:
        print('Your guess is saved:', value)
        classroom.tell_guess(question, value)
        classroom.say_trouble()
    return value


def _kind_of(
    on: object,
    several: bool | int,
    unit: str,
    line_m: float | None,
    marks: Mapping[str, float | tuple[float, float]] | None,
    start: Pose | None,
    point: bool,
) -> Kind:
    # Slow to load, and most guesses have no floor.
    from helpers.guesses import kind_of
    from helpers.robot import Floor

    if not isinstance(on, Floor):
        return kind_of(on, several, unit, marks)
    from helpers.robot_view import Place, Point

    if point:
        return Point(on, marks or {})
    if marks:
        [(line, line_m)] = marks.items()
        return Place(on, line_m, start, line)
    return Place(on, line_m, start)


def _guess_on(kind: Kind, question: str, *answers: object) -> Guess:
    """Show a guess, with what was typed, or else what was set before in this lesson."""
    from helpers.guesses import Guess, show

    typed = answers[0] if len(answers) == 1 else list(answers)
    made, wrong = Guess(question, kind), ''
    if typed is None or typed is ...:
        # A class sees no old one.
        remembers = somebody_watches() and not os.environ.get(BEGIN_EMPTY)
        made.value = progress.kept_guess(question, _word_of(kind)) if remembers else None
    else:
        try:
            made.value = kind.read(typed)
        except ValueError as problem:
            wrong = str(problem)
    show(made, lambda value: _keep(made))
    if wrong:
        print(*wrap(wrong), sep='\n')
    elif typed is not None and typed is not ...:
        _keep(made)
        classroom.say_trouble()
    return made


def _keep(made: Guess) -> None:
    """Keep what was guessed, for the next kernel, and tell the class."""
    progress.keep_guess(made.question, _word_of(made.kind), made.value)
    classroom.tell_guess(made.question, made.kind.told(made.value))


def _word_of(kind: Kind) -> str:
    return type(kind).__name__.lower()


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
