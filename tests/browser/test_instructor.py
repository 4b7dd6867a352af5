"""An instructor's hour: start a lesson as slides, walk through it, run and change cells in it."""

import nbformat
import pytest
from lab_page import CUT_OFF, PANEL, complaints, printed
from lab_server import NOTEBOOKS

from tools.lessons.slides import slide_types

# Of the shapes of projectors, 4:3 and 16:9. All sizes are parts of the slide's height, so what fits
# one of a shape fits each. The last is that of the screenshots.
SIZES = ((1024, 768), (1280, 720))
TWO_FRAMES = '() => new Promise(d => requestAnimationFrame(() => requestAnimationFrame(d)))'
OPEN_ANSWERS = f"""index => {{
    const answers = [...{PANEL}.content.widgets[index].node.querySelectorAll('details')];
    answers.forEach(answer => answer.open = true);
    return answers.length;
}}"""


def cut_off(deck):
    found = []
    for width, height in SIZES:
        deck.page.set_viewport_size({'width': width, 'height': height})
        deck.page.evaluate(TWO_FRAMES)
        found += [f'{width} x {height}: {what}' for what in deck.page.evaluate(CUT_OFF)]
    return found


@pytest.mark.parametrize('path', NOTEBOOKS, ids=[path.name for path in NOTEBOOKS])
def test_every_slide_is_reached_and_nothing_is_cut_off(deck, path):
    notebook = nbformat.read(path, as_version=4)
    wanted = [i for i, kind in enumerate(slide_types(notebook)) if kind != 'skip']
    deck.present(path.name)
    if any('ipywidgets' in cell.source for cell in notebook.cells):
        deck.command('notebook:run-all-cells')  # a widget is not saved
        deck.page.evaluate(f'() => {{ {PANEL}.content.activeCellIndex = 0 }}')
        deck.wait_for_slide(0)
    visited, found = [deck.active()], []
    while True:
        cells = deck.on_screen()
        if visited[-1] == max(cells):
            deck.screenshot(path.stem, f'{visited[-1]:02d}')
            found += cut_off(deck)
            if notebook.cells[visited[-1]].source.startswith('### Question '):
                assert deck.page.evaluate(OPEN_ANSWERS, visited[-1]) >= 3
                deck.screenshot(path.stem, f'{visited[-1]:02d}_answers')
                found += cut_off(deck)
        if visited[-1] == wanted[-1]:
            break
        visited.append(deck.press('Space'))
    assert visited == wanted
    assert found == []


def test_run_and_change_a_cell_in_a_slide(deck):
    deck.present('00_start_here.ipynb')
    deck.command('notebook:clear-all-cell-outputs')
    starter, check = deck.find('exercise', 'robots'), deck.find('check', 'robots')
    while deck.active() < starter:
        deck.press('Space')
    deck.page.keyboard.press('Enter')
    deck.page.keyboard.press('Control+A')
    deck.page.keyboard.insert_text('robots = 2')
    deck.page.keyboard.press('Control+Enter')
    deck.wait_until_ran(starter)
    while deck.active() < check:
        deck.press('Space')
    deck.page.keyboard.press('Control+Enter')
    deck.wait_until_ran(check)
    assert complaints(deck.cells()[check]) == []
    assert 'All done.' in printed(deck.cells()[check])
    assert deck.page.evaluate(CUT_OFF) == []
