"""A run as one picture: a row for each message, and why it waited.

It is SVG, a tenth of the size of a PNG, and stands in a notebook as an image does.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from urllib.parse import quote

from matplotlib.ticker import MaxNLocator

from helpers.plots.style import GREY, GROUP_COLOURS, HEARD, INK, LOST, PALE, PUBLISHED
from helpers.replay.events import ARRIVE, END, TAKE, Event

WIDTH, NARROW = 760, 440  # pixels; the narrow ones stand side by side
LEFT, RIGHT, TOP, BOTTOM = 46, 14, 30, 40
MOST_ROWS = 120
TIME_LABEL = 'time since the first publish (s)'
SAFE = "!$'()*+,-./:;=?@_~ "  # may stand in the address of an image, in double quotes
# Why a message waits, as model.js calls it: colour, dashes, and how the legend says it.
CAUSES = {
    '': (PALE, '', 'waits, a thread is free'),
    'thread busy': (PUBLISHED, '', 'waits, thread busy'),
    'group busy': (GROUP_COLOURS[1], '6 2', 'waits, group busy'),
    'no executor': (GREY, '2 2', 'waits, no executor'),
}


def causes(events: Sequence[Event], threads: int, exclusive: bool) -> list[tuple[float, str]]:
    """Return from when on (seconds) a message that waits has which cause, one of CAUSES."""
    running, found = 0, [(0.0, '' if threads else 'no executor')]
    for event in events:
        running += {ARRIVE: 0, TAKE: 1, END: -1}[event.do]
        if not threads:
            cause = 'no executor'
        elif running == threads:
            cause = 'thread busy'
        else:
            cause = 'group busy' if exclusive and running else ''
        if cause != found[-1][1]:
            found.append((event.at_s, cause))
    return found


def picture(
    events: Sequence[Event],
    depth: int,
    threads: int,
    exclusive: bool,
    span_s: tuple[float, float],
    width: int = WIDTH,
) -> str:
    """Return an SVG of the first MOST_ROWS messages, in a span of seconds, `width` pixels wide."""
    from_s, until_s = span_s
    published = [event for event in events if event.do == ARRIVE][:MOST_ROWS]
    rows = {event.seq: row for row, event in enumerate(published)}
    taken = {event.seq: event.at_s for event in events if event.do == TAKE}
    ended = {event.seq: event.at_s for event in events if event.do == END}
    step = max(4.0, min(14.0, 260 / max(len(rows), 1)))
    height = TOP + step * len(rows) + BOTTOM
    scale = (width - LEFT - RIGHT) / (until_s - from_s)

    def x(at_s: float) -> str:
        return f'{LEFT + scale * (max(at_s, from_s) - from_s):.1f}'.removesuffix('.0')

    def y(seq: int) -> str:
        return f'{TOP + step * (rows[seq] + 0.5):.1f}'.removesuffix('.0')

    waits: dict[str, list[str]] = {}
    runs, crosses, pushed = [], [], []
    phases = causes(events, threads, exclusive)
    arrivals = {event.seq: event.at_s for event in events if event.do == ARRIVE}
    seqs = list(arrivals)
    for row, event in enumerate(published):
        by = seqs[row + depth] if row + depth < len(seqs) else None
        left = taken.get(event.seq, arrivals.get(by, until_s))
        for (start, cause), (end, _) in zip(phases, [*phases[1:], (until_s, '')], strict=True):
            begin, stop = max(start, event.at_s), min(end, left)
            if begin < stop:
                waits.setdefault(cause, []).append(f'M{x(begin)} {y(event.seq)}H{x(stop)}')
        if event.seq in taken:
            runs.append(f'M{x(left)} {y(event.seq)}H{x(ended.get(event.seq, until_s))}')
        elif by is not None:
            crosses.append(f'M{x(left)} {y(event.seq)}m-3-3l6 6m0-6l-6 6')
            if by in rows:
                pushed.append(f'M{x(left)} {y(event.seq)}V{y(by)}')

    thin, thick = max(1.5, step * 0.3), max(3.0, step * 0.7)
    seen = {name: look for name, look in CAUSES.items() if name in waits}
    parts = [_path(waits[name], look[0], thin, look[1]) for name, look in seen.items()]
    parts += [
        _path(lines, *look)
        for lines, look in (
            (pushed, (LOST, 0.8, '1 2')),
            (runs, (HEARD, thick)),
            (crosses, (LOST, 1.6)),
        )
        if lines
    ]
    legend = [(look[0], thin, look[1], look[2]) for look in seen.values()]
    if runs:
        legend.append((HEARD, thick, '', 'callback runs'))
    if crosses:
        legend.append((LOST, 0, '', 'pushed out'))
    marks, texts = _legend(legend)
    parts += marks
    bottom = height - BOTTOM
    for tick in MaxNLocator(max(2, width // 110)).tick_values(from_s, until_s):
        if from_s <= tick <= until_s:
            parts.append(_path([f'M{x(tick)} {bottom:g}v5'], INK, 1))
            texts.append(
                f'<text x="{x(tick)}" y="{bottom + 18:g}" text-anchor="middle">{tick:g}</text>'
            )
    every = next(n for n in (1, 2, 5, 10, 20, 50, 100) if n * step >= 13)
    texts += [
        f'<text x="{LEFT - 6}" y="{float(y(seq)) + 4:g}" text-anchor="end">{seq}</text>'
        for seq, row in rows.items()
        if row % every == 0
    ]
    middle = (width + LEFT) // 2
    texts.append(f'<text x="{middle}" y="{bottom + 34:g}" text-anchor="middle">{TIME_LABEL}</text>')
    parts.append(_path([f'M{LEFT} {bottom:g}H{width - RIGHT}'], INK, 1))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height:g}" '
        f'width="{width}" height="{height:g}"><rect width="100%" height="100%" fill="#fff"/>'
        f'<g fill="none">{"".join(parts)}</g><g font-family="sans-serif" font-size="12" '
        f'fill="{INK}">{"".join(texts)}</g></svg>'
    )


def _path(lines: list[str], colour: str, line: float, dashes: str = '') -> str:
    dashed = f' stroke-dasharray="{dashes}"' if dashes else ''
    return f'<path d="{"".join(lines)}" stroke="{colour}" stroke-width="{line:g}"{dashed}/>'


def _legend(entries: list[tuple[str, float, str, str]]) -> tuple[list[str], list[str]]:
    """Return marks and texts of entries: colour, width of a line (0 for a cross), dashes, words."""
    marks, texts, at = [], [], LEFT
    for colour, line, dashes, words in entries:
        mark = [f'M{at} 12h22'] if line else [f'M{at + 8} 9l6 6m0-6l-6 6']
        marks.append(_path(mark, colour, line or 1.6, dashes))
        texts.append(f'<text x="{at + 28}" y="16">{escape(words)}</text>')
        at += 44 + 7 * len(words)
    return marks, texts


def address(svg: str) -> str:
    """Return the picture as the address of an image: percent signs are shorter than base64."""
    return f'data:image/svg+xml,{quote(svg.replace(chr(34), chr(39)), safe=SAFE)}'
