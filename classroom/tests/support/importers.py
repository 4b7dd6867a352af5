"""Which grades Moodle and Canvas would take from a file: the rules of their importers, in short.

Moodle 4.5, `mod/assign/feedback/offline`: `importgradeslib.php` finds the columns by their names,
and a student by what follows `Participant `; `locallib.php` says which rows are skipped.
`mod/assign/feedback/file/importziplib.php` reads the names in a zip of feedback. Canvas,
`lib/gradebook_importer.rb`. We have neither to try them.
"""

import csv
import io
import re
from dataclasses import dataclass

MINUTE = 60
DOWNLOADED_S = 1_000_000  # when the worksheet was downloaded
NOW_S = DOWNLOADED_S + 3600
HIDDEN_USER = 'Participant '
PLUGINS = {('assignsubmission', 'file'), ('assignsubmission', 'onlinetext')}


@dataclass
class Graded:
    """A grade in Moodle. Feedback alone makes one, too: it has no grade yet, and a time."""

    grade: float | None = None
    modified_s: float = NOW_S


def worksheet(numbers, maximum, status=None, names=None) -> bytes:
    """Return a grading worksheet as Moodle writes it. `names` is left out of an anonymous one."""
    rows = []
    for number in numbers:
        name = f'Student {number - 500:03}' if names is None else names[number]
        row = {'Identifier': f'{HIDDEN_USER}{number}', 'Full name': name}
        row |= {'Status': (status or {}).get(number, 'Submitted for grading'), 'Grade': ''}
        row |= {'Maximum Grade': f'{maximum:.2f}', 'Grade can be changed': 'Yes'}
        row |= {'Last modified (submission)': 'Monday, 23 November 2026, 9:41 AM'}
        rows.append(row | {'Last modified (grade)': '-', 'Feedback comments': ''})
    text = io.StringIO()
    table = csv.DictWriter(text, rows[0])
    table.writeheader()
    table.writerows(rows)
    return f'\ufeff{text.getvalue()}'.encode()


def moodle_takes(text: str, graded: dict, maximum: float, ignore_modified: bool = False) -> int:
    """Take the grades of a worksheet into `graded`, and return how many were taken.

    `graded` has the students who take part, by their numbers. Raises KeyError without a column.
    """
    taken = 0
    for row in csv.DictReader(io.StringIO(text)):
        number, new = row['Identifier'][len(HIDDEN_USER) :], row['Grade']
        # `-` is no time: strtotime returns false, which is 0.
        modified_s = 0 if row['Last modified (grade)'] == '-' else DOWNLOADED_S
        if number not in graded:
            continue
        old = graded[number]
        is_stale = old is not None and old.modified_s > modified_s + MINUTE
        if new == '' or not 0 <= float(new) <= maximum or (old and old.grade == float(new)):
            continue
        if is_stale and not ignore_modified:
            continue
        graded[number] = Graded(float(new))
        taken += 1
    return taken


def moodle_takes_feedback(paths: list[str], graded: dict) -> int:
    """Take the files of a zip, and return of how many students it has some."""
    found = set()
    for path in paths:
        for part in path.split('/'):
            words = part.split('_', 4)
            if len(words) < 4 or words[1] not in graded or (*words[2:4],) not in PLUGINS:
                continue
            old = graded[words[1]]
            graded[words[1]] = Graded(old.grade if old else None)
            found.add(words[1])
            break
    return len(found)


def canvas_takes(text: str, assignments: set[str]) -> dict[tuple[str, str], str]:
    """Return the scores that Canvas takes, by the student's ID and the assignment.

    Raises ValueError for a header that it refuses.
    """
    header, *lines = csv.reader(io.StringIO(text))
    two_names = header[:3] == ['LastName', 'FirstName', 'ID']
    if not two_names and not ('Student' in header[0] and 'ID' in header[1]):
        raise ValueError('Invalid header row')
    number = header.index('ID')
    if 'Section' not in header[number:]:
        raise ValueError('Invalid header row')
    taken = {}
    for line in lines:
        is_note = all(re.fullmatch(r'\s*(Muted|Manual Posting.*)?\s*', one) for one in line)
        if 'Points Possible' in line[0] or is_note:
            continue
        for name, score in zip(header, line, strict=True):
            if name in assignments and score:
                taken[line[number], name] = score
    return taken
