"""An instructor's hour: start a lesson as slides, walk through it, run and change cells in it."""

from itertools import pairwise

import nbformat
import pytest
from lab_page import CUT_OFF, PANEL, SLIDE_DRAWN, complaints, printed
from lab_server import NOTEBOOKS

from tools.lessons.slides import slide_types

# Of the shapes of projectors, 4:3 and 16:9. All sizes are parts of the slide's height, so what fits
# one of a shape fits each.
SIZES = ((1024, 768), (1280, 720))
# Both scripts go through a whole lesson: from here, each slide would cost several times as much.
# This one goes on as the key Space does, until nothing follows.
WALK = f"""async () => {{
    const notebook = {PANEL}.content, visited = [];
    while (notebook.activeCellIndex !== visited.at(-1)) {{
        visited.push(notebook.activeCellIndex);
        await window.jupyterapp.commands.execute(
            'deck:go', {{ direction: 'down', alternate: 'forward' }});
    }}
    return visited;
}}"""
# This one shows these cells, each the last of its slide, and says what is cut off, also when the
# answers of a quiz are open.
MEASURE = f"""async cells => {{
    const drawn = {SLIDE_DRAWN}, cutOff = {CUT_OFF};
    const notebook = {PANEL}.content, found = [];
    const twoFrames = () => new Promise(
        done => requestAnimationFrame(() => requestAnimationFrame(done)));
    for (const index of cells) {{
        notebook.activeCellIndex = index;
        const {{ node, model }} = notebook.activeCell, limit = performance.now() + 30000;
        do {{
            notebook.node.getAnimations({{ subtree: true }}).forEach(fade => fade.finish());
            await twoFrames();
            if (performance.now() > limit) throw Error(`Cell ${{index}} is not drawn.`);
        }} while (!drawn(index));
        found.push(...cutOff());
        if (!model.sharedModel.getSource().startsWith('### Question ')) continue;
        const answers = [...node.querySelectorAll('details')];
        if (answers.length < 3) found.push(`cell ${{index}} has not three answers`);
        answers.forEach(answer => answer.open = true);
        await twoFrames();
        found.push(...cutOff());
        answers.forEach(answer => answer.open = false);
    }}
    return found;
}}"""


@pytest.mark.parametrize('path', NOTEBOOKS, ids=[path.name for path in NOTEBOOKS])
def test_every_slide_is_reached_and_nothing_is_cut_off(deck, path):
    notebook = nbformat.read(path, as_version=4)
    shown = [(i, kind) for i, kind in enumerate(slide_types(notebook)) if kind != 'skip']
    last = [i for (i, _), (_, after) in pairwise([*shown, (0, 'slide')]) if after != 'fragment']
    deck.present(path.name)
    if any('ipywidgets' in cell.source for cell in notebook.cells):
        deck.command('notebook:run-all-cells')  # a widget is not saved
        deck.page.evaluate(f'() => {{ {PANEL}.content.activeCellIndex = 0 }}')
    assert deck.page.evaluate(WALK) == [i for i, _ in shown]
    for width, height in SIZES:
        deck.page.set_viewport_size({'width': width, 'height': height})
        cut_off = deck.page.evaluate(MEASURE, last)
        assert cut_off == [], f'At {width} x {height}'


def test_run_and_change_a_cell_in_a_slide(deck):
    deck.present('00_start_here.ipynb')
    deck.command('notebook:clear-all-cell-outputs')
    starter, check = (deck.find('robots', tag) for tag in ('exercise', 'check'))
    deck.walk_to(starter)
    deck.write('robots = 2')
    deck.run_here()
    deck.walk_to(check)
    deck.run_here()
    assert complaints(deck.cells()[check]) == []
    assert 'All done.' in printed(deck.cells()[check])
    number = deck.page.locator('.jp-deck-mod-visible .jp-InputPlaceholder .jp-InputPrompt').last
    assert number.inner_text() == f'[{deck.cells()[check]["execution_count"]}]:'
    assert deck.page.evaluate(CUT_OFF) == []
