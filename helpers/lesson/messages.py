"""The messages of errors that a lesson makes or names, each with what it means.

A message is one of these:

    shown   a line in the saved output of a cell that a tool wrote when something failed; what it
            means is what the next text says
    row     a row of a table with the columns `message`, and `cause` or `look at`, say: what is in
            backticks in the first one, and the rest of the row
    named   what looks like a message, in backticks or italics in a text: its sentence says what
            it means
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from helpers.lesson.cells import Node, is_for_instructors, is_question, tags
from helpers.lesson.lesson import Lesson, is_solution
from helpers.lesson.mentions import without_links

# How the tools of ROS 2, Python, CMake and compilers begin what has failed.
LOOKS = re.compile(
    r'\b[\w.]*(Error|Exception|InvalidHandle|InvalidResourceName)\b'
    r'|^(CMake Error|fatal error|error|ERROR|Failed|failed)\b'
    r'|\b([Cc]annot|[Cc]ould not|[Uu]nable to|[Nn]o such|not found|undefined symbol|bad yield)\b'
    r'|\b([Ii]nvalid|[Ff]ailed|incompatible|not declared|deprecated)\b'
)
BEGINS_LINE = re.compile(
    r'^(\S*: )?([\w.]*(Error|Exception)\b|ERROR|error:|CMake Error|fatal error'
    r'|Setting parameter failed|Set parameter \w+ failed|  Invalid )'
    r'|(Error|Exception): |[Cc]annot locate|was not found|rclpy\.\S+(Error|Exception)'
)
HEADING = re.compile(r'^#{2,4} (.+)$', re.MULTILINE)
CODE = re.compile(r'`([^`\n]+)`')
ITALIC = re.compile(r'(?<![*\w])\*([A-Z][^*\n]+)\*(?!\*)')
IN_BRACKETS = re.compile(r'\s+\([^()]*\)')
SECOND_COLUMN = {
    'cause',
    'look at',
    'where to look',
    'means',
    'what it means',
    'cure',
    'what helps',
}
LEAST_WORDS = 3
LONGEST = 300


class Message(NamedTuple):
    """`meaning` is Markdown, `step` the heading above, `cell` the id of its cell."""

    text: str
    meaning: str
    lesson: Lesson
    step: str
    cell: str
    shown: bool


def messages(lesson: Lesson) -> list[Message]:
    """Return the messages of a lesson in the order of its cells, each once."""
    found: dict[str, Message] = {}
    step = ''
    cells = [cell for cell in lesson.cells if not is_for_instructors(cell)]
    for place, cell in enumerate(cells):
        if cell.cell_type == 'markdown':
            step = next(iter(HEADING.findall(cell.source)), step)
            said = _in_text(cell.source) if not is_question(cell) else ()
        else:
            after, before = _text(cells[place + 1 :]), _text(cells[:place][::-1])
            said = ((line, _meaning(line, after, before)) for line in _in_outputs(cell))
        for text, meaning in said:
            shown = cell.cell_type == 'code'
            message = Message(text, meaning, lesson, step, cell.id, shown)
            if text not in found or shown and not found[text].shown:
                found[text] = message
    return list(found.values())


def _in_outputs(cell: Node) -> Iterator[str]:
    """Yield the lines of errors in what a cell has printed, which is no answer to a task."""
    if cell.cell_type != 'code' or is_solution(cell) or {'predict', 'check'} & tags(cell):
        return
    for output in cell.get('outputs', ()):
        if output['output_type'] == 'error':
            yield f'{output["ename"]}: {output["evalue"]}'[:LONGEST]
        if output['output_type'] == 'stream':
            for line in ''.join(output['text']).splitlines():
                if BEGINS_LINE.search(line):
                    yield line.strip()[:LONGEST]


def _text(cells: list[Node]) -> str:
    return next((cell.source for cell in cells if cell.cell_type == 'markdown'), '')


def _meaning(message: str, after: str, before: str) -> str:
    """Return the line after a message that names it, or what is said first, or what led to it."""
    naming = [line for line in after.split('\n') if message in line or _named_part(line, message)]
    if after.startswith('#') and not naming:
        parts = _paragraphs(before)[::-1]
    else:
        parts = [*naming, *_paragraphs(after)]
    return without_links(' '.join(parts[0].removeprefix('- ').split())) if parts else ''


def _named_part(line: str, message: str) -> bool:
    """Return whether a line has a part of this message in backticks or italics."""
    texts = [*CODE.findall(line), *ITALIC.findall(line)]
    return any(len(text.split()) >= LEAST_WORDS and text in message for text in texts)


def _paragraphs(text: str) -> list[str]:
    parts = text.split('\n\n')
    return [part for part in parts if part and not part.startswith(('#', '|', '!', '<', '```'))]


def _in_text(text: str) -> Iterator[tuple[str, str]]:
    is_table = False
    for line in map(str.strip, text.split('\n')):
        if not line.startswith('|'):
            is_table = False
            yield from _in_sentences(without_links(line))
            continue
        cells = [part.strip() for part in re.split(r'(?<!\\)\|', line)[1:-1]]
        heads = [cell.lower().strip('* ') for cell in cells]
        is_table = is_table or heads[0] == 'message' and bool(SECOND_COLUMN & set(heads[1:]))
        if is_table:
            yield from _in_row(cells)


def _in_row(cells: list[str]) -> Iterator[tuple[str, str]]:
    first = IN_BRACKETS.sub('', cells[0])
    beside = CODE.sub('', first).strip(' ,')
    meaning = without_links(' '.join(cells[1:]))
    for text in CODE.findall(first):
        yield text, f'{beside}: {meaning}' if beside else meaning


def _in_sentences(line: str) -> Iterator[tuple[str, str]]:
    for sentence in re.split(r'(?<=[.!?]) (?=[A-Z`*])', line):
        for text in [*CODE.findall(sentence), *ITALIC.findall(sentence)]:
            is_code = text.endswith((')', '='))
            if LOOKS.search(text) and len(text.split()) >= LEAST_WORDS and not is_code:
                yield text, sentence.removeprefix('- ')
