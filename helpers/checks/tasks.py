"""The tasks of a lesson, and the check that judges what a student wrote.

A lesson's tasks are in a module of their own, `helpers/checks/lessons/NAME.py`:

    tasks = Tasks()
    check = tasks.check

    @tasks.add
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
of the task stands `check('hear_the_text', MinimalSubscriber)`. The name of the function is that of
the task, for ever: progress, classes and grades keep it. Its number is its place in the lesson,
which is also that in the module.

The function of a task gets what the student wrote, and returns its points: what is right, a test,
and a hint, which appears at the second wrong try. points.py says what a test is, and has the words
with which judges are written. The points are judged in their order, in a sandbox (see sandbox.py),
so what a check does to the notebook's objects is undone when it ends. What the function itself
raises is a mistake of the check: the task cannot be judged, and the verdict says in which line.
"""

from __future__ import annotations

import re
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from IPython import get_ipython
from IPython.core.error import UsageError
from IPython.display import display

from helpers.checks import classroom, progress
from helpers.checks.points import Test, judge_points
from helpers.checks.sandbox import Ending, Sandbox
from helpers.checks.verdict import Point, Verdict, bundle
from helpers.lesson import check_call, earlier_name
from helpers.notebook import names_of, own_line, somebody_watches
from helpers.ros import change_domain_id

CPU_LIMIT_S = 5.0  # of one point: an endless loop uses it up
LIMIT_S = 30.0  # of one point by the clock
SHOW_AFTER_S = 1.0
ENDLESS = 'it did not end. Is there an endless loop, or a spin() that never returns?'
NOT_TRIED = 'not tried, because the one above did not end'
# Magics that run the lines below them in the notebook:
RUNS_PYTHON = re.compile(r'\A(\s*%%(time|capture)\b.*\n)+')


@dataclass
class Attempt:
    """What this notebook knows of a task."""

    arguments: list[str] | None = None  # of its check, as its cell has them; None: it has not run
    solved: bool = False
    failed: int = 0  # tries since the last one that passed
    given: dict[str, object] = field(default_factory=dict)  # names and values of its solution


@dataclass(frozen=True)
class Judge:
    """The function that judges a task, the task's place in the lesson, and its limits."""

    function: Callable
    number: int
    limit_s: float
    cpu_s: float
    about: Callable[..., str] | None
    own_domain: bool

    def points(self, answer: Sequence[object]) -> Sequence[Test]:
        """Return the points of an answer. This runs in the sandbox, a copy of the kernel."""
        if self.own_domain:
            change_domain_id()
        return self.function(*answer)


class Tasks:
    """The tasks of one lesson, by their names, in their order."""

    def __init__(self) -> None:
        global _of_this_notebook
        self.judges: dict[str, Judge] = {}
        self.attempts: defaultdict[str, Attempt] = defaultdict(Attempt)
        _of_this_notebook = self

    def add(
        self,
        function: Callable | None = None,
        *,
        name: str = '',
        limit_s: float = LIMIT_S,
        cpu_s: float = CPU_LIMIT_S,
        about: Callable[..., str] | None = None,
        own_domain: bool = False,
    ) -> Callable:
        """Register a function as the judge of the next task: `@tasks.add`.

        The task has the name of the function, or `name` if one function judges several tasks. Each
        of its points may use `cpu_s` seconds of CPU and `limit_s` seconds of the clock:
        `@tasks.add(limit_s=90)`. If one needs more, those after it are not tried. A build is none
        of its CPU, but takes its time. If a task is another one for each student, `about` gets the
        answer and says which. With `own_domain` the nodes and programs of the check are in a domain
        of their own, so that what runs in the student's terminals changes no verdict. Without it,
        they hear these terminals.

        Raises ValueError if the lesson has a task of this name.
        """

        def register(function: Callable) -> Callable:
            task = name or function.__name__
            if task in self.judges:
                raise ValueError(f'This lesson has two tasks that are called {task}.')
            self.judges[task] = Judge(
                function, len(self.judges) + 1, limit_s, cpu_s, about, own_domain
            )
            return function

        return register if function is None else register(function)

    def check(self, task: str, *answer: object) -> None:
        """Judge what the student wrote for a task, and show the verdict.

        A task that passes is kept in the student's progress. Raises ValueError if the lesson has no
        such task.
        """
        judge = self._judge_of(task)
        called = check_call(RUNS_PYTHON.sub('', _cells.running))
        arguments = called[1] if called and called[0] == task else None
        verdict = Verdict(task, judge.number)
        attempt = self.attempts[task]
        verdict.note = _reason_not_to_judge(attempt, arguments, answer)
        if not verdict.note:
            attempt.arguments = arguments
            hints = _judge(verdict, lambda: judge.points(answer), judge.cpu_s, judge.limit_s)
            attempt.failed = 0 if verdict.solved else attempt.failed + 1
            if attempt.failed > 1:
                verdict.add_hints(hints)
        if not verdict.points:
            _show(verdict)
            return
        about = ''
        if verdict.solved:
            about = judge.about(*answer) if judge.about else ''
            progress.record(task, about)
            verdict.total = progress.total()
        _show(verdict)
        attempt.solved = verdict.solved
        classroom.tell_task(task, verdict.solved)
        if about:
            classroom.tell_about(task, about)

    def run_solution(self, task: str, cell: str) -> None:
        """Run the solution of a task if the student has not solved it, and check it as well."""
        judge, attempt = self._judge_of(task), self.attempts[task]
        if attempt.solved:
            print(f'Task {judge.number} is solved: the lesson goes on with your code.')
            return
        shell = get_ipython()
        names = shell.user_ns
        before = dict(names)
        code = shell.transform_cell(cell)
        exec(compile(code, shell.compile.cache(code), 'exec'), names)
        attempt.given = {
            name: value
            for name, value in names.items()
            if name not in before or before[name] is not value
        }
        _cells.failed.difference_update(attempt.given)
        if attempt.arguments is None:
            print(f'The solution of task {judge.number} has run, but its check has not.')
            return
        answer = [eval(argument, names) for argument in attempt.arguments]
        verdict = Verdict(task, judge.number, of='solution')
        _judge(verdict, lambda: judge.points(answer), judge.cpu_s, judge.limit_s)
        _show(verdict)

    def _judge_of(self, task: str) -> Judge:
        if task not in self.judges:
            raise ValueError(f'This lesson has no task {task!r}. {self.names_in_words(task)}')
        return self.judges[task]

    def names_in_words(self, task: object) -> str:
        """Say how the tasks are called. In version 0.3 a student wrote a number."""
        if str(task).isdecimal():
            name = earlier_name(progress.this_lesson(), int(str(task)))
            if name in self.judges:
                return f'Tasks have names now, and this one is {name!r}.'
        return f'Its tasks are called: {", ".join(self.judges)}.'

    def is_written(self, names: set[str]) -> None:
        """Note that a cell of the student has given these names a value: no solution has."""
        for attempt in self.attempts.values():
            for name in names & attempt.given.keys():
                del attempt.given[name]


_of_this_notebook: Tasks | None = None


def solution(line: str, cell: str) -> None:
    """Run a cell `%%solution hear_the_text` if the student has not solved this task; check it.

    So the lesson goes on with the student's code if its check has passed, and with the solution if
    it has not. The cell may begin with another magic, such as `%%write`.
    """
    if _of_this_notebook is None or line.strip() not in _of_this_notebook.judges:
        names = _of_this_notebook.names_in_words(line.strip()) if _of_this_notebook else ''
        raise UsageError(f'Write the name of a task of this lesson. {names}'.strip())
    _of_this_notebook.run_solution(line.strip(), cell)


# --- Judging --------------------------------------------------------------------------------------


def _judge(
    verdict: Verdict, points: Callable[[], Sequence[Test]], cpu_s: float, limit_s: float
) -> list[str]:
    """Fill the verdict with the points of a task, judged in a sandbox; return their hints."""
    started = time.monotonic()
    hints: list[str] = []
    sandbox = Sandbox(lambda send: judge_points(points, send), cpu_s, limit_s)
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
                verdict.points[tried].ok, verdict.points[tried].found, hint = content
                if hint is not None:
                    hints[tried] = hint  # that of the point would be for another mistake
                tried += 1
            running.update(time.monotonic() - started)
    verdict.seconds = time.monotonic() - started
    _add_ending(verdict, tried, sandbox.ending)
    if sandbox.ending.printed:
        print(sandbox.ending.printed, end='' if sandbox.ending.printed.endswith('\n') else '\n')
    return hints


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


def _reason_not_to_judge(
    attempt: Attempt, arguments: list[str] | None, answer: Sequence[object]
) -> str:
    """Return why the answer is not judged: it is the solution's, or the student's cell failed.

    `arguments` are those of the check, as its cell has them.
    """
    shell = get_ipython()
    names = {name for argument in arguments or () for name in names_of(argument).taken}
    if shell and any(
        name in names and shell.user_ns.get(name) is value and any(value is x for x in answer)
        for name, value in attempt.given.items()
    ):
        return 'This is the code of the solution. Run your own cell first, then this one again.'
    failed = names & _cells.failed
    if failed:
        return (
            f'The last cell that defines {sorted(failed)[0]} ended with an error. Mend it and run '
            'it, then this one again.'
        )
    return ''


# --- The cells of the notebook --------------------------------------------------------------------


class Cells:
    """The cell that runs, and names that are missing because their cells ended with an error."""

    def __init__(self) -> None:
        self.running = ''
        self.failed: set[str] = set()

    def begin(self, info: object) -> None:
        """IPython calls this before it runs a cell."""
        self.running = getattr(info, 'raw_cell', None) or ''

    def end(self, result: object) -> None:
        """IPython calls this after a cell; the result is None if the Interrupt came in its code."""
        self.running = ''
        if result is None:
            return
        names = names_of(RUNS_PYTHON.sub('', result.info.raw_cell or '')).given
        if _of_this_notebook:
            _of_this_notebook.is_written(names)
        if result.success or isinstance(result.error_in_exec, KeyboardInterrupt):
            self.failed.difference_update(names)
        else:
            self.failed.update(names)


_cells = Cells()


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
    shell.events.register('pre_run_cell', _cells.begin)
    shell.events.register('post_run_cell', _cells.end)
