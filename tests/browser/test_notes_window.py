"""The instructor's window: it follows the deck, and shows itself to nobody without the secret."""

import json
import re

import psutil
import pytest
from lab_server import ROOT, server
from playwright.sync_api import Error

from tools.lessons.lesson import first_heading, minutes_of_note, read, tags
from tools.lessons.present import DECK

LESSON = '02_lose_messages.ipynb'
KNOWN = read((ROOT / 'notebooks' / LESSON).read_text(), LESSON)
CELLS = KNOWN.notebook.cells
# The third note of a step, below its heading, and the heading after this step.
NOTE = [i for i, cell in enumerate(CELLS) if 'notes' in tags(cell)][3]
NEXT = next(i for i, cell in enumerate(CELLS) if i > NOTE and cell.source.startswith('## '))
PLANNED = sum(minutes_of_note(cell.source) for cell in CELLS[:NEXT])
SLIDES = [cell.metadata.slideshow['slide_type'] in ('slide', 'subslide') for cell in CELLS]
SHOWS = "slide => document.querySelector('#slide').textContent === slide"


def addresses(running):
    printed = (running.folder / 'present.log').read_text().partition('Your notes:\n')[2]
    return re.findall(r'^ +(http://\S+:\d+/\w+/)$', printed, re.MULTILINE)


def began_at(running):
    """Return when the minutes of the lesson began, as JupyterLab's server keeps it."""
    file = running.folder / 'JUPYTER_CONFIG_DIR' / 'lab' / 'workspaces' / DECK
    return json.loads(file.read_text())['data']['began'].get(f'presentation/{LESSON}')


def words(text):
    return ' '.join(re.findall(r'\w+', text))


def wait_for_place(window, cell):
    window.wait_for_function(SHOWS, arg=f'{sum(SLIDES[: cell + 1])} of {sum(SLIDES)}')


@pytest.fixture
def window(deck):
    """Yield the window, opened with its key. It may ask nobody but its own server."""
    deck.present(LESSON)
    with deck.page.expect_popup() as opened:
        deck.page.keyboard.press('n')
    asked = []
    opened.value.on('request', lambda request: asked.append(request.url))
    yield opened.value
    assert [url for url in asked if not url.startswith(addresses(deck.server)[0])] == []


def test_the_window_follows_the_deck(deck, window):
    assert window.url == addresses(deck.server)[0]
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
    window.set_viewport_size({'width': 768, 'height': 1024})
    window.screenshot(path=deck.artefacts / 'notes_window_tablet.png')


def test_both_windows_may_be_reloaded(deck, window):
    assert began_at(deck.server) is None
    place = deck.press('PageDown')
    wait_for_place(window, place)
    began = began_at(deck.server)
    for key in ('PageUp', 'PageDown'):
        wait_for_place(window, deck.press(key))
        assert began_at(deck.server) == began  # a glance at the first slide
    place = [deck.press('PageDown') for _ in range(4)][-1]
    window.reload()
    wait_for_place(window, place)
    deck.page.reload()
    deck.wait_for_notebook(f'presentation/{LESSON}')
    deck.wait_for_slide(place)
    wait_for_place(window, deck.press('Space'))
    deck.page.keyboard.press('Home')
    deck.wait_for_slide(0)
    wait_for_place(window, 0)
    assert began_at(deck.server) is None
    assert '/state' not in (deck.server.folder / 'present.log').read_text()


def test_a_tablet_needs_the_secret_and_reaches_the_notes_only(chromium, tmp_path):
    arguments = (tmp_path, 'present', 'LESSON=02', 'TABLET=yes')
    with server(*arguments) as running, chromium.new_context() as tablet:
        local, *others = addresses(running)
        if not others:
            pytest.skip('This machine is in no network.')
        page = tablet.new_page()
        page.goto(others[0])
        page.locator('#trouble', has_text='Wait').wait_for()
        own, secret = others[0].rstrip('/').rsplit('/', 1)
        refused = [own, f'{own}/{secret[:-1]}/', f'{own}/x/state', f'{others[0]}lab', f'{own}/lab']
        assert [page.request.get(address).status for address in refused] == [404] * 5
        lab = own.rpartition(':')[0] + ':' + running.url.split(':')[2]
        with pytest.raises(Error, match='ECONNREFUSED'):
            page.request.get(lab)


def test_without_a_tablet_nobody_else_reaches_the_notes(deck):
    assert len(addresses(deck.server)) == 1
    port = int(addresses(deck.server)[0].split(':')[2].split('/')[0])
    [listening] = [
        one.laddr.ip
        for one in psutil.net_connections('tcp')
        if one.laddr.port == port and one.status == 'LISTEN'
    ]
    assert listening == '127.0.0.1'


def test_a_server_that_was_started_again_shows_the_same_slide(lab_page, tmp_path):
    arguments = (tmp_path, 'present', 'LESSON=02', 'FRESH=no')
    with server(*arguments) as running, lab_page(running, 'before') as deck:
        deck.present(LESSON)
        place = [deck.press('PageDown') for _ in range(4)][-1]
        with deck.page.expect_popup() as opened:
            deck.page.keyboard.press('n')
        wait_for_place(opened.value, place)  # it is saved
    with server(*arguments) as running, lab_page(running, 'after') as deck:
        deck.page.goto(running.address)
        deck.wait_for_notebook(f'presentation/{LESSON}')
        deck.wait_for_slide(place)
        assert deck.press('PageDown') > place
