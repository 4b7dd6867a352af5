"""The exported slides, opened as files, without a network."""

import shutil

import nbformat
import pytest
from lab_server import NOTEBOOKS
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_raw_cell

from tools.lessons import export

FORMULA = r'A law: $x_{k+1} = F x_k$, and $$\int_0^1 x^2 \, dx = \frac{1}{3}.$$'
NOTE = 'For the instructor: 5 minutes\n\nAsk first.'
CUT_OFF = """() => [...Reveal.getCurrentSlide().querySelectorAll('.jp-Cell, .jp-Cell *')].filter(
    part => {
        const box = part.getBoundingClientRect();
        const higher = part.scrollHeight > part.clientHeight + 1;
        const wider = part.scrollWidth > part.clientWidth + 1;
        const hides = (higher || wider) && getComputedStyle(part).overflow !== 'visible';
        return box.width && !part.closest('svg, .notes') && (hides || box.top < 0 || box.left < 0
            || box.bottom > innerHeight || box.right > innerWidth);
    }).map(part => `${part.tagName}.${part.className}: ${part.textContent.slice(0, 60)}`)"""
# Goes on as the key Space does, to the end, in one script: from here, each slide would cost several
# times as much. The translations of the summary are unfolded.
WALK = f"""async () => {{
    const found = [], cutOff = {CUT_OFF};
    for (let slides = 0;; Reveal.next()) {{
        if (Reveal.availableFragments().next) continue;
        slides++;
        const slide = Reveal.getCurrentSlide();
        slide.querySelectorAll('details[lang]').forEach(part => part.open = true);
        slide.getAnimations({{ subtree: true }}).forEach(fade => fade.finish());
        // Two frames later the events of the first one have been handled.
        await new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)));
        found.push(...cutOff());
        if (Reveal.isLastSlide()) return {{ slides, found }};
    }}
}}"""


@pytest.fixture(scope='session')
def folder(tmp_path_factory):
    """Return a folder with what decks need, one lesson, and a notebook made for this test."""
    if not shutil.which('npm'):
        pytest.skip('There is no npm, which fetches reveal.js and MathJax.')
    source, output = tmp_path_factory.mktemp('source'), tmp_path_factory.mktemp('slides')
    cells = [
        new_markdown_cell('# 99 Try formulas\n\n' + FORMULA),
        new_raw_cell(NOTE, metadata={'tags': ['notes']}),
        new_markdown_cell('## 1. Again\n\n' + FORMULA),
        new_code_cell('x = 1'),
        new_code_cell('secret = 1', metadata={'tags': ['solution']}),
    ]
    nbformat.write(new_notebook(cells=cells), source / '99_try_formulas.ipynb')
    assert export.main(['00'], output=output) == 0
    assert export.main([], source, output) == 0
    return output


@pytest.fixture
def open_deck(file_page, folder):
    """Return a function that opens an exported deck. Nothing but files may be asked for."""
    with file_page(1280, 720) as page:
        asked, failed = [], []
        page.on('request', lambda request: asked.append(request.url))
        page.on('requestfailed', lambda request: failed.append(request.url))

        def open_deck(name):
            page.goto(folder.joinpath(name).as_uri())
            page.wait_for_function('() => window.Reveal?.isReady() && MathJax.startup.promise')
            page.evaluate('() => MathJax.startup.promise')
            return page

        yield open_deck
    assert [url for url in asked if not url.startswith(('file:', 'data:'))] == []
    assert failed == []


@pytest.mark.parametrize('path', NOTEBOOKS, ids=[path.name for path in NOTEBOOKS])
def test_every_slide_is_reached_and_nothing_is_cut_off(open_deck, folder, path):
    page = open_deck(export.export(path, folder).name)
    notebook = export.for_reveal(nbformat.read(path, as_version=4))
    types = [cell.metadata.slideshow['slide_type'] for cell in notebook.cells]
    walked = page.evaluate(WALK)
    assert walked['slides'] == types.count('slide') + types.count('subslide')
    assert walked['slides'] == page.evaluate('() => Reveal.getTotalSlides()')
    assert walked['found'] == []
    assert page.locator('img:not([alt]), img[alt=""]').count() == 0


def test_formulas_are_drawn_and_notes_and_solutions_are_not_shown(open_deck, artefacts):
    page = open_deck('99_try_formulas.html')
    assert page.locator('.slides mjx-container').count() == 4
    page.keyboard.press('ArrowRight')
    page.wait_for_function('() => Reveal.getIndices().h === 1')
    page.screenshot(path=artefacts / 'formulas_exported.png')
    boxes = page.locator('.slides section.present section.present mjx-container').all()
    assert all(formula.bounding_box()['height'] > 10 for formula in boxes)
    assert '$' not in page.locator('.slides').inner_text()
    assert page.locator('text=secret').count() == 0
    assert page.locator('aside.notes').count() == 1
    assert not page.locator('aside.notes').is_visible()
    with page.expect_popup() as opened:
        page.keyboard.press('ArrowLeft')
        page.keyboard.press('s')
    opened.value.wait_for_function(
        """() => document.querySelector('.speaker-controls-notes .value')
            ?.innerText.includes('Ask first.')"""
    )
