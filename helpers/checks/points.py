"""The points of a task: what a test returns, the words of a judge, and how points are judged.

A judge returns points: what is right, a test, and a hint.

    return [
        ('it keeps one text', lambda: keeps('Hello World: 7'), 'A list has .append(...).'),
        ('it keeps two texts', lambda: keeps('one', 'two'), 'Append message.data.'),
    ]

A test returns True, or a text that says what the student's code did instead. Anything else, such as
None, a tuple or an empty text, is a mistake of the check: the task is not judged, and the verdict
names the line. What a test raises was found, too, and is shown with the student's line.

A hint is shown at the second wrong try, unless the line of the student says more. A test that finds
what its hint does not fit raises `Failed(found, hint='')`, or gives another hint there.

The words of this module, for each judge:

    expect(found, right, 'it returns')   True, or 'it returns 3, not 4'
    expect(..., within=0.01, unit='m')   the same for numbers that are measured
    all_of(expect(...), expect(...))     True, or the first of these texts
    needs(built, 'it is not built')      at the beginning of a test: an earlier point must be right
    cached(function)                     what several points look at is made once
    rows(test, hint, (what, 3, 4), ...)  one point for each row of a table, test(3, 4)

Those for nodes are in bench.py, those for programs in programs.py, and those for builds in
builds.py.
"""

from __future__ import annotations

import inspect
import math
import os
import sys
import threading
import traceback
from collections.abc import Callable, Sequence
from functools import partial, wraps
from numbers import Real

import numpy as np

from helpers.checks.errors import Failed, NeverEnds, place_of, sentence
from helpers.checks.honest import (
    CHANGED,
    Untouched,
    mend_new_classes,
    refuse_what_equals_everything,
)
from helpers.notebook import frames, own_line, places

Test = tuple[str, Callable[[], object], str]

LONGEST = 400  # characters of a value in a text


class WrongCheckError(Exception):
    """A mistake of a check, and none of the student: its text says which, and where."""


# --- The words of a judge -------------------------------------------------------------------------


def expect(
    found: object, right: object, what: str, *, within: float | None = None, unit: str = ''
) -> bool | str:
    """Return True if what was found is right, or else a text with both: 'it returns 3, not 4'.

    `what` is the beginning of the sentence: 'it returns', 'of [1, 2] it keeps'. With `within` both
    are numbers, and may differ by less than that.
    """
    if within is None:
        return _is_equal(found, right) or f'{what} {_value(found, unit)}, not {_value(right, unit)}'
    is_number = isinstance(found, Real) and not isinstance(found, bool)
    if is_number:
        found = float(found)  # not what a type of the student's own calls equal
        if found == right or abs(found - right) < within:
            return True
    said = _measured(found, within, unit) if is_number else _value(found, '')
    return f'{what} {said}, not {_measured(right, within, unit)}'


def all_of(*results: bool | str) -> bool | str:
    """Return True if all these results are True, or else the first text. Put the cause first."""
    return next((result for result in results if not _is_true(result)), True)


def in_turn(*tests: Callable[[], bool | str]) -> bool | str:
    """Return True if these tests all return True, or else the first text: none behind it is run."""
    return next((result for test in tests if not _is_true(result := test())), True)


def needs(point: Callable[[], object], otherwise: str = '') -> None:
    """Raise Failed if an earlier point is not right. Call it at the beginning of a test.

    `point` is the test of that point, which should be `cached`. `otherwise` says what is missing,
    'it is not built'; without it, what the earlier point has found is said again. No hint is
    shown: that of the point is for another mistake.
    """
    try:
        found = _result(point)
    except NeverEnds:
        raise
    except Failed as failed:
        found = str(failed)
    if found is not True:
        raise Failed(otherwise or found, hint='')


def cached(function: Callable[[], object]) -> Callable[[], object]:
    """Return the function, but run at most once: later calls get its result, or its exception.

    For what several points of a task look at: a build, a drive.
    """
    results: list[object] = []
    errors: list[BaseException] = []

    @wraps(function)
    def run() -> object:
        if not results and not errors:
            try:
                results.append(function())
            except BaseException as error:
                errors.append(error)
        if errors:
            raise errors[0]
        return results[0]

    return run


def rows(test: Callable, hint: str, *cases: tuple) -> list[Test]:
    """Return a point for each case of a table: what is right, then the arguments of the test.

    return rows(
        returns,
        'math.ceil rounds up.',
        ('30 messages, 2 threads', 30, 2),
        ('no message', 0, 2),
    )
    """
    return [(what, partial(test, *arguments), hint) for what, *arguments in cases]


def _is_equal(found: object, right: object) -> bool:
    try:
        return bool(found == right)
    except ValueError:  # an array, in place of a number or a list
        return False


def _measured(number: float, within: float, unit: str) -> str:
    """Write a number with as many decimals as tell it from one that is `within` away."""
    decimals = max(0, math.ceil(-math.log10(within)))
    return f'{round(float(number), decimals):.10g} {unit}'.rstrip()


def _value(value: object, unit: str) -> str:
    """Write a value as Python does; one of numpy as the number that it is."""
    if isinstance(value, np.generic):
        value = value.item()
    text = ' '.join(repr(value).split())
    if len(text) > LONGEST:
        text = f'{text[:LONGEST]} ...'
    return f'{text} {unit}'.rstrip()


# --- Judging --------------------------------------------------------------------------------------


def judge_points(points: Callable[[], Sequence[Test]], send: Callable) -> None:
    """Judge the points one by one. This runs in the sandbox.

    It sends ('points', [(what, hint), ...]), then ('point', (ok, found, hint)) for each, where the
    hint is None if that of the point is right. If the check itself is wrong it sends ('mistake',
    text), and no more.
    """
    failures: list[str] = []
    threading.excepthook = lambda error: failures.append(
        f'A thread of yours ended with {sentence(error.exc_value or error.exc_type())}'
    )
    threads = set(threading.enumerate())
    refuse_what_equals_everything()
    untouched = Untouched()
    try:
        tests = _tests_of(points())
    except Exception as error:  # of the check, not of the student
        send(('mistake', _mistake(error, points)))
        return
    send(('points', [(what, hint) for what, _, hint in tests]))
    for number, (what, test, _) in enumerate(tests):
        failures.clear()
        never_ends, hint = False, None
        mend_new_classes()
        try:
            result = _result(test)
            ok, found = (False, result) if isinstance(result, str) else (True, '')
        except WrongCheckError as error:
            send(('mistake', f'at the point {what!r}, {error}'))
            return
        except BaseException as error:  # whatever a student's code raises is an answer, not right
            ok, found = False, sentence(error)
            never_ends = isinstance(error, NeverEnds)
            if isinstance(error, Failed):
                hint = error.hint
            elif place_of(error):
                hint = ''  # the line says more
        if failures and not ok:
            found = found if found[-1:] in ('', '.', '!', '?') else f'{found}.'
            found = f'{found} {failures[0]}'.strip()
        if number == len(tests) - 1:
            left = [
                thread
                for thread in threading.enumerate()
                if thread not in threads and not thread.daemon
            ]
            if left and ok:
                ok, found = False, _still_runs(left[0])
        if ok and (changed := untouched.look()):
            ok, found, hint = False, CHANGED.format(changed), ''
        sys.audit('ros2_notebooks.point', what, ok)  # a grader hears it: see classroom/grade
        send(('point', (ok, found, hint)))
        if never_ends:
            break


def _result(test: Callable[[], object]) -> bool | str:
    """Call a test, and return True or its text. Raises WrongCheckError if it returns neither."""
    result = test()
    if _is_true(result):
        return True
    if isinstance(result, str) and result:
        return result
    raise WrongCheckError(
        f'the test{_place_of_test(test)} returns {_value(result, "")}, and it must return True or '
        'a text that says what was found'
    )


def _is_true(result: object) -> bool:
    return isinstance(result, bool | np.bool_) and bool(result)


def _place_of_test(test: Callable) -> str:
    """Return where a test is written: ' in line 7 of my_lesson.py'."""
    while isinstance(test, partial):
        test = test.func
    code = getattr(inspect.unwrap(test), '__code__', None)
    if code is None:  # it is not written in Python
        return ''
    return f' in line {code.co_firstlineno} of {os.path.basename(code.co_filename)}'


def _tests_of(points: object) -> list[Test]:
    """Return the points that a check gave. Raises Failed if it cannot try them."""
    tests = list(points) if points is not None else []
    if not tests:
        raise Failed('its check returns no points, as if a `return` were missing')
    for point in tests:
        if not (isinstance(point, tuple) and len(point) == 3 and callable(point[1])):
            name = point[0] if isinstance(point, tuple) and point else point
            raise Failed(
                f'the point {name!r} of its check must be what is right, a test to call and a '
                "hint, as in ('it keeps 7', lambda: keeps(7), 'Append it.')"
            )
    return tests


def _mistake(error: Exception, points: Callable) -> str:
    """Say what is wrong with a check that did not return its points, and in which line."""
    if isinstance(error, Failed):
        return str(error)
    frame = traceback.extract_tb(error.__traceback__)[-1]
    said = f'its check ended with {type(error).__name__}: {error}'
    # What the notebook hands over is not what the check takes:
    if frame.filename == points.__code__.co_filename:
        return said
    return f'{said}, in line {frame.lineno} of {os.path.basename(frame.filename)}'


def _still_runs(thread: threading.Thread) -> str:
    place = next((own_line(places(frame)) for _, frame in frames([thread])), '')
    return f'the thread {thread.name} that your code has started does not end. {place}'.strip()
