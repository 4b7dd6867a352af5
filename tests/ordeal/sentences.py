"""The sentence beside a program that says what it does not stand, made from known.yaml.

It stands in a cell of the program's lesson, between two marks:

    <!-- made by `make ordeal`: watchful_brake -->
    ...
    <!-- end -->
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from helpers.lesson import Lesson, path_of, paths, read
from ordeal.programs import declared
from ordeal.troubles import OF_INPUTS, SIGNALS
from tools.lessons.clean import text_of, write

Known = dict[str, dict[str, list[str]]]  # as in known.yaml: by program and trouble, the bases
Troubles = list[tuple[str, str]]  # of what, and what

MARKED = re.compile(r'(<!-- made by `make ordeal`: (\w+) -->\n+)(.*?)(\n*<!-- end -->)', re.DOTALL)
KEEPS = {'untimed', 'turtlebot3'}  # the bases that keep the last command
INPUTS = {
    'silent from the start': 'never comes',
    'silent': 'falls silent',
    'frozen': 'hangs',
    'NaN': 'is NaN',
    'empty': 'is empty',
    'old': 'is old',
    'early stamps': 'has early stamps',
    'stamps of another clock': 'has stamps of another clock',
    'a second node': 'comes from two nodes',
}
OTHERS = {
    'jumps': 'its clock jumps',
    'a second voice': 'a second program publishes on `cmd_vel`',
    'is cut': 'the network between it and the robot is cut',
}
# The lesson that takes a trouble away. Where none is named, no program of the course stands it.
FRESH, WHOLE = 'keep_what_is_fresh', 'build_a_robot_program'
GUARDED = 'put_a_program_on_a_robot'
TAKEN_AWAY = {
    **dict.fromkeys(['silent from the start', 'silent', 'old', 'jumps'], FRESH),
    'frozen': WHOLE,
    **dict.fromkeys(['SIGKILL', 'SIGSTOP', 'is cut'], GUARDED),
}


def sentence(name: str, listed: dict[str, list[str]]) -> str:
    """Return what a program does not stand on a base that keeps the last command.

    `listed` is its part of known.yaml.
    """
    by_lesson: dict[str, Troubles] = {}
    for trouble, bases in listed.items():
        if KEEPS & {*bases}:
            of, what = trouble.rsplit(': ', 1)
            lesson = TAKEN_AWAY.get(what, '')
            lesson = '' if lesson == declared()[name]['lesson'] else lesson
            by_lesson.setdefault(lesson, []).append((of, what))
    if not by_lesson:
        return 'On a base that keeps the last command, this program stands all that we have tried.'
    groups = [
        f'if {_one_of(_clauses(troubles), ", or ")}{_link(lesson)}'
        for lesson, troubles in sorted(by_lesson.items(), key=lambda group: group[0] == '')
    ]
    return f'On a base that keeps the last command, this program fails {"; ".join(groups)}.'


def _clauses(troubles: Troubles) -> Iterator[str]:
    inputs: dict[str, list[str]] = {}
    for of, what in troubles:
        if what in OF_INPUTS:
            inputs.setdefault(of, []).append(INPUTS[what])
    for topic, words in inputs.items():
        yield f'`{topic}` {_one_of(words)}'
    if signals := sorted({f'`{what}`' for _, what in troubles if what in SIGNALS}):
        yield f'it gets {_one_of(signals)}'
    for of, what in troubles:
        if what == 'raises':
            yield f'`{of.split(".")[-1]}` raises'
        elif what.startswith('becomes '):
            yield f'`{of.split(".", 1)[-1]}` {what}'
        elif what in OTHERS:
            yield OTHERS[what]


def _one_of(words: Iterable[str], last_of_all: str = ' or ') -> str:
    *first, last = words
    return f'{", ".join(first)}{last_of_all}{last}' if first else last


def _link(lesson: str) -> str:
    if not lesson:
        return ''
    path = path_of(lesson)
    return f' ([the way out]({path.name}))'


def out_of_date(lesson: Lesson, known: Known) -> list[str]:
    """Write the sentences of today into a lesson. Return the names of those that have changed."""
    changed = []

    def written(found: re.Match) -> str:
        if found[2] not in known:  # it was not tried
            return found[0]
        text = f'{found[1]}{sentence(found[2], known[found[2]])}{found[4]}'
        if text != found[0]:
            changed.append(found[2])
        return text

    for cell in lesson.cells:
        if cell.cell_type == 'markdown':
            cell.source = MARKED.sub(written, cell.source)
    return changed


def write_sentences(known: Known) -> None:
    """Write the sentences of today into all lessons."""
    for path in paths():
        before = path.read_text(encoding='utf-8')
        lesson = read(before, path.name)
        if out_of_date(lesson, known):
            write(path, text_of(lesson.notebook), before)
