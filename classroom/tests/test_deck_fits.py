"""Each deck: with Space every slide is reached and seen to its end, and nothing of it is cut off.

All sizes are parts of the slide's height: what fits one projector of a shape fits each. One of 4:3
is as wide in these units as one of 16:9, and higher, so two lessons tell whether that holds.
"""

import nbformat
import pytest
from support.lab_page import PANEL
from support.lab_server import NOTEBOOKS

from classroom.deck.slides import slide_types
from classroom.tests.support.deck_page import CUT_OFF

WIDE, SQUARE = (1280, 720), (1024, 768)  # 16:9 and 4:3
IN_BOTH = ('02', '20')
# This goes through a whole lesson, with the keys of the deck: from here, each slide would cost
# several times as much. It says what is cut off, also when the answers of a quiz are open, and
# which slides are left before their end was seen.
WALK = f"""async () => {{
    const cutOff = {CUT_OFF}, notebook = {PANEL}.content, found = [], visited = [];
    const frames = () => new Promise(done => requestAnimationFrame(() => setTimeout(done, 20)));
    const number = () => +document.querySelector('#deck-head span').textContent.split('/')[0];
    const press = key => notebook.activeCell.node.dispatchEvent(
        new KeyboardEvent('keydown', {{ key, bubbles: true, cancelable: true }}));
    const outer = notebook.outerNode;
    let end = 0;
    for (let before = ''; ; press(' ')) {{
        await frames();
        const state = [number(), notebook.activeCellIndex, outer.scrollTop].join();
        if (state === before && document.querySelector('#deck-says').textContent) break;
        before = state;
        if (visited.at(-1) !== number()) {{
            if (end > 4) found.push(`slide ${{visited.at(-1)}} is left ${{end}} px before its end`);
            visited.push(number());
        }}
        end = outer.scrollHeight - outer.clientHeight - outer.scrollTop;
        found.push(...cutOff());
        for (const answer of document.querySelectorAll('.deck-on details')) {{
            const title = answer.closest('.jp-Cell').querySelector('h3')?.textContent;
            if (!title?.startsWith('Question')) continue;
            answer.open = true;
            await frames();
            found.push(...cutOff());
            answer.open = false;
        }}
    }}
    return [visited, [...new Set(found)]];
}}"""


@pytest.mark.parametrize('path', NOTEBOOKS, ids=[path.name for path in NOTEBOOKS])
def test_every_slide_is_reached_and_nothing_is_cut_off(deck, path):
    notebook = nbformat.read(path, as_version=4)
    slides = sum(kind in ('slide', 'subslide') for kind in slide_types(notebook))
    deck.present(path.name)
    if any('ipywidgets' in cell.source for cell in notebook.cells):
        deck.command('notebook:run-all-cells')  # a widget is not saved
    for width, height in (WIDE, SQUARE) if path.name[:2] in IN_BOTH else (WIDE,):
        deck.page.set_viewport_size({'width': width, 'height': height})
        deck.page.evaluate(f'() => {{ {PANEL}.content.activeCellIndex = 0 }}')
        assert deck.page.evaluate(WALK) == [[*range(1, slides + 1)], []]
