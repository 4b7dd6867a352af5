"""A name that is missing in a cell: which cell the student has to run, or what to import."""

from __future__ import annotations

import sys

from helpers.lesson import CHECK_BEGINS

NOT_RUN = (
    'This kernel has not run the first cells of the lesson: choose Run > Run All Above Selected '
    'Cell, then run this cell again.'
)
NO_ANSWER = '{} is not there yet: run the cell of the task above, then this one again.'
NO_GUESS = '{} is a guess: make it in its cell above, run that cell, then this one again.'
OF_A_CLASS = '{0} is for a class: write `from helpers.checks import {0}` above it.'
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
    # It is there if the lesson has tasks; no other notebook loads it for a sentence.
    tasks = sys.modules.get('helpers.checks.tasks')
    return tasks.who_makes(name) if tasks else ''
