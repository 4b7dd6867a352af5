"""A portrait of a student's intuition: each guess against what came out, a row for each lesson.

`compare_prediction` keeps a guess in the file of the progress, as a line `gap LESSON {...}`: what
was asked, what was said, what came out, whether it was right, and for a number its axis.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

from helpers.checks.verdict import AMBER, GREEN

if TYPE_CHECKING:
    from helpers.guesses import Guess
    from helpers.lesson import Lesson

KEPT = 'gap'  # begins the line of a guess that was compared
ENOUGH = 3  # so many guesses say something, fewer are chance
WIDE, HIGH, EDGE = 64, 24, 6  # px, of the picture of one guess


def line_of(lesson: str, guess: Guess, outcome: Mapping) -> str:
    """Return the line that keeps a guess of this lesson, and what came out."""
    kind, said, was = guess.kind, guess.value, outcome['at']
    if kind.axis is None:
        said, was = kind.told(said), kind.told(was)
    kept = {
        'asked': guess.question,
        'said': said,
        'was': was,
        'right': guess.gap(outcome)['right'],
        'axis': kind.axis,
    }
    return f'{KEPT} {lesson} {json.dumps(kept, ensure_ascii=False)}'


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

    def _repr_html_(self) -> str:
        rows = [
            f'<tr><th scope="row" style="text-align:left"><a href="{escape(lesson.file)}">'
            f'{lesson.number} {escape(lesson.title_or_name)}</a></th>'
            f'<td style="text-align:left">{"".join(map(_picture, self.guesses[lesson.name]))}</td>'
            '</tr>'
            for lesson in self.known
        ]
        key = 'A ring is your guess, a bar is what came out.'
        return f'<table>{"".join(rows)}</table><p>{key} {escape(str(self))}</p>'


def portrait(known: Iterable[Lesson], lines: Iterable[str]) -> Portrait | None:
    """Return the portrait that lines of the progress make, or None if no guess was compared.

    Of each question the newest guess counts. A line that cannot be read is passed over.
    """
    found: dict[str, dict[str, dict]] = {}
    for line in lines:
        if line.startswith(f'{KEPT} '):
            with suppress(ValueError):
                _, lesson, text = line.split(' ', 2)
                one = json.loads(text)
                found.setdefault(lesson, {})[one['asked']] = one
    known = [lesson for lesson in known if lesson.name in found]
    guesses = {lesson.name: found[lesson.name].values() for lesson in known}
    return Portrait(known, guesses) if known else None


def _picture(one: Mapping) -> str:
    """Return a small SVG: the guess is a ring, what came out is a bar; or a tick, or a cross."""
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
