"""Which cell of a lesson starts a slide: a rule, so that nobody keeps it up by hand.

A title and a step (`#`, `##`) start a slide. What follows joins it as long as it fits: a text
always with the code that it leads to. A task and a question (`### ✎`, `### Question`) start a slide
below, unless only text is before them; a cell with the tag `deck-break` does so, too (JupyterLab,
Property Inspector). A raw cell is a note for the instructor, and left out.
"""

import ast
import re
from base64 import b64decode
from math import ceil

from nbformat import NotebookNode

from tools.lessons.lesson import tags

SENTENCE = 16.0  # a text below this height has no slide of its own

# The sizes of deck.css, in hundredths of the slide's height. Letters are taken a little wider than
# in most fonts. tests/classroom measures what they really are.
SLIDE, WIDTH = 90.0, 165.0
LARGEST = 101.0  # with the smallest letters
FOLDED, BORDER = 4.2, 2.0
PROSE_LINE, PROSE_GAP, PROSE_CHARACTERS, PROSE_PICTURE = 4.3, 3.2, 92, 47.0
HEADINGS = {'#': 10.0, '##': 0.0, '###': 6.5}
TABLE_ROW, TABLE_CHARACTERS = 4.7, 130
UNFOLDED = re.compile(r'<summary>(.*?)</summary>.*?</details>', re.DOTALL)
LISTING = re.compile(r'^```.*?\n(.*?)^```$', re.DOTALL | re.MULTILINE)
MARKUP = re.compile(r'<[^>]+>|\]\([^)]*\)|[*`\[]')
CODE = {8: 60.0, 18: 38.0, 999: 28.0}  # lines of code at most: the height of a figure
LETTER = 2.8  # of code
CODE_LINE, CODE_CHARACTER = 1.2, 0.61  # times the size of a letter
REPLAY = 80.0  # about; the deck scrolls to the end of a higher one
PICTURE = re.compile('src="data:image/png;base64,([^"]*)"')


def slide_types(notebook: NotebookNode) -> list[str]:
    """Return the slide type of each cell: slide, subslide, skip, or nothing if it goes on."""
    types = ['skip' if cell.cell_type == 'raw' else '' for cell in notebook.cells]
    slide: list[list[int]] = []  # its groups
    for group in _groups(notebook):
        cells = [notebook.cells[i] for i in group]
        fits = _height(notebook, [*slide, group]) <= SLIDE
        if not slide or heading(cells[0], '##? '):
            slide, types[group[0]] = [group], 'slide'
        elif fits and not _breaks(cells[0], after_code=_has_code(notebook, slide)):
            slide.append(group)
        else:
            # A sentence at the end takes what it is about along.
            last = slide[-1]
            alone = not _has_code(notebook, [group]) and _height(notebook, [group]) < SENTENCE
            along = alone and len(slide) > 1 and _height(notebook, [last, group]) <= SLIDE
            slide = [last, group] if along else [group]
            types[slide[0][0]] = 'subslide'
    return types


def _groups(notebook: NotebookNode) -> list[list[int]]:
    """Return the cells that are shown, by index, in groups: text, and the code that it leads to."""
    groups: list[list[int]] = []
    for i, cell in enumerate(notebook.cells):
        if cell.cell_type == 'raw':
            continue
        joins = cell.cell_type != 'markdown' and 'deck-break' not in tags(cell)
        fits = groups and _height(notebook, [[*groups[-1], i]]) <= SLIDE
        if groups and joins and (fits or 'solution' in tags(cell)):
            groups[-1].append(i)
        else:
            groups.append([i])
    return groups


def _height(notebook: NotebookNode, groups: list[list[int]]) -> float:
    return sum(height(notebook.cells[i]) for group in groups for i in group)


def _has_code(notebook: NotebookNode, groups: list[list[int]]) -> bool:
    return any(notebook.cells[i].cell_type == 'code' for group in groups for i in group)


def _breaks(cell: NotebookNode, after_code: bool) -> bool:
    return 'deck-break' in tags(cell) or after_code and heading(cell, '### (✎|Question )')


def heading(cell: NotebookNode, form: str) -> bool:
    """Return whether a cell of text begins with a heading of this form, a regular expression."""
    return cell.cell_type == 'markdown' and bool(re.match(form, cell.source))


def height(cell: NotebookNode) -> float:
    """Return about how high a cell is with its outputs, in hundredths of the slide's height."""
    if cell.cell_type == 'raw':
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
    # What a solution prints comes into view if it is run.
    shown = [] if 'solution' in tags(cell) else cell.outputs
    outputs = sum(_height_of_output(output, figure) for output in shown)
    return BORDER + source + outputs + (BORDER if shown else 0)


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
    """Return the PNG file of an output that is a figure of `helpers.plots.alt_text`."""
    picture = PICTURE.search(output.get('data', {}).get('text/html', ''))
    return b64decode(picture[1]) if picture else None


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
