"""A lesson goes on with the program of an earlier one: the student's, or that of its solutions.

    workspace = Workspace('put_a_program_on_a_robot')
    carry_on(workspace, 'build_a_robot_program')

The student's own files are taken where their tasks are solved, and those of the solutions for the
others. What comes together must be whole: the check of the last task of the earlier lesson's core
takes it, or else all of it is that of the solutions. In an edition without solutions nothing is
taken that the student has neither solved nor borrowed.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from IPython.core.error import UsageError

from helpers.checks import progress
from helpers.lesson import (
    FOLDER,
    Lesson,
    Magic,
    Task,
    code_of_solution,
    kept_solution,
    magic_of,
    outline,
    path_and_part,
    path_of,
    tags,
)
from helpers.notebook import wrap

if TYPE_CHECKING:
    from helpers.workspace import BuildResult, Workspace

CPU_LIMIT_S, LIMIT_S = 60.0, 90.0  # of each point of the check that takes the whole
MADE = shutil.ignore_patterns('__pycache__', '.pytest_cache', '*.egg-info')


class Part(NamedTuple):
    """What a cell of the earlier lesson does to its workspace.

    It writes `file`, or it runs `code` in a terminal if that is empty. `task` is whose solution it
    is, empty for a cell that is nobody's task.
    """

    file: str
    number: int | None
    code: str
    task: str


def carry_on(workspace: Workspace, earlier: str) -> None:
    """Bring the program of an earlier lesson into this workspace, build it, and use what was built.

    If its packages are there already, they stay as they are. It prints whose files they are. Raises
    UsageError with what is missing if this edition of the earlier lesson has no solutions and the
    student has not solved it, or if the program does not build.
    """
    lesson = _lesson(earlier)
    packages = sorted(lesson.packages)
    if not all(workspace.file(f'src/{name}').is_dir() for name in packages):
        print(*wrap(_bring(workspace, lesson, packages)), sep='\n')
    result = workspace.build(*packages)
    if not result.ok:
        raise UsageError(f'The program does not build. {_why(result)}')
    workspace.use()


def _lesson(name: str) -> Lesson:
    """Return a lesson from beside the running notebook; a grader has it only in the checkout."""
    try:
        return outline(path_of(name, progress.folder()))
    except ValueError:
        return outline(path_of(name, FOLDER))


def _bring(workspace: Workspace, lesson: Lesson, packages: list[str]) -> str:
    """Write the program, and return whose it is."""
    core = [task for task in lesson.tasks if not task.star]
    solved = progress.solved_of(lesson)
    parts = [*_parts(lesson)]
    given = {part.task for part in parts}
    for task in core:
        if task.name not in solved | given:
            raise UsageError(
                f'This lesson goes on with the program of {_named(lesson)}. Its task '
                f'{task.number}, "{task.title}", is neither solved nor borrowed: do it there, then '
                'run this cell again.'
            )
    whose = f'The program of {_named(lesson)}'
    own = workspace.path.parent / lesson.workspace / 'src'
    if solved and own.is_dir():
        kept = {name for name in _files(lesson, solved) if (own.parent / name).is_file()}
        for name in packages:
            if (own / name).is_dir():
                target = workspace.file(f'src/{name}')
                shutil.copytree(own / name, target, ignore=MADE, dirs_exist_ok=True)
        _write(workspace, parts, kept)
        why = _why_not_whole(workspace, lesson, packages, core[-1])
        if not why:
            others = {Path(part.file).name for part in parts if part.file not in kept | {''}}
            said = f' Of its solutions: {", ".join(sorted(others))}.' if others else ''
            return f'{whose}: yours.{said}'
        if any(task.name not in given for task in core):
            raise UsageError(f'{whose} is not whole: {why}. Mend it there, and begin anew here.')
        for name in packages:
            shutil.rmtree(workspace.file(f'src/{name}'))
        whose = f'Yours is not whole: {why}. It stays where it is. {whose}'
    _write(workspace, parts, set())
    return f'{whose}: that of its solutions.'


def _named(lesson: Lesson) -> str:
    return f'"{lesson.title_or_name}"'


def _parts(lesson: Lesson) -> Iterator[Part]:
    """Yield what the cells of a lesson write and run, with what has been given of solutions."""
    owners = {cell.id: task for task in lesson.tasks for cell in task.cells}
    borrowed = progress.borrowed_of(lesson)
    for cell in lesson.code_cells():
        task, code = owners.get(cell.id), cell.source
        if task is not None:
            code = code_of_solution(code) if 'solution' in tags(cell) else ''
            if cell in task.checks and not task.solutions and task.name in borrowed:
                code = kept_solution(cell)
        name = task.name if task else ''
        match magic_of(code):
            case Magic('write', line, text):
                yield Part(*path_and_part(line), text, name)
            case Magic('terminal', '', commands):
                yield Part('', None, commands, name)


def _files(lesson: Lesson, solved: set[str]) -> set[str]:
    """Return the files that only cells of no task, or of these tasks, write."""
    owners = {cell.id: task.name for task in lesson.tasks for cell in task.cells}
    writers: dict[str, set[str]] = {}
    for cell in lesson.code_cells():
        if file := magic_of(code_of_solution(cell.source)).file:
            writers.setdefault(file, set()).add(owners.get(cell.id, ''))
    return {file for file, tasks in writers.items() if tasks <= solved | {''}}


def _write(workspace: Workspace, parts: list[Part], kept: set[str]) -> None:
    """Write all files but these, and run what is run in terminals."""
    for part in parts:
        if not part.file:
            workspace.terminal(part.code)
        elif part.file not in kept:
            workspace.write(part.file, part.code, part.number)


def _why_not_whole(workspace: Workspace, lesson: Lesson, packages: list[str], last: Task) -> str:
    """Return why the check of a task, which gets the workspace, does not take it; or nothing."""
    # Only here: each lesson imports helpers.checks, and these take a while.
    from helpers.checks.tasks import try_points
    from helpers.checks.verdict import Verdict

    result = workspace.build(*packages)
    if not result.ok:
        return _why(result)

    def points() -> list:
        # In the sandbox: this notebook goes on with the tasks of its own lesson.
        judges = import_module(f'helpers.checks.lessons.{lesson.name}').tasks.judges
        workspace.use()
        return judges[last.name].points([workspace])

    verdict = Verdict(last.name, last.number)
    try_points(verdict, points, CPU_LIMIT_S, LIMIT_S)
    if verdict.note:
        return verdict.note
    wrong = next((point for point in verdict.points if not point.ok), None)
    return f'{last.title}: {wrong.found or wrong.what}' if wrong else ''


def _why(result: BuildResult) -> str:
    from helpers.workspace import why_it_failed

    return why_it_failed(result)
