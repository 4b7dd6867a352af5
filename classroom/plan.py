"""A timetable for the slides: its lessons, their steps and their minutes."""

import itertools
import re
from typing import NamedTuple

from helpers.lesson import lessons
from tools.lessons.timetables import Timetable, minutes_and_lesson, timetables


class Row(NamedTuple):
    """A row of a timetable. Without a file it is no lesson; without steps it is all of them.

    `write` has the names of the tasks that students write, none for all.
    """

    minutes: int
    file: str
    steps: tuple[int, int] | None
    write: tuple[str, ...] = ()


class Plan(NamedTuple):
    """What happens, in its order."""

    title: str
    rows: list[Row]

    @property
    def steps(self) -> dict[str, tuple[int, int] | None]:
        """The lessons in their order, by file name: the first and the last step, None for all."""
        found = {}
        for row in self.rows:
            if row.file:  # a lesson may come again, with later steps
                found[row.file] = row.steps and (found.get(row.file, row.steps)[0], row.steps[1])
        return found

    def write(self, file: str) -> set[str]:
        """Return the names of the tasks of a lesson that students write, none for all."""
        return {name for row in self.rows if row.file == file for name in row.write}

    @property
    def from_first_lesson(self) -> list[Row]:
        """The rows without what comes before the first lesson."""
        return list(itertools.dropwhile(lambda row: not row.file, self.rows))


NO_PLAN = Plan('', [])


def plan_of(name: str) -> Plan:
    """Return the timetable whose title holds this word, such as `90` or `half`.

    Raises ValueError with one sentence if there is none, or more than one, or if a notebook does
    not say what it needs.
    """
    known = timetables()
    found = [one for one in known if re.search(rf'\b{re.escape(name)}\b', one.title, re.I)]
    if len(found) != 1:
        names = ', '.join(repr(timetable.title) for timetable in known)
        raise ValueError(f'There is no single timetable {name!r}. Give a word of one: {names}.')
    return _plan(found[0])


def _plan(timetable: Timetable) -> Plan:
    known = lessons()
    rows = []
    for row in timetable.rows:
        minutes, lesson = minutes_and_lesson(row, known)
        rows.append(Row(minutes, lesson.file if lesson else '', row.steps, row.write))
    return Plan(timetable.title, rows)
