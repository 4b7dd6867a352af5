"""The scripts and styles of this folder, as a page gets them, or Python runs them.

A file of another package, such as the drive of the robot, is given as its path. A script is a
module that imports what it needs; a page gets them all as one script, what is needed first.
"""

import json
import re
from collections.abc import Iterable
from functools import cache
from html import escape
from pathlib import Path

# Not from `quickjs`: importing that starts a thread, which stays in the kernel.
from _quickjs import Context  # private: quickjs-ng, quickjs-ng 0.17.0
from rjsmin import jsmin

from helpers.notebook import LOOK, LOOK_CSS

HERE = Path(__file__).resolve().parent
IMPORT = re.compile(r"^import \{[^}]*\} from '(.+)';\n", re.MULTILINE)
COLOURS = f'const LOOK = {json.dumps(LOOK)};\n'


def short(css: str) -> str:
    """Return a style without comments, needless spaces, and the last semicolon of a rule."""
    css = re.sub(r'/\*.*?\*/', '', css, flags=re.DOTALL)
    return re.sub(r'\s*([{};,>])\s*|(?<=:) ', r'\1', css).replace(';}', '}')


@cache
def source(file: str | Path) -> str:
    """Return a file without comments, needless spaces, and what makes it a module.

    rjsmin does not know a template inside of another one: it takes blanks out of it.
    """
    path = HERE / file
    text = path.read_text()
    if path.suffix != '.js':
        return short(text)
    text = re.sub('^export ', '', IMPORT.sub('', text), flags=re.MULTILINE)
    return jsmin(text) + '\n'


def with_imports(files: Iterable[str | Path]) -> list[Path]:
    """Return files `.js`, each once, and before each of them what it imports."""
    found: list[Path] = []

    def add(path: Path) -> None:
        if path in found:
            return
        for name in IMPORT.findall(path.read_text()):
            add((path.parent / name).resolve())
        found.append(path)

    for file in files:
        add((HERE / file).resolve())
    return found


@cache
def script(*files: str | Path) -> str:
    """Return files and what they import as one script that leaves no name on the page."""
    paths = with_imports(files)
    look = COLOURS if HERE / 'picture.js' in paths else ''
    return f'(() => {{\n{look}{"".join(map(source, paths))}}})();'


@cache
def style(*files: str | Path, rows: bool = True) -> str:
    """Return the look that all share, and files, as an element of HTML.

    `rows` are those of a replay: what has none, such as a guess, is lighter without.
    """
    shared = ('frame.css', 'style.css') if rows else ('frame.css',)
    return f'<style>{short(LOOK_CSS)}{"".join(map(source, (*shared, *files)))}</style>'


def played(kind: str, record: dict, says: str, *styles: str) -> str:
    """Return a game of this kind as a part of a page: what it says, and its script and style.

    `record` is what the script gets, `styles` are further ones.
    """
    return (
        f'<div class="replay {kind}" data-{kind}={attribute(record)}>'
        f'{style(f"{kind}.css", *styles)}<p>{escape(says)}</p>'
        '<p class="replay-static">To play it, run the cell, or trust the notebook.</p>'
        f'<script>{script(f"{kind}.js")}</script></div>'
    )


def javascript(
    function: str, *arguments, files: tuple[str | Path, ...] = ('picture.js', 'circle.js')
) -> list | dict | str:
    """Return what a function of these files returns, here in Python: without a page."""
    context = Context()
    context.eval(COLOURS + ''.join(map(source, with_imports(files))))
    given = ', '.join(map(json.dumps, arguments))
    return json.loads(context.eval(f'JSON.stringify({function}({given}))'))


def attribute(value: dict) -> str:
    """Return a value as JSON in an attribute of HTML, with its quotes.

    They are single quotes: JSON has double quotes around each name and each text.
    """
    text = json.dumps(value, separators=(',', ':'))
    return "'" + text.replace('&', '&amp;').replace("'", '&#39;').replace('<', '&lt;') + "'"
