"""Which lesson is it, and what has the student written? All of it is read as text."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from nbformat import NotebookNode

from tools.lessons.lesson import FOLDER, Lesson, lessons, tags

CHECKS = re.compile(r'^from helpers\.checks\.lessons\.(\w+) import ', re.MULTILINE)
CHECK = re.compile(r'check\((\d+)')
HEADING = re.compile(r'^### ✎ Task (\d+)( ★)?', re.MULTILINE)
SEED = re.compile(r'^SEED *= *(\d{1,9})\b.*$', re.MULTILINE)
# The lesson whose tasks ask for what a cell of the student's own has printed.
LOOKS_FIRST = 'find_the_fault'
LOOK = '%%terminal'
LARGEST_SOURCE = 200_000  # letters of a cell
# What an answer of a lesson has no need for, and what forges a verdict would use.
MACHINERY = re.compile(
    r'helpers\.checks|ros2_notebooks|sys\.modules|get_ipython|gc\.get_|_getframe|ctypes|/proc/'
    r'|\.ipynb|__globals__|__closure__|__code__|inspect\.'
)


@dataclass
class Task:
    """A task of a lesson: its exercise cells, in their order, and the cells of its checks."""

    number: int
    exercises: list[NotebookNode] = field(default_factory=list)
    checks: list[NotebookNode] = field(default_factory=list)
    solutions: list[NotebookNode] = field(default_factory=list)


class Handed:
    """A lesson as it was handed out, with its tasks.

    `stars`: those with ★ count, too. `only`: no other ones count.
    """

    def __init__(self, lesson: Lesson, *, stars: bool = True, only: Collection[int] = ()) -> None:
        self.lesson = lesson
        self.cells = lesson.notebook.cells
        self._stars, self._only = stars, only

    @cached_property
    def module(self) -> str:
        """The name of the module that has the checks."""
        found = [name for cell in self.cells for name in CHECKS.findall(cell.source)]
        return found[0] if found else self.lesson.name

    @cached_property
    def tasks(self) -> dict[int, Task]:
        """The tasks, by their numbers."""
        tasks: dict[int, Task] = {}
        waiting: list[NotebookNode] = []
        for cell in self.cells:
            if 'exercise' in tags(cell):
                waiting.append(cell)
            elif 'check' in tags(cell) and (match := CHECK.search(cell.source)):
                task = tasks.setdefault(int(match[1]), Task(int(match[1])))
                task.checks.append(cell)
                task.exercises += waiting
                waiting = []
            elif 'solution' in tags(cell):
                number = int(cell.source.split(maxsplit=2)[1])
                tasks.setdefault(number, Task(number)).solutions.append(cell)
        return tasks

    @cached_property
    def counted(self) -> list[int]:
        """The numbers of the tasks that give a point."""
        headings = [heading for cell in self.cells for heading in HEADING.findall(cell.source)]
        starred = set() if self._stars else {int(number) for number, star in headings if star}
        wanted = {*(self._only or self.tasks)} - starred
        return [number for number in self.tasks if number in wanted]

    @cached_property
    def ids(self) -> set[str]:
        """The ids of the cells of tasks."""
        return {
            cell.id
            for task in self.tasks.values()
            for cell in (*task.exercises, *task.checks, *task.solutions)
        }


def handed_out(
    folder: Path = FOLDER, *, stars: bool = True, only: Collection[int] = ()
) -> list[Handed]:
    """Return the lessons that have tasks."""
    handed = [Handed(lesson, stars=stars, only=only) for lesson in lessons(folder)]
    return [one for one in handed if one.tasks]


@dataclass
class Cell:
    """A cell of a student's notebook, whatever else it has."""

    kind: str
    source: str
    id: str
    tags: set[str]


def cells_of(data: bytes) -> list[Cell]:
    """Return the cells of a notebook. Raises ValueError with the end of a sentence."""
    if not data.strip():
        raise ValueError('it is empty')
    try:
        notebook = json.loads(data)
    except (ValueError, RecursionError):
        raise ValueError(_why_no_json(data)) from None
    cells = notebook.get('cells') if isinstance(notebook, dict) else None
    if not isinstance(cells, list):
        raise ValueError('it is no notebook: it has no cells')
    return [_cell(cell) for cell in cells if isinstance(cell, dict)]


def _why_no_json(data: bytes) -> str:
    start = data.lstrip()[:1000].lower()
    if start.startswith((b'<!doctype', b'<html')):
        return 'it is a web page, no notebook'
    if re.search(rb'^(<{7}|>{7}) ', data, re.MULTILINE):
        return 'it is broken: git has left its marks of a conflict in it'
    return 'it is broken: it is no JSON'


def _cell(cell: dict) -> Cell:
    source = cell.get('source', '')
    if isinstance(source, list):
        source = ''.join(line for line in source if isinstance(line, str))
    source = source if isinstance(source, str) else ''
    # Half of a pair of UTF-16, which JSON may name, is no text.
    source = source.encode('utf-8', 'replace').decode()
    metadata = cell.get('metadata')
    named = metadata.get('tags') if isinstance(metadata, dict) else None
    found = {tag for tag in named if isinstance(tag, str)} if isinstance(named, list) else set()
    return Cell(str(cell.get('cell_type')), source, str(cell.get('id', '')), found)


def lesson_of(cells: Iterable[Cell], known: Iterable[Handed]) -> Handed | None:
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


def _plain(source: str) -> str:
    """Return a source without the white space that an editor adds or takes."""
    return '\n'.join(line.rstrip() for line in source.strip().splitlines())


def answers_of(cells: list[Cell], handed: Handed) -> Answers:
    """Return what a student has written in the exercise cells of a lesson."""
    answers = Answers()
    doubled, missing, looked_at, beside = [], [], [], []
    by_id: dict[str, list[Cell]] = {}
    for cell in cells:
        if cell.kind == 'code':
            by_id.setdefault(cell.id, []).append(cell)
    for task in handed.tasks.values():
        in_order = _below_heading(cells, task.number)
        for place, exercise in enumerate(task.exercises):
            same = by_id.get(exercise.id, [])
            if len(same) > 1:
                doubled.append(str(task.number))
            written = [cell for cell in same if _plain(cell.source) != _plain(exercise.source)]
            if same:
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
            taught = '\n'.join(cell.source for cell in (*task.exercises, *task.solutions))
            if set(MACHINERY.findall(source)) - set(MACHINERY.findall(taught)):
                looked_at.append(str(task.number))
        known = {cell.id for cell in handed.cells}
        added = [cell for cell in _inside(cells, task.number) if cell.id not in known]
        has_ids = any(cell.id in known for cell in cells)
        if has_ids and not answers.changed(task) and any(cell.source.strip() for cell in added):
            beside.append(str(task.number))
    for numbers, what in (
        (missing, 'has no cell'),
        (doubled, 'has its cell twice: the last one that was changed counts'),
        (beside, 'is as it was handed out, but a cell was added to it: read that yourself'),
        (looked_at, 'reaches for what judges it: read it yourself'),
    ):
        if numbers:
            answers.said.append(f'task {", ".join(dict.fromkeys(numbers))} {what}')
    # A number decides which robots the lesson has.
    if any(SEED.search(cell.source) for cell in handed.cells):
        found = [SEED.search(cell.source) for cell in cells if cell.kind == 'code']
        answers.seed = next((match[1] for match in found if match), '')
        answers.said.append(f'SEED {answers.seed or "is not there"}')
    if handed.lesson.name == LOOKS_FIRST:
        answers.looks = _looks(
            cells, {cell.id for cell in handed.cells if cell.cell_type == 'code'}
        )
    return answers


def _looks(cells: list[Cell], known: set[str]) -> dict[str, list[str]]:
    looks, waiting = {}, []
    for cell in cells:
        if cell.id in known:
            if waiting:
                looks[cell.id], waiting = waiting, []
        elif cell.kind == 'code' and cell.source.startswith(LOOK):
            waiting.append(cell.source[:LARGEST_SOURCE])
    return looks


def _below_heading(cells: list[Cell], task: int) -> list[Cell]:
    """Return the exercise cells below the heading of a task, by their tag, else by their place."""
    found = _inside(cells, task)
    tagged = [cell for cell in found if 'exercise' in cell.tags]
    if tagged:
        return tagged
    above = []
    for cell in found:
        if CHECK.match(cell.source) or cell.source.startswith('%%solution'):
            break
        above.append(cell)
    return above


def _inside(cells: list[Cell], task: int) -> list[Cell]:
    """Return the code cells between the heading of a task and the next heading."""
    inside, found = False, []
    for cell in cells:
        heading = HEADING.search(cell.source) if cell.kind == 'markdown' else None
        if heading:
            inside = int(heading[1]) == task
        elif inside and cell.kind == 'markdown' and cell.source.startswith('#'):
            inside = False
        elif inside and cell.kind == 'code':
            found.append(cell)
    return found
