"""What other places say of the lessons, written from their notebooks.

README.md and teaching.md and the notebook 00 hold tables between two marks:

    <!-- made by `make notebooks`: map of nodes -->
    <!-- end -->

Each lesson ends with a link to the next lesson. What a timetable has is in timetables.yaml; times,
and the minutes and titles of lessons, follow. The functions take and return texts by their path in
the checkout, so that nothing is written before all of it is right.
"""

import re
from collections.abc import Callable
from itertools import zip_longest
from pathlib import Path

from helpers.checks import progress
from tools.lessons import timetables
from tools.lessons.clean import clean, text_of
from tools.lessons.lesson import GLOSSARY, PARTS, ROOT, START, Lesson, paths, read
from tools.lessons.timetables import Timetable, minutes_and_lesson

Rows = list[list[str]]  # of a table, the first is its head
Texts = dict[str, str]  # by the path in the checkout, such as notebooks/02_lose_messages.ipynb
DOCUMENTS = ('README.md', 'teaching.md')
COMMAND = f'make notebooks LESSON={START}'
BLOCK = re.compile(r'(<!-- made by `make notebooks`: (.+?) -->\n\n)(?:\|.*\n)*\n?<!-- end -->')
NEXT = re.compile(r'\n*^Next: \[.*\]\(\S+\.ipynb\)$', re.MULTILINE)


def texts_of(root: Path = ROOT) -> Texts:
    """Return the texts of all notebooks, of the documents that hold tables, and the timetables."""
    others = (root / name for name in (*DOCUMENTS, timetables.FILE))
    files = [*paths(root / 'notebooks'), *others]
    return {
        str(path.relative_to(root)): path.read_text(encoding='utf-8')
        for path in files
        if path.exists()
    }


def lessons_of(texts: Texts) -> list[Lesson]:
    return [read(texts[path], Path(path).name) for path in sorted(texts) if path.endswith('.ipynb')]


def updated(texts: Texts) -> Texts:
    """Return the texts that differ from what the notebooks say, as they should be.

    Raises ValueError with one sentence if a notebook does not say what a table needs.
    """
    lessons = lessons_of(texts)
    known = timetables.read(texts[timetables.FILE]) if timetables.FILE in texts else []
    should = {
        name: _with_tables(texts[name], lessons, known) for name in DOCUMENTS if name in texts
    }
    for lesson, following in zip(lessons, [*lessons[1:], None], strict=True):
        for cell in lesson.notebook.cells:
            if cell.cell_type == 'markdown':
                cell.source = _with_tables(cell.source, lessons, known)
        if lesson.number != GLOSSARY:
            _link(lesson, following if following and following.number != GLOSSARY else None)
        should[f'notebooks/{lesson.file}'] = text_of(clean(lesson.notebook))
    return {path: text for path, text in should.items() if text != texts[path]}


def needs_run(lessons: list[Lesson]) -> bool:
    """Return whether the saved table of tasks in notebook 00 is not that of these lessons."""
    table = progress.table(with_tasks(lessons))
    start = [lesson for lesson in lessons if lesson.number == START]
    return any(
        'progress.show()' in cell.source
        and table not in ''.join(output.get('text', '') for output in cell.outputs)
        for lesson in start
        for cell in lesson.notebook.cells
        if cell.cell_type == 'code'
    )


def with_tasks(lessons: list[Lesson]) -> list[progress.Lesson]:
    """Return the notebooks that have tasks, as `helpers.checks.progress` knows them."""
    return [
        progress.Lesson(lesson.number, lesson.name, lesson.title, len(lesson.tasks))
        for lesson in lessons
        if lesson.tasks
    ]


def _link(lesson: Lesson, following: Lesson | None) -> None:
    """Let a notebook lead to the next one: where its link stands, or at its end."""
    cells = [cell for cell in lesson.notebook.cells if cell.cell_type == 'markdown']
    cell = next((cell for cell in cells if NEXT.search(cell.source)), cells[-1] if cells else None)
    if cell:
        rest = NEXT.sub('', cell.source)
        cell.source = f'{rest}\n\nNext: {following.next_link}' if following else rest


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
    rows = [[lesson.number, lesson.leave_out] for lesson in lessons if lesson.leave_out]
    return [['lesson', ''], *rows]


def _timetable(title: str, lessons: list[Lesson], known: list[Timetable]) -> Rows:
    found = [timetable for timetable in known if timetable.title == title]
    if not found:
        names = ', '.join(timetable.title for timetable in known)
        raise ValueError(f'{timetables.FILE} has no timetable {title!r}. Name one of {names}.')
    at, table = 0, [['from', 'minutes', '']]
    for row in found[0].rows:
        minutes, lesson = minutes_and_lesson(row, lessons)
        event = _link_to(lesson, row.steps) if lesson else row.text
        table.append([_time(at), str(minutes), event])
        at += minutes
    return [*table, [_time(at), '', 'End']]


def _link_to(lesson: Lesson, steps: tuple[int, int] | None) -> str:
    link = f'[{lesson.number} {lesson.title}](notebooks/{lesson.file})'
    if steps is None:
        return link
    first, last = steps
    return f'{link}, step {first}' if first == last else f'{link}, steps {first} to {last}'


def _time(minutes: int) -> str:
    return f'{minutes // 60}:{minutes % 60:02d}'


TABLES: dict[str, Callable[[str, list[Lesson], list[Timetable]], Rows]] = {
    'lessons': _readme,
    'map': _map,
    'what to leave out': _leave_out,
    'timetable': _timetable,
}
