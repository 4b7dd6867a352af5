"""What the instructor's notes of a lesson say: of a step, and how many minutes they plan."""

import re

from nbconvert.filters import markdown2html
from nbformat import NotebookNode

from helpers.lesson import (
    first_heading,
    has_heading,
    minutes_of_note,
    step_number,
    tags,
    without_links,
)


def of_step(cells: list[NotebookNode], at: int) -> dict:
    """Return the notes of the step of cell `at`, and its minutes: own, to its end, in all.

    `number` is that of the step, 0 for one that has none.
    """
    steps = [i for i, cell in enumerate(cells) if has_heading(cell, '##? ')]
    notes = [i for i, cell in enumerate(cells) if 'notes' in tags(cell)]
    minutes = {i: minutes_of_note(cells[i].source) for i in notes}
    step = max((i for i in steps if i <= at), default=0)
    end = min((i for i in steps if i > at), default=len(cells))
    before = [i for i in notes if i < end]
    title = first_heading(cells[step].source)
    own = [i for i in before if i > step]
    return {
        'number': step_number(cells[step]),
        'lesson': first_heading(cells[0].source),
        'step': title,
        'notes': ''.join(markdown2html(_with_breaks(without_links(cells[i].source))) for i in own),
        'own': sum(minutes[i] for i in own),
        'planned': sum(minutes[i] for i in before),
        'all': sum(minutes.values()),
    }


def _with_breaks(source: str) -> str:
    """Return a text whose lines stay lines in Markdown."""
    return re.sub(r'(?<=\S)\n(?=\S)', '  \n', source)
