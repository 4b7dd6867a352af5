"""Which cell starts a slide, on notebooks made for it."""

import re
import shutil

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_raw_cell

from classroom.deck.pdf import NAMES, main, pages
from classroom.deck.slides import LINES, folded, slide_types
from helpers.lesson import path_of, tags

TITLE = new_markdown_cell('# 02 Lose messages\n\n**You need** lesson 01.')
STEP = new_markdown_cell('## 1. Build\n\nA node.')
TASK = new_markdown_cell('### ✎ Task 1')
QUESTION = new_markdown_cell('### Question 1')
FOLDED = {'source_hidden': True}


def text(source='Look at the output.', *tags):
    return new_markdown_cell(source, metadata={'tags': list(tags)})


def note(source='Ask.'):
    return new_raw_cell(source, metadata={'tags': ['notes']})


def code(lines=3, *tags, **metadata):
    metadata['tags'] = list(tags)
    return new_code_cell('\n'.join(['run()'] * lines), metadata=metadata)


@pytest.mark.parametrize(
    ('cells', 'types'),
    [
        ([code()], ['slide']),
        ([TITLE, STEP, text(), code(), code()], ['slide', 'slide', '', '', '']),
        ([TITLE, STEP, text('### Run'), code()], ['slide', 'slide', '', '']),
        # A text takes the code along that it leads to.
        ([STEP, code(), text(), code()], ['slide', '', 'subslide', '']),
        # Without code after it, it is about what is above.
        ([STEP, code(), text(), text('## 2. Look')], ['slide', '', '', 'slide']),
        # A task starts a slide, but joins a text before it. All that belongs to it is on one slide.
        ([STEP, TASK, code()], ['slide', '', '']),
        (
            [STEP, code(), TASK, code(9), code(1, 'check'), code(40, jupyter=FOLDED)],
            ['slide', '', 'subslide', '', '', ''],
        ),
        # Its check does so however long its code is.
        (
            [STEP, code(), TASK, code(LINES + 9), code(1, 'check'), code(40, 'solution')],
            ['slide', '', 'subslide', '', '', ''],
        ),
        # Questions start slides, also without code between them.
        ([STEP, QUESTION, new_markdown_cell('### Question 2')], ['slide', '', 'subslide']),
        # Much code is on two slides; what is folded does not count.
        ([STEP, code(LINES), code(1)], ['slide', '', 'subslide']),
        ([STEP, code(LINES), code(99, jupyter=FOLDED), code(1)], ['slide', '', '', 'subslide']),
        ([STEP, code(LINES + 9)], ['slide', '']),
        ([TITLE, text(), text('', 'deck-break'), code()], ['slide', '', 'subslide', '']),
        ([TITLE, code(), code(1, 'deck-break')], ['slide', '', 'subslide']),
        ([TITLE, note('word ' * 400), code(16)], ['slide', 'skip', '']),
        # A note does not part a text from its code.
        ([TITLE, code(), text(), note(), code()], ['slide', '', 'subslide', 'skip', '']),
    ],
)
def test_the_rule(cells, types):
    assert slide_types(new_notebook(cells=cells)) == types


@pytest.mark.parametrize(
    ('cell', 'is_folded'),
    [
        (code(1, jupyter=FOLDED), True),
        (new_code_cell('import math\nfrom pathlib import Path'), True),
        (new_code_cell('import math\nmath.pi'), False),
        (new_code_cell('%%write setup.py\nimport math'), False),
        (text(), False),
    ],
)
def test_what_is_folded(cell, is_folded):
    assert folded(cell) == is_folded


def test_the_slides_on_paper_are_those_of_the_deck():
    """Each slide begins a page; solutions and notes are on none."""
    notebook = nbformat.read(path_of('lose_messages'), as_version=4)
    text = pages(notebook)
    starts = [kind for kind in slide_types(notebook) if kind in ('slide', 'subslide')]
    [rule] = re.findall(r'((?:#page-\d+,? ?)+) \{ break-before: page; \}', text)
    assert len(re.findall(r'#page-\d+', rule)) == len(starts) - 1  # the first has its page
    for cell in notebook.cells:
        if cell.cell_type == 'raw':
            assert cell.source.splitlines()[0] not in text
        if 'solution' in tags(cell):
            assert cell.source.splitlines()[0] not in text
    ids = re.findall(r'id="page-(\d+)"', text)
    assert ids == [str(n) for n in range(len(ids))]


@pytest.mark.skipif(not any(map(shutil.which, NAMES)), reason='LEFT OUT, no Chromium')
def test_chromium_prints_them(tmp_path):
    assert main(['00', '--output', str(tmp_path)]) == 0
    [pdf] = tmp_path.iterdir()
    assert pdf.read_bytes().startswith(b'%PDF-')
