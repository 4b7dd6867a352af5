"""Which lesson is it, and what has the student written? All of it is read as text."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path

from nbformat import NotebookNode

from classroom.grade.reach import reaches_for
from classroom.grade.source import code_only
from classroom.update import YOURS
from helpers.lesson import (
    FOLDER,
    Lesson,
    Node,
    Task,
    chosen_tasks,
    code_of_solution,
    is_check,
    is_solution,
    lessons,
    magic_of,
    tags,
)

CHECKS = re.compile(r'^from helpers\.checks\.lessons\.(\w+) import ', re.MULTILINE)
SEED = re.compile(r'^SEED *= *(\d{1,9})\b.*$', re.MULTILINE)
# The lesson whose tasks ask for what a cell of the student's own has printed.
LOOKS_FIRST = 'find_the_fault'
LARGEST_SOURCE = 200_000  # letters of a cell


class Handed:
    """A lesson as it was handed out, with its tasks.

    `stars`: those with ★ count, too. `only`: no other ones count, by their numbers or names.
    """

    def __init__(self, lesson: Lesson, *, stars: bool = True, only: str = '') -> None:
        self.lesson = lesson
        self.cells: list[NotebookNode] = lesson.cells
        self._stars, self._only = stars, only

    @cached_property
    def module(self) -> str:
        """The name of the module that has the checks."""
        found = [name for cell in self.cells for name in CHECKS.findall(cell.source)]
        return found[0] if found else self.lesson.name

    @cached_property
    def tasks(self) -> dict[str, Task]:
        """The tasks, by their names."""
        return {task.name: task for task in self.lesson.tasks if task.checks}

    @cached_property
    def counted(self) -> list[str]:
        """The names of the tasks that give a point. Raises ValueError if `only` names none."""
        wanted = chosen_tasks(self._only, self.lesson) if self._only else self.lesson.tasks
        names = {task.name for task in wanted if self._stars or not task.star}
        return [name for name in self.tasks if name in names]

    @cached_property
    def ids(self) -> set[str]:
        """The ids of the cells of tasks."""
        return {cell.id for task in self.tasks.values() for cell in task.cells}


def handed_out(folder: Path = FOLDER, *, stars: bool = True, only: str = '') -> list[Handed]:
    """Return the lessons that have tasks."""
    handed = [Handed(lesson, stars=stars, only=only) for lesson in lessons(folder)]
    return [one for one in handed if one.tasks]


def lesson_of(cells: Iterable[Node], known: Iterable[Handed]) -> Handed | None:
    """Return the lesson of a notebook, or None: by the ids of its tasks, else by its import."""
    cells = list(cells)
    ids = {cell.id for cell in cells}
    imported = {name for cell in cells for name in CHECKS.findall(cell.source)}
    best = max(known, key=lambda one: (len(ids & one.ids), one.module in imported), default=None)
    return best if best and (ids & best.ids or best.module in imported) else None


@dataclass
class Answers:
    """The sources of a student's exercise cells by the ids of the lesson, and what was found.

    `looks` are the cells with `%%terminal` that were added before a cell of the lesson.
    """

    sources: dict[str, str] = field(default_factory=dict)
    looks: dict[str, list[str]] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)
    seed: str = ''

    def changed(self, task: Task) -> bool:
        """Whether the student has written something for a task."""
        return any(
            cell.id in self.sources and _plain(self.sources[cell.id]) != _plain(cell.source)
            for cell in task.exercises
        )


@lru_cache(10_000)
def _plain(source: str) -> str:
    """Return a source without what a mended starter changes, or an editor: see code_only."""
    return code_only(source)


def _below_marker(cells: list[Node]) -> dict[str, str]:
    """Return what `make update` has put below a cell, because the lesson has a newer one there."""
    found = {}
    for cell, marker, own in zip(cells, cells[1:], cells[2:], strict=False):
        if marker.source.strip() == YOURS and own.cell_type == 'code':
            found[cell.id] = own.source
    return found


def answers_of(cells: list[Node], handed: Handed) -> Answers:
    """Return what a student has written in the exercise cells of a lesson."""
    answers = Answers()
    doubled, missing, beside, updated = [], [], [], []
    below = _below_marker(cells)
    reached: dict[int, list[str]] = {}
    by_id: dict[str, list[Node]] = {}
    for cell in cells:
        if cell.cell_type == 'code':
            by_id.setdefault(cell.id, []).append(cell)
    for task in handed.tasks.values():
        inside = _same_task(cells, task)
        in_order = _exercises(inside)
        for place, exercise in enumerate(task.exercises):
            same = by_id.get(exercise.id, [])
            if len(same) > 1:
                doubled.append(str(task.number))
            written = [cell for cell in same if _plain(cell.source) != _plain(exercise.source)]
            if same and not written and exercise.id in below:
                source = below[exercise.id]
                updated.append(str(task.number))
            elif same:
                source = (written or same)[-1].source
            elif place < len(in_order):
                source = in_order[place].source
            else:
                missing.append(str(task.number))
                continue
            if len(source) > LARGEST_SOURCE:
                answers.said.append(f'task {task.number} has a cell of {len(source)} letters')
                continue
            answers.sources[exercise.id] = source
            taught = [cell.source for cell in (*task.exercises, *task.solutions)]
            if words := reaches_for(source, map(code_of_solution, taught)):
                reached.setdefault(task.number, []).extend(words)
        known = {cell.id for cell in handed.cells}
        added = [cell for cell in inside if cell.id not in known]
        has_ids = any(cell.id in known for cell in cells)
        if has_ids and not answers.changed(task) and any(cell.source.strip() for cell in added):
            beside.append(str(task.number))
    for numbers, what in (
        (missing, 'has no cell'),
        (doubled, 'has its cell twice: the last one that was changed counts'),
        (updated, 'has its answer below the newer cell, from before an update: that one counts'),
        (beside, 'is as it was handed out, but a cell was added to it: read that yourself'),
    ):
        if numbers:
            answers.said.append(f'task {", ".join(dict.fromkeys(numbers))} {what}')
    for number, words in reached.items():
        named = ', '.join(dict.fromkeys(words))[:120]
        answers.said.append(f'task {number} reaches for what judges it ({named}): read it yourself')
    # A number decides which robots the lesson has.
    if any(SEED.search(cell.source) for cell in handed.cells):
        found = [SEED.search(cell.source) for cell in cells if cell.cell_type == 'code']
        answers.seed = next((match[1] for match in found if match), '')
        answers.said.append(f'SEED {answers.seed or "is not there"}')
    if handed.lesson.name == LOOKS_FIRST:
        answers.looks = _looks(
            cells, {cell.id for cell in handed.cells if cell.cell_type == 'code'}
        )
    return answers


def _looks(cells: list[Node], known: set[str]) -> dict[str, list[str]]:
    looks, waiting = {}, []
    for cell in cells:
        if cell.id in known:
            if waiting:
                looks[cell.id], waiting = waiting, []
        elif cell.cell_type == 'code' and magic_of(cell.source).name == 'terminal':
            waiting.append(cell.source[:LARGEST_SOURCE])
    return looks


def _same_task(cells: list[Node], task: Task) -> list[Node]:
    """Return the code cells below the heading of a task, in a student's notebook.

    It is that with the same id; else, in a notebook without ids, that whose check has the name of
    the task; else, in one of version 0.3, that with the same title.
    """
    own = Lesson('', Node(cells=cells)).tasks
    same = [one for one in own if one.heading.id == task.heading.id]
    same = same or [one for one in own if one.name == task.name]
    same = same or [one for one in own if one.title == task.title]
    return [cell for one in same[:1] for cell in one.code]


def _exercises(inside: list[Node]) -> list[Node]:
    """Return the exercise cells among those of a task, by their tag, else by their place."""
    tagged = [cell for cell in inside if 'exercise' in tags(cell)]
    if tagged:
        return tagged
    above = []
    for cell in inside:
        if is_check(cell) or is_solution(cell):
            break
        above.append(cell)
    return above
