"""What other places say of the lessons, written from their notebooks.

README.md and teaching.md and the notebook 00 hold tables between two marks:

    <!-- made by `make notebooks`: map of nodes -->
    <!-- end -->

The numbers of today are written as well: in titles, in headings of tasks, and in each link to a
lesson or a task. Each lesson ends with a link to the next lesson. What a timetable has is in
timetables.yaml; times, and the minutes and titles of lessons, follow. The functions take and return
texts by their path in the checkout, so that nothing is written before all of it is right.
"""

import os
import re
from collections.abc import Callable
from itertools import zip_longest
from pathlib import Path

from helpers.checks import progress
from helpers.lesson import (
    GLOSSARY,
    PARTS,
    ROOT,
    START,
    Lesson,
    paths,
    read,
    with_mentions,
    without_links,
    write_next,
    write_numbers,
)
from tools.lessons import timetables
from tools.lessons.clean import clean, text_of
from tools.lessons.timetables import Row, Timetable, minutes_and_lesson

Rows = list[list[str]]  # of a table, the first is its head
Texts = dict[str, str]  # by the path in the checkout, such as notebooks/02_lose_messages.ipynb
HISTORY = 'CHANGELOG.md'  # has the numbers of its time
NOT_OURS = {
    '.git',
    '.venv',
    '.jupyter',
    '.handed_out',
    '.site',
    'node_modules',
    'presentation',
    'scratch',
    'site',
}
COMMAND = f'make notebooks LESSON={START}'
BLOCK = re.compile(r'(<!-- made by `make notebooks`: (.+?) -->\n\n)(?:\|.*\n)*\n?<!-- end -->')


def texts_of(root: Path = ROOT) -> Texts:
    """Return the texts of all notebooks, of all documents, and of the timetables."""
    files = [*paths(root / 'notebooks'), *documents(root), root / timetables.FILE]
    return {
        str(path.relative_to(root)): path.read_text(encoding='utf-8')
        for path in files
        if path.exists()
    }


def documents(root: Path = ROOT) -> list[Path]:
    """Return the documents of the course, in which lessons are mentioned."""
    found = []
    for folder, inside, files in os.walk(root):
        inside[:] = [name for name in inside if name not in NOT_OURS]
        found += [Path(folder, name) for name in files if name.endswith('.md') and name != HISTORY]
    return sorted(found)


def lessons_of(texts: Texts) -> list[Lesson]:
    return [read(texts[path], Path(path).name) for path in sorted(texts) if path.endswith('.ipynb')]


def updated(texts: Texts) -> Texts:
    """Return the texts that differ from what the notebooks say, as they should be.

    Raises ValueError with one sentence if a notebook does not say what a table needs.
    """
    lessons = lessons_of(texts)
    for lesson in lessons:
        write_numbers(lesson)
    known = timetables.read(texts[timetables.FILE]) if timetables.FILE in texts else []
    should = {}
    for path, text in texts.items():
        if path.endswith('.md'):
            should[path] = with_mentions(_with_tables(text, lessons, known), lessons)
    for lesson, following in zip(lessons, [*lessons[1:], None], strict=True):
        for cell in lesson.cells:
            if cell.cell_type != 'code':
                text = _with_tables(cell.source, lessons, known)
                cell.source = with_mentions(text, lessons, lesson)
        if lesson.number != GLOSSARY:
            write_next(lesson, following if following and following.number != GLOSSARY else None)
        should[f'notebooks/{lesson.file}'] = text_of(clean(lesson.notebook))
    return {path: text for path, text in should.items() if text != texts[path]}


def needs_run(lessons: list[Lesson]) -> bool:
    """Return whether the saved table of tasks in notebook 00 is not that of these lessons."""
    table = progress.table([lesson for lesson in lessons if lesson.tasks])
    start = [lesson for lesson in lessons if lesson.number == START]
    return any(
        'progress.show()' in cell.source
        and table
        not in ''.join(output.get('data', {}).get('text/plain', '') for output in cell.outputs)
        for lesson in start
        for cell in lesson.code_cells()
    )


def _with_tables(text: str, lessons: list[Lesson], known: list[Timetable]) -> str:
    def new(block: re.Match) -> str:
        return f'{block[1]}{_table(block[2], lessons, known)}\n<!-- end -->'

    return BLOCK.sub(new, text)


def _table(title: str, lessons: list[Lesson], known: list[Timetable]) -> str:
    """Return the lines of the table with a title such as `map of nodes`."""
    kind, _, name = title.partition(' of ')
    if kind not in TABLES:
        raise ValueError(f'No table is called {title!r}. Name one of {", ".join(TABLES)}.')
    head, *rows = TABLES[kind](name, lessons, known)
    lines = [
        f'|{"|".join(f" {cell} " if cell else " " for cell in row)}|\n' for row in [head, *rows]
    ]
    return ''.join([lines[0], '|---' * len(head) + '|\n', *lines[1:]])


def _readme(_name: str, lessons: list[Lesson], _known: list[Timetable]) -> Rows:
    columns = [
        [
            f'[{lesson.number} {lesson.title}](notebooks/{lesson.file})'
            for lesson in lessons
            if _is_in(lesson, part)
        ]
        for part in PARTS
    ]
    return [[part.capitalize() for part in PARTS], *map(list, zip_longest(*columns, fillvalue=''))]


def _is_in(lesson: Lesson, part: str) -> bool:
    return lesson.number not in (START, GLOSSARY) and lesson.part == part


def _map(part: str, lessons: list[Lesson], _known: list[Timetable]) -> Rows:
    if part not in PARTS:
        raise ValueError(f'The map has no part {part!r}. Name one of {", ".join(PARTS)}.')
    return [
        ['lesson', 'you can then', 'minutes'],
        *(
            [lesson.next_link, lesson.can, str(lesson.minutes)]
            for lesson in lessons
            if _is_in(lesson, part)
        ),
    ]


def _leave_out(_name: str, lessons: list[Lesson], _known: list[Timetable]) -> Rows:
    rows = [
        [lesson.number, without_links(lesson.leave_out)] for lesson in lessons if lesson.leave_out
    ]
    return [['lesson', ''], *rows]


def _timetable(title: str, lessons: list[Lesson], known: list[Timetable]) -> Rows:
    found = [timetable for timetable in known if timetable.title == title]
    if not found:
        names = ', '.join(timetable.title for timetable in known)
        raise ValueError(f'{timetables.FILE} has no timetable {title!r}. Name one of {names}.')
    at, table = 0, [['from', 'minutes', '']]
    for row in found[0].rows:
        minutes, lesson = minutes_and_lesson(row, lessons)
        event = _link_to(lesson, row.steps) + _to_write(lesson, row) if lesson else row.text
        table.append([_time(at), str(minutes), event])
        at += minutes
    return [*table, [_time(at), '', 'End']]


def _link_to(lesson: Lesson, steps: tuple[int, int] | None) -> str:
    link = f'[{lesson.number} {lesson.title}](notebooks/{lesson.file})'
    if steps is None:
        return link
    first, last = steps
    return f'{link}, step {first}' if first == last else f'{link}, steps {first} to {last}'


def _to_write(lesson: Lesson, row: Row) -> str:
    """Return which tasks students write, if these are not all."""
    tasks = [task for task in lesson.tasks if task.name in row.write]
    if not tasks:
        return ''
    links = [f'[task {one.number}](notebooks/{lesson.file}{one.anchor})' for one in tasks]
    which = ' and '.join(filter(None, [', '.join(links[:-1]), links[-1]]))
    return f'. Students write {which} only, and run the solutions of the others'


def _time(minutes: int) -> str:
    return f'{minutes // 60}:{minutes % 60:02d}'


TABLES: dict[str, Callable[[str, list[Lesson], list[Timetable]], Rows]] = {
    'lessons': _readme,
    'map': _map,
    'what to leave out': _leave_out,
    'timetable': _timetable,
}
