"""Each deck: every slide is reached with Space, and nothing of it is cut off.

All sizes are parts of the slide's height: what fits one projector fits each.
"""

from itertools import pairwise

import nbformat
import pytest
from support.lab_page import CUT_OFF, PANEL, SLIDE_DRAWN
from support.lab_server import NOTEBOOKS

from tools.lessons.slides import slide_types

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
    assert deck.page.evaluate(MEASURE, last) == []
