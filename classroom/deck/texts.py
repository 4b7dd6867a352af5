"""What of a text a slide shows: some forty words before a run. The rest is for the notes.

A slide is a stage. So of the texts above the first cell that runs, it keeps headings and pictures,
the first sentences below the last heading, and then those above it, as long as there is room. The
rest becomes a cell of the slide type 'notes': the notes window shows it, and T brings it onto the
slide. The first slide keeps what its lesson promises. A list, a table or a listing is shown as a
whole, or not at all.
"""

import re
from collections.abc import Iterator
from copy import deepcopy

import nbformat
from nbformat import NotebookNode
from nbformat.v4 import new_markdown_cell

WORDS = 40
NOTES = 'notes'  # a slide type of Jupyter: no slide shows it
BLOCKS = re.compile(r'\n{2,}(?![ \t])')  # between two of them: what is indented goes on
HEADING = re.compile(r'#{1,6} ')
PICTURE = re.compile(r'!\[')
PROSE = re.compile(r'(?![-*+|>] |\d+\. |```|\|)')
SENTENCE = re.compile(r'(?<=[.?!:])\s+(?=\S)')
LINK = re.compile(r'\[([^\]]*)\]\([^)]*\)')
UNSEEN = re.compile(r'<details lang=.*?</details>|<[^>]*>', re.DOTALL)  # in other languages; tags
HEAD = re.compile(r'^##? .*', re.MULTILINE)  # is not in the text: the head of the deck shows it

Unit = list[tuple[int, str]]  # what is shown together, or not at all: blocks, by their index


def words(text: str) -> int:
    """Return how many words of a text one reads on a slide."""
    text = HEAD.sub(' ', UNSEEN.sub(' ', LINK.sub(r'\1', text)))
    return sum(bool(re.search(r'\w', word)) for word in text.split())


def blocks(source: str) -> list[str]:
    """Return headings, paragraphs, lists and listings, in their order."""
    found: list[str] = []
    for part in BLOCKS.split(source.strip()):
        if found and found[-1].count('```') % 2:  # in a listing
            found[-1] += f'\n\n{part}'
        elif HEADING.match(part) and '\n' in part:
            found += part.split('\n', 1)
        else:
            found.append(part)
    return found


def sentences(block: str) -> list[str]:
    """Return the sentences of a paragraph. Inside of code, brackets and bold words none ends."""
    found: list[str] = []
    for part in SENTENCE.split(block):
        if found and _is_open(found[-1]):
            found[-1] += f' {part}'
        else:
            found.append(part)
    return [*_joined(found)]


def _is_open(text: str) -> bool:
    return (
        text.count('`') % 2 == 1
        or text.count('**') % 2 == 1
        or text.count('(') > text.count(')')
        or text.count('[') > text.count(']')
    )


def _joined(parts: list[str]) -> Iterator[str]:
    """Yield sentences. What ends with a colon goes on, but at the end of its paragraph."""
    text = ''
    for part in parts:
        text = f'{text} {part}' if text else part
        if not text.endswith(':'):
            yield text
            text = ''
    if text:
        yield text


def shortened(cells: list[NotebookNode], types: list[str]) -> list[NotebookNode]:
    """Return the cells, of which no slide shows more than some words before a run.

    `types` are the slide types of the cells.
    """
    starts = [i for i, kind in enumerate(types) if kind in ('slide', 'subslide')]
    found: list[NotebookNode] = []
    for start, end in zip(starts, [*starts[1:], len(cells)], strict=True):
        slide = cells[start:end]
        runs = next((i for i, cell in enumerate(slide) if cell.cell_type == 'code'), None)
        if start == 0 and runs is None:
            found += _opening(slide)
        elif runs is None:
            found += slide
        else:
            found += [*_before_a_run(slide[:runs]), *slide[runs:]]
    return found


def _before_a_run(cells: list[NotebookNode]) -> list[NotebookNode]:
    """Return the cells above a run, with what is for the notes in cells of their own."""
    texts = [i for i, cell in enumerate(cells) if cell.cell_type == 'markdown']
    parts = [(i, block) for i in texts for block in blocks(cells[i].source)]
    heads = [k for k, (_, block) in enumerate(parts) if HEADING.match(block)]
    shown = {k: block for k, (_, block) in enumerate(parts) if PICTURE.match(block) or k in heads}
    rest: dict[int, str] = {}
    left = WORDS - sum(words(parts[k][1]) for k in heads)
    last = heads[-1] if heads else 0
    for group, must in ((range(last, len(parts)), True), (range(last), False)):
        kept = True
        units = _units([(k, parts[k][1]) for k in group if k not in shown])
        for number, unit in enumerate(units):
            count = sum(words(text) for _, text in unit)
            kept = kept and count <= left
            left -= count * kept
            for n, (k, text) in enumerate(unit):
                # A text that begins with a long sentence shows it all the same.
                into = shown if kept or (must and number == n == 0) else rest
                into[k] = f'{into[k]} {text}' if k in into else text
    found = []
    for i, cell in enumerate(cells):
        if i in texts:
            own = [k for k, (place, _) in enumerate(parts) if place == i]
            of_both = ('\n\n'.join(of[k] for k in own if k in of) for of in (shown, rest))
            found += _parts(cell, *of_both)
        else:
            found.append(cell)
    return found


def _units(parts: list[tuple[int, str]]) -> list[Unit]:
    """Return the sentences of paragraphs, and other blocks. A colon leads to the next block."""
    found: list[Unit] = []
    for k, block in parts:
        pieces = sentences(block) if PROSE.match(block) else [block]
        if found and found[-1][-1][1].endswith(':'):
            found[-1].append((k, pieces.pop(0)))
        found += [[(k, piece)] for piece in pieces]
    return found


def _opening(slide: list[NotebookNode]) -> list[NotebookNode]:
    """Return the cells of the first slide: title, promise, picture; the rest is for the notes."""
    found = []
    for i, cell in enumerate(slide):
        if cell.cell_type != 'markdown' or PICTURE.search(cell.source):
            found.append(cell)
        else:
            parts = blocks(cell.source)
            kept = 2 if i == 0 else 0  # the title and the first paragraph
            found += _parts(cell, '\n\n'.join(parts[:kept]), '\n\n'.join(parts[kept:]))
    return found


def _parts(cell: NotebookNode, shown: str, rest: str) -> list[NotebookNode]:
    """Return a cell with what is shown, and one with the rest."""
    if not rest:
        return [cell]
    notes = {'slideshow': {'slide_type': NOTES}}
    cell = deepcopy(cell)
    if not shown:
        cell.metadata.update(nbformat.from_dict(notes))
        return [cell]
    cell.source = shown
    return [cell, new_markdown_cell(rest, id=f'{cell.id}-rest', metadata=notes)]
