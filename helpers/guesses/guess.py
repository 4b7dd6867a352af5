"""A guess, and how a cell shows it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Protocol

from helpers.notebook import somebody_watches
from helpers.replay import attribute, javascript, picture_of, script, style

HERE = Path(__file__).parent
CSS = HERE / 'guess.css'
MEMORY = HERE / 'memory.js'
SHELL = 'element.js', MEMORY, HERE / 'guess.js'  # after the files of the kind


class Kind(Protocol):
    """What may be answered, and how it is drawn."""

    asks: str  # what one does with it: a sentence
    forms: str  # what may be typed in place of the dots
    axis: tuple[float, float] | None  # on which the value is a number
    scripts: tuple[Path, ...]  # the first has its words, without a page

    def record(self) -> dict:
        """Return what the script needs, with the name of the kind in `kind`."""

    def picture(self) -> str:
        """Return an SVG without a guess, or an empty text."""

    def words(self) -> str:
        """Return what the picture shows."""

    def read(self, typed: object) -> object:
        """Return the value of what was typed. Raises ValueError with a sentence."""

    def told(self, value: object) -> object:
        """Return a value as a class is told it: a number, a text, or a list of them."""

    def outcome(self, measured: object, run: object, tolerance: float) -> dict:
        """Return what came out, as the script compares it. `run` is that of the guess."""

    def answer(self, outcome: Mapping) -> str:
        """Return what came out after `The answer is`; empty if it moves from run to run."""


@dataclass
class Guess:
    """A question, what may be answered, the answer of the student, and the run that came out.

    `value` is None as long as there is no answer. `run` is what a helper drew that knows the guess.
    """

    question: str
    kind: Kind
    value: object = None
    run: object = None

    def record(self) -> dict:
        """Return what a page needs to draw it, also in the picture of the run."""
        kind = self.kind
        own = {'asks': kind.asks, 'forms': kind.forms, 'value': self.value}
        return {'question': self.question, **kind.record(), **own}

    def said(self) -> str:
        """Return the guess as a sentence, such as `It stops 0.60 m before the wall.`"""
        return self._words('said', self.value)

    def gap(self, outcome: Mapping) -> dict:
        """Return `right`, and the sentence `says`, of what came out."""
        return self._words('gap', self.value, dict(outcome))

    def _words(self, function: str, *values: object) -> object:
        kind = self.kind.record()
        return javascript(
            f'{kind["kind"]}Kind.{function}', kind, *values, files=self.kind.scripts[:1]
        )

    def __str__(self) -> str:
        """Return what is true in each run: nbval compares it."""
        yours = '' if self.value is None else f'\nYou say: {self.said()}'
        return f'{self.question}\n{self.kind.asks} {self.kind.forms}{yours}'

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict[str, str]:
        svg = self.kind.picture()
        figure = picture_of(svg, f'{self.question} {self.kind.words()}') if svg else ''
        look = style(CSS, rows=False)
        html = (
            f'<div class="replay guess" data-guess={attribute(self.record())}>{look}'
            f'<p class="guess-question">{escape(self.question)}</p>{figure}'
            f'<p class="replay-static">Run the cell, to answer here. {escape(self.kind.forms)}</p>'
            f'<script>{script(*self.kind.scripts, *SHELL)}</script></div>'
        )
        return {'text/plain': str(self), 'text/html': html}


@dataclass(frozen=True)
class Gap:
    """A guess and what came out: the gap, in words and in the picture, and its cause.

    The picture is left out if that of the run has it already. Without a guess it shows what came
    out, and on a slide what the class has guessed.
    """

    guess: Guess
    outcome: Mapping

    def __str__(self) -> str:
        if self.guess.value is None:
            answer = self.guess.kind.answer(self.outcome)
            lines = [f'The answer is {answer}.'] if answer else []
        else:
            lines = [f'You say: {self.guess.said()}', self.guess.gap(self.outcome)['says']]
        table = self.outcome.get('table', {'columns': [], 'rows': []})
        for name, texts in table['rows']:
            cells = zip(table['columns'], texts, strict=True)
            lines.append(f'{name}: {", ".join(f"{column} {text}" for column, text in cells)}.')
        return '\n'.join(f'  {line}' for line in lines)

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict[str, str]:
        guess = self.guess
        if guess.run is not None and guess.value is not None:
            html = f'<p>You said: {escape(guess.said())}</p>'
            return {'text/plain': str(self), 'text/html': html}
        record = attribute({**guess.record(), 'outcome': dict(self.outcome)})
        svg = guess.kind.picture()
        words = f'{guess.question} {guess.kind.words()} {" ".join(str(self).split())}'
        figure = picture_of(svg, words) if svg else ''
        look = style(CSS, rows=False)
        html = (
            f'<div class="replay guess" data-guess={record}>{look}'
            f'<p class="guess-question">{escape(guess.question)}</p>{figure}'
            f'<p class="replay-static">{escape(str(self))}</p>'
            f'<script>{script(*guess.kind.scripts, *SHELL)}</script></div>'
        )
        return {'text/plain': str(self), 'text/html': html}


def show(guess: Guess, changed: Callable[[object], None] = lambda value: None) -> None:
    """Show a guess in the output of the cell that runs.

    Where somebody watches, `changed` is called with each value that is set there, after it is in
    `guess.value`. The page speaks to the kernel by an input that is not seen, a widget.
    """
    from IPython.display import display

    display(guess)
    if not somebody_watches():
        return
    from ipywidgets import Text

    def hear(change: dict) -> None:
        guess.value = json.loads(change['new'])
        changed(guess.value)

    line = Text(continuous_update=False)
    line.add_class('guess-line')
    line.observe(hear, 'value')
    display(line)
