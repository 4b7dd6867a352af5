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

import math
import os
import re
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from IPython import get_ipython
from IPython.core.error import UsageError
from IPython.utils.capture import capture_output

from helpers.checks import classroom, progress
from helpers.checks.honest import CHANGED, Untouched
from helpers.checks.needs import Needs, needs_of
from helpers.checks.points import Test, judge_points
from helpers.checks.sandbox import Ending, Sandbox
from helpers.checks.showing import Running, show
from helpers.checks.verdict import AGAIN, BELOW, Point, Verdict
from helpers.lesson import (
    Lesson,
    check_call,
    code_of_solution,
    earlier_name,
    kept_solution,
    outline,
    path_of,
)
from helpers.notebook import names_of, own_line, wrap
from helpers.ros import change_domain_id

CPU_LIMIT_S = 5.0  # of one point: an endless loop uses it up
LIMIT_S = 15.0  # of one point by the clock, on an idle machine
TOGETHER_S = 15.0  # of all points, once one of them is wrong
ENDLESS = 'it did not end. Is there an endless loop, or a spin() that never returns?'
NOT_TRIED = 'not tried, because the one above did not end'
NO_TIME = 'not tried, because those above took too long'
TRIES_BEFORE_BORROWING = 3
BORROWED = '<borrowed>'  # the file name of code that was borrowed: no traceback shows a line of it
# Magics that run the lines below them in the notebook:
RUNS_PYTHON = re.compile(r'\A(\s*%%(time|capture)\b.*\n)+')


@dataclass
class Attempt:
    """What this notebook knows of a task."""

    arguments: list[str] | None = None  # of its check, as its cell has them; None: it has not run
    solved: bool = False
    failed: int = 0  # tries since the last one that passed
    given: dict[str, object] = field(default_factory=dict)  # names and values of its solution
    stands_in: str = ''  # 'solution' or 'borrowed': what the lesson goes on with


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
        self._added: dict[str, Judge] = {}  # the same, which nobody has a reason to change
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
            judge = Judge(function, len(self.judges) + 1, limit_s, cpu_s, about, own_domain)
            self.judges[task] = self._added[task] = judge
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
        verdict.note = _reason_not_to_judge(attempt, arguments, answer) or self._needed(task)
        if not verdict.note:
            attempt.arguments = arguments
            hints = try_points(verdict, lambda: judge.points(answer), judge.cpu_s, judge.limit_s)
            open_files = self._open(self.needs.files_before(task)) if self.needs else []
            if open_files and verdict.points and not verdict.solved:
                # What it has found may come from the files of these tasks: that is no try.
                verdict.note = self._says(open_files, 'This may come from', 'check this one again')
                show(verdict)
                return
            attempt.failed = 0 if verdict.solved else attempt.failed + 1
            if attempt.failed > 1 or progress.IS_GRADED in os.environ:
                verdict.add_hints(hints)
            verdict.again = self._again(task)
            if verdict.solved and (changed := self._what_has_changed(task)):
                verdict.note = f'{CHANGED.format(changed).capitalize()}. Restart the kernel.'
        if not verdict.points:
            show(verdict)
            return
        about = ''
        if verdict.solved:
            about = judge.about(*answer) if judge.about else ''
            progress.record(task, about)
            verdict.total = progress.total()
        show(verdict)
        attempt.solved = verdict.solved
        if verdict.solved:
            attempt.stands_in = ''
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
        code = shell.transform_cell(cell)
        self._run(task, code, shell.compile.cache(code))
        attempt.stands_in = 'solution'
        if needed := self._needed(task):
            print(*wrap(f'The solution of task {judge.number} has run. {needed}'), sep='\n')
            return
        if attempt.arguments is None:
            print(f'The solution of task {judge.number} has run, but its check has not.')
            return
        answer = [eval(argument, names) for argument in attempt.arguments]
        verdict = Verdict(task, judge.number, of='solution')
        try_points(verdict, lambda: judge.points(answer), judge.cpu_s, judge.limit_s)
        show(verdict)

    def borrow(self, task: str) -> None:
        """Put what the next steps need of a task into place, without showing it.

        A student who is stuck in an edition without solutions can go on. It is there after some
        tries, and is not the student's: the task counts as borrowed, and not as solved.

        Raises UsageError with a sentence if it cannot be borrowed.
        """
        judge, attempt = self._judge_of(task), self.attempts[task]
        if attempt.solved:
            print(f'Task {judge.number} is solved: the lesson goes on with your code.')
            return
        code = self._borrowable(task)
        if not code:
            raise UsageError('This edition of the lesson lends nothing: ask your teacher.')
        left = TRIES_BEFORE_BORROWING - attempt.failed
        if left > 0 and not attempt.stands_in:
            raise UsageError(
                f'Try task {judge.number} first: you can borrow it after '
                f'{left} more {"try" if left == 1 else "tries"}.'
            )
        shell = get_ipython()
        with capture_output():
            self._run(task, shell.transform_cell(code), BORROWED)
        attempt.stands_in = 'borrowed'
        progress.keep_borrowed(self.lesson_name, task)
        text = (
            f'Task {judge.number} is borrowed, not solved: what the next steps need is in place. '
            'When you have another idea, run your own cell and its check again.'
        )
        print(*wrap(text), sep='\n')

    def _run(self, task: str, code: str, file: str) -> None:
        """Run code in place of the student's, and note which names it gives."""
        names = get_ipython().user_ns
        before = dict(names)
        exec(compile(code, file, 'exec'), names)
        given = {
            name: value
            for name, value in names.items()
            if name not in before or before[name] is not value
        }
        self.attempts[task].given = given
        _cells.runs_again(set(given))

    @cached_property
    def lesson_name(self) -> str:
        """The name of the lesson whose judges these are; empty for those of a test."""
        modules = (judge.function.__module__ or '' for judge in self.judges.values())
        found = (re.match(r'helpers\.checks\.lessons\.(\w+)', module) for module in modules)
        return next((match[1] for match in found if match), '')

    @cached_property
    def lesson(self) -> Lesson | None:
        """The lesson as its notebook has it, None if there is no such notebook."""
        try:
            return outline(path_of(self.lesson_name, progress.folder()))
        except ValueError:
            return None

    @cached_property
    def needs(self) -> Needs | None:
        return needs_of(self.lesson) if self.lesson else None

    def why_not_to_run(self, source: str) -> str:
        """Return the sentence of a cell that cannot run yet: it needs a task, or another cell."""
        cell = self.needs.cells.get(source.strip()) if self.needs else None
        if cell is None:
            return ''
        if tasks := self._open(cell.tasks):
            return self._says(tasks, 'This cell needs', 'run this cell again')
        if cell.compares and (tasks := self._open(cell.files)):
            return self._says(tasks, 'This cell may need', 'run this cell again')
        names = [*cell.names & _cells.unfinished.keys()]
        return _cells.says(names[0]) if names else ''

    def what_may_be_missing(self, source: str) -> str:
        """Return a sentence for a cell that uses files which tasks have not written yet."""
        cell = self.needs.cells.get(source.strip()) if self.needs else None
        tasks = self._open(cell.files) if cell else []
        return self._says(tasks, 'This cell may need', 'run this cell again') if tasks else ''

    def who_makes(self, name: str) -> str:
        """Return a sentence that says which cell gives a name its value, empty if none does."""
        if name in _cells.unfinished:
            return _cells.says(name)
        maker = self.needs.makers.get(name) if self.needs else None
        if isinstance(maker, str):
            return f'{name} comes from the cell that begins with "{maker}": run it first.'
        if maker:
            return f'{name} is made in task {maker.number}, "{maker.title}": do it first.'
        return ''

    def _what_has_changed(self, task: str) -> str:
        """Return what judges no more as it did when this module was imported; usually nothing."""
        return task if self.judges[task] is not self._added[task] else _untouched.look()

    def _needed(self, task: str) -> str:
        needed = self.needs.of_tasks.get(task, set()) if self.needs else set()
        tasks = self._open(self.needs.in_order(needed)) if needed else []
        return self._says(tasks, 'This task needs', 'check this one again') if tasks else ''

    def _open(self, tasks: Sequence[str]) -> list[str]:
        """Return those of these tasks that have been neither solved nor replaced."""
        attempts = ((task, self.attempts[task]) for task in tasks)
        return [task for task, one in attempts if not one.solved and not one.stands_in]

    def _says(self, tasks: Sequence[str], begin: str, then: str) -> str:
        """Return the sentence that says which task is needed, and what helps."""
        task = self.needs.tasks[tasks[0]]
        helps = ['solve it']
        if task.solutions:
            helps = ['solve it, or run its solution']
        elif self._lends(task.name):
            helps = [f'solve it, or write `%borrow {task.name}`']
        return (
            f'{begin} task {task.number}, "{task.title}", which is not solved: {helps[0]}, then '
            f'{then}.'
        )

    def _again(self, task: str) -> str:
        """Return what a student can do whose answer is not right."""
        known = self.needs.tasks.get(task) if self.needs else None
        if known and known.solutions:
            return BELOW
        if self._lends(task):
            return f'{AGAIN} If you are stuck: `%borrow {task}` lets you go on.'
        return AGAIN

    def _lends(self, task: str) -> bool:
        tried = self.attempts[task].failed >= TRIES_BEFORE_BORROWING
        return tried and bool(self._borrowable(task))

    def _borrowable(self, task: str) -> str:
        """Return the code of a solution that can be borrowed, empty if there is none."""
        known = self.needs.tasks.get(task) if self.needs else None
        if known is None or progress.IS_GRADED in os.environ:
            return ''
        return '\n'.join(
            [code_of_solution(cell.source) for cell in known.solutions]
            or [kept_solution(cell) for cell in known.checks]
        ).strip()

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
                attempt.stands_in = ''


_of_this_notebook: Tasks | None = None


def who_makes(name: str) -> str:
    """Return a sentence that says which cell gives a name its value, empty if none does."""
    return _of_this_notebook.who_makes(name) if _of_this_notebook else ''


def solution(line: str, cell: str) -> None:
    """Run a cell `%%solution hear_the_text` if the student has not solved this task; check it.

    So the lesson goes on with the student's code if its check has passed, and with the solution if
    it has not. The cell may begin with another magic, such as `%%write`.
    """
    if _of_this_notebook is None or line.strip() not in _of_this_notebook.judges:
        names = _of_this_notebook.names_in_words(line.strip()) if _of_this_notebook else ''
        raise UsageError(f'Write the name of a task of this lesson. {names}'.strip())
    _of_this_notebook.run_solution(line.strip(), cell)


def borrow(line: str) -> None:
    """Go on with what the course has for a task: `%borrow be_the_queue`. See `Tasks.borrow`."""
    if _of_this_notebook is None or line.strip() not in _of_this_notebook.judges:
        names = _of_this_notebook.names_in_words(line.strip()) if _of_this_notebook else ''
        raise UsageError(f'Write the name of a task of this lesson. {names}'.strip())
    _of_this_notebook.borrow(line.strip())


# --- Judging --------------------------------------------------------------------------------------


def try_points(
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
                if not verdict.points[tried - 1].ok and sandbox.together_s == math.inf:
                    # What builds or starts programs has needed its time before.
                    sandbox.since = started if limit_s <= LIMIT_S else time.monotonic()
                    sandbox.together_s = TOGETHER_S
            running.update(time.monotonic() - started)
    verdict.seconds = time.monotonic() - started
    _add_ending(verdict, tried, sandbox.ending)
    if sandbox.ending.printed:
        print(sandbox.ending.printed, end='' if sandbox.ending.printed.endswith('\n') else '\n')
    return hints


def _add_ending(verdict: Verdict, tried: int, ending: Ending) -> None:
    """Say of the point that did not come back why, and of those after it that they wait."""
    found, rest = '', NO_TIME if ending.reason == 'late' else NOT_TRIED
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
        point.ok, point.found = False, found or rest
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
    """The cell that runs, and names that are missing because their cells did not end well."""

    def __init__(self) -> None:
        self.running = ''
        self.failed: set[str] = set()  # their cells ended with an error
        self.unfinished: dict[str, tuple[str, str]] = {}  # what became of their cell, and which
        self.waits = False  # this cell has only said what it needs

    def transform(self, lines: list[str]) -> list[str]:
        """Let a cell that cannot run yet say why. IPython calls this for each cell."""
        self.waits = False
        if _of_this_notebook is None:
            return lines
        sentence = _of_this_notebook.why_not_to_run(''.join(lines))
        if not sentence:
            return lines
        self.waits = True
        return [f'print({line!r})\n' for line in wrap(sentence)]

    def begin(self, info: object) -> None:
        """IPython calls this before it runs a cell."""
        self.running = getattr(info, 'raw_cell', None) or ''
        if _of_this_notebook is None or self.waits:
            return
        if sentence := _of_this_notebook.what_may_be_missing(self.running):
            print(*wrap(sentence), sep='\n')

    def end(self, result: object) -> None:
        """IPython calls this after a cell; the result is None if the Interrupt came in its code."""
        source, self.running = self.running, ''
        if self.waits:
            self.waits = False
            return
        error = KeyboardInterrupt()
        if result is not None:
            source, error = result.info.raw_cell or '', result.error_before_exec
            error = error or result.error_in_exec
        names = names_of(RUNS_PYTHON.sub('', source)).given
        interrupted = isinstance(error, KeyboardInterrupt)
        if result is not None:
            if _of_this_notebook:
                _of_this_notebook.is_written(names)
            if error is None or interrupted:
                self.failed.difference_update(names)
            else:
                self.failed.update(names)
        what = 'was interrupted' if interrupted else 'ended with an error'
        for name in names:
            self.unfinished.pop(name, None)
            if error is not None:
                line = next((one for one in source.splitlines() if one.strip()), '')
                self.unfinished[name] = what, line.strip()[:60]

    def runs_again(self, names: set[str]) -> None:
        """Note that these names have a value again."""
        self.failed.difference_update(names)
        for name in names:
            self.unfinished.pop(name, None)

    def says(self, name: str) -> str:
        """Return the sentence of a cell that uses a name whose cell did not end well."""
        what, line = self.unfinished[name]
        return f'{name} comes from the cell that begins with "{line}", which {what}: run it first.'


_cells = Cells()
_untouched = Untouched()


if shell := get_ipython():
    shell.register_magic_function(solution, 'cell')
    shell.register_magic_function(borrow, 'line')
    shell.input_transformers_cleanup.insert(0, _cells.transform)
    shell.events.register('pre_run_cell', _cells.begin)
    shell.events.register('post_run_cell', _cells.end)
