"""The instructor's card of a timetable, one page to print: `make card PLAN=90`.

It holds what comes when, for how many minutes, what goes wrong, and the keys of the deck.
"""

import html
import re
import sys

from classroom.plan import Plan, keys, lesson_of, plan_of
from tools.lessons.clean import write
from tools.lessons.lesson import FOLDER, ROOT, Lesson, first_heading, read

FILE = ROOT / 'presentation' / 'card.html'
WRONG = re.compile(r'What goes wrong[^:.]*: (.+)')
PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>{title}</title>
<style>
@page {{ size: A4; margin: 9mm; }}
body {{ margin: 0; columns: {columns}; column-gap: 5mm; font: {size}pt/1.2 sans-serif; }}
h1 {{ margin: 0; font-size: 130%; column-span: all; }}
table {{ width: 100%; margin-bottom: 1mm; border-collapse: collapse; }}
td {{ padding: 0.2mm 1mm; border-top: 0.2mm solid #bbb; vertical-align: top; }}
td:first-child {{ white-space: nowrap; font-variant-numeric: tabular-nums; }}
tr {{ break-inside: avoid; }}
i {{ color: #444; }}
</style>
<h1>{title}</h1>
<table>
{rows}
</table>
<table>
{keys}
</table>
"""


def card(plan: Plan) -> str:
    """Return the page of a timetable."""
    lines, at = [], 0
    for minutes, what in plan.rows:
        file, steps = lesson_of(what)
        rows = [(int(minutes), what, '')]
        if file:
            lesson = read((FOLDER / file).read_text(encoding='utf-8'), file)
            rows = _steps(lesson, steps)
        for own, title, wrong in rows:
            told = f'<b>{_plain(title)}</b> <i>{_plain(wrong)}</i>'
            lines.append(f'<tr><td>{at // 60}:{at % 60:02d} <b>{own}′</b><td>{told}')
            at += own
    return PAGE.format(
        title=f'{html.escape(plan.title)}: {at // 60} h {at % 60} min',
        columns=1 if len(lines) < 20 else 2,
        size=10.5 if len(lines) < 20 else 8,
        rows='\n'.join(lines),
        keys='\n'.join(f'<tr><td>{_plain(key)}<td>{_plain(does)}' for key, does in keys()),
    )


def _steps(lesson: Lesson, wanted: tuple[int, int] | None) -> list[tuple[int, str, str]]:
    """Return minutes, title, and what goes wrong, of the steps of a lesson that are wanted."""
    found = []
    for number, minutes in lesson.minutes_by_step.items():
        if wanted and number not in map(str, range(wanted[0], wanted[1] + 1)):
            continue
        cells = [
            c for c, step in zip(lesson.notebook.cells, lesson.steps, strict=True) if step == number
        ]
        title = f'{lesson.number} {first_heading(cells[0].source)}'
        notes = '\n'.join(cell.source for cell in cells if cell.cell_type == 'raw')
        found.append((minutes, title, ' '.join(WRONG.findall(notes))))
    return found


def _plain(text: str) -> str:
    text = re.sub(r'\[(.+?)\]\(.+?\)', r'\1', text)
    return html.escape(re.sub('[*`]', '', text))


if __name__ == '__main__':
    try:
        page = card(plan_of(' '.join(sys.argv[1:])))
    except ValueError as error:
        sys.exit(str(error))
    FILE.parent.mkdir(exist_ok=True)
    write(FILE, page)
    print(f'{FILE}: open it in a browser, and print it.')
