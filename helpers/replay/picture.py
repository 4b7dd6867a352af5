"""A run as one picture: a row for each message, and why it waited.

It is SVG, a tenth of the size of a PNG, and stands in a notebook as an image does.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from html import escape
from urllib.parse import quote

from matplotlib.ticker import MaxNLocator

from helpers.plots.style import GREY, GROUP_COLOURS, HEARD, INK, LOST, PALE, PUBLISHED

WIDTH, NARROW = 760, 440  # pixels; the narrow ones stand side by side
LEFT, RIGHT, TOP, BOTTOM = 46, 14, 14, 40
LINE, MARK = 16, 28  # of the legend: a line's height, and how far its words are from its mark
LETTER = 6.6  # about as wide as one of a name
MOST_ROWS = 120
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
    'answer': (PALE, '', 'callback waits for an answer'),
    'lock': (PALE, '2 1', 'callback waits for a lock'),
}


def picture(
    messages: Sequence[dict],
    names: Sequence[str],
    span_s: tuple[float, float],
    width: int,
    left: int,
    time_label: str,
) -> tuple[str, list[float]]:
    """Return an SVG of messages, as stories.js tells of them, in a span of seconds; and its plot.

    It is `width` pixels wide; `left` of them are for the names, one for each message. The plot is
    where time is shown: its left, right, top and bottom, as parts of the width and of the height.
    """
    from_s, until_s = span_s
    rows = {(one['callback'], one['seq']): row for row, one in enumerate(messages)}
    step = max(4.0, min(14.0, 260 / max(len(rows), 1)))
    bottom = step * len(rows)
    scale = (width - left - RIGHT) / (until_s - from_s)

    def x(at_s: float) -> str:
        return f'{left + scale * (max(at_s, from_s) - from_s):.1f}'.removesuffix('.0')

    def y(row: int) -> str:
        return f'{step * (row + 0.5):.1f}'.removesuffix('.0')

    def lines(row: int, phases: list, end_s: float) -> Iterator[tuple[str, str]]:
        """Yield of each phase its cause, and its line."""
        for (start, cause), (end, _) in zip(phases, [*phases[1:], (end_s, '')], strict=False):
            begin, stop = max(start, from_s), min(end, end_s)
            if begin < stop:
                yield cause, f'M{x(begin)} {y(row)}H{x(stop)}'

    waits, runs = defaultdict(list), defaultdict(list)
    crosses, pushed = [], []
    for row, one in enumerate(messages):
        left_s = one.get('left', until_s)
        for cause, line in lines(row, one['waits'], left_s):
            waits[cause].append(line)
        for cause, line in lines(row, one['runs'], one.get('ended', until_s)):
            runs[cause].append(line)
        if 'by' in one:
            crosses.append(f'M{x(left_s)} {y(row)}m-3-3l6 6m0-6l-6 6')
            if (by := rows.get((one['callback'], one['by']))) is not None:
                pushed.append(f'M{x(left_s)} {y(row)}V{y(by)}')

    thin, thick = max(1.5, step * 0.3), max(3.0, step * 0.7)
    parts, texts, legend = [], [], []
    for found, looks, line in ((waits, WAITS, thin), (runs, RUNS, thick)):
        for cause, (colour, dashes, words) in looks.items():
            if cause in found:
                parts.append(_path(found[cause], colour, line, dashes))
                legend.append((colour, line, dashes, words))
    if pushed:
        parts.append(_path(pushed, LOST, 0.8, '1 2'))
    if crosses:
        parts.append(_path(crosses, LOST, 1.6))
        legend.append((LOST, 0, '', 'pushed out'))
    for tick in MaxNLocator(max(2, width // 110)).tick_values(from_s, until_s):
        if from_s <= tick <= until_s:
            parts.append(_path([f'M{x(tick)} {bottom:g}v5'], INK, 1))
            texts.append(
                f'<text x="{x(tick)}" y="{bottom + 18:g}" text-anchor="middle">{tick:g}</text>'
            )
    every = next(n for n in (1, 2, 5, 10, 20, 50, 100) if n * step >= 13)
    texts += [
        f'<text x="{left - 6}" y="{float(y(row)) + 4:g}" text-anchor="end">{escape(name)}</text>'
        for row, name in enumerate(names)
        if row % every == 0
    ]
    middle = (width + left) // 2
    texts.append(f'<text x="{middle}" y="{bottom + 34:g}" text-anchor="middle">{time_label}</text>')
    parts.append(_path([f'M{left} {bottom:g}H{width - RIGHT}'], INK, 1))
    above, top = _legend(legend, width)
    height = top + bottom + BOTTOM
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height:g}" '
        f'width="{width}" height="{height:g}" font-family="sans-serif" font-size="12" '
        f'fill="{INK}"><rect width="100%" height="100%" fill="#fff"/>{"".join(above)}'
        f'<g transform="translate(0 {top})">{"".join(parts)}{"".join(texts)}</g></svg>'
    )
    plot = left / width, 1 - RIGHT / width, top / height, (top + bottom) / height
    return svg, [round(part, 4) for part in plot]


def _path(lines: list[str], colour: str, line: float, dashes: str = '') -> str:
    dashed = f' stroke-dasharray="{dashes}"' if dashes else ''
    return f'<path d="{"".join(lines)}" stroke="{colour}" stroke-width="{line:g}"{dashed}/>'


def _legend(entries: list[tuple[str, float, str, str]], width: int) -> tuple[list[str], int]:
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
    return parts, y + TOP


def address(svg: str) -> str:
    """Return the picture as the address of an image: percent signs are shorter than base64."""
    return f'data:image/svg+xml,{quote(svg.replace(chr(34), chr(39)), safe=SAFE)}'
