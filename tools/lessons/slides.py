"""Which cell of a lesson starts a slide: a rule, so that nobody keeps it up by hand.

A title and a step (`#`, `##`) start a slide. What follows is revealed on it, cell by cell, as long
as it fits: `fragment`. A part (`###`), a solution, and what no longer fits start a slide below it:
`subslide`. A cell stays together with the text that leads to it, if a slide has room for both,
and `### Explain` with what it explains.

If the rule is wrong for a cell, a tag of the cell (JupyterLab, Property Inspector) changes it:

    deck-break      starts a slide below, although it would fit
    deck-skip       is left out of the deck
    notes           is for the instructor: a raw cell, folded in JupyterLab, left out of the deck

jupyterlab-slideshow has traps: it hides a cell of the type `-`, and from one of the type `notes`,
where Shift+Enter can lead, no key leads on. So no cell gets these types.
"""

import ast
import re
from base64 import b64decode
from math import ceil

from nbformat import NotebookNode

from tools.lessons.lesson import tags

SKIPPED = {'deck-skip', 'notes'}
ALONE = {'deck-break', 'solution'}

# The sizes of deck.css, in hundredths of the slide's height. Letters are taken a little wider than
# in most fonts. tests/browser measures what they really are.
SLIDE, WIDTH = 97.0, 155.0
FOLDED, BORDER = 4.0, 1.5
PROSE_LINE, PROSE_GAP, PROSE_CHARACTERS, PROSE_PICTURE = 4.2, 3.1, 82, 47.0
HEADINGS = {'#': 17.0, '##': 12.0, '###': 9.0}
TABLE_ROW, TABLE_CHARACTERS = 4.6, 120
UNFOLDED = re.compile(r'<summary>(.*?)</summary>.*?</details>', re.DOTALL)
LISTING = re.compile(r'^```.*?\n(.*?)^```$', re.DOTALL | re.MULTILINE)
MARKUP = re.compile(r'<[^>]+>|\]\([^)]*\)|[*`\[]')
CODE = {8: 62.0, 18: 38.0, 999: 28.0}  # lines of code at most: the height of a figure
LETTER = 2.78  # of code
CODE_LINE, CODE_CHARACTER = 1.2, 0.61  # times the size of a letter
REPLAY = 80.0  # about; the deck scrolls to the end of a higher one
PICTURE = re.compile('src="data:image/png;base64,([^"]*)"')


def slide_types(notebook: NotebookNode) -> list[str]:
    """Return the slide type of each cell: slide, subslide, fragment or skip."""
    types: list[str] = []
    used = 0.0
    for group in _groups(notebook):
        heights = [height(cell) for cell in group]
        together = [sum(heights) if sum(heights) <= SLIDE else heights[0], *heights[1:]]
        for cell, own, needed in zip(group, heights, together, strict=True):
            kind = _slide_type(cell, set(types) <= {'skip'}, used + needed <= SLIDE)
            used = own + (used if kind in ('fragment', 'skip') else 0)
            types.append(kind)
    return types


def _groups(notebook: NotebookNode) -> list[list[NotebookNode]]:
    """Return the cells in groups: text, and the code that it leads to."""
    groups: list[list[NotebookNode]] = []
    for cell in notebook.cells:
        follows = tags(cell) & SKIPPED or cell.cell_type != 'markdown' and not tags(cell) & ALONE
        if groups and follows:
            groups[-1].append(cell)
        else:
            groups.append([cell])
    return groups


def _slide_type(cell: NotebookNode, first: bool, fits: bool) -> str:
    if tags(cell) & SKIPPED:
        return 'skip'
    if first or heading(cell, '##? '):
        return 'slide'
    if not fits or heading(cell, '### (?!Explain)') or tags(cell) & ALONE:
        return 'subslide'
    return 'fragment'


def heading(cell: NotebookNode, form: str) -> bool:
    """Return whether a cell of text begins with a heading of this form, a regular expression."""
    return cell.cell_type == 'markdown' and bool(re.match(form, cell.source))


def height(cell: NotebookNode) -> float:
    """Return about how high a cell is with its outputs, in hundredths of the slide's height."""
    if tags(cell) & SKIPPED or cell.cell_type == 'raw':
        return 0.0
    if cell.cell_type == 'markdown':
        source = UNFOLDED.sub(r'\1', cell.source)  # a reader unfolds one part at a time
        listings = LISTING.findall(source)
        prose = re.split(r'\n{2,}', LISTING.sub('', source).strip())
        return sum(map(_height_of_prose, prose)) + sum(
            PROSE_GAP + _height_of_text(listing) for listing in listings
        )
    lines = len(cell.source.splitlines())
    figure = next(tall for most, tall in CODE.items() if lines <= most)
    source = FOLDED if folded(cell) else _height_of_text(cell.source)
    outputs = sum(_height_of_output(output, figure) for output in cell.outputs)
    return BORDER + source + outputs + (BORDER if cell.outputs else 0)


def folded(cell: NotebookNode) -> bool:
    """Return whether a slide shows of a cell only the first line and the outputs."""
    if cell.cell_type != 'code':
        return False
    if tags(cell) & {'check', 'harness'} or cell.metadata.get('jupyter', {}).get('source_hidden'):
        return True
    try:
        statements = ast.parse(cell.source).body
    except SyntaxError:  # a magic command
        return False
    return bool(statements) and all(isinstance(s, ast.Import | ast.ImportFrom) for s in statements)


def _height_of_prose(block: str) -> float:
    if block.startswith('#'):
        return HEADINGS.get(block.partition(' ')[0], PROSE_LINE + PROSE_GAP)
    if block.startswith('!['):
        return PROSE_PICTURE + PROSE_GAP
    text = MARKUP.sub('', block)
    lines = text.splitlines()
    if text.startswith('|'):
        rows = [TABLE_ROW * ceil(len(line) / TABLE_CHARACTERS) for line in lines]
        return sum(rows) - TABLE_ROW + PROSE_GAP
    if not re.search(r'^(- |\d\. |> )', text, re.MULTILINE):
        lines = [' '.join(lines)]
    return PROSE_GAP + PROSE_LINE * sum(ceil(len(line) / PROSE_CHARACTERS) for line in lines)


def png_of(output: NotebookNode) -> bytes | None:
    """Return the PNG file of an output that is a figure of `helpers._plumbing.alt_text`."""
    found = PICTURE.search(output.get('data', {}).get('text/html', ''))
    return b64decode(found[1]) if found else None


def _height_of_output(output: NotebookNode, figure: float) -> float:
    data = output.get('data', {})
    if png := png_of(output):
        width, tall = (int.from_bytes(png[i : i + 4], 'big') for i in (16, 20))
        return min(figure, WIDTH * tall / max(width, 1)) + BORDER
    if '<div class="replay' in data.get('text/html', ''):
        return REPLAY
    if 'text/html' in data:
        return data['text/html'].count('<tr') * TABLE_ROW
    return _height_of_text(output.get('text', '') or data.get('text/plain', ''))


def _height_of_text(text: str) -> float:
    most = int(WIDTH / LETTER / CODE_CHARACTER)
    lines = sum(max(1, ceil(len(line) / most)) for line in text.splitlines())
    return lines * LETTER * CODE_LINE
