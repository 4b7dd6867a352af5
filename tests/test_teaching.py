"""What a class needs beside the lessons: summaries and terms in four languages, notes, timetables.

A function returns sentences about what is wrong, as the rules of notebook_rules.py do.
"""

import re
from pathlib import Path

import nbformat
import notebook_rules as rules
import pytest
from nbformat import NotebookNode
from nbformat.v4 import new_markdown_cell, new_notebook, new_raw_cell

from tools.notebooks import FOLDER

NAMES = {path.name[:2]: path.name for path in sorted(FOLDER.glob('*.ipynb'))}
NOTEBOOKS = {number: nbformat.read(FOLDER / name, 4) for number, name in NAMES.items()}
LESSONS = [number for number in NOTEBOOKS if number not in rules.NO_LESSON]
GLOSSARY = NOTEBOOKS['99']
TEACHING = Path(__file__).parents[1] / 'teaching.md'

# Letters that English does not have, and of which every text in this language has one.
LETTERS = {'fr': 'éèêàç', 'ur': 'ٹڈڑںے', 'vi': 'ăđơưạảấầẩậắặẻẽẹếềểệỉịọỏốồộớờợụủứữựỳ'}
FOLDED = re.compile(
    r'<details lang="(?P<lang>\w+)"(?P<rtl> dir="rtl")?>\n'
    r'<summary>[^<]+</summary>\n(?P<text>[^\n]+)\n</details>'
)
ROW = re.compile(
    r'\| \*\*(?P<term>[^*]+)\*\* \| (?P<meaning>[^|]+) \| <span lang="fr">(?P<fr>[^|]+)</span>'
    r' \| <span dir="rtl" lang="ur">(?P<ur>[^|]+)</span> \| <span lang="vi">(?P<vi>[^|]+)</span>'
    r' \| \[(?P<lesson>\d\d)\]\((?P=lesson)_\w+\.ipynb\) \|'
)


def summaries(notebook: NotebookNode) -> dict[str, str]:
    """Return the texts of the cell behind the title by their languages, `en` among them."""
    source = notebook.cells[1].source
    english = re.match(r'\*\*In short\*\*: ([^\n]+)\n', source)
    return ({'en': english[1]} if english else {}) | {
        found['lang']: found['text'] for found in FOLDED.finditer(source)
    }


def terms(glossary: NotebookNode) -> list[dict[str, str]]:
    """Return the rows of the glossary's tables; a row that is not as ROW wants it gives {}."""
    lines = [line for cell in glossary.cells for line in cell.source.splitlines()]
    rows = [line for line in lines if line.startswith('| **')]
    return [found.groupdict() if (found := ROW.fullmatch(line)) else {} for line in rows]


def minutes_by_step(notebook: NotebookNode) -> dict[str, int]:
    """Return the minutes of the instructor's notes: `1`, `2`, ..., `Exercises` to their sum."""
    found: dict[str, int] = {}
    step = ''
    for cell in notebook.cells:
        if heading := re.match(r'## (\w+)', cell.source):
            step = heading[1]
        if 'notes' in rules.tags(cell):
            note = re.match(rf'{rules.NOTE}: (\d+) minutes', cell.source)
            found[step] = found.get(step, 0) + (int(note[1]) if note else 0)
    return found


def time_of(notebook: NotebookNode) -> int:
    """Return the minutes that a notebook's opening promises."""
    return int(re.search(r'\*\*Time\*\*:? (\d+) minutes?', notebook.cells[0].source)[1])


def wrong_in_summaries(notebook: NotebookNode, glossary: NotebookNode = GLOSSARY) -> list[str]:
    found = summaries(notebook)
    if list(found) != ['en', 'fr', 'ur', 'vi']:
        return [f'The second cell has summaries in {list(found)}, not in en, fr, ur, vi.']
    marks = [match['lang'] for match in FOLDED.finditer(notebook.cells[1].source) if match['rtl']]
    wrong = [] if marks == ['ur'] else ['Urdu, and nothing else, is written right to left.']
    for language, text in found.items():
        if not 1 <= len(re.findall(r'[.?؟۔](?=\s|$)', text)) <= 3:
            wrong.append(f'{language}: write one to three sentences.')
        if language != 'en':
            wrong += wrong_in_translation(language, text)
            known = [row[language] for row in terms(glossary)]
            wrong += [
                f'{language}: {bracket} stands behind another word than in the glossary.'
                for bracket in re.findall(r'\((?:<bdi[^>]*>)?.+?\)', text)
                if not any(w.endswith(bracket) and w.lower() in text.lower() for w in known)
            ]
    return wrong


def wrong_in_translation(language: str, text: str) -> list[str]:
    """Look at the letters: another language's text, or Latin that Urdu would turn around."""
    wrong = []
    if not set(text) & set(LETTERS[language]):
        wrong.append(f'{language}: no letter of {text!r} is of this language.')
    return wrong + wrong_in_direction(language, text)


def wrong_in_direction(language: str, text: str) -> list[str]:
    plain = re.sub(r'<bdi dir="ltr">.*?</bdi>', '', text)
    if language == 'ur' and (latin := re.search('[A-Za-z+]+', plain)):
        return [f'ur: write <bdi dir="ltr">{latin[0]}</bdi>.']
    return []


def wrong_in_glossary(
    glossary: NotebookNode, lessons: dict[str, NotebookNode] = NOTEBOOKS
) -> list[str]:
    wrong, seen = [], set()
    for number, row in enumerate(terms(glossary), 1):
        if not row:
            wrong.append(f'Row {number} is not term, meaning, fr, ur, vi, lesson.')
            continue
        text = '\n'.join(line for _, lines in rules.prose(lessons[row['lesson']]) for line in lines)
        stem = re.escape(row['term'].removesuffix('y'))
        if not re.search(rf'\b{stem}(y|s|es|ies)?\b', text, re.IGNORECASE):
            wrong.append(f'Lesson {row["lesson"]} never says {row["term"]}.')
        if row['term'].lower() in seen:
            wrong.append(f'{row["term"]} stands there twice.')
        seen.add(row['term'].lower())
        wrong += wrong_in_direction('ur', row['ur'])
    return wrong


def wrong_in_notes(notebook: NotebookNode) -> list[str]:
    noted, promised = sum(minutes_by_step(notebook).values()), time_of(notebook)
    return [] if noted == promised else [f'The notes take {noted} minutes, not {promised}.']


def wrong_in_timetables(text: str, lessons: dict[str, NotebookNode] = NOTEBOOKS) -> list[str]:
    wrong, at = [], 0
    for hours, minute, length, what in re.findall(r'\| (\d):(\d\d) \| (\d*) ?\| (.+) \|', text):
        at = 0 if hours + minute == '000' else at
        if int(hours) * 60 + int(minute) != at:
            wrong.append(f'{what} begins at {at // 60}:{at % 60:02d}.')
        at += int(length or 0)
        found = re.match(r'Lesson (\d\d)(?:, steps (\d+) to (\d+))?', what)
        if not found:
            continue
        number, first, last = found.groups()
        if first:
            steps = minutes_by_step(lessons[number])
            needed = sum(steps[str(step)] for step in range(int(first), int(last) + 1))
        else:
            needed = time_of(lessons[number])
        if int(length) != needed:
            wrong.append(f'{what} takes {needed} minutes.')
    return wrong


@pytest.mark.parametrize('notebook', NOTEBOOKS.values(), ids=NAMES.values())
def test_summaries(notebook):
    assert wrong_in_summaries(notebook) == []


def test_glossary():
    assert len(terms(GLOSSARY)) >= 45
    assert wrong_in_glossary(GLOSSARY) == []


@pytest.mark.parametrize('number', LESSONS, ids=NAMES.get)
def test_the_notes_fill_the_time_of_a_lesson(number):
    assert wrong_in_notes(NOTEBOOKS[number]) == []


def test_timetables():
    text = TEACHING.read_text(encoding='utf-8')
    assert text.count('| 0:00 |') == text.count('| End |') == 3
    assert wrong_in_timetables(text) == []


# The functions above find what is broken on purpose.

TITLE = '# 02 Lose messages\n\n**Time** 7 minutes'
FRENCH = '<details lang="fr">\n<summary>Français</summary>\nUne file gardée.\n</details>'
URDU = (
    '<details lang="ur" dir="rtl">\n<summary>اردو</summary>\n'
    'قطار میں پیغام ہے <bdi dir="ltr">C++</bdi>۔\n</details>'
)
VIETNAMESE = '<details lang="vi">\n<summary>Tiếng Việt</summary>\nMột nút (node) ở đây.\n</details>'
SUMMARY = '\n\n'.join(['**In short**: A queue.', FRENCH, URDU, VIETNAMESE])
TERM = (
    '| **node** | a part | <span lang="fr">nœud</span> | <span dir="rtl" lang="ur">نوڈ</span> '
    '| <span lang="vi">nút (node)</span> | [02](02_lose_messages.ipynb) |'
)
WORDS = new_notebook(cells=[new_markdown_cell(TERM)])
TABLE = (
    '| 0:00 | 3 | Lesson 02, steps 1 to 1 |\n'
    '| 0:03 | 4 | Break |\n| 0:07 | 7 | Lesson 02 |\n| 0:14 | | End |'
)


def lesson(summary=SUMMARY, minutes=4):
    def note(length):
        return new_raw_cell(f'{rules.NOTE}: {length} minutes', metadata={'tags': ['notes']})

    return new_notebook(
        cells=[
            new_markdown_cell(TITLE),
            new_markdown_cell(summary),
            new_markdown_cell('## 1. Begin\n\nTwo nodes.'),
            note(3),
            new_markdown_cell('## Exercises'),
            note(minutes),
        ]
    )


def test_what_is_right_is_let_pass():
    assert wrong_in_summaries(lesson(), WORDS) == []
    assert wrong_in_glossary(WORDS, {'02': lesson()}) == []
    assert wrong_in_notes(lesson()) == []
    assert wrong_in_timetables(TABLE, {'02': lesson()}) == []


@pytest.mark.parametrize(
    ('old', 'new'),
    [
        ('**In short**: ', ''),
        (FRENCH, ''),
        ('lang="vi"', 'lang="fr"'),
        (' dir="rtl"', ''),
        ('<details lang="fr">', '<details lang="fr" dir="rtl">'),
        ('Une file gardée', 'A queue'),
        ('gardée.', 'gardée. Une. Deux. Trois.'),
        ('<bdi dir="ltr">C++</bdi>', 'C++'),
        ('nút (node)', 'bên (node)'),
    ],
)
def test_a_broken_summary_is_reported(old, new):
    assert SUMMARY.count(old) == 1
    assert wrong_in_summaries(lesson(SUMMARY.replace(old, new)), WORDS)


@pytest.mark.parametrize(
    ('old', 'new'),
    [
        ('nœud', ''),
        ('lang="vi"', 'lang="fr"'),
        ('dir="rtl" ', ''),
        ('[02]', '[01]'),
        ('**node**', '**deadlock**'),
        ('نوڈ', 'node'),
        (TERM, f'{TERM}\n{TERM}'),
    ],
)
def test_a_broken_glossary_is_reported(old, new):
    assert TERM.count(old) == 1
    broken = new_notebook(cells=[new_markdown_cell(TERM.replace(old, new))])
    assert wrong_in_glossary(broken, {'02': lesson()})


def test_wrong_minutes_are_reported():
    assert wrong_in_notes(lesson(minutes=5))
    assert wrong_in_timetables(TABLE, {'02': lesson(minutes=5)}) == []
    for old, new in [('| 3 |', '| 2 |'), ('| 7 |', '| 8 |'), ('0:14', '0:15'), ('0:07', '0:06')]:
        assert wrong_in_timetables(TABLE.replace(old, new), {'02': lesson()})
