"""Terminals: what commands of a lesson have printed when it was run."""

from html import escape

from helpers.lesson import Lesson
from tools.lessons.first_pictures.look import PLAYS_S, WIDTH, svg, text_of

LINE, PAD = 32, 18  # pixels
STYLE = """
.window{fill:COLOUR(way);stroke:COLOUR(wall);stroke-opacity:.5}
.typed,.printed,.fault{font:21px ui-monospace,'SF Mono','DejaVu Sans Mono',Consolas,monospace;
white-space:pre}
.typed{font-weight:bold}
"""


def terminal_picture(lesson: Lesson, lines: list[str | tuple[str, str]]) -> str:
    """Return a terminal in which one line comes after the other.

    A line is what somebody types, or (cell, beginning): the lines that this cell has printed and
    that begin so. What is not there any more raises ValueError.
    """
    shown = []
    for line in lines:
        if isinstance(line, str):
            shown.append(('typed ink', line))
            continue
        cell_id, beginning = line
        printed = text_of(lesson, cell_id).splitlines()
        found = [text for text in printed if text.startswith(beginning)]
        if not found:
            raise ValueError(f'{cell_id} of {lesson.name} prints no {beginning!r} any more.')
        # A line of two sentences would be too long for the picture.
        for text in '\n'.join(found).replace('. ', '.\n').splitlines():
            shown.append(('fault lost' if 'assert' in text else 'printed ink', text))
    every_s = PLAYS_S / len(shown)
    texts = ''.join(
        f'<text class="{kind} comes" style="animation-delay:{i * every_s:.2f}s" x="{2 * PAD}" '
        f'y="{2 * PAD + i * LINE + 14}">{escape(text)}</text>'
        for i, (kind, text) in enumerate(shown)
    )
    height = len(shown) * LINE + 3.4 * PAD
    window = (
        f'<rect class="window" x="{PAD / 2}" y="{PAD / 2}" width="{WIDTH - PAD}" '
        f'height="{height - PAD}" rx="8"/>'
    )
    return svg(height, f'What {lesson.name} has printed', STYLE, window + texts)
