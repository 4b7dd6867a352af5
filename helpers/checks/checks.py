"""Guesses and tasks: what is right, what the student's code did, and a hint.

    my_guess = guess('How many?', ...)                          the student writes a guess
    compare_prediction('How many?', my_guess, 20)               later: was it right?

    check(2, ('none is lost', lambda: ..., 'Count the threads.'))      below the cell of task 2
    %%solution 2                                                the first line of the next cell

The functions print and return None, so that a cell shows their text and nothing else. The text is
the same in every fresh run from top to bottom. If a task is still wrong in a second run of the
same kernel, its hints appear.
"""

from __future__ import annotations

import re
import signal
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence, Set
from contextlib import contextmanager
from numbers import Integral, Real

from IPython import get_ipython
from IPython.core.error import UsageError

from helpers.checks import classroom, progress
from helpers.notebook import can_ask, wrap

NO_GUESS = 'No guess yet. Write one in place of the three dots, run that cell, then this one again.'
ENDLESS = 'it did not end. Is there an endless loop, or a spin() that never returns?'
AGAIN = ' Try again, or go on with the solution below.'
NOT_TRIED = 'not tried, because the one above did not end'
CPU_LIMIT_S = 5.0  # of one test of a check: an endless loop uses it up
LIMIT_S = 90.0  # a build on a busy machine takes its time

# By the numbers of the tasks of this notebook:
_requirements: dict[int, tuple[Sequence[tuple], tuple[float, float]]] = {}
_solved: dict[int, bool] = {}
_failed_tries: dict[int, int] = {}  # since the last try that passed
_given: dict[int, dict[str, object]] = {}  # names and values that `%%solution` has given


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

    If a measured number moves from run to run, whatever lies within `tolerance` of it is right, in
    its own unit. Choose it wide enough for the slowest machine: then the verdict stays the same.
    The right answer is then printed for a student only, not in a run without one.

    `because` is a sentence that explains the outcome. It is printed after any guess. If there is no
    guess yet, a student is asked for one; a run without a student, as in CI, prints the answer. A
    guess of the wrong kind gets a sentence that says what to do: it raises nothing.

    Raises TypeError for an outcome of another kind.
    """
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


def _has_student() -> bool:
    """Return whether somebody can answer, as in JupyterLab; in CI nobody can."""
    shell = get_ipython()
    return shell is None or not hasattr(shell, 'kernel') or can_ask(shell.kernel)


def check(
    task: int,
    *requirements: tuple[str, object | Callable[[], object], str],
    limit_s: float = LIMIT_S,
    cpu_s: float = CPU_LIMIT_S,
) -> None:
    """Print for each requirement of a task whether it is met, and if not, what the code did.

    A requirement is `(what_is_right, test, hint)`. `test`, or what it returns if it is a function
    without arguments, says whether the requirement is met: a str says that it is not, and what was
    found instead; everything else is a truth value. If the function raises, its error is what was
    found. So a test is often one line:

        lambda: heard == [2, 4, 42] or f'your node published {heard}'

    A test looks the student's names up when it runs, in the notebook, so that `%%solution` can run
    it again. What was found must not move from run to run. Hints are shown when the task is still
    wrong at the second try. A task that passes is kept in the student's progress.

    A test may use `cpu_s` seconds of CPU and `limit_s` seconds of the clock. If one needs more,
    those after it are not tried.
    """
    _requirements[task] = requirements, (limit_s, cpu_s)
    with _without_solution(task):
        solved = _print_results(f'Task {task}', *_requirements[task], task)
    _solved[task] = solved
    if solved:
        progress.record(task)
    classroom.tell_task(task, solved)


def _print_results(
    title: str, requirements: Sequence[tuple], limits: tuple[float, float], task: int | None = None
) -> bool:
    """Print the results; with a `task`, count the tries at it. Return whether all is right."""
    results, endless = [], False
    for what, test, hint in requirements:
        met, found = (False, NOT_TRIED) if endless else _run(test, *limits)
        results.append((what, met, found, hint))
        endless = endless or found.endswith(ENDLESS)
    met_ones = sum(met for _, met, _, _ in results)
    done = met_ones == len(results)
    if task is not None:
        _failed_tries[task] = 0 if done else _failed_tries.get(task, 0) + 1
    for what, met, found, hint in results:
        _print(f'[{"ok" if met else "not yet"}] {what}')
        if found:
            _print(f'    Found: {found}')
        if not met and _failed_tries.get(task, 0) > 1:
            _print(f'    Hint: {hint}')
    end = '' if task is None else ' All done.' if done else AGAIN
    _print(f'{title}: {met_ones} of {len(results)}.{end}')
    return done


def solution(line: str, cell: str) -> None:
    """Run a cell `%%solution 2` if the student has not solved task 2, and check it as well.

    So the lesson goes on with the student's code if its check has passed, and with the solution if
    it has not. The cell may begin with another magic, such as `%%write`.
    """
    if not line.strip().isdecimal():
        raise UsageError('Write the number of the task: %%solution 2')
    task = int(line)
    if _solved.get(task):
        _print(f'Task {task} is solved: the lesson goes on with your code.')
        return
    shell = get_ipython()
    names = shell.user_ns
    before = dict(names)
    code = shell.transform_cell(cell)
    exec(compile(code, shell.compile.cache(code), 'exec'), names)
    _given[task] = {
        name: value
        for name, value in names.items()
        if name not in before or before[name] is not value
    }
    if task in _requirements:
        _print_results(f'Solution of task {task}', *_requirements[task])
    else:
        _print(f'The solution of task {task} has run, but its check has not.')


@contextmanager
def _without_solution(task: int) -> Iterator[None]:
    """Hide what the solution gave to names: a check is about the student's code only."""
    shell = get_ipython()
    names = shell.user_ns if shell else {}
    given = {
        name: value for name, value in _given.get(task, {}).items() if names.get(name) is value
    }
    for name in given:
        del names[name]
    try:
        yield
    finally:
        for name, value in given.items():
            names.setdefault(name, value)


def _print(text: str) -> None:
    print(*wrap(text, rest=' ' * 10), sep='\n')


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


def _run(test: object, limit_s: float, cpu_s: float) -> tuple[bool, str]:
    """Return whether the test is met, and what was found instead, if that is known."""
    try:
        with _limited(limit_s, cpu_s):
            result = test() if callable(test) else test
        return (False, result) if isinstance(result, str) else (bool(result), '')
    except Exception as error:  # whatever a student's code raises is an answer that is not right
        return False, _found(error)


@contextmanager
def _limited(limit_s: float, cpu_s: float) -> Iterator[None]:
    """Interrupt what takes too long, as the student would. Raises TimeoutError after that.

    An endless loop uses CPU, which a busy machine does not use up for us; a wait does not.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    over = []

    def interrupt(signal_number: int, _) -> None:
        over.append(signal_number)
        signal.raise_signal(signal.SIGINT)

    timers = {
        signal.SIGPROF: (signal.ITIMER_PROF, cpu_s),
        signal.SIGALRM: (signal.ITIMER_REAL, limit_s),
    }
    handlers = {number: signal.signal(number, interrupt) for number in timers}
    try:
        for timer, seconds in timers.values():
            signal.setitimer(timer, seconds)
        yield
    except KeyboardInterrupt:
        if not over:
            raise
        raise TimeoutError(ENDLESS) from None
    finally:
        for number, (timer, _) in timers.items():
            signal.setitimer(timer, 0)
            signal.signal(number, handlers[number])


def _found(error: Exception) -> str:
    """Say in one sentence or two what an error says."""
    if isinstance(error, SystemError) and error.__cause__:  # pybind11 hides a wrong field in one
        error = error.__cause__
    lines = str(error).splitlines()
    if not lines:
        return f'{type(error).__name__} in {traceback.extract_tb(error.__traceback__)[-1].name}()'
    # The second line of a time-out says what was waited for, and one after a colon the fault.
    more = isinstance(error, TimeoutError) or lines[0].rstrip().endswith(':')
    text = ' '.join(map(str.strip, lines[: 2 if more else 1]))
    found = re.sub(r' at 0x[0-9a-fA-F]+', '', f'{type(error).__name__}: {text}')
    if isinstance(error, NameError) and error.name:
        found += '. Is it defined in the cell of the task, or in a cell above that has not run?'
    if re.match(r'[A-Z]\w*\.\w+\(\) missing 1 required positional argument', text):
        found += '. Did you forget () after a class, or write () after a callback?'
    return found


if shell := get_ipython():
    shell.register_magic_function(solution, 'cell')
