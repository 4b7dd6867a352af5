"""A name that is missing in a cell: which cell the student has to run, or what to import."""

from __future__ import annotations

from helpers.lesson import CHECK_BEGINS
from helpers.notebook import names_of

NOT_RUN = (
    'This kernel has not run the first cells of the lesson: choose Run > Run All Above Selected '
    'Cell, then run this cell again.'
)
NO_ANSWER = '{} is not there yet: run the cell of the task above, then this one again.'
NO_GUESS = '{} is a guess: make it in its cell above, run that cell, then this one again.'
OF_A_CLASS = '{0} is for a class: write `from helpers.checks import {0}` above it.'
NOT_FINISHED = (
    '{} comes from the cell that begins with\n    {}\n'
    'That cell has not run to its end: run it, then this one again.'
)
LONGEST = 70  # characters of a line
CLASS = 'join_class', 'leave_class', 'lower_hand', 'raise_hand'


def explain_missing_name(name: str, first_line: str, begun: bool) -> str:
    """Return a sentence for a student whose cell misses a name, '' if the name is the student's.

    `first_line` is that of the cell. `begun` is whether the first cells of the lesson have run.
    """
    if name in CLASS:
        return OF_A_CLASS.format(name)
    if not begun:
        return NOT_RUN
    if name.startswith('my_'):
        return NO_GUESS.format(name)
    if first_line.startswith(CHECK_BEGINS):
        return NO_ANSWER.format(name)
    return ''


class Unfinished:
    """The cells that an error or an Interrupt has ended, by the names that they were to give.

    A later cell then finds no such name, or an old or half made value.
    """

    def __init__(self) -> None:
        self._cells: dict[str, str] = {}  # the first line of a cell, by name

    def ended(self, source: str, well: bool) -> None:
        """Note that a cell has ended, with or without an error."""
        given = names_of(source).given
        if well:
            for name in given:
                self._cells.pop(name, None)
        else:
            lines = (line.strip() for line in source.splitlines())
            line = next((line for line in lines if line and not line.startswith('#')), '')
            if len(line) > LONGEST:
                line = f'{line[:LONGEST]} ...'
            self._cells |= dict.fromkeys(given, line)

    def explain(self, source: str) -> str:
        """Return which cell must run before this one, which has failed; '' if none is known."""
        used = sorted(names_of(source).used & self._cells.keys())
        return NOT_FINISHED.format(used[0], self._cells[used[0]]) if used else ''
