"""A timetable of teaching.md: its lessons, and their steps."""

import itertools
import re
from typing import NamedTuple

from helpers.lesson import ROOT
from tools.lessons.tables import BLOCK, LINK, ROW

HEADING = re.compile(r'^### (.+)$', re.MULTILINE)


class Row(NamedTuple):
    """A row of a timetable. Without a file it is no lesson; without steps it is all of them."""

    minutes: int
    file: str
    steps: tuple[int, int] | None


class Plan(NamedTuple):
    """What happens, as (minutes, text)."""

    title: str
    rows: list[tuple[str, str]]

    @property
    def steps(self) -> dict[str, tuple[int, int] | None]:
        """The lessons in their order, by file name: the first and the last step, None for all."""
        found = {}
        for _, what in self.rows:
            file, steps = lesson_of(what)
            if file:  # a lesson may come again, with later steps
                found[file] = steps and (found.get(file, steps)[0], steps[1])
        return found

    @property
    def from_first_lesson(self) -> list[Row]:
        """The rows without what comes before the first lesson."""
        rows = [Row(int(minutes), *lesson_of(what)) for minutes, what in self.rows]
        return list(itertools.dropwhile(lambda row: not row.file, rows))


def lesson_of(what: str) -> tuple[str, tuple[int, int] | None]:
    """Return the file of a row's lesson and its steps, None for all; no file for another row."""
    if not (link := LINK.match(what)):
        return '', None
    _, path, first, last = link.groups()
    return path.rpartition('/')[2], (int(first), int(last or first)) if first else None


NO_PLAN = Plan('', [])


def plans() -> list[Plan]:
    """Return the timetables of teaching.md."""
    text = (ROOT / 'teaching.md').read_text(encoding='utf-8')
    tables = [block for block in BLOCK.finditer(text) if block[2] == 'timetable']
    return [
        Plan(HEADING.findall(text, 0, table.start())[-1], ROW.findall(table[3])) for table in tables
    ]


def plan_of(name: str) -> Plan:
    """Return the timetable whose heading holds this word, such as `90` or `half`.

    Raises ValueError with one sentence if there is none, or more than one.
    """
    known = plans()
    found = [plan for plan in known if re.search(rf'\b{re.escape(name)}\b', plan.title, re.I)]
    if len(found) != 1:
        names = ', '.join(repr(plan.title) for plan in known)
        raise ValueError(f'There is no single timetable {name!r}. Give a word of one: {names}.')
    return found[0]
