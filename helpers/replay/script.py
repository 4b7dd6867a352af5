"""The scripts and styles of this folder, as a page gets them."""

import json
import re
from functools import cache
from pathlib import Path

# A text of JavaScript, or a sign with spaces around it. Lines stay: some end a statement.
SPACE = re.compile(r"""('(?:\\.|[^'\\])*'|`(?:\\.|[^`\\])*`)| *([-{}()[\],;:?=<>+*&|!]) *""")


@cache
def source(name: str) -> str:
    """Return a file of this folder without comments, and without spaces that mean nothing."""
    text = Path(__file__).with_name(name).read_text()
    lines = (line.strip() for line in text.splitlines())
    code = ''.join(f'{line}\n' for line in lines if line and not line.startswith('//'))
    if name.endswith('.css'):
        return re.sub(r'\s*([{};,])\s*|: ', lambda found: found[1] or ':', code)
    code = SPACE.sub(lambda found: found[1] or found[2], code)
    return re.sub(r'(?<=[{;,(])\n|\n(?=})', '', code)


@cache
def script(*names: str) -> str:
    """Return files of this folder as one script that leaves no name on the page."""
    return f'(() => {{\n{"".join(map(source, names))}}})();'


def attribute(value: dict) -> str:
    """Return a value as JSON in an attribute of HTML, with its quotes.

    The quotes are single ones, of which JSON has none but in texts.
    """
    text = json.dumps(value, separators=(',', ':'))
    return "'" + text.replace('&', '&amp;').replace("'", '&#39;').replace('<', '&lt;') + "'"
