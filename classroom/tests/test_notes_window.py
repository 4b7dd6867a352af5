"""The notes window: it follows the deck, through a reload of both and a new start of the server."""

import re

import pytest
from support.lab_page import PANEL, printed
from support.lab_server import ROOT, server
from support.waits import wait_for

from classroom.deck.slides import slide_types
from classroom.deck.texts import shortened
from classroom.tests.support.deck_page import DeckPage
from helpers.lesson import first_heading, minutes_of_note, path_of, read, tags, without_links

LESSON = path_of('lose_messages').name
KNOWN = read((ROOT / 'notebooks' / LESSON).read_text(), LESSON)
TYPES = slide_types(KNOWN.notebook)
STARTS = {
    cell.id
    for cell, kind in zip(KNOWN.notebook.cells, TYPES, strict=True)
    if kind in ('slide', 'subslide')
}
CELLS = shortened(KNOWN.notebook.cells, TYPES)  # those of the copy
# The third note of a step, below its heading, and the heading after this step.
NOTE = [i for i, cell in enumerate(CELLS) if 'notes' in tags(cell)][3]
NEXT = next(i for i, cell in enumerate(CELLS) if i > NOTE and cell.source.startswith('## '))
OWN = minutes_of_note(CELLS[NOTE].source)
PLANNED = sum(minutes_of_note(cell.source) for cell in CELLS[:NEXT])
SLIDES = [cell.id in STARTS for cell in CELLS]
SHOWS = "slide => document.querySelector('#slide').textContent === slide"


def began_at(deck):
    """Return when the minutes of the lesson began, as its copy keeps it."""
    return deck.page.evaluate(f"() => {PANEL}.model.getMetadata('deck').began ?? null")


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
    assert 'You need' in window.locator('#rest').inner_text()  # the slide does not say it
    while deck.active() < NEXT:
        promised = words(window.locator('#next').inner_text())
        place = deck.go_on()
        first = max(i for i, starts in enumerate(SLIDES[: place + 1]) if starts)
        wait_for_place(window, place)
        heading = words(CELLS[first].source).split()[:3]
        assert promised.startswith(' '.join(heading))
    deck.press('ArrowLeft')
    wait_for_place(window, deck.active())
    shown = [
        window.locator(f'#{name}').inner_text()
        for name in ('step', 'own', 'planned', 'all', 'gone')
    ]
    heading = next(
        first_heading(cell.source) for cell in CELLS[NOTE::-1] if cell.source.startswith('## ')
    )
    assert shown == [heading, str(OWN), str(PLANNED), str(KNOWN.minutes), '0']
    assert words(window.locator('#notes').inner_text()) == words(without_links(CELLS[NOTE].source))
    window.screenshot(path=deck.artefacts / 'notes_window.png')


def test_the_minutes_begin_after_the_first_slide(deck, window):
    assert began_at(deck) is None
    wait_for_place(window, deck.go_on())
    began = began_at(deck)
    for go in (lambda: deck.press('PageUp'), deck.go_on):
        wait_for_place(window, go())
        assert began_at(deck) == began  # a glance at the first slide
    deck.page.keyboard.press('Home')
    deck.wait_for_slide(0)
    wait_for_place(window, 0)
    assert began_at(deck) is None


def test_the_place_outlives_the_server(lab_page, tmp_path):
    """And what was typed: the deck says so, and R R makes it anew."""
    arguments = (tmp_path, 'present', 'LESSON=lose_messages')
    with server(*arguments) as running, lab_page(running, 'before', DeckPage) as deck:
        deck.present(LESSON)
        place = deck.press('ArrowRight')
        deck.write('typed = 1')
        deck.run_here()
        window = open_window(deck)
        wait_for_place(window, place)  # it is saved
        window.reload()
        wait_for_place(window, place)
        wait_for(lambda: 'typed = 1' in (tmp_path / 'presentation' / LESSON).read_text())
    with server(*arguments) as running, lab_page(running, 'after', DeckPage) as deck:
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


def test_the_window_says_that_the_deck_is_gone(deck, window):
    wait_for_place(window, 0)
    window.get_by_text('The deck is closed').wait_for(state='detached')
    deck.page.goto('about:blank')
    window.get_by_text('The deck does not answer.').wait_for()
    deck.present(LESSON)
    window.get_by_text('The deck does not answer.').wait_for(state='detached')
    wait_for_place(window, deck.go_on())


def test_the_page_of_the_window_holds_no_notes(deck, window, chromium):
    """So it needs no login, and what somebody else tells it is not shown."""
    with chromium.new_context() as stranger:
        page = stranger.new_page()
        page.goto(window.url)
        page.get_by_text('The deck is closed').wait_for()
        page.evaluate("() => postMessage({ lesson: 'x', notes: 'told', next: '' }, '*')")
        page.wait_for_timeout(100)
        assert page.locator('#notes').inner_text() == ''
