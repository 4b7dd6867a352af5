"""Every check judges the answers that students give: wrong ones of many kinds, and right ones.

A file `<lesson>.yaml` beside this one has the answers of a lesson's tasks:

    3 wrong:
    - self.publisher.publish(message): ''  # publishes nothing
    - x = self.speed: x = 0.5  # two edits are one answer
      z = self.turn: z = 1.0
    3 right:
    - message = ... (message): |-
        from geometry_msgs.msg import Vector3
        self.publisher.publish(Twist(linear=Vector3(x=self.speed), angular=Vector3(z=self.turn)))

An answer is the notebook's solution, edited: `old text: new text`. ` ... ` in the old text is
whatever lies between, and a space is any white space. The solution must have each old text exactly
once. If it has not, the starter is edited, which must. New lines are indented as the line in which
the old text begins. An answer that has little in common with both is given as a whole, as text.

YAML wants quotes around text that begins with a quote, a bracket or another sign of its own, or
that has a colon with a space behind it, or a # with a space before it.
"""

import os
import re
import shutil
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import nbformat
import pytest
from support.answers import LEAST, answers_of, source_of
from support.kernel import NOTEBOOKS, Kernel

from helpers.checks.progress import with_tasks

HERE = Path(__file__).parent
BUILDS = re.compile(r'check\(\d+, workspace\b')  # or clones, or starts programs
KEEP_NAMES = 'get_ipython().names_before = dict(get_ipython().user_ns)'
PUT_NAMES_BACK = """
def put_back(names, before):
    names.clear()
    names.update(before)


put_back(get_ipython().user_ns, get_ipython().names_before)
"""
Cells = dict[str, list[str]]  # of a task, by their tag

FILES = sorted(HERE.glob('*.yaml'))


def tasks_of(path: Path) -> set[int]:
    """Return the numbers of the tasks that have answers."""
    return {int(key.split()[0]) for key in answers_of(path)}


def tag_of(cell: nbformat.NotebookNode) -> str:
    """Return 'exercise', 'check' or 'solution', or nothing for another cell."""
    tags = {'exercise', 'check', 'solution'}.intersection(cell.metadata.get('tags', []))
    return tags.pop() if tags else ''


def read_tasks(name: str) -> list[tuple[list[str], Cells]]:
    """Return for each task of a lesson the cells above it, and its own."""
    [path] = NOTEBOOKS.glob(f'[0-9][0-9]_{name}.ipynb')
    tasks, above, own = [], [], defaultdict(list)
    for cell in nbformat.read(path, 4).cells:
        if cell.cell_type != 'code':
            continue
        tag, source = tag_of(cell), cell.source
        if not tag:
            above.append(source)
        elif tag != 'solution':
            own[tag].append(source)
        else:
            own[tag].append(source.split('\n', 1)[1])
            tasks.append((above, own))
            above, own = [], defaultdict(list)
    return tasks


class Lesson:
    """A lesson in a kernel: its tasks are judged in their order, in one pass through its cells.

    `go_to` runs the cells above a task, with the solutions of the tasks before it, and `go_on`
    leaves the task as if only its solution had been written.
    """

    def __init__(self, name: str) -> None:
        self.name, self.kernel = name, Kernel()
        self._tasks = read_tasks(name)
        self._folder: Path | None = None  # of its workspace
        self.reached = 0  # the task whose cells are `cells`
        self.cells: Cells = {}

    def go_to(self, task: int) -> None:
        """Run the cells above a task."""
        while self.reached < task:
            if self.reached:
                # Some solutions change the files that their starters have written.
                run_all(self.kernel, self.cells['exercise'], self.cells['solution'])
                # What a check builds is used by the cells below it.
                run_all(self.kernel, filter(BUILDS.match, self.cells['check']))
            self._reach_next()

    @contextmanager
    def undone(self) -> Iterator[None]:
        """Undo what cells do to files of the workspace and to names of the kernel."""
        self.kernel.run(KEEP_NAMES)
        with tempfile.TemporaryDirectory() as aside:
            kept = Path(aside, 'kept')
            if self._folder:
                shutil.copytree(self._folder, kept, symlinks=True)
            yield
            if self._folder:
                for path in self._folder.iterdir():
                    (shutil.rmtree if path.is_dir() and not path.is_symlink() else os.remove)(path)
                shutil.copytree(kept, self._folder, symlinks=True, dirs_exist_ok=True)
        self.kernel.run(PUT_NAMES_BACK)

    def _reach_next(self) -> None:
        """Run the cells above the next task."""
        above, self.cells = self._tasks[self.reached]
        self.reached += 1
        run_all(self.kernel, above)
        path = self.kernel.run("print(globals()['workspace'].path)") if self._folder is None else ''
        if path.startswith('/'):
            self._folder = Path(path.strip())


def run_all(kernel: Kernel, *sources: list[str]) -> str:
    """Run cells, and return what they print."""
    return ''.join(kernel.run(source) for group in sources for source in group)


def made(answers: list, key: str, cells: Cells) -> list[str]:
    """Return the sources of the answers below a key of the file."""
    least = LEAST[key.split()[1]]
    assert len(answers) >= least, (
        f'There are {len(answers)} answers below `{key}:`, and at least {least} are wanted.'
    )
    try:
        return [source_of(answer, *cells['solution'], *cells['exercise']) for answer in answers]
    except ValueError as error:
        text = f'An answer below `{key}:` cannot be made. {error}'
        raise pytest.fail.Exception(text, pytrace=False) from None


def judge(kernel: Kernel, sources: list[str], key: str, cells: Cells) -> None:
    """Run each answer, and its check twice: each time it must find of which kind the answer is."""
    kind = key.split()[1]
    starters = cells['exercise']
    files = starters if len(starters) > 1 else []  # the answer changes what they have written
    for source in sources:
        said = run_all(kernel, files, [source])
        for _ in range(2):
            said += run_all(kernel, cells['check'])
            solved = [verdict['solved'] for verdict in kernel.verdicts]
            # A name that the answer does not define is an error of the cell, not a verdict.
            if solved != [kind == 'right'] and not (kind == 'wrong' and not solved):
                pytest.fail(
                    f'This answer stands below `{key}:`, and its check says something else.\n'
                    f'{source}\n\nThe check said:\n{said}',
                    pytrace=False,
                )


@pytest.fixture(scope='module')
def open_lesson():
    """Return a function that returns a lesson in a kernel in which a task was not reached yet.

    The tasks of a lesson come in their order, so the next one goes on in the kernel of the last.
    """
    lessons: list[Lesson] = []  # at most one

    def close() -> None:
        while lessons:
            lessons.pop().kernel.__exit__(None, None, None)

    @contextmanager
    def open_at(name: str, task: int) -> Iterator[Lesson]:
        if not lessons or lessons[0].name != name or lessons[0].reached >= task:
            close()
            lesson = Lesson(name)
            lesson.kernel.__enter__()
            lessons.append(lesson)
        lesson = lessons[0]
        try:
            lesson.go_to(task)
            with lesson.undone():
                yield lesson
        except BaseException:
            close()  # what a wrong verdict has left is not what the next task begins with
            raise

    yield open_at
    close()


@pytest.mark.parametrize(
    ('lesson', 'task'),
    [(path.stem, task) for path in FILES for task in sorted(tasks_of(path))],
    ids=lambda value: value if isinstance(value, str) else f'task_{value:02d}',
)
def test_check_judges_right_and_wrong_answers(lesson, task, open_lesson):
    answers, tasks = answers_of(HERE / f'{lesson}.yaml'), read_tasks(lesson)
    assert task <= len(tasks), f'The lesson {lesson} has no task {task}.'
    # Before the cells above the task have run: that takes a while.
    wrong, right = (
        made(answers.get(f'{task} {kind}', []), f'{task} {kind}', tasks[task - 1][1])
        for kind in LEAST
    )
    with open_lesson(lesson, task) as opened:
        kernel, cells = opened.kernel, opened.cells
        run_all(kernel, cells['exercise'])
        started = time.monotonic()
        said = run_all(kernel, cells['check'])
        times = f'A verdict took {time.monotonic() - started:.1f} s for the starter'
        assert [verdict['solved'] for verdict in kernel.verdicts] == [False], (
            f'The starter must be wrong. Its check said:\n{said}'
        )
        judge(kernel, wrong, f'{task} wrong', cells)
        # What a right answer builds stays, so the solution comes after the wrong ones.
        run_all(kernel, cells['exercise'])
        started = time.monotonic()
        said = kernel.run(f'%%solution {task}\n{cells["solution"][0]}')
        print(f'{times}, and {time.monotonic() - started:.1f} s for the solution.')  # with -rP
        assert [(verdict['of'], verdict['solved']) for verdict in kernel.verdicts] == [
            ('solution', True)
        ], said
        judge(kernel, right, f'{task} right', cells)


def test_each_task_of_a_lesson_has_answers():
    for tasks in with_tasks():
        path = HERE / f'{tasks.name}.yaml'
        known = tasks_of(path) if path.exists() else set()
        missing = sorted(set(range(1, tasks.tasks + 1)) ^ known)
        assert not missing, (
            f'tests/answers/{tasks.name}.yaml lacks tasks, or has others: {missing}.'
        )
