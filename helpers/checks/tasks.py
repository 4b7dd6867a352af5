"""The tasks of a lesson, and the check that judges what a student wrote.

A lesson's tasks are in a module of their own, `helpers/checks/lessons/NAME.py`:

    tasks = Tasks()
    check = tasks.check

    @tasks.add(1)
    def hear_the_text(MinimalSubscriber):
        def keeps(*texts):
            with Bench() as bench:
                node = bench.spin(MinimalSubscriber())
                bench.say('topic', *(String(data=text) for text in texts))
            return node.heard == [*texts] or f'of {[*texts]}, self.heard has {node.heard}'

        return [
            ('it keeps one text', lambda: keeps('Hello World: 7'), 'A list has .append(...).'),
            ('it keeps two texts', lambda: keeps('one', 'two'), 'Append message.data.'),
        ]

and the notebook imports its check: `from helpers.checks.lessons.NAME import check`. Below the cell
of the task stands `check(1, MinimalSubscriber)`.

The function of a task gets what the student wrote, and returns its points: what is right, a test,
and a hint, which appears at the second wrong try. points.py says what a test is, and has the words
with which judges are written. The points are judged in their order, in a sandbox (see sandbox.py),
so what a check does to the notebook's objects is undone when it ends. What the function itself
raises is a mistake of the check: the task cannot be judged, and the verdict says in which line.
"""

from __future__ import annotations

import inspect
import re
import time
from collections.abc import Callable, Sequence
from types import CodeType, FrameType

from IPython import get_ipython
from IPython.core.error import UsageError
from IPython.display import display

from helpers.checks import classroom, progress
from helpers.checks.errors import own_line
from helpers.checks.points import Test, judge
from helpers.checks.sandbox import Ending, Sandbox
from helpers.checks.verdict import Point, Verdict, bundle
from helpers.notebook import names_of, somebody_watches

CPU_LIMIT_S = 5.0  # of one point: an endless loop uses it up
LIMIT_S = 30.0  # of one point by the clock
SHOW_AFTER_S = 1.0
ENDLESS = 'it did not end. Is there an endless loop, or a spin() that never returns?'
NOT_TRIED = 'not tried, because the one above did not end'
# Magics that run the lines below them in the notebook:
RUNS_PYTHON = re.compile(r'\A(\s*%%(time|capture)\b.*\n)+')

# By the numbers of the tasks of this notebook:
_checks: dict[int, CodeType] = {}  # the statement `check(2, ...)` of its cell
_solved: dict[int, bool] = {}
_failed_tries: dict[int, int] = {}  # since the last try that passed
_given: dict[int, dict[str, object]] = {}  # names and values that `%%solution` has given
_judges_solution = False


class Tasks:
    """The tasks of one lesson, by their numbers."""

    def __init__(self) -> None:
        self._tasks: dict[int, tuple[Callable, float, float]] = {}
        self._about: dict[int, Callable[..., str]] = {}

    def add(
        self,
        number: int,
        limit_s: float = LIMIT_S,
        cpu_s: float = CPU_LIMIT_S,
        about: Callable[..., str] | None = None,
    ) -> Callable[[Callable], Callable]:
        """Register a function as the judge of a task.

        Each of its points may use `cpu_s` seconds of CPU and `limit_s` seconds of the clock. If one
        needs more, those after it are not tried. A build is none of its CPU, but takes its time.
        If a task is another one for each student, `about` gets the answer and says which.
        """

        def register(function: Callable) -> Callable:
            self._tasks[number] = function, cpu_s, limit_s
            if about is not None:
                self._about[number] = about
            return function

        return register

    def check(self, number: int, *answer: object) -> None:
        """Judge what the student wrote for a task, and show the verdict.

        A task that passes is kept in the student's progress. Raises ValueError if the lesson has no
        such task.
        """
        if number not in self._tasks:
            raise ValueError(f'This lesson has no task {number}: the tasks are {[*self._tasks]}.')
        caller = inspect.currentframe().f_back
        names = _names_in(caller)
        of = 'solution' if _judges_solution else 'answer'
        verdict = Verdict(number, of=of)
        if of == 'answer':
            verdict.note = _reason_not_to_judge(number, names, answer)
        if not verdict.note:
            if names:
                _checks[number] = caller.f_code
            function, cpu_s, limit_s = self._tasks[number]
            _judge(verdict, lambda: function(*answer), cpu_s, limit_s)
        if of == 'solution' or not verdict.points:
            _show(verdict)
            return
        about = ''
        if verdict.solved:
            about = self._about[number](*answer) if number in self._about else ''
            progress.record(number, about)
            verdict.total = progress.total()
        _show(verdict)
        _solved[number] = verdict.solved
        classroom.tell_task(number, verdict.solved)
        if about:
            classroom.tell_about(number, about)


def solution(line: str, cell: str) -> None:
    """Run a cell `%%solution 2` if the student has not solved task 2, and check it as well.

    So the lesson goes on with the student's code if its check has passed, and with the solution if
    it has not. The cell may begin with another magic, such as `%%write`.
    """
    global _judges_solution
    if not line.strip().isdecimal():
        raise UsageError('Write the number of the task: %%solution 2')
    task = int(line)
    if _solved.get(task):
        print(f'Task {task} is solved: the lesson goes on with your code.')
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
    _failed_names.difference_update(_given[task])
    if task not in _checks:
        print(f'The solution of task {task} has run, but its check has not.')
        return
    _judges_solution = True
    try:
        exec(_checks[task], names)
    finally:
        _judges_solution = False


# --- Judging --------------------------------------------------------------------------------------


def _judge(
    verdict: Verdict, points: Callable[[], Sequence[Test]], cpu_s: float, limit_s: float
) -> None:
    """Fill the verdict with the points of a task, judged in a sandbox."""
    started = time.monotonic()
    hints: list[str] = []
    sandbox = Sandbox(lambda send: judge(points, send), cpu_s, limit_s)
    tried = 0
    with Running(verdict) as running:
        for kind, content in sandbox:
            if kind == 'points':
                verdict.points = [Point(what) for what, _ in content]
                hints = [hint for _, hint in content]
            elif kind == 'mistake':
                verdict.points = []  # those that were tried count for nothing
                verdict.note = f'This task cannot be judged: {content}.'
            else:
                verdict.points[tried].ok, verdict.points[tried].found, names_line = content
                if names_line:
                    hints[tried] = ''  # the line says more; a hint for another mistake misleads
                tried += 1
            running.update(time.monotonic() - started)
    verdict.seconds = time.monotonic() - started
    _add_ending(verdict, tried, sandbox.ending)
    if sandbox.ending.printed:
        print(sandbox.ending.printed, end='' if sandbox.ending.printed.endswith('\n') else '\n')
    if verdict.of == 'solution':
        return
    tries = 0 if verdict.solved else _failed_tries.get(verdict.task, 0) + 1
    _failed_tries[verdict.task] = tries
    if tries > 1:
        for point, hint in zip(verdict.points, hints, strict=False):
            point.hint = '' if point.ok else hint


def _add_ending(verdict: Verdict, tried: int, ending: Ending) -> None:
    """Say of the point that did not come back why, and of those after it that they wait."""
    found = ''
    if ending.reason in ('computes', 'waits'):
        found = f'TimeoutError: {ENDLESS} {own_line(ending.frames)}'.strip()
    elif ending.reason == 'exit':
        found = 'your code has ended the whole program, with os._exit or from C'
    elif ending.reason == 'signal':
        found = f'your code has ended the whole program: signal {ending.status}'
        if ending.status == 9:
            found += '. Perhaps it took all the memory'
    if found and not verdict.points:
        verdict.note = f'This task cannot be judged: {found}.'
    for point in verdict.points[tried:]:
        point.ok, point.found = False, found or NOT_TRIED
        found = ''
    if ending.left and verdict.points:
        last = verdict.points[-1]
        if last.ok:
            last.ok = False
            last.found = f'a program that your code has started still runs: {ending.left[0]}'


def _reason_not_to_judge(task: int, names: set[str], answer: Sequence[object]) -> str:
    """Return why the answer is not judged: it is the solution's, or the student's cell failed."""
    shell = get_ipython()
    given = _given.get(task, {})
    if shell and any(
        name in names and shell.user_ns.get(name) is value and any(value is x for x in answer)
        for name, value in given.items()
    ):
        return 'This is the code of the solution. Run your own cell first, then this one again.'
    failed = names & _failed_names
    if failed:
        return (
            f'The last cell that defines {sorted(failed)[0]} ended with an error. Mend it and run '
            'it, then this one again.'
        )
    return ''


def _names_in(caller: FrameType) -> set[str]:
    """Return the names in the statement `check(...)` of a cell, or none if a function calls it."""
    return set(caller.f_code.co_names) if caller.f_code.co_name == '<module>' else set()


# --- Cells that failed ----------------------------------------------------------------------------

_failed_names: set[str] = set()  # that a cell should have defined, which ended with an error


def _after_cell(result: object) -> None:
    if result is None:  # the Interrupt came in IPython's own code
        return
    source = result.info.raw_cell or ''
    names = names_of(RUNS_PYTHON.sub('', source)).given
    for given in _given.values():
        for name in names & given.keys():
            del given[name]  # now it is the student's
    if result.success or isinstance(result.error_in_exec, KeyboardInterrupt):
        _failed_names.difference_update(names)
    else:
        _failed_names.update(names)


# --- Showing --------------------------------------------------------------------------------------


class Running:
    """Says how far a check is, if a person watches and it takes a while. Nothing of it stays."""

    def __init__(self, verdict: Verdict) -> None:
        self._verdict = verdict
        self._watched = somebody_watches()
        self._display = None

    def __enter__(self) -> Running:
        return self

    def update(self, waited_s: float) -> None:
        """Show how many points were tried, once the check has taken `SHOW_AFTER_S`."""
        if not self._watched or waited_s < SHOW_AFTER_S:
            return
        count = sum(bool(point.ok or point.found) for point in self._verdict.points)
        data = {'text/html': f'Checking: {count} of {len(self._verdict.points)} …'}
        if self._display is None:
            self._display = display(data, raw=True, display_id=True)
        else:
            self._display.update(data, raw=True)

    def __exit__(self, *exception) -> None:
        if self._display is not None:
            self._display.update({'text/html': ''}, raw=True)


def _show(verdict: Verdict) -> None:
    if get_ipython() is None:
        print(verdict.text())
        return
    data, metadata = bundle(verdict)
    display(data, metadata=metadata, raw=True)


if shell := get_ipython():
    shell.register_magic_function(solution, 'cell')
    shell.events.register('post_run_cell', _after_cell)
