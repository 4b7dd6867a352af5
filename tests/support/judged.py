"""A lesson in a kernel, in which the checks of its tasks judge answers."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from helpers.lesson import check_call, code_of_solution, path_of, read
from support.kernel import NOTEBOOKS, Kernel

# What was run in terminals is evidence in lesson 19, and another answer has not run it.
KEEP_NAMES = """
get_ipython().names_before = dict(get_ipython().user_ns)
get_ipython().ran_before = [*getattr(globals().get('workspace'), '_ran', [])]
"""
PUT_NAMES_BACK = """
def put_back(names, before, ran_before):
    names.clear()
    names.update(before)
    if 'workspace' in names:
        names['workspace']._ran[:] = ran_before


put_back(get_ipython().user_ns, get_ipython().names_before, get_ipython().ran_before)
"""
STANDS_IN = """
check.__self__.attempts[{task!r}].given.clear()
check.__self__.attempts[{task!r}].stands_in = 'solution'
"""
Cells = dict[str, list[str]]  # of a task, by their tag


def stand_in(kernel: Kernel, task: str) -> None:
    """Let the solution of a task stand in for it, though its cell was run without its first line.

    Else what needs the task would not be run, or not be judged.
    """
    kernel.run(STANDS_IN.format(task=task))


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
                stand_in(self.kernel, self._names[self.reached])
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
