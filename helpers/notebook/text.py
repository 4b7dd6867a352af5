"""Lines that a slide can show."""

import textwrap
from collections.abc import Sequence

WIDTH = 94


def wrap(text: str, first: str = '', rest: str = '') -> list[str]:
    """Break a text into lines of at most 94 columns, at blanks only.

    `first` and `rest` are the indentations of the first line and of the others. JupyterLab breaks
    longer lines too, but inside words.
    """
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )


def table(rows: Sequence[Sequence[str]]) -> str:
    """Return rows of cells as text, with a line below the first row, the heading.

    If the last column is too long, it continues on lines of its own.
    """
    widths = [max(map(len, column)) for column in list(zip(*rows, strict=True))[:-1]]
    indent = ' ' * sum(width + 2 for width in widths)
    lines = []
    for *cells, last in rows:
        start = ''.join(f'{cell:<{width}}  ' for cell, width in zip(cells, widths, strict=True))
        lines += wrap(last, start, indent) or [start.rstrip()]
    lines.insert(1, '-' * max(map(len, lines)))
    return '\n'.join(lines)
