"""What a cell needs: which tasks, which cells. As long as that is missing, the cell says so.

A lesson goes on with what a task has made: a class, a function, a number. As long as the task is
not solved, that is its starter, which is wrong. A cell that measures a starter would call a right
guess wrong, and a check would call right code wrong. So a cell of the lesson that needs a task
which is not solved does not run: it says which task it needs. It does the same if a cell whose
names it uses was interrupted, or ended with an error.

What a cell needs is found in the notebook: the cells in which its names get their values, and what
these need themselves. Cells of a task, from its first one to its last one, are its own: there a
student tries what is half done. A cell that a student has added or changed is not known here, and
always runs.

Files are another matter: which program needs which line of a `setup.py`, no name tells. So a cell
that uses files runs, and says which tasks are not solved; one that compares a guess waits for them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from helpers.lesson import Lesson, Task, check_call, code_of_solution, magic_of
from helpers.notebook import names_of

USE_FILES = 'write', 'terminal'


@dataclass
class Cell:
    """What a cell that belongs to no task needs."""

    names: set[str]  # of other cells
    tasks: list[str]  # whose names it uses, or whose names these have used
    files: list[str] = field(default_factory=list)  # tasks whose files it may use
    compares: bool = False  # a guess with what was measured


@dataclass
class Needs:
    """What the cells of a lesson need, by their source; what its tasks need, by their names.

    `files` are the tasks that write files, in their order, without those that have a star: what may
    be left out is needed nowhere, which tests/left_out makes sure of. `makers` says where each name
    is made: the task, or the first line of the cell.
    """

    tasks: dict[str, Task]
    cells: dict[str, Cell] = field(default_factory=dict)
    of_tasks: dict[str, set[str]] = field(default_factory=dict)
    files: list[str] = field(default_factory=list)
    makers: dict[str, Task | str] = field(default_factory=dict)

    def files_before(self, task: str) -> list[str]:
        """Return the tasks that write files before this one does; none if it uses no files."""
        return self.files[: self.files.index(task)] if task in self.files else []

    def in_order(self, names: set[str]) -> list[str]:
        return [name for name in self.tasks if name in names]


def needs_of(lesson: Lesson) -> Needs:
    """Return what each cell and each task of a lesson needs."""
    found = Needs({task.name: task for task in lesson.tasks})
    owners = _owners(lesson)
    made_by: dict[str, set[str]] = {}  # a name, and the tasks that its value needs
    for cell in lesson.code_cells():
        source = code_of_solution(cell.source)
        names, task = names_of(source), owners.get(cell.id)
        need = set().union(*(made_by.get(name, set()) for name in names.taken))
        if task:
            of_task = found.of_tasks.setdefault(task.name, set())
            of_task |= need - {task.name}
            need = {task.name} | of_task
            if _writes_files(task) and not task.star and task.name not in found.files:
                found.files.append(task.name)
        else:
            in_terminal = magic_of(source).name == 'terminal'
            uses_files = in_terminal or names.taken & {'workspace', 'terminals'}
            found.cells[source.strip()] = Cell(
                names.taken,
                found.in_order(need),
                [*found.files] if uses_files else [],
                'compare_prediction' in names.taken,
            )
        for name in names.given:
            if need:
                made_by[name] = need
            else:
                made_by.pop(name, None)
            found.makers[name] = task or _first_line(source)
    return found


def _owners(lesson: Lesson) -> dict[str, Task]:
    """Return the task of each cell from its first one to its last one, by the cell's id."""
    owners = {}
    for task in lesson.tasks:
        if task.cells:
            last = max(task.code.index(cell) for cell in task.cells)
            owners |= {cell.id: task for cell in task.code[: last + 1]}
    return owners


def _writes_files(task: Task) -> bool:
    calls = [check_call(cell.source) for cell in task.checks]
    hands_over = any('workspace' in call[1] for call in calls if call)
    return hands_over and any(magic_of(cell.source).name in USE_FILES for cell in task.exercises)


def _first_line(source: str) -> str:
    return next((line.strip() for line in source.splitlines() if line.strip()), '')[:60]
