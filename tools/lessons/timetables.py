"""The timetables of a class, in timetables.yaml: for teaching.md and `make present PLAN=90`.

    90 minutes:
    - {minutes: 8, text: Welcome}
    - {lesson: start_here, steps: [1, 2]}
    - {lesson: publish_and_subscribe}
    - {lesson: lose_messages, steps: [1, 6], write: [two_executors, be_the_queue]}

A title, and what happens, in its order: a lesson by its name, all of it or from one step to
another; or a text, and its minutes. The minutes of a lesson follow from its notebook. `write` has
the tasks that students write, if these are not all: of the others they run the solutions.
"""

from dataclasses import dataclass
from pathlib import Path

import yaml

from helpers.lesson import ROOT, Lesson

FILE = 'tools/lessons/timetables.yaml'  # in the checkout


@dataclass(frozen=True)
class Row:
    """A lesson with its first and last step, None for all of it; or minutes and a text."""

    lesson: str = ''
    steps: tuple[int, int] | None = None
    minutes: int = 0
    text: str = ''
    write: tuple[str, ...] = ()  # names of tasks: none for all of them


@dataclass(frozen=True)
class Timetable:
    """What happens, in its order."""

    title: str
    rows: tuple[Row, ...]


def timetables(root: Path = ROOT) -> list[Timetable]:
    """Return the timetables of a checkout. Raises ValueError with one sentence for bad data."""
    return read((root / FILE).read_text(encoding='utf-8'))


def read(text: str) -> list[Timetable]:
    """Return the timetables of a text in YAML. Raises ValueError with one sentence for bad data."""
    try:
        data = yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        where = f', line {mark.line + 1}' if mark else ''
        raise ValueError(f'{FILE}{where}: this is no YAML.') from None
    if not isinstance(data, dict):
        raise ValueError(f'{FILE} needs a title for each timetable, and its rows below it.')
    return [_timetable(str(title), rows) for title, rows in data.items()]


def minutes_and_lesson(row: Row, lessons: list[Lesson]) -> tuple[int, Lesson | None]:
    """Return the minutes of a row, and its lesson, None for another row.

    Raises ValueError with one sentence if there is no such lesson, or no such step or task in it.
    """
    if not row.lesson:
        return row.minutes, None
    for lesson in lessons:
        if lesson.name == row.lesson:
            if unknown := {*row.write} - {task.name for task in lesson.tasks}:
                raise ValueError(f'{FILE}: {row.lesson} has no task {", ".join(sorted(unknown))}.')
            return lesson.minutes_of(row.steps), lesson
    raise ValueError(f'{FILE} names {row.lesson}, which is no lesson.')


def _timetable(title: str, rows: object) -> Timetable:
    if not isinstance(rows, list) or not rows:
        raise ValueError(f'{FILE}: the timetable {title!r} needs a list of rows.')
    return Timetable(title, tuple(_row(title, number, row) for number, row in enumerate(rows, 1)))


def _row(title: str, number: int, row: object) -> Row:
    match row:
        case {'minutes': int(minutes), 'text': str(text)} if len(row) == 2 and minutes > 0:
            return Row(minutes=minutes, text=text)
        case {'lesson': str(lesson)} if len(row) == 1:
            return Row(lesson)
        case {'lesson': str(lesson), 'steps': [int(first), int(last)]} if first <= last:
            write = row.get('write', [])
            if row.keys() <= {'lesson', 'steps', 'write'} and isinstance(write, list):
                return Row(lesson, (first, last), write=tuple(map(str, write)))
    raise ValueError(
        f'{FILE}: row {number} of {title!r} is {row!r}. Write {{minutes: 15, text: Break}}, '
        '{lesson: start_here} or {lesson: start_here, steps: [1, 2]}.'
    )
