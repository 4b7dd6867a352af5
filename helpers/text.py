"""Lines that a slide can show."""

import textwrap

COLUMNS = 94


def wrap(text: str, first: str = '', rest: str = '') -> list[str]:
    """Break a text into lines of at most 94 columns, at blanks only.

    `first` and `rest` are the indentations of the first line and of the others. JupyterLab breaks
    longer lines too, but inside words.
    """
    return textwrap.wrap(
        text,
        COLUMNS,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )
