"""A map of what a student has done, and a portrait of the intuition: guesses against what came out.

`compare_prediction` keeps a guess in the file of the progress: what was asked, what was said, what
came out, whether it was right, for a number its axis, and of points where they are on their floor.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

from helpers.checks.verdict import AMBER, GREEN

if TYPE_CHECKING:
    from helpers.guesses import Guess
    from helpers.lesson import Lesson

ENOUGH = 3  # so many guesses say something, fewer are chance
LEFT = 'style="text-align:left"'
WIDE, HIGH, EDGE = 64, 24, 6  # px, of the picture of one guess


def record_of(guess: Guess, outcome: Mapping) -> dict:
    """Return what is kept of a guess, and of what came out."""
    kind, said, was = guess.kind, guess.value, outcome['at']
    shares = [kind.share(said), kind.share(was)] if hasattr(kind, 'share') else None
    if kind.axis is None and shares is None:
        said, was = kind.told(said), kind.told(was)
    return {
        'asked': guess.question,
        'said': said,
        'was': was,
        'right': guess.gap(outcome)['right'],
        'axis': kind.axis,
        **({'shares': shares} if shares else {}),
    }


@dataclass(frozen=True)
class Portrait:
    """Of some lessons, all guesses that were compared, by the names of the lessons."""

    known: Collection[Lesson]
    guesses: Mapping[str, Collection[Mapping]]

    def __str__(self) -> str:
        """Return what all guesses say together: sentences, none of what may be chance."""
        every = [one for guesses in self.guesses.values() for one in guesses]
        right = sum(one['right'] for one in every)
        count = f'{len(every)} guess{"es" * (len(every) > 1)}'
        words = [f'Of your {count}, {right} came out right.']
        missed = [one for one in every if one['axis'] and not one['right']]
        sides = {
            'low': sum(one['said'] < one['was'] for one in missed),
            'high': sum(one['said'] > one['was'] for one in missed),
        }
        for side, count in sides.items():
            if len(missed) >= ENOUGH and count > len(missed) * 2 / 3:
                words.append(f'Of {len(missed)} wrong numbers, {count} were too {side}.')
        shares = {
            lesson.title_or_name: sum(one['right'] for one in guesses) / len(guesses)
            for lesson in self.known
            if len(guesses := self.guesses[lesson.name]) >= ENOUGH
        }
        best, worst = (pick(shares, key=shares.get, default='') for pick in (max, min))
        if best and shares[best] > shares[worst]:
            words.append(f'You were right most often in {best}, least in {worst}.')
        return ' '.join(words)

    def pictures(self, lesson: str) -> str:
        """Return the guesses of a lesson as small pictures."""
        return ''.join(map(_picture, self.guesses.get(lesson, ())))


@dataclass(frozen=True)
class Map:
    """All lessons, with their links, their tasks, and the guesses that were compared.

    `text` says the same of the tasks; `solved` holds the numbers of those that are, by lesson.
    """

    known: Collection[Lesson]
    solved: Mapping[str, Collection[int]]
    text: str
    portrait: Portrait | None

    def __str__(self) -> str:
        return f'{self.text}\n{self.portrait}' if self.portrait else self.text

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict[str, str]:
        return {'text/plain': str(self), 'text/html': self.html()}

    def html(self) -> str:
        heads = ['lesson', 'tasks', *(['guesses'] if self.portrait else [])]
        rows = [f'<tr>{"".join(f"<th {LEFT}>{head}</th>" for head in heads)}</tr>']
        for lesson in self.known:
            link = f'<a href="{escape(lesson.file)}">{lesson.number} '
            cells = [f'<th scope="row" {LEFT}>{link}{escape(lesson.title_or_name)}</a></th>']
            cells.append(f'<td {LEFT}>{self._tasks(lesson)}</td>')
            if self.portrait:
                cells.append(f'<td {LEFT}>{self.portrait.pictures(lesson.name)}</td>')
            rows.append(f'<tr>{"".join(cells)}</tr>')
        key = 'A full square is a task that is solved, a star one beyond the core.'
        if self.portrait:
            key += f' A ring is your guess, a bar or a dot is what came out. {self.portrait}'
        total = self.text.splitlines()[-1]
        return f'<table>{"".join(rows)}</table><p>{escape(f"{total} {key}")}</p>'

    def _tasks(self, lesson: Lesson) -> str:
        """Return a sign for each task, with its title."""
        signs = []
        for task in lesson.tasks:
            done = task.number in self.solved[lesson.name]
            sign = ('★' if done else '☆') if task.star else ('■' if done else '□')
            says = f'Task {task.number}: {task.title}{", solved" if done else ""}'
            colour = f'color:{GREEN}' if done else 'opacity:.6'
            signs.append(f'<span style="{colour}" title="{escape(says)}">{sign}</span>')
        count = f'{len(self.solved[lesson.name])} of {len(lesson.tasks)} are solved'
        return f'<span role="img" aria-label="{count}">{" ".join(signs)}</span>'


def portrait(known: Iterable[Lesson], gaps: Mapping[str, Mapping[str, Mapping]]) -> Portrait | None:
    """Return the portrait that records make, by lesson and question, or None if there is none."""
    known = [lesson for lesson in known if lesson.name in gaps]
    guesses = {lesson.name: gaps[lesson.name].values() for lesson in known}
    return Portrait(known, guesses) if known else None


def _picture(one: Mapping) -> str:
    """Return a small SVG: a ring for the guess, a bar or a dot for what came out; or a tick."""
    says = f'{one["asked"]} You said {_written(one["said"])}, and it was {_written(one["was"])}.'
    color = GREEN if one['right'] else AMBER
    if one['axis']:
        said, was = (_at(number, *one['axis']) for number in (one['said'], one['was']))
        middle = HIGH / 2
        drawn = (
            f'<path d="M{EDGE} {middle}H{WIDE - EDGE}" stroke="currentColor" opacity=".4"/>'
            f'<path d="M{said} {middle}H{was}" stroke="{color}" stroke-width="2"/>'
            f'<path d="M{was} 4V{HIGH - 4}" stroke="{color}" stroke-width="4"/>'
            f'<circle cx="{said}" cy="{middle}" r="5" fill="none" stroke="{color}" '
            'stroke-width="2"/>'
        )
        wide = WIDE
    elif one.get('shares'):
        (x, y), (real_x, real_y) = (
            (_at(right, 0, 1), round(HIGH - 3 - up * (HIGH - 6), 1)) for right, up in one['shares']
        )
        drawn = (
            f'<path d="M1 1H{WIDE - 1}V{HIGH - 1}H1z" fill="none" stroke="currentColor" '
            f'opacity=".4"/><path d="M{x} {y}L{real_x} {real_y}" stroke="{color}" '
            f'stroke-width="2"/><circle cx="{real_x}" cy="{real_y}" r="3" fill="{color}"/>'
            f'<circle cx="{x}" cy="{y}" r="5" fill="none" stroke="{color}" stroke-width="2"/>'
        )
        wide = WIDE
    else:
        way = 'M5 13l5 5 9-12' if one['right'] else 'M6 6l12 12M18 6l-12 12'
        drawn = f'<path d="{way}" fill="none" stroke="{color}" stroke-width="3"/>'
        wide = HIGH
    return (
        f'<svg width="{wide}" height="{HIGH}" viewBox="0 0 {wide} {HIGH}" role="img" '
        f'style="margin-right:6px"><title>{escape(says)}</title>{drawn}</svg>'
    )


def _at(number: float, low: float, high: float) -> float:
    """Return where a number is on the axis of a picture (px); at its end if it is beyond."""
    share = min(1.0, max(0.0, (number - low) / (high - low)))
    return round(EDGE + share * (WIDE - 2 * EDGE), 1)


def _written(value: object) -> str:
    if isinstance(value, float):
        return f'{value:.3g}'
    return ', '.join(map(str, value)) or 'none' if isinstance(value, list) else str(value)
