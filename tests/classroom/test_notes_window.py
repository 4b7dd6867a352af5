"""The notes window: it follows the deck, through a reload of both and a new start of the server."""

import json
import re

import pytest
from support.lab_server import ROOT, server

from tools.classroom.present import DECK
from tools.lessons.lesson import first_heading, minutes_of_note, read, tags

LESSON = '02_lose_messages.ipynb'
KNOWN = read((ROOT / 'notebooks' / LESSON).read_text(), LESSON)
CELLS = KNOWN.notebook.cells
# The third note of a step, below its heading, and the heading after this step.
NOTE = [i for i, cell in enumerate(CELLS) if 'notes' in tags(cell)][3]
NEXT = next(i for i, cell in enumerate(CELLS) if i > NOTE and cell.source.startswith('## '))
PLANNED = sum(minutes_of_note(cell.source) for cell in CELLS[:NEXT])
SLIDES = [cell.metadata.slideshow['slide_type'] in ('slide', 'subslide') for cell in CELLS]
SHOWS = "slide => document.querySelector('#slide').textContent === slide"


def began_at(running):
    """Return when the minutes of the lesson began, as JupyterLab's server keeps it."""
    file = running.folder / 'JUPYTER_CONFIG_DIR' / 'lab' / 'workspaces' / DECK
    return json.loads(file.read_text())['data']['began'].get(f'presentation/{LESSON}')


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
    place = deck.active()
    while place < NEXT:
        heading = window.locator('#next').inner_text()
        promised = window.locator('#cells').inner_text()
        place = deck.press('Space')
        assert (heading == 'Next slide') == SLIDES[place]
        assert words(promised).startswith(' '.join(words(CELLS[place].source).split()[:3]))
        wait_for_place(window, place)
        window.wait_for_function(
            'before => document.querySelector("#cells").innerText !== before', arg=promised
        )
    deck.press('Shift+Space')
    wait_for_place(window, deck.active())
    shown = [window.locator(f'#{name}').inner_text() for name in ('step', 'planned', 'all', 'gone')]
    heading = first_heading(CELLS[NOTE - 1].source)
    assert shown == [heading, str(PLANNED), str(KNOWN.minutes), '0']
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
    arguments = (tmp_path, 'present', 'LESSON=02', 'FRESH=no')
    with server(*arguments) as running, lab_page(running, 'before') as deck:
        deck.present(LESSON)
        place = [deck.press('PageDown') for _ in range(4)][-1]
        window = open_window(deck)
        wait_for_place(window, place)  # it is saved
        window.reload()
        wait_for_place(window, place)
    with server(*arguments) as running, lab_page(running, 'after') as deck:
        deck.page.goto(running.address)
        deck.wait_for_notebook(f'presentation/{LESSON}')
        deck.wait_for_slide(place)
        assert deck.press('PageDown') > place


def test_the_notes_need_the_login_of_jupyterlab(deck, window, chromium):
    with chromium.new_context() as stranger:
        answer = stranger.request.get(f'{deck.server.url}notes/state', max_redirects=0)
        assert answer.status == 302
