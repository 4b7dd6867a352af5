"""The scripts and styles of this folder, as a page gets them."""

import json
from functools import cache
from pathlib import Path

from rjsmin import jsmin


@cache
def source(name: str) -> str:
    """Return a file of this folder; a script without comments and needless spaces."""
    text = Path(__file__).with_name(name).read_text()
    return jsmin(text) + '\n' if name.endswith('.js') else text


@cache
def script(*names: str) -> str:
    """Return files of this folder as one script that leaves no name on the page."""
    return f'(() => {{\n{"".join(map(source, names))}}})();'


def attribute(value: dict) -> str:
    """Return a value as JSON in an attribute of HTML, with its quotes.

    They are single quotes: JSON has double quotes around each name and each text.
    """
    text = json.dumps(value, separators=(',', ':'))
    return "'" + text.replace('&', '&amp;').replace("'", '&#39;').replace('<', '&lt;') + "'"
