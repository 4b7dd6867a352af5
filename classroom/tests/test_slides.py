"""Which cell starts a slide, on notebooks made for it."""

import re
import shutil

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_raw_cell

from classroom.deck.pdf import NAMES, main, pages
from classroom.deck.slides import LINES, folded, slide_types
from classroom.deck.texts import WORDS, shortened, words
from helpers.lesson import lessons, path_of, tags

TITLE = new_markdown_cell('# 02 Lose messages\n\n**You need** lesson 01.')
STEP = new_markdown_cell('## 1. Build\n\nA node.')
TASK = new_markdown_cell('### ✎ Task 1')
QUESTION = new_markdown_cell('### Question 1')
FOLDED = {'source_hidden': True}
SLIDES = ('slide', 'subslide')


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
            [STEP, code(), TASK, code(9), code(1, 'check'), code(40, 'solution', jupyter=FOLDED)],
            ['slide', '', 'subslide', '', '', ''],
        ),
        # What runs then has a slide of its own, and so has what answers a guess.
        (
            [STEP, TASK, code(), code(1, 'check'), code(9, 'solution'), code(1)],
            ['slide', '', '', '', '', 'subslide'],
        ),
        ([STEP, code(1, 'predict'), note(), code(2)], ['slide', '', 'skip', 'subslide']),
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
        (new_code_cell('from helpers.workspace import Workspace\nhere = Workspace("a")'), True),
        (new_code_cell('limit = 1'), False),
        (new_code_cell('import math\nmath.pi'), False),
        (new_code_cell('%%write setup.py\nimport math'), False),
        (new_code_cell('LIMIT = 1\n\n\ndef wait():\n    run()'), True),
        (new_code_cell('def wait():\n    run()\n\n\nwait()'), False),
        (new_code_cell('class Talker:\n    pass'), False),
        (new_code_cell('def wait():\n    pass', metadata={'tags': ['exercise']}), False),
        (text(), False),
    ],
)
def test_what_is_folded(cell, is_folded):
    assert folded(cell) == is_folded


LONG = 'This is a sentence that has nine words, no more. '
LIST = '\n\n- a list of\n- things'


def shown(*cells):
    """Return what slides show of texts, and what is for the notes, in their order."""
    cells = [new_markdown_cell('# 02 Lose'), *cells]
    types = slide_types(new_notebook(cells=cells))
    found = shortened(cells, types)
    rest = [cell.metadata.get('slideshow', {}).get('slide_type') == 'notes' for cell in found]
    return [(cell.source, notes) for cell, notes in zip(found, rest, strict=True)][1:]


@pytest.mark.parametrize(
    ('source', 'kept', 'rest'),
    [
        ('Short.', 'Short.', ''),
        (LONG * 6, (LONG * 4).strip(), (LONG * 2).strip()),
        # What is below the last heading comes first, then what is above it.
        (
            f'## 1. Run\n\n{(LONG * 4).strip()}\n\n### ? Guess\n\nHow many? {LONG * 2}',
            f'## 1. Run\n\n{LONG.strip()}\n\n### ? Guess\n\nHow many? {(LONG * 2).strip()}',
            (LONG * 3).strip(),
        ),
        # A list is whole, with the sentence that leads to it, or not there.
        (f'It says:{LIST}', f'It says:{LIST}', ''),
        (f'{LONG * 4}It says:{LIST}', (LONG * 4).strip(), f'It says:{LIST}'),
        # A full stop inside of code or brackets ends nothing.
        (f'{LONG * 3}Use (e.g. `a. b`) here. {LONG}', None, LONG.strip()),
        # A beginning is always there.
        (f'{LONG[:-2] * 6}.', f'{LONG[:-2] * 6}.', ''),
    ],
)
def test_a_slide_shows_forty_words_before_a_run(source, kept, rest):
    found = shown(new_markdown_cell(source.strip()), code())
    parts = [part for part, notes in found if not notes][:-1]
    assert [part for part, notes in found if notes] == [rest] * bool(rest)
    assert kept is None or parts == [kept]
    assert kept is not None or words(parts[0]) <= WORDS


def test_what_explains_and_what_runs_nothing_is_whole():
    assert shown(STEP, code(), text(LONG * 6))[-1] == (LONG * 6, False)
    assert shown(new_markdown_cell(f'## Recap\n\n{LONG * 6}')) == [
        (f'## Recap\n\n{LONG * 6}', False)
    ]


def test_all_slides_of_the_lessons_have_forty_words_before_a_run():
    for lesson in lessons():
        cells = lesson.notebook.cells
        types = slide_types(lesson.notebook)
        starts = {cell.id for cell, kind in zip(cells, types, strict=True) if kind in SLIDES}
        found, count = {}, 0
        for cell in shortened(cells, types):
            if cell.id in starts:
                slide, count = cell.id, 0
            if cell.cell_type == 'code':
                found.setdefault(slide, count)
            elif cell.metadata.get('slideshow', {}).get('slide_type') != 'notes':
                count += words(cell.source) if cell.cell_type == 'markdown' else 0
        assert {slide: count for slide, count in found.items() if count > WORDS} == {}


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
