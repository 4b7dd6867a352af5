"""The notes window: it follows the deck, through a reload of both and a new start of the server."""

import json
import re

import pytest
from support.lab_page import printed
from support.lab_server import ROOT, server
from support.waits import wait_for

from tools.lessons.lesson import first_heading, minutes_of_note, read, tags
from tools.lessons.slides import slide_types

LESSON = '02_lose_messages.ipynb'
KNOWN = read((ROOT / 'notebooks' / LESSON).read_text(), LESSON)
CELLS = KNOWN.notebook.cells
# The third note of a step, below its heading, and the heading after this step.
NOTE = [i for i, cell in enumerate(CELLS) if 'notes' in tags(cell)][3]
NEXT = next(i for i, cell in enumerate(CELLS) if i > NOTE and cell.source.startswith('## '))
OWN = minutes_of_note(CELLS[NOTE].source)
PLANNED = sum(minutes_of_note(cell.source) for cell in CELLS[:NEXT])
SLIDES = [kind in ('slide', 'subslide') for kind in slide_types(KNOWN.notebook)]
SHOWS = "slide => document.querySelector('#slide').textContent === slide"


def began_at(running):
    """Return when the minutes of the lesson began, as JupyterLab's server keeps it."""
    file = running.folder / 'JUPYTER_CONFIG_DIR' / 'deck.json'
    return json.loads(file.read_text())['began'].get(f'presentation/{LESSON}')


def words(text):
    return ' '.join(re.findall(r'\w+', text))


def wait_for_place(window, cell):
    window.wait_for_function(SHOWS, arg=f'{sum(SLIDES[: cell + 1])} of {sum(SLIDES)}')


def open_window(deck):
    with deck.page.expect_popup() as opened:
        deck.page.keyboard.press('n')
    return opened.value


@pytest.fixture
def window(deck):
    deck.present(LESSON)
    return open_window(deck)


def test_the_window_follows_the_deck(deck, window):
    wait_for_place(window, 0)
    assert 'the lesson in a class' in window.locator('#notes').inner_text()
    while deck.active() < NEXT:
        promised = words(window.locator('#cells').inner_text())
        before = deck.active()
        place = deck.press('Space')
        first = max(i for i, starts in enumerate(SLIDES[: place + 1]) if starts)
        wait_for_place(window, place)
        if first > before:  # the next slide
            heading = words(CELLS[first].source).split()[:3]
            assert promised.startswith(' '.join(heading))
    deck.press('PageUp')
    wait_for_place(window, deck.active())
    shown = [
        window.locator(f'#{name}').inner_text()
        for name in ('step', 'own', 'planned', 'all', 'gone')
    ]
    heading = first_heading(CELLS[NOTE - 1].source)
    assert shown == [heading, str(OWN), str(PLANNED), str(KNOWN.minutes), '0']
    assert words(window.locator('#notes').inner_text()) == words(CELLS[NOTE].source)
    window.screenshot(path=deck.artefacts / 'notes_window.png')


def test_the_minutes_begin_after_the_first_slide(deck, window):
    assert began_at(deck.server) is None
    wait_for_place(window, deck.press('PageDown'))
    began = began_at(deck.server)
    for key in ('PageUp', 'PageDown'):
        wait_for_place(window, deck.press(key))
        assert began_at(deck.server) == began  # a glance at the first slide
    deck.page.keyboard.press('Home')
    deck.wait_for_slide(0)
    wait_for_place(window, 0)
    assert began_at(deck.server) is None


def test_the_place_outlives_the_server(lab_page, tmp_path):
    """And what was typed: the deck says so, and R R makes it anew."""
    arguments = (tmp_path, 'present', 'LESSON=2')
    with server(*arguments) as running, lab_page(running, 'before') as deck:
        deck.present(LESSON)
        place = deck.press('ArrowRight')
        deck.write('typed = 1')
        deck.run_here()
        window = open_window(deck)
        wait_for_place(window, place)  # it is saved
        window.reload()
        wait_for_place(window, place)
        wait_for(lambda: 'typed = 1' in (tmp_path / 'presentation' / LESSON).read_text())
    with server(*arguments) as running, lab_page(running, 'after') as deck:
        deck.page.goto(running.address)
        deck.wait_for_notebook(f'presentation/{LESSON}')
        deck.wait_for_slide(place)
        deck.page.locator('#deck-says', has_text='Used on ').wait_for()
        deck.screenshot('used')
        deck.page.keyboard.press('r')
        deck.page.keyboard.press('r')
        deck.wait_for_slide(0)
        assert all('typed = 1' not in cell['source'] for cell in deck.cells())
        assert deck.press('ArrowRight') == place
        deck.write("print('typed' in globals())")
        deck.run_here()
        assert printed(deck.cells()[place]).strip() == 'False'


def test_the_notes_need_the_login_of_jupyterlab(deck, window, chromium):
    with chromium.new_context() as stranger:
        answer = stranger.request.get(f'{deck.server.url}notes/state', max_redirects=0)
        assert answer.status == 302
