"""What other places say of the lessons, written from their notebooks.

README.md and teaching.md and the notebook 00 hold tables between two marks:

    <!-- made by `make notebooks`: map of nodes -->
    <!-- end -->

Each lesson ends with a link to the next one. In a timetable, the rows of the lessons are made; what
else stands there (a break, questions) is kept after the lesson after which it stood, with its own
minutes. The functions take and return texts by their path in the checkout, so that nothing is
written before all of it is right.
"""

import re
from collections.abc import Callable
from pathlib import Path

from helpers import progress
from tools.lessons.clean import clean, text_of
from tools.lessons.lesson import GLOSSARY, LANGUAGES, PARTS, ROOT, START, Lesson, paths, read

Texts = dict[str, str]  # by the path in the checkout, such as notebooks/02_lose_messages.ipynb
DOCUMENTS = ('README.md', 'teaching.md')
COMMAND = f'make notebooks LESSON={START}'
BLOCK = re.compile(r'(<!-- made by `make notebooks`: (.+?) -->\n\n)((?:\|.*\n)*)\n?<!-- end -->')
NEXT = re.compile(r'\n*^Next: \[.*\]\(\S+\.ipynb\)$', re.MULTILINE)


def texts_of(root: Path = ROOT) -> Texts:
    """Return the texts of all notebooks, and of the documents that hold tables."""
    files = [*paths(root / 'notebooks'), *(root / name for name in DOCUMENTS)]
    return {
        str(path.relative_to(root)): path.read_text(encoding='utf-8')
        for path in files
        if path.exists()
    }


def lessons_of(texts: Texts) -> list[Lesson]:
    """Return the notebooks among some texts, in teaching order."""
    return [read(texts[path], Path(path).name) for path in sorted(texts) if path.endswith('.ipynb')]


def made(texts: Texts) -> Texts:
    """Return the texts that differ from what the notebooks say, as they should be.

    Raises ValueError with one sentence where a notebook does not say what a table needs.
    """
    lessons = lessons_of(texts)
    _check_timetables(lessons, texts)
    should = {name: _with_tables(texts[name], lessons) for name in DOCUMENTS if name in texts}
    for lesson, following in zip(lessons, [*lessons[1:], None], strict=True):
        for cell in lesson.notebook.cells:
            if cell.cell_type == 'markdown':
                cell.source = _with_tables(cell.source, lessons)
        if lesson.number != GLOSSARY:
            _link(lesson, following if following and following.number != GLOSSARY else None)
        should[f'notebooks/{lesson.file}'] = text_of(clean(lesson.notebook))
    return {path: text for path, text in should.items() if text != texts[path]}


def _check_timetables(lessons: list[Lesson], texts: Texts) -> None:
    documents = '\n'.join(texts.get(name, '') for name in DOCUMENTS)
    blocks = [what.partition(' of ') for _, what, _ in BLOCK.findall(documents)]
    known = [name for kind, _, name in blocks if kind == 'timetable']
    for lesson in lessons if known else []:
        if unknown := [name for name in lesson.timetables if name not in known]:
            raise ValueError(
                f'{lesson.file}: there is no timetable {unknown[0]!r}. '
                f'Give some of {", ".join(known)}.'
            )


def needs_run(lessons: list[Lesson]) -> bool:
    """Say whether the saved table of exercises in notebook 00 is not that of these lessons."""
    table = progress.table(with_exercises(lessons))
    start = [lesson for lesson in lessons if lesson.number == START]
    return any(
        'progress.show()' in cell.source
        and table not in ''.join(output.get('text', '') for output in cell.outputs)
        for lesson in start
        for cell in lesson.notebook.cells
        if cell.cell_type == 'code'
    )


def with_exercises(lessons: list[Lesson]) -> list[progress.Lesson]:
    """Return the notebooks that have exercises, as `helpers.progress` knows them."""
    return [
        progress.Lesson(one.number, one.name, one.title, len(one.exercises))
        for one in lessons
        if one.exercises
    ]


def missing_translations(lessons: list[Lesson]) -> list[str]:
    """Return a sentence for each lesson whose summary lacks a language."""
    return [
        f'{lesson.file}: its summary is not yet in {", ".join(missing)}.'
        for lesson in lessons
        if (missing := [name for key, name in LANGUAGES.items() if key not in lesson.summaries])
    ]


def _link(lesson: Lesson, following: Lesson | None) -> None:
    """Let a notebook lead to the next one: where its link stands, or at its end."""
    cells = [cell for cell in lesson.notebook.cells if cell.cell_type == 'markdown']
    cell = next((cell for cell in cells if NEXT.search(cell.source)), cells[-1] if cells else None)
    if cell:
        rest = NEXT.sub('', cell.source)
        cell.source = f'{rest}\n\nNext: {following.next_link}' if following else rest


def _with_tables(text: str, lessons: list[Lesson]) -> str:
    def new(block: re.Match) -> str:
        return f'{block[1]}{_table(block[2], block[3], lessons)}\n<!-- end -->'

    return BLOCK.sub(new, text)


def _table(what: str, old: str, lessons: list[Lesson]) -> str:
    """Return the lines of the table `what`, which was `old`."""
    kind, _, name = what.partition(' of ')
    if kind not in TABLES:
        raise ValueError(f'No table is called {what!r}. Name one of {", ".join(TABLES)}.')
    head, *rows = TABLES[kind](name, old, lessons)
    lines = [f'| {" | ".join(row)} |\n'.replace('|  |', '| |') for row in [head, *rows]]
    return ''.join([lines[0], '|---' * len(head) + '|\n', *lines[1:]])


def _readme(_name: str, _old: str, lessons: list[Lesson]) -> list[list[str]]:
    return [
        ['', 'lesson', 'at the end you can', 'minutes'],
        *(
            [one.number, f'[{one.title}](notebooks/{one.file})', one.can, str(one.minutes)]
            for one in lessons
            if one.number != GLOSSARY
        ),
    ]


def _map(part: str, _old: str, lessons: list[Lesson]) -> list[list[str]]:
    if part not in PARTS:
        raise ValueError(f'The map has no part {part!r}. Name one of {", ".join(PARTS)}.')
    return [
        ['lesson', 'you can then', 'minutes'],
        *(
            [one.next_link, one.can, str(one.minutes)]
            for one in lessons
            if one.number not in (START, GLOSSARY) and one.part == part
        ),
    ]


def _leave_out(_name: str, _old: str, lessons: list[Lesson]) -> list[list[str]]:
    rows = [[one.number, one.leave_out] for one in lessons if one.leave_out]
    return [['lesson', ''], *rows]


def _alone(_name: str, _old: str, lessons: list[Lesson]) -> list[list[str]]:
    parts = sorted({part for one in lessons if one.is_lesson for part in one.minutes_alone})
    rows = [
        [one.number, *(str(one.minutes_alone.get(part, '')) for part in parts)]
        for one in lessons
        if one.is_lesson
    ]
    return [['lesson', *(part.lower() for part in parts)], *rows]


def _timetable(name: str, old: str, lessons: list[Lesson]) -> list[list[str]]:
    others: dict[str, list[tuple[str, int]]] = {}  # by the number of the lesson before, or ''
    before = ''
    for minutes, what in re.findall(r'^\| \d+:\d\d \| (\d+) \| (.+) \|$', old, re.MULTILINE):
        if lesson := re.match(r'Lesson (\d\d)', what):
            before = lesson[1]
        else:
            others.setdefault(before, []).append((what, int(minutes)))
    rows = {one.number: _row(one, name) for one in lessons if name in one.timetables}
    at, table = 0, [['from', 'minutes', '']]
    for number in sorted(rows.keys() | others.keys()):
        for what, minutes in [rows.get(number, ('', 0)), *others.get(number, [])]:
            if what:
                table.append([f'{at // 60}:{at % 60:02d}', str(minutes), what])
                at += minutes
    return [*table, [f'{at // 60}:{at % 60:02d}', '', 'End']]


def _row(lesson: Lesson, timetable: str) -> tuple[str, int]:
    steps = lesson.timetables[timetable]
    which = f', steps {steps[0]} to {steps[1]}' if steps else ''
    return f'Lesson {lesson.number}{which}', lesson.minutes_of(steps)


TABLES: dict[str, Callable[[str, str, list[Lesson]], list[list[str]]]] = {
    'lessons': _readme,
    'map': _map,
    'what to leave out': _leave_out,
    'minutes': _alone,
    'timetable': _timetable,
}
