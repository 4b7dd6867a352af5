"""`make mutants`: judge the mutants of lessons as answers of students, and report the survivors.

A lesson runs in a kernel as in tests/answers: the cells above a task, then each mutant and its
check, and what they did to names and files is undone. A check stops at the first point that is not
met: an answer is wrong then, whatever the others say.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import textwrap
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from multiprocessing import get_context

import yaml
from nbclient.exceptions import CellTimeoutError, DeadKernelError
from nbclient.util import run_sync
from support.judged import Cells, Lesson, run_all

from helpers.checks.progress import FILE_VARIABLE
from helpers.lesson import chosen, chosen_tasks, outline
from mutants.lessons import drawn_of_lesson, of_lesson
from mutants.made import Mutant, entry_of

SEED = 1
WAITS_AT_MOST_S = 15  # a student, for a verdict, builds apart
LIMIT_S = 120  # of a cell: what takes longer has no verdict
NOTICED, SURVIVED, EQUAL, NO_VERDICT = 'noticed', 'survived', 'equal', 'no verdict'
LEFT = SURVIVED, NO_VERDICT
HOW = {'right': SURVIVED, 'wrong': NOTICED, 'not judged': NO_VERDICT}
STOP_EARLY = """
import helpers.checks.tasks

helpers.checks.tasks.TOGETHER_S = 0
"""


@dataclass(frozen=True)
class Judged:
    """What became of a mutant, how long it took, and what the check said."""

    task: str
    mutant: Mutant
    how: str
    seconds: float
    said: str = ''


class Judge:
    """Judges the mutants of a lesson. It opens another kernel where one has ended or hangs."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._lesson: Lesson | None = None
        self._folder = tempfile.TemporaryDirectory(prefix='kernels-')
        self._opened = 0

    def close(self) -> None:
        if self._lesson is not None:
            lesson, self._lesson = self._lesson, None
            lesson.kernel.__exit__(None, None, None)

    def _at(self, task: str) -> Lesson:
        if self._lesson is None:
            self._lesson = Lesson(self._name)
            # Two kernels that start at once may choose the same port. A file is nobody else's.
            self._opened += 1
            self._lesson.kernel.config.KernelManager.transport = 'ipc'
            self._lesson.kernel.config.KernelManager.connection_file = (
                f'{self._folder.name}/{self._opened}.json'
            )
            self._lesson.kernel.__enter__()
        if self._lesson.reached < 0 or not self._lesson.is_behind(task):
            self._lesson.kernel.timeout = 600  # what stands above may build a workspace
            self._lesson.go_to(task)
            run_all(self._lesson.kernel, [STOP_EARLY], self._lesson.cells['exercise'])
            self._lesson.kernel.timeout = LIMIT_S
        return self._lesson

    def judge(self, task: str, mutant: Mutant) -> Judged:
        """Return what the check of a task says of a mutant."""
        lesson = self._at(task)
        started = time.monotonic()
        how, said = NO_VERDICT, f'The check took more than {LIMIT_S} s.'
        try:
            with lesson.undone():
                how, said = _verdict_of(lesson, lesson.cells, mutant)
        except (CellTimeoutError, DeadKernelError):
            self.close()
        return Judged(task, mutant, how, time.monotonic() - started, said)

    def judge_all(self, task: str, mutants: list[Mutant]) -> list[Judged]:
        """Return what the check of a task says of its mutants, if it takes the solution itself.

        A check that refuses everything would notice all of them.
        """
        if not mutants:
            return []
        solution = mutants[0].solution
        control = self.judge(task, Mutant('solution', solution, solution))
        if control.how == SURVIVED:
            judged = [self.judge(task, mutant) for mutant in mutants]
            if of_lesson(self._name)[task].each_equal:
                return [replace(one, how=EQUAL) if one.how == SURVIVED else one for one in judged]
            return judged
        said = f'The check does not take the solution itself. {control.said}'
        return [Judged(task, mutant, NO_VERDICT, control.seconds, said) for mutant in mutants]


def _verdict_of(lesson: Lesson, cells: Cells, mutant: Mutant) -> tuple[str, str]:
    files = cells['exercise'] if len(cells['exercise']) > 1 else []
    try:
        said = run_all(lesson.kernel, files, [mutant.source])
    except CellTimeoutError:
        # A student would see that the own cell does not end. No check runs then.
        run_sync(lesson.kernel.km.interrupt_kernel)()
        return NOTICED, 'Its cell does not end.'
    said += run_all(lesson.kernel, cells['check'])
    return HOW[lesson.kernel.judged], said


def judge_part(name: str, mutants: dict[str, list[Mutant]]) -> list[Judged]:
    """Judge mutants of a lesson in one kernel: a job, in a process of its own."""
    judge, judged = Judge(name), []
    try:
        for task, of_task in mutants.items():
            judged += judge.judge_all(task, of_task)
            if of_task:
                left = [one.mutant.id for one in judged if one.task == task and one.how in LEFT]
                told = ' '.join([f'{len(left)} left', *left])
                print(f'{name}, {task}: {len(of_task)} judged, {told}', file=sys.stderr, flush=True)
    finally:
        judge.close()
    return judged


def parts(mutants: dict[str, list[Mutant]], count: int) -> Iterator[dict[str, list[Mutant]]]:
    """Yield the mutants of a lesson in so many parts, each with some of each task."""
    for number in range(count):
        part = {task: of_task[number::count] for task, of_task in mutants.items()}
        if any(part.values()):
            yield part


def judge_lessons(
    drawn: dict[str, dict[str, list[Mutant]]], jobs: int
) -> Iterator[tuple[str, Judged]]:
    """Judge the mutants of some lessons, several beside each other."""
    each = max(1, jobs // max(1, len(drawn)))
    # Kernels go their own way: nothing is recorded, and no terminal meets another's session.
    os.environ[FILE_VARIABLE] = ''
    with (
        tempfile.TemporaryDirectory(prefix='sessions-') as sessions,
        ProcessPoolExecutor(jobs, get_context('spawn')) as pool,
    ):
        os.environ['ROS2_SESSIONS'] = sessions
        started = {
            pool.submit(judge_part, name, part): name
            for name, mutants in drawn.items()
            for part in parts(mutants, each)
        }
        for job in as_completed(started):
            for one in job.result():
                yield started[job], one


# --- The report -----------------------------------------------------------------------------------


class Lines(yaml.SafeDumper):
    """Writes a text of several lines as it is, as tests/answers does."""


Lines.add_representer(
    str,
    lambda dumper, text: dumper.represent_scalar(
        'tag:yaml.org,2002:str', text, style='|' if '\n' in text else None
    ),
)


def report_of(name: str, one: Judged) -> str:
    """Return what is said of a survivor: its difference, and how its entry would look."""
    old, new = entry_of(one.mutant)
    entry = yaml.dump([{old: new, 'because': '...'}], Dumper=Lines, sort_keys=False, width=1000)
    return '\n'.join(
        [
            f'{name}, {one.task}: {one.mutant.rule.replace("_", " ")} ({one.mutant.id}), {one.how}',
            textwrap.indent(one.mutant.difference, '    '),
            f'  if it is equal, below `{one.task} equal:` of tests/answers/{name}.yaml:',
            textwrap.indent(entry.rstrip(), '    '),
            *([f'  It was not judged: {one.said}'] if one.how == NO_VERDICT else []),
            '',
        ]
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--lesson', default='', help='numbers or names, all if there are none')
    parser.add_argument('--task', default='', help='of one lesson: numbers or names')
    parser.add_argument('--seed', type=int, default=SEED, help='draws the mutants')
    parser.add_argument('--count', type=int, help='of a lesson, all if it is not given')
    parser.add_argument('--jobs', type=int, default=2, help='that run beside each other')
    parser.add_argument('--list', action='store_true', help='only show what would be judged')
    options = parser.parse_args()
    try:
        drawn = chosen_mutants(options)
    except ValueError as error:
        sys.exit(str(error))
    made = {name: sum(map(len, tasks.values())) for name, tasks in drawn.items()}
    print(f'{sum(made.values())} mutants, drawn with SEED={options.seed}.', flush=True)
    if options.list:
        for name, tasks in drawn.items():
            for task, mutants in tasks.items():
                for one in mutants:
                    print(f'\n{name}, {task}: {one.rule.replace("_", " ")} ({one.id})')
                    print(textwrap.indent(one.difference, '    '))
        return 0
    counts: dict[str, Counter] = {name: Counter() for name in drawn}
    slowest: list[tuple[float, str, Judged]] = []
    left = []
    started = time.monotonic()
    for name, one in judge_lessons(drawn, options.jobs):
        counts[name][one.how] += 1
        slowest.append((one.seconds, name, one))
        if one.how in LEFT:
            left.append((name, one))
            print(report_of(name, one), flush=True)
    print(f'{"lesson":40} made noticed equal left')
    for name, count in counts.items():
        of_tasks = of_lesson(name)
        listed = sum(len(of.equal) for task, of in of_tasks.items() if task in drawn[name])
        equal, open_ones = listed + count[EQUAL], sum(count[how] for how in LEFT)
        numbers = made[name] + listed, count[NOTICED], equal, open_ones
        print(f'{name:40} {"{:4} {:7} {:5} {:4}".format(*numbers)}')
    slowest.sort(key=lambda entry: entry[0], reverse=True)
    for seconds, name, one in slowest:
        if seconds > WAITS_AT_MOST_S or one is slowest[0][-1]:
            print(f'Slow: {seconds:.0f} s, {name}, {one.task}, {one.mutant.id}.')
    print(f'{time.monotonic() - started:.0f} s in all.')
    if left:
        print(f'Left: {dict(Counter(one.mutant.rule for _, one in left))}')
    return bool(left)


def chosen_mutants(options: argparse.Namespace) -> dict[str, dict[str, list[Mutant]]]:
    """Return the drawn mutants of the chosen lessons and tasks. Raises ValueError."""
    found = {}
    for path in chosen(options.lesson):
        lesson = outline(path)
        if not lesson.tasks:
            continue
        tasks = {task.name for task in chosen_tasks(options.task, lesson)} if options.task else None
        found[lesson.name] = drawn_of_lesson(lesson.name, options.count, options.seed, tasks)
    return found
