"""A run as one picture: a row for each message, and why it waited.

It is SVG, a tenth of the size of a PNG, and shown as an image.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple
from urllib.parse import quote

from matplotlib.ticker import MaxNLocator

from helpers.plots.style import GREY, GROUP_COLOURS, HEARD, INK, LOST, PALE, PUBLISHED

WIDTH, NARROW = 760, 440  # pixels; the narrow ones are side by side
LEFT, RIGHT, TOP, BOTTOM = 46, 14, 14, 40
LINE, MARK = 16, 28  # of the legend: a line's height, and how far its words are from its mark
LETTER = 6.6  # about as wide as one of a name
MAX_ROWS = 120
SAFE = "!$'()*+,-./:;=?@_~ "  # may stand in the address of an image, in double quotes
# Why a message waits, and a callback, as model.js calls it: colour, dashes, and the legend's words.
WAITS = {
    '': (PALE, '', 'waits, a thread is free'),
    'thread busy': (PUBLISHED, '', 'waits, thread busy'),
    'group busy': (GROUP_COLOURS[1], '6 2', 'waits, group busy'),
    'no executor': (GREY, '2 2', 'waits, no executor'),
    'answer': (LOST, '4 2', 'waits, for one that waits'),
    'lock': (GROUP_COLOURS[2], '2 2', 'waits, for a lock'),
}
RUNS = {
    '': (HEARD, '', 'callback runs'),
    'answer': (HEARD, '2 2', 'callback waits for an answer'),
    'lock': (HEARD, '1 3', 'callback waits for a lock'),
}


def picture(
    messages: Sequence[dict],
    names: Sequence[str],
    span_s: tuple[float, float],
    width: int,
    left: int,
    time_label: str,
) -> tuple[str, list[float]]:
    """Return an SVG of messages, as stories.js returns them, in a span of seconds; and its plot.

    It is `width` pixels wide; `left` of them are for the names, one for each message. The plot is
    the area of the time axis: left, right, top and bottom, as parts of the width and the height.
    """
    frame = _Frame(*span_s, width, left, len(messages))
    drawn, entries = _runs(frame, messages)
    above, top = _legend(entries, width)
    height = top + frame.bottom + BOTTOM
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height:g}" '
        f'width="{width}" height="{height:g}" font-family="sans-serif" font-size="12" '
        f'fill="{INK}"><rect width="100%" height="100%" fill="#fff"/>{above}'
        f'<g transform="translate(0 {top})">{drawn}{_axes(frame, names, time_label)}</g></svg>'
    )
    plot = left / width, 1 - RIGHT / width, top / height, (top + frame.bottom) / height
    return svg, [round(part, 4) for part in plot]


class _Frame(NamedTuple):
    """The places of times and rows, in pixels."""

    from_s: float
    until_s: float
    width: int
    left: int
    rows: int

    @property
    def step(self) -> float:
        """The height of a row."""
        return max(4.0, min(14.0, 260 / max(self.rows, 1)))

    @property
    def bottom(self) -> float:
        return self.step * self.rows

    def x(self, at_s: float) -> str:
        scale = (self.width - self.left - RIGHT) / (self.until_s - self.from_s)
        at = self.left + scale * (max(at_s, self.from_s) - self.from_s)
        return f'{at:.1f}'.removesuffix('.0')

    def y(self, row: int) -> str:
        return f'{self.step * (row + 0.5):.1f}'.removesuffix('.0')

    def lines(self, row: int, phases: list, end_s: float) -> Iterator[tuple[str, str]]:
        """Yield of each phase its cause, and its line."""
        for (start, cause), (end, _) in zip(phases, [*phases[1:], (end_s, '')], strict=False):
            begin, stop = max(start, self.from_s), min(end, end_s)
            if begin < stop:
                yield cause, f'M{self.x(begin)} {self.y(row)}H{self.x(stop)}'


def _runs(frame: _Frame, messages: Sequence[dict]) -> tuple[str, list]:
    """Return what became of the messages, and the entries of the legend."""
    rows = {(one['callback'], one['seq']): row for row, one in enumerate(messages)}
    waits, runs = defaultdict(list), defaultdict(list)
    crosses, pushed = [], []
    for row, one in enumerate(messages):
        left_s = one.get('left', frame.until_s)
        for cause, line in frame.lines(row, one['waits'], left_s):
            waits[cause].append(line)
        for cause, line in frame.lines(row, one['runs'], one.get('ended', frame.until_s)):
            runs[cause].append(line)
        if 'by' in one:
            crosses.append(f'M{frame.x(left_s)} {frame.y(row)}m-3-3l6 6m0-6l-6 6')
            if (by := rows.get((one['callback'], one['by']))) is not None:
                pushed.append(f'M{frame.x(left_s)} {frame.y(row)}V{frame.y(by)}')
    thin, thick = max(1.5, frame.step * 0.3), max(3.0, frame.step * 0.7)
    paths, legend = [], []
    for found, looks, line in ((waits, WAITS, thin), (runs, RUNS, thick)):
        for cause, (colour, dashes, words) in looks.items():
            if cause in found:
                paths.append(_path(found[cause], colour, line, dashes))
                legend.append((colour, line, dashes, words))
    if pushed:
        paths.append(_path(pushed, LOST, 0.8, '1 2'))
    if crosses:
        paths.append(_path(crosses, LOST, 1.6))
        legend.append((LOST, 0, '', 'pushed out'))
    return ''.join(paths), legend


def _axes(frame: _Frame, names: Sequence[str], time_label: str) -> str:
    """Return the names of the rows, and the axis of time."""
    left, width = frame.left, frame.width
    marks, texts = [], []
    for tick in MaxNLocator(max(2, width // 110)).tick_values(frame.from_s, frame.until_s):
        if frame.from_s <= tick <= frame.until_s:
            x = frame.x(tick)
            marks.append(_path([f'M{x} {frame.bottom:g}v5'], INK, 1))
            texts.append(
                f'<text x="{x}" y="{frame.bottom + 18:g}" text-anchor="middle">{tick:g}</text>'
            )
    every = next(n for n in (1, 2, 5) if n * frame.step >= 13)
    for row in range(0, len(names), every):
        y, name = float(frame.y(row)) + 4, escape(names[row])
        texts.append(f'<text x="{left - 6}" y="{y:g}" text-anchor="end">{name}</text>')
    middle, below = (width + left) // 2, frame.bottom + 34
    texts.append(f'<text x="{middle}" y="{below:g}" text-anchor="middle">{time_label}</text>')
    marks.append(_path([f'M{left} {frame.bottom:g}H{width - RIGHT}'], INK, 1))
    return ''.join(marks + texts)


def _path(lines: list[str], colour: str, line: float, dashes: str = '') -> str:
    dashed = f' stroke-dasharray="{dashes}"' if dashes else ''
    return f'<path d="{"".join(lines)}" stroke="{colour}" stroke-width="{line:g}"{dashed}/>'


def _legend(entries: list[tuple[str, float, str, str]], width: int) -> tuple[str, int]:
    """Return marks and texts of entries, and the height that they take.

    An entry is its colour, the width of its line (0 for a cross), its dashes, its words.
    """
    parts, at, y = [], RIGHT, LINE
    for colour, line, dashes, words in entries:
        needed = MARK + LETTER * len(words)
        if at > RIGHT and at + needed > width:
            at, y = RIGHT, y + LINE
        mark = f'M{at:g} {y - 4}h22' if line else f'M{at + 8:g} {y - 7}l6 6m0-6l-6 6'
        parts.append(_path([mark], colour, line or 1.6, dashes))
        parts.append(f'<text x="{at + MARK:g}" y="{y}">{escape(words)}</text>')
        at += needed + RIGHT
    return ''.join(parts), y + TOP


def address(svg: str) -> str:
    """Return the picture as the address of an image: percent signs are shorter than base64."""
    return f'data:image/svg+xml,{quote(svg.replace(chr(34), chr(39)), safe=SAFE)}'
