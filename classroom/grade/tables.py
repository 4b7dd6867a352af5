"""The tables: grades.csv for you, and the files that Moodle and Canvas import.

Moodle takes its grading worksheet back: *Identifier*, *Grade* and *Last modified (grade)* must be
there (`mod/assign/feedback/offline/importgradeslib.php`), in the language of the teacher. Canvas
takes its gradebook: *Student* or *LastName* and *FirstName*, *ID*, perhaps the SIS columns,
*Section*, then assignments (`lib/gradebook_importer.rb`). If their own file lies beside the
submissions, it is filled in, and its maximum counts. Otherwise one with the same columns is made.
"""

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass, field

from classroom.grade.answers import Handed
from classroom.grade.marking import Marking
from classroom.grade.results import Result
from classroom.grade.submissions import Submission

MOODLE = (
    *('Identifier', 'Full name', 'Email address', 'Status', 'Grade', 'Maximum Grade'),
    *('Grade can be changed', 'Last modified (submission)', 'Last modified (grade)'),
    'Feedback comments',
)
IDENTIFIER = re.compile(r'\D+(\d+)')  # `Participant 501`, in the language of the teacher
# A part of a status, as `Submitted for grading - 2 days 3 hours late - Graded`: gradingtable.php.
LATE = re.compile(r' late$')
MOODLE_NEEDS = {'Identifier', 'Grade', 'Last modified (grade)'}
CANVAS = ('Student', 'ID', 'SIS User ID', 'SIS Login ID', 'Section')
POINTS_POSSIBLE = '    Points Possible'  # as Canvas writes it


@dataclass
class Row:
    """A student, and the results of the lessons, by their names. `said` are the sentences.

    `points` are those of the tasks that count.
    """

    student: Submission
    results: dict[str, Result] = field(default_factory=dict)
    points: float = 0
    said: list[str] = field(default_factory=list)


@dataclass
class Sheet:
    """A CSV file of Moodle or Canvas."""

    name: str
    rows: list[list[str]]
    delimiter: str = ','

    def text(self) -> str:
        return text_of(self.rows, self.delimiter)


def read_sheet(name: str, data: bytes) -> Sheet:
    """Return a CSV file. Raises ValueError with one sentence if it is none."""
    try:
        text = data.decode('utf-8-sig')
        first = text.partition('\n')[0]
        delimiter = ';' if first.count(';') > first.count(',') else ','
        rows = list(csv.reader(io.StringIO(text), delimiter=delimiter))
    except (UnicodeDecodeError, csv.Error):
        raise ValueError(f'{name} cannot be read as CSV in UTF-8.') from None
    return Sheet(name, rows, delimiter)


def is_moodle(sheet: Sheet) -> bool:
    return bool(sheet.rows) and {*sheet.rows[0]} >= MOODLE_NEEDS


def is_foreign(sheet: Sheet, students: list[Submission]) -> bool:
    """Whether it is a worksheet of Moodle in another language: the students stand in it."""
    first = [IDENTIFIER.fullmatch(line[0]) for line in sheet.rows[1:] if line]
    numbers = {student.number for student in students if student.system == 'moodle'}
    return not is_moodle(sheet) and all(first) and any(match[1] in numbers for match in first)


def is_canvas(sheet: Sheet) -> bool:
    header = sheet.rows[0] if sheet.rows else []
    names = ['Student'], ['LastName', 'FirstName']
    begins = any(header[: len(name) + 1] == [*name, 'ID'] for name in names)
    return len(header) > 3 and begins and 'Section' in header


def note_late(rows: list[Row], sheet: Sheet | None) -> None:
    """Mark the students who are late by their status in a worksheet."""
    if sheet is None or 'Status' not in sheet.rows[0]:
        return
    at = sheet.rows[0].index('Status')
    by_number = _by_number(rows)
    for line in sheet.rows[1:]:
        is_late = len(line) > at and any(map(LATE.search, line[at].split(' - ')))
        if is_late and (row := _row_of(line, sheet.rows[0], by_number)):
            row.student.late = True


def _by_number(rows: list[Row]) -> dict[str, Row]:
    return {row.student.number: row for row in rows if row.student.system == 'moodle'}


def _row_of(line: list[str], header: list[str], by_number: dict[str, Row]) -> Row | None:
    """Return the student of a line of a worksheet, by number and name.

    If a group has handed in, its number may be that of somebody else: the name must be the same,
    too. The anonymous have no other name than their number.
    """
    number = IDENTIFIER.fullmatch(line[header.index('Identifier')])
    row = by_number.get(number[1]) if number else None
    if row and not row.student.anonymous and 'Full name' in header:
        return row if _is_same(line[header.index('Full name')], row.student.name) else None
    return row


def grades(rows: list[Row], lessons: list[Handed], marking: Marking) -> str:
    """Return grades.csv: a row for each student, a column for each task."""
    columns = [(one.lesson.name, task) for one in lessons for task in one.tasks]
    header = ['name', 'id', 'late', *(f'{lesson} {task}' for lesson, task in columns)]
    most = f'{sum(map(marking.most, lessons)):.10g}'
    table = [[*header, 'points', 'of', 'minutes to judge', 'said']]
    for row in rows:
        values = []
        for lesson, task in columns:
            result = row.results.get(lesson)
            outcome = result.tasks.get(task) if result else None
            values.append(f'{marking.share(result, task):.3g}' if outcome else '')
        minutes = sum(result.minutes for result in row.results.values())
        student = row.student
        said = '; '.join(row.said)
        points = f'{row.points:.10g}' if row.results else ''
        end = [points, most, f'{minutes:.1f}', harmless(said)]
        late = 'late' if student.late else ''
        table.append([harmless(student.name), student.number, late, *values, *end])
    return text_of(table)


def harmless(text: str) -> str:
    """Return a text that no spreadsheet takes for a formula."""
    return f"'{text}" if text[:1] in tuple('=+-@\t\r') else text


def moodle(rows: list[Row], most: float, sheet: Sheet | None) -> tuple[str, list[str]]:
    """Return a grading worksheet, and the names of students who are not in it.

    Students of whom nothing was judged are left as they are.
    """
    by_number = _by_number(rows)
    if sheet is None:
        lines = [[*MOODLE]]
        for number, row in by_number.items():
            known = {
                'Identifier': f'Participant {number}',
                'Full name': row.student.name,
                'Maximum Grade': f'{most:.2f}',
                'Grade can be changed': 'Yes',
            }
            lines.append([known.get(column, '') for column in MOODLE])
        sheet = Sheet('', lines)
    header, *lines = sheet.rows
    at = {column: header.index(column) for column in header}
    filled, absent = [header], {*by_number}
    for line in lines:
        line = [*line, *[''] * (len(header) - len(line))]
        row = _row_of(line, header, by_number)
        if row:
            absent.discard(row.student.number)
        if row and row.results:
            maximum = _number(line[at['Maximum Grade']]) if 'Maximum Grade' in at else None
            line[at['Grade']] = f'{row.points * (maximum or most) / most:.2f}'
            if 'Feedback comments' in at:
                line[at['Feedback comments']] = f'{row.points:.10g} of {most:.10g} points.'
        elif row and row.said and 'Feedback comments' in at:
            line[at['Feedback comments']] = f'Not judged: {"; ".join(row.said)}.'
        filled.append(line)
    names = [by_number[number].student.name for number in sorted(absent)]
    return text_of(filled, sheet.delimiter), names


def _is_same(name: str, in_download: str) -> bool:
    """Whether two names are that of one student: that of a file lacks some letters."""
    one, other = (re.sub(r'[\W_]', '', text).casefold() for text in (name, in_download))
    return one == other


def canvas(rows: list[Row], most: float, sheet: Sheet | None, title: str) -> str:
    """Return a gradebook with one assignment. Raises ValueError if the sheet has more that fit."""
    known = [row for row in rows if row.student.system == 'canvas' and not row.student.anonymous]
    by_number = {row.student.number: row for row in known}
    if sheet is None:
        lines = [[*CANVAS, title], [POINTS_POSSIBLE, *[''] * (len(CANVAS) - 1), f'{most:.10g}']]
        for number, row in by_number.items():
            points = f'{row.points:.10g}' if row.results else ''
            lines.append([row.student.name, number, '', '', '', points])
        return text_of(lines)
    header, *lines = sheet.rows
    info = header.index('Section') + 1
    assignments = [n for n, name in enumerate(header) if n >= info and re.search(r'\(\d+\)$', name)]
    wanted = title.casefold()
    fit = [n for n in assignments if wanted in header[n].casefold()] or assignments
    if len(fit) != 1:
        names = ', '.join(header[n] for n in fit) or 'none'
        raise ValueError(
            f'{sheet.name} has these assignments: {names}. Name yours with ASSIGNMENT= and its id.'
        )
    column, number = fit[0], header.index('ID')
    maximum = None
    filled = [[*header[:info], header[column]]]
    for line in lines:
        line = [*line, *[''] * (len(header) - len(line))]
        score = line[column]
        if 'Points Possible' in line[0]:
            maximum = _number(line[column])
        elif (row := by_number.get(line[number].strip())) and row.results:
            score = f'{row.points * (maximum or most) / most:.2f}'
        filled.append([*line[:info], score])
    return text_of(filled, sheet.delimiter)


def _number(text: str) -> float | None:
    try:
        return float(text.replace(',', '.'))
    except ValueError:
        return None


def text_of(rows: list, delimiter: str = ',') -> str:
    lines = io.StringIO()
    csv.writer(lines, delimiter=delimiter, lineterminator='\n').writerows(rows)
    return lines.getvalue()
