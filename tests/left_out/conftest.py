"""A plugin for pytest beside nbval, for `make left-out`: notebooks run with tasks left unsolved.

`--left-out stars` leaves out what has a star: each notebook runs without the solutions of its tasks
with ★, whose starters stay as they are. All other cells must print what is saved, but for those
that have a star themselves. `--left-out each` runs a notebook once for each task of its core,
without the solution of this task alone; numbers or names of tasks choose some. A cell that needs
what is missing says so, with the task's name; all others print what is saved.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import groupby

import pytest

from helpers.lesson import Lesson, Task, chosen_tasks, read
from tools.lessons.comparison import NamedCell

STARS, EACH = 'stars', 'each'


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption('--left-out', default=STARS, help=f'{STARS}, {EACH}, or tasks of one lesson')


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Take the solutions out that are left out, and let a cell that needs them say so."""
    plain, items[:] = list(items), []
    asked = config.option.left_out
    for file, group in groupby(plain, key=lambda item: item.parent):
        lesson = read(file.path.read_text(encoding='utf-8'), file.path.name)
        if asked == STARS:
            items += without_stars(lesson, list(group))
            continue
        for task in lesson.tasks if asked == EACH else chosen_tasks(asked, lesson):
            if not task.star or asked != EACH:
                items += without(lesson, task, file)


def without_stars(lesson: Lesson, cells: list[NamedCell]) -> list[NamedCell]:
    """Return the cells of a notebook without the solutions of tasks with a star."""
    left_out = {cell.id for task in lesson.tasks if task.star for cell in task.solutions}
    free = {cell.id for cell in lesson.starred}
    kept = [cell for cell in cells if cell.cell.id not in left_out]
    for cell in kept:
        if cell.cell.id in free:
            cell.options |= {'check': False, 'check_exception': True}
    return kept if left_out else []


def without(lesson: Lesson, task: Task, file: pytest.File) -> Iterator[NamedCell]:
    """Yield the cells of a notebook without the solution of a task, for a kernel of their own."""
    run = type(file).from_parent(file.parent, path=file.path)
    left_out = {cell.id for cell in task.solutions}
    for cell in run.collect():
        if cell.cell.id in left_out:
            continue
        one = MayNeed.from_parent(
            run,
            name=f'{cell.name} without {task.name}',
            cell_num=cell.cell_num,
            cell=cell.cell,
            options=cell.options,
        )
        one.options['check_exception'] = True
        one.needed = f'task {task.number}, "{task.title}", which is not solved'
        yield one


class MayNeed(NamedCell):
    """A cell that prints what is saved, or says that it needs a task."""

    needed = ''

    def compare_outputs(self, test, ref, skip_compare=None) -> bool:
        texts = (
            output.get('text') or output.get('data', {}).get('text/plain', '') for output in test
        )
        said = re.sub(r'\s+', ' ', ' '.join(texts))
        return self.needed in said or super().compare_outputs(test, ref, skip_compare)
