"""The scripts and styles of this folder, as a page gets them, or Python runs them.

A file of another package, such as the drive of the robot, is given as its path.
"""

import json
import re
from functools import cache
from html import escape
from pathlib import Path

# Not from `quickjs`: importing that starts a thread, which stays in the kernel.
from _quickjs import Context  # private: quickjs-ng, quickjs-ng 0.17.0
from rjsmin import jsmin

from helpers.notebook import LOOK, LOOK_CSS

DRAWN = 'model.js', 'rules.js', 'walk.js', 'stories.js', 'picture.js'
COLOURS = f'const LOOK = {json.dumps(LOOK)};\n'


def short(css: str) -> str:
    """Return a style without comments and needless spaces."""
    return re.sub(r'/\*.*?\*/|\s*([{};,])\s*|(?<=:) ', r'\1', css, flags=re.DOTALL)


@cache
def source(file: str | Path) -> str:
    """Return a file without comments and needless spaces."""
    path = Path(__file__).parent / file
    text = path.read_text()
    return jsmin(text) + '\n' if path.suffix == '.js' else short(text)


@cache
def script(*files: str | Path) -> str:
    """Return files as one script that leaves no name on the page."""
    look = COLOURS if 'picture.js' in files else ''
    return f'(() => {{\n{look}{"".join(map(source, files))}}})();'


@cache
def style(*files: str | Path, rows: bool = True) -> str:
    """Return the look that all share, and files, as an element of HTML.

    `rows` are those of a replay: what has none, such as a guess, is lighter without.
    """
    shared = ('frame.css', 'style.css') if rows else ('frame.css',)
    return f'<style>{short(LOOK_CSS)}{"".join(map(source, (*shared, *files)))}</style>'


def played(kind: str, record: dict, says: str, *names: str) -> str:
    """Return a game of this kind as a part of a page: what it says, and the files that make it one.

    `record` is what their script gets.
    """
    styles = [f'{kind}.css', *(['ring.css'] if 'ring.js' in names else [])]
    return (
        f'<div class="replay {kind}" data-{kind}={attribute(record)}>'
        f'{style(*styles)}<p>{escape(says)}</p>'
        '<p class="replay-static">To play it, run the cell, or trust the notebook.</p>'
        f'<script>{script(*names)}</script></div>'
    )


def javascript(
    function: str, *arguments, files: tuple[str | Path, ...] = ('circle.js', *DRAWN)
) -> list | dict | str:
    """Return what a function of these files returns, here in Python: without a page."""
    context = Context()
    context.eval(COLOURS + ''.join(map(source, files)))
    given = ', '.join(map(json.dumps, arguments))
    return json.loads(context.eval(f'JSON.stringify({function}({given}))'))


def attribute(value: dict) -> str:
    """Return a value as JSON in an attribute of HTML, with its quotes.

    They are single quotes: JSON has double quotes around each name and each text.
    """
    text = json.dumps(value, separators=(',', ':'))
    return "'" + text.replace('&', '&amp;').replace("'", '&#39;').replace('<', '&lt;') + "'"
