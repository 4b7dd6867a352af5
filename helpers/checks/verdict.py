"""A verdict: what a check has found, as data, as text, and as a card.

The data stand in the metadata of the cell's output, under `ros2_notebooks`:

    {'task': 'a_driver', 'of': 'answer', 'solved': False,
     'points': [{'what': 'it turns', 'ok': False, 'found': 'it published (0.5, 0.0)'}]}

`of` is 'answer', or 'solution' if the lesson's own solution was judged. `found`, `hint` and `note`
are there if something was found, if a hint was shown, and if the answer could not be judged.
Grades, rules and tests read these, and never the text.
"""

from __future__ import annotations

import html
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field

from helpers.notebook import LOOK, wrap

KEY = 'ros2_notebooks'
SAME, LONG = 'the same', 40
AGAIN, BELOW = 'Try again.', 'Try again, or go on with the solution below.'
CARD = 'border-left:4px solid {};padding:.1em .8em;margin:.2em 0;line-height:1.45'
TITLE = 'display:inline;font:inherit;margin:0;padding:0'
INDENTED, FAINT = 'margin-left:1.5em', 'font-weight:normal;margin-left:1em;opacity:.75'
GREEN, AMBER = LOOK['robot'], LOOK['waiting']


@dataclass
class Point:
    """One thing that a task asks for: is it so, what was found instead, and what helps?"""

    what: str
    ok: bool = False
    found: str = ''
    hint: str = ''


@dataclass
class Verdict:
    """What a check says of a task.

    `task` is its name, `number` its place in the lesson. `seconds` is how long the check took, and
    `total` how many tasks are solved now, in words. `again` is what helps if it is not solved.
    """

    task: str
    number: int
    points: list[Point] = field(default_factory=list)
    of: str = 'answer'
    note: str = ''
    seconds: float = 0.0
    total: str = ''
    again: str = AGAIN

    @property
    def solved(self) -> bool:
        """Whether every point is met."""
        return bool(self.points) and not self.note and all(point.ok for point in self.points)

    def add_hints(self, hints: list[str]) -> None:
        """Show the hints of the points that are not met."""
        for point, hint in zip(self.points, hints, strict=False):
            point.hint = '' if point.ok else hint

    def data(self) -> dict:
        """Return the verdict as data, for the output's metadata. Its time would move."""
        data = {'task': self.task, 'of': self.of, 'solved': self.solved, 'note': self.note}
        points = [asdict(point) for point in self.points]
        return _without_empty(data) | {'points': [_without_empty(point) for point in points]}

    def title(self) -> str:
        """Return the last line: how many points are met."""
        name = f'Solution of task {self.number}' if self.of == 'solution' else f'Task {self.number}'
        if not self.points:
            return f'{name}: not judged.'
        if self.note:
            return f'{name}: not judged yet.'
        count = f'{name}: {sum(point.ok for point in self.points)} of {len(self.points)}.'
        if self.of == 'solution':
            return count
        return f'{count} {"All done." if self.solved else self.again}'

    def text(self) -> str:
        """Return the verdict as lines of text."""
        lines = []
        for point, found, hint in self._rows():
            lines += wrap(f'[{"ok" if point.ok else "not yet"}] {point.what}', rest=' ' * 10)
            if found:
                lines += wrap(f'    Found: {found}', rest=' ' * 10)
            if hint:
                lines += wrap(f'    Hint: {hint}', rest=' ' * 10)
        if self.note:
            lines += wrap(self.note)
        return '\n'.join([*lines, self.title()])

    def _rows(self) -> Iterator[tuple[Point, str, str]]:
        """Yield each point, what was found, and its hint: of equal long texts in a row, one."""
        before = ''
        for point in self.points:
            is_same = len(point.found) > LONG and point.found == before
            yield point, SAME if is_same else point.found, '' if is_same else point.hint
            before = point.found

    def card(self) -> str:
        """Return the verdict as HTML: solved is seen at a glance, and what is missing is indented.

        Its colours are those of the page, so that it fits a dark one, too.
        """
        rows = []
        for point, found, hint in self._rows():
            mark, colour = ('✔', GREEN) if point.ok else ('○', AMBER)
            rows.append(
                f'<div><span style="color:{colour}">{mark}</span> {html.escape(point.what)}</div>'
            )
            for name, text in (('Found', found), ('Hint', hint)):
                if text:
                    rows.append(f'<div style="{INDENTED}"><b>{name}</b> {html.escape(text)}</div>')
        if self.note:
            rows.append(f'<div>{html.escape(self.note)}</div>')
        title, colour = html.escape(self.title()), GREEN if self.solved else AMBER
        if self.solved:
            total = f' <span style="{FAINT}">{self.total}</span>' if self.total else ''
            heading = f'<div><b>✔ {title}</b>{total}</div>'
            if self.of == 'answer':  # JupyterLab's table of contents then shows what is solved
                name, rest = title.split(':', 1)
                name = f'<h4 style="{TITLE}">✔ {name}</h4>'
                heading = f'<div style="font-weight:bold">{name}:{rest}{total}</div>'
            rows = [heading, *rows]
        else:
            rows.append(f'<div><b>{title}</b></div>')
        return f'<div style="{CARD.format(colour)}">{"".join(rows)}</div>'


def verdict_in(output: dict) -> dict | None:
    """Return the data of the verdict that an output of a cell shows, if it shows one.

    A student's notebook may have anything in their place.
    """
    metadata = output.get('metadata')
    data = metadata.get(KEY) if isinstance(metadata, dict) else None
    return data if isinstance(data, dict) else None


def _without_empty(data: dict) -> dict:
    return {key: value for key, value in data.items() if value != ''}


def bundle(verdict: Verdict) -> tuple[dict, dict]:
    """Return the data and the metadata of the output that shows a verdict."""
    return (
        {'text/plain': verdict.text(), 'text/html': verdict.card()},
        {KEY: verdict.data()},
    )
