"""The circle of what waits, as a page shows it: on a phone, and in JupyterLab in its two themes."""

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from helpers.waits_view import Circle
from tools.lessons.clean import NOTEBOOK_METADATA

# Two threads take two locks, each in another order.
SOURCE = """import threading
import time

from helpers.waits import circle, find_waits
from helpers.waits_view import what_waits

left, right, both = threading.Lock(), threading.Lock(), threading.Barrier(2)

def take():
    with left:
        both.wait()
        with right:
            pass

def give():
    with right:
        both.wait()
        with left:
            pass

for function in (take, give):
    threading.Thread(target=function, daemon=True).start()
while not circle(find_waits()):
    time.sleep(0.1)
what_waits()"""
SAYS = (
    'Nobody can go on: give() waits for a lock (left); take() holds it; '
    'take() waits for a lock (right); give() holds it.'
)
# The boxes that do not stand inside of their picture, and the words that do not fit into a box.
OUTSIDE = """() => [...document.querySelectorAll('.ring-box')].filter(box => {
    const inside = (one, other) => one.left >= other.left && one.right <= other.right
        && one.top >= other.top && one.bottom <= other.bottom;
    const of = one => one.getBoundingClientRect();
    const rect = box.querySelector('rect');
    return !inside(of(rect), of(box.closest('svg')))
        || [...box.querySelectorAll('text')].some(text => !inside(of(text), of(rect)));
}).map(box => box.textContent)"""


def turn(*names):
    """Return a circle of boxes with these names: what runs, what it waits for, and so on."""
    ids = [f'{"thing" if i % 2 else "run"} {i}' for i in range(len(names))]
    boxes = [{'id': one, 'name': name} for one, name in zip(ids, names, strict=True)]
    arrows = [
        {'from': one, 'to': other, 'label': 'waits for', 'says': 'it waits', 'hot': True}
        for one, other in zip(ids, [*ids[1:], ids[0]], strict=True)
    ]
    return Circle({'stuck': [0], 'boxes': boxes, 'arrows': arrows, 'says': 'Nobody can go on.'})


@pytest.mark.parametrize('many', [3, 4, 6, 8])
def test_names_of_any_length_stand_in_boxes_inside_of_the_picture(phone, many):
    names = [
        *(
            'a_callback_with_a_long_name()',
            'the answer of the service left_arm/get_the_state_of_it',
        ),
        *('tick()', 'something in a queue that is empty (self.robot.lines_to_print)'),
        *('state()', 'a lock (self.robot.lock)', 'serve()', 'the only thread'),
    ]
    page = phone(turn(*names[:many]))
    assert page.locator('.ring-box').count() == many
    assert page.evaluate(OUTSIDE) == []
    assert page.locator('.ring svg').get_attribute('aria-label') == 'Nobody can go on.'


def test_in_jupyterlab(lab):
    path = lab.server.folder / 'notebooks' / '98_hang.ipynb'
    cells = [new_markdown_cell('# 98'), new_code_cell(SOURCE)]
    nbformat.write(new_notebook(cells=cells, metadata=NOTEBOOK_METADATA), path)
    lab.open(path.name)
    lab.run(1)
    cell = lab.show(1)
    assert 'take() waits for a lock (right)' in cell.inner_text()
    drawn = lab.page.locator('.ring svg')
    assert drawn.get_attribute('aria-label') == SAYS
    for theme in lab.themes():
        drawn.scroll_into_view_if_needed()
        ink, paper = (
            lab.page.evaluate('name => getComputedStyle(document.querySelector(name)).color', one)
            for one in ('.ring text', '.jp-RenderedHTMLCommon')
        )
        assert ink == paper  # its letters are those of the page
        lab.screenshot(f'circle_{theme}')
