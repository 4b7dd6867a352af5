"""Which cell starts a slide, on notebooks made for it."""

import pytest
from nbformat.v4 import (
    new_code_cell,
    new_markdown_cell,
    new_notebook,
    new_output,
    new_raw_cell,
)

from tools.lessons.slides import SLIDE, height, slide_types

TITLE = new_markdown_cell('# 02 Lose messages\n\n**You need** lesson 01.')
STEP = new_markdown_cell('## 1. Build\n\nA node.')


def text(source='Look at the output.', *tags):
    return new_markdown_cell(source, metadata={'tags': list(tags)})


def note(source='Ask.'):
    return new_raw_cell(source, metadata={'tags': ['notes']})


def code(lines=3, *tags, outputs=(), **metadata):
    metadata['tags'] = list(tags)
    return new_code_cell('\n'.join(['run()'] * lines), metadata=metadata, outputs=list(outputs))


def printed(lines):
    return [new_output('stream', text='heard\n' * lines)]


@pytest.mark.parametrize(
    ('cells', 'types'),
    [
        ([code()], ['slide']),
        ([TITLE, STEP, text(), code(), code()], ['slide', 'slide', '', '', '']),
        ([TITLE, STEP, text('### Run'), code()], ['slide', 'slide', '', '']),
        # A task starts a slide, but joins a text before it.
        ([TITLE, STEP, text('### ✎ Task 1'), code()], ['slide', 'slide', '', '']),
        ([TITLE, code(), text('### ✎ Task 1'), code()], ['slide', '', 'subslide', '']),
        # The text moves to the next slide with the code that it leads to,
        ([TITLE, STEP, code(18), text(), code(16)], ['slide', 'slide', '', 'subslide', '']),
        # except if the two do not fit together either.
        ([STEP, text('word ' * 80), code(25, outputs=printed(8))], ['slide', '', 'subslide']),
        # A sentence takes what it is about along.
        (
            [STEP, code(13), text('word ' * 20), code(5), text()],
            ['slide', '', 'subslide', '', ''],
        ),
        ([TITLE, code(), code(1, 'solution'), code(1)], ['slide', '', '', '']),
        ([TITLE, code(), text('', 'deck-break'), code()], ['slide', '', 'subslide', '']),
        ([TITLE, note('word ' * 400), code(16)], ['slide', 'skip', '']),
        # A note does not part a text from its code.
        ([TITLE, code(18), text(), note(), code(16)], ['slide', '', 'subslide', 'skip', '']),
    ],
)
def test_the_rule(cells, types):
    assert slide_types(new_notebook(cells=cells)) == types


def test_no_slide_holds_more_than_its_height():
    cells = [TITLE, STEP]
    for lines in range(1, 25):
        cells += [text('word ' * 7 * lines), code(lines, outputs=printed(25 - lines))]
    filled = []
    for cell, slide_type in zip(cells, slide_types(new_notebook(cells=cells)), strict=True):
        if slide_type:
            filled.append(0)
        filled[-1] += height(cell)
    assert max(filled) <= SLIDE
    assert sum(filled) / len(filled) > SLIDE / 2
