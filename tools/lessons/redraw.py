"""Give saved replays, levels and guesses the scripts and the style of today, without a run.

    python -m tools.lessons.redraw            all lessons
    python -m tools.lessons.redraw 02 05      some of them

What a notebook holds of a replay is its record, its picture, and the files that draw it. If a file
`.js` or `.css` has changed, as of a colour, the record is still what happened. So only the files
are exchanged, and a lesson is not run. Which files an output has is read from the names in them.
Pictures stay: run the lesson if these have changed, too.
"""

import re
import sys
from functools import cache
from pathlib import Path

import nbformat

from helpers.lesson import ROOT, chosen
from helpers.replay import script, style
from tools.lessons.clean import clean, text_of, write

SCRIPT = re.compile(r'(?<=<script>)\(\(\) => \{\n.*?\}\)\(\);(?=</script>)', re.DOTALL)
STYLE = re.compile(r'<style>.*?</style>', re.DOTALL)
OURS = '<div class="replay'
GUESS = f'{OURS} guess"'
FIRST = re.compile(r'^(?:export )?(?:function|const|let) (\w+)', re.MULTILINE)
LAST = re.compile(r'JSON\.parse\((root\.dataset\.\w+)\)')  # of a file that ends a script
RULE = re.compile(r'^([^/\s@][^{]*?)\s*\{', re.MULTILINE)
SHARED = {'frame.css', 'style.css', 'look.css'}  # no maker of a style names them


@cache
def marks(kind: str) -> dict[Path | str, list[str]]:
    """Return the files `.js` or `.css` of helpers, each with patterns of what is in it alone."""
    found = {}
    for file in sorted((ROOT / 'helpers').rglob(f'*.{kind}')):
        text = re.sub(r'/\*.*?\*/', '', file.read_text(encoding='utf-8'), flags=re.DOTALL)
        if file.name in SHARED:
            continue
        if kind == 'css':
            patterns = [rf'[}}]{re.escape(rule)}\s*[{{]' for rule in RULE.findall(text)[:1]]
        elif 'document.currentScript' in text:
            patterns = [re.escape(last) for last in LAST.findall(text)]
        else:
            patterns = [rf'\b(?:function|const|let) {name}\b' for name in FIRST.findall(text)]
        if patterns:
            found[file.name if file.parent.name == 'replay' else file] = patterns
    return found


def files_in(text: str, kind: str) -> list[Path | str]:
    """Return the files that a script or a style was made of, in their order.

    Most names of a file are there: two files may have one in common, and a new one is in no old
    output.
    """
    places = {}
    for file, patterns in marks(kind).items():
        hits = [hit.start() for pattern in patterns if (hit := re.search(pattern, text))]
        if len(hits) > len(patterns) / 2:
            places[file] = hits[0]
    return sorted(places, key=places.get)


def names_in(text: str) -> set[str]:
    """Return the functions and constants of today's files `.js` that a script has."""
    known = {name for patterns in marks('js').values() for name in patterns}
    return {name for name in known if re.search(name, text)}


def redrawn(html: str) -> str:
    """Return an output with the files of today.

    Raises ValueError if a file has changed so much that it is not known again in the output.
    """
    if OURS not in html:
        return html

    def of_today(old: re.Match) -> str:
        new = script(*files_in(old[0], 'js'))
        if lost := names_in(old[0]) - names_in(new):
            raise ValueError(f'it would lose {min(lost)}: run the lesson.')
        return new

    html = SCRIPT.sub(of_today, html)
    rows = not html.startswith(GUESS)
    return STYLE.sub(lambda old: style(*files_in(old[0], 'css'), rows=rows), html)


def redraw(path: Path) -> bool:
    """Redraw the outputs of a notebook in place; return whether that changed it."""
    before = path.read_text(encoding='utf-8')
    notebook = clean(nbformat.reads(before, as_version=4))
    for cell in notebook.cells:
        for output in cell.get('outputs', []):
            data = output.get('data', {})
            if 'text/html' in data:
                data['text/html'] = redrawn(data['text/html'])
    return write(path, text_of(notebook), before)


if __name__ == '__main__':
    for path in chosen(' '.join(sys.argv[1:]), ROOT / 'notebooks'):
        try:
            print(f'{path.name}: {"redrawn" if redraw(path) else "unchanged"}')
        except ValueError as error:
            print(f'{path.name}: not redrawn, {error}')
