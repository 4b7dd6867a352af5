"""Which cell of a lesson starts a slide: a rule, so that nobody keeps it up by hand.

A title and a step (`#`, `##`) start a slide. A text starts one below it if code follows, and so
does a task or a question (`### ✎`, `### Question`); a text without code joins what it is about.
Code joins its text, as long as the slide shows not too much of it. The check and the solution of a
task join the cell that they are about, whatever its length, and end its slide. So does a guess:
what answers it has a slide of its own. A cell with the tag `deck-break` always starts a slide
(JupyterLab, Property Inspector). A raw cell is a note for the instructor, and left out.

The rule knows no heights: the deck makes a slide that is too full a little smaller, and scrolls it.
"""

import ast

from nbformat import NotebookNode

from helpers.lesson import WRITTEN, has_heading, is_folded, tags

LINES = 18  # of code that is not folded: more of it is on the next slide
HELPERS = ast.Import, ast.ImportFrom, ast.FunctionDef, ast.Assign  # of a cell that runs nothing


def slide_types(notebook: NotebookNode) -> list[str]:
    """Return the slide type of each cell: slide, subslide, skip, or nothing if it goes on."""
    types, slide = [], []
    for index, cell in enumerate(notebook.cells):
        if cell.cell_type == 'raw':
            types.append('skip')
            continue
        kind = ''
        if not slide or has_heading(cell, '##? '):
            kind = 'slide'
        elif _starts(cell, slide, _code_after(notebook, index)):
            kind = 'subslide'
        slide = [cell] if kind else [*slide, cell]
        types.append(kind)
    return types


def _starts(cell: NotebookNode, slide: list[NotebookNode], code_follows: bool) -> bool:
    """Return whether a cell starts a slide below the one that holds these cells."""
    if 'deck-break' in tags(cell):
        return True
    if {'check', 'solution'}.intersection(tags(cell)):
        return slide[-1].cell_type != 'code'
    if cell.cell_type == 'code':
        lines = sum(_lines(other) for other in [*slide, cell])
        too_many = _lines(cell) > 0 and lines > LINES and slide[-1].cell_type == 'code'
        return too_many or bool({'predict', 'check', 'solution'} & tags(slide[-1]))
    if has_heading(cell, '### Question '):
        return any(other.cell_type == 'code' or has_heading(other, '### ') for other in slide)
    has_code = any(other.cell_type == 'code' for other in slide)
    return has_code and (code_follows or has_heading(cell, '### '))


def _code_after(notebook: NotebookNode, index: int) -> bool:
    """Return whether the next cell that is shown after the one with an index is code."""
    later = (cell for cell in notebook.cells[index + 1 :] if cell.cell_type != 'raw')
    return next((cell.cell_type == 'code' for cell in later), False)


def _lines(cell: NotebookNode) -> int:
    """Return how many lines of code of a cell a slide shows."""
    is_shown = cell.cell_type == 'code' and not folded(cell)
    return len(cell.source.splitlines()) if is_shown else 0


def folded(cell: NotebookNode) -> bool:
    """Return whether a slide shows of a cell only the first line and the outputs.

    So it is with what was folded in the lesson, with imports and names that are given beside them,
    and with functions that help.
    """
    if cell.cell_type != 'code' or WRITTEN & tags(cell):
        return False
    if is_folded(cell):
        return True
    try:
        kinds = {type(statement) for statement in ast.parse(cell.source).body}
    except SyntaxError:  # a magic command
        return False
    helps = kinds & {ast.Import, ast.ImportFrom, ast.FunctionDef}
    return bool(helps) and kinds <= {*HELPERS}
