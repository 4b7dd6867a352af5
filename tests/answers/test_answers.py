"""Every check judges the answers that students give: wrong ones of many kinds, and right ones.

A file `<lesson>.yaml` beside this one has the answers of a lesson's tasks:

    a_driver wrong:
    - self.publisher.publish(message): ''  # publishes nothing
    - x = self.speed: x = 0.5  # two edits are one answer
      z = self.turn: z = 1.0
    a_driver right:
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
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from support.answers import LEAST, answers_of, source_of
from support.kernel import NOTEBOOKS, Kernel

from helpers.lesson import check_call, code_of_solution, path_of, read

HERE = Path(__file__).parent
KEEP_NAMES = 'get_ipython().names_before = dict(get_ipython().user_ns)'
PUT_NAMES_BACK = """
def put_back(names, before):
    names.clear()
    names.update(before)


put_back(get_ipython().user_ns, get_ipython().names_before)
"""
Cells = dict[str, list[str]]  # of a task, by their tag

FILES = sorted(HERE.glob('*.yaml'))


def builds(check: str) -> bool:
    """Return whether a check builds, clones or starts programs."""
    _, arguments = check_call(check)
    return arguments[:1] == ['workspace']


def read_tasks(name: str) -> dict[str, tuple[list[str], Cells]]:
    """Return for each task of a lesson, by its name, the cells above it, and its own."""
    path = path_of(name, NOTEBOOKS)
    lesson = read(path.read_text(encoding='utf-8'), path.name)
    of_tasks = {cell.id for task in lesson.tasks for cell in task.cells}
    found, above = {}, []
    tasks = iter(lesson.tasks)
    task = next(tasks, None)
    for cell in lesson.code_cells():
        if cell.id not in of_tasks:
            above.append(cell.source)
        elif cell is task.cells[-1]:
            found[task.name] = (
                above,
                {
                    'exercise': [one.source for one in task.exercises],
                    'check': [one.source for one in task.checks],
                    'solution': [code_of_solution(one.source) for one in task.solutions],
                },
            )
            above, task = [], next(tasks, None)
    return found


class Lesson:
    """A lesson in a kernel: its tasks are judged in their order, in one pass through its cells.

    `go_to` runs the cells above a task, with the solutions of the tasks before it, and `go_on`
    leaves the task as if only its solution had been written.
    """

    def __init__(self, name: str) -> None:
        self.name, self.kernel = name, Kernel()
        self._tasks = read_tasks(name)
        self._names = [*self._tasks]
        self._folder: Path | None = None  # of its workspace
        self.reached = -1  # the place of the task whose cells are `cells`
        self.cells: Cells = {}

    def is_behind(self, task: str) -> bool:
        """Return whether the lesson has reached a task, or a later one."""
        return self.reached >= self._names.index(task)

    def go_to(self, task: str) -> None:
        """Run the cells above a task."""
        while not self.is_behind(task):
            if self.cells:
                # Some solutions change the files that their starters have written.
                run_all(self.kernel, self.cells['exercise'], self.cells['solution'])
                # What a check builds is used by the cells below it.
                run_all(self.kernel, filter(builds, self.cells['check']))
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
        self.reached += 1
        above, self.cells = self._tasks[self._names[self.reached]]
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
    opened: list[Lesson] = []  # at most one

    def close() -> None:
        while opened:
            opened.pop().kernel.__exit__(None, None, None)

    @contextmanager
    def open_at(name: str, task: str) -> Iterator[Lesson]:
        if not opened or opened[0].name != name or opened[0].is_behind(task):
            close()
            lesson = Lesson(name)
            lesson.kernel.__enter__()
            opened.append(lesson)
        lesson = opened[0]
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
    ('lesson', 'task'), [(path.stem, task) for path in FILES for task in read_tasks(path.stem)]
)
def test_check_judges_right_and_wrong_answers(lesson, task, open_lesson):
    answers, tasks = answers_of(HERE / f'{lesson}.yaml'), read_tasks(lesson)
    # Before the cells above the task have run: that takes a while.
    wrong, right = (
        made(answers.get(f'{task} {kind}', []), f'{task} {kind}', tasks[task][1]) for kind in LEAST
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


IN_TERMINALS = """
from helpers.ros import ros_session

for program in ('listener', 'talker'):
    run = f'source install/setup.bash\\nros2 run hello_pkg {program}'
    workspace.start(run, f'one more {program}')
with ros_session() as session:
    session.wait_until(lambda: session.node.count_subscribers('/topic'))
    session.wait_until(lambda: session.node.count_publishers('/topic'))
"""


@pytest.mark.parametrize('lesson', ['make_a_package'])
def test_what_runs_in_a_terminal_changes_no_verdict(lesson, open_lesson):
    tasks = read_tasks(lesson)
    with open_lesson(lesson, 'other_arguments') as opened:
        said = opened.kernel.run(IN_TERMINALS)
        for task in ('a_slow_listener', 'callbacks_in_parallel', 'other_arguments'):
            _, cells = tasks[task]
            said += run_all(opened.kernel, cells['solution'], cells['check'])
            assert [verdict['solved'] for verdict in opened.kernel.verdicts] == [True], said
