"""In front of a class: what is typed stays where it was typed, and the deck where it was."""

from support.lab_page import CUT_OFF, PANEL, SLIDES_SHOWN, printed
from support.lab_server import ROOT

from tools.lessons.lesson import lessons

LESSON = '02_lose_messages.ipynb'
START, NEXT = lessons()[:2]
SAVED = f'() => !{PANEL}.context.model.dirty'
AUTOSAVE = f'() => {PANEL}.context.save()'  # what JupyterLab's timer does
REPLAY = """from helpers.queue_model import predict
from helpers.replay import replay
replay(predict(0.05, 0.2, 10, 1, 41), 10)"""
# The smallest letters in these parts of the slide, in pixels of a slide of 1280 x 720.
LETTERS = """parts => {
    const pixel = Math.min(innerHeight, 0.5625 * innerWidth) / 720;
    const size = part => parseFloat(getComputedStyle(part).fontSize) / pixel;
    return Math.min(...[...document.querySelectorAll(parts)].map(size));
}"""
# Of a traceback: it is cut, its end is not, and it is on the screen.
LAST_LINE = """() => {
    const seen = document.querySelector('.jp-deck-mod-onscreen [data-mime-type$="jupyter.stderr"]');
    const text = document.createRange();
    text.selectNodeContents(seen);
    const end = Math.max(...[...text.getClientRects()].map(line => line.bottom));
    const box = seen.getBoundingClientRect();
    return [seen.scrollHeight > box.height, end <= box.bottom + 1, box.bottom <= innerHeight];
}"""
END_IN_SIGHT = """() => [...document.querySelectorAll('.jp-deck-mod-onscreen .jp-OutputArea')]
    .at(-1).getBoundingClientRect().bottom <= innerHeight"""
SCROLLED = "() => document.querySelector('.jp-deck-mod-onscreen').getBoundingClientRect().top < 0"
CALLS = ''.join(f'def f{n}():\n    f{n + 1}()\n' for n in range(9)) + 'f0()'
PRINTS = """import time
for number in range(60):
    print(number)
    time.sleep(0.05)"""
IN_REPLAY = "() => document.activeElement.matches('.replay-on')"
IN_SIGHT = f"""() => {{
    const box = {PANEL}.content.activeCell.node.getBoundingClientRect();
    return !document.body.dataset.jpDeckMode && box.height && box.top > 0 && box.top < innerHeight;
}}"""


def walk_to_code(deck):
    cells = deck.cells()
    slide = {'slide_type': 'subslide'}  # of its own
    code = next(
        i
        for i, cell in enumerate(cells)
        if cell['cell_type'] == 'code' and cell['metadata']['slideshow'] == slide
    )
    deck.walk_to(code)
    return code


def test_typing_goes_on_during_saves_and_outputs(deck):
    deck.present(LESSON)
    code = walk_to_code(deck)
    deck.page.keyboard.press('Enter')
    deck.page.keyboard.press('Control+A')
    typed = 'import time\nfor number in range(9):\ntime.sleep(0.2)\nprint(number)'
    deck.page.keyboard.type(typed[:5])
    deck.page.keyboard.press('Control+S')
    deck.page.wait_for_function(SAVED)
    for part in (typed[5:9], typed[9:20], typed[20:]):
        deck.page.keyboard.type(part)
        deck.page.evaluate(AUTOSAVE)
    deck.page.keyboard.press('Control+Enter')
    deck.page.keyboard.press('Enter')
    deck.page.keyboard.press('Control+End')
    deck.page.keyboard.type('  # a')
    deck.wait_until_ran(code)
    deck.page.keyboard.type('bxd')
    source = 'import time\nfor number in range(9):\n    time.sleep(0.2)\n    print(number)  # abxd'
    cell = deck.cells()[code]
    assert ''.join(cell['source']) == source
    assert printed(cell).split() == [str(number) for number in range(9)]
    deck.page.evaluate(AUTOSAVE)
    copy, lesson = (deck.server.folder / name / LESSON for name in ('presentation', 'notebooks'))
    assert '# abxd' in copy.read_text()
    assert lesson.read_bytes() == (ROOT / 'notebooks' / LESSON).read_bytes()


def test_the_end_of_an_output_is_seen(deck):
    deck.present(LESSON)
    code = walk_to_code(deck)
    deck.page.keyboard.press('Enter')
    assert deck.page.evaluate(LETTERS, '.cm-focused .cm-line') >= 20
    deck.page.keyboard.press('Control+A')
    deck.page.keyboard.insert_text(CALLS)
    deck.run_here()
    assert deck.page.evaluate(LAST_LINE) == [True, True, True]
    deck.screenshot('traceback')
    deck.write(PRINTS)
    deck.page.keyboard.press('Control+Enter')
    deck.page.wait_for_function(SCROLLED)
    deck.wait_until_ran(code)
    assert deck.page.evaluate(END_IN_SIGHT)


def test_a_key_walks_blackens_or_does_nothing(deck):
    deck.present(LESSON)
    code = walk_to_code(deck)
    before = deck.cells()
    for key in [*'abcdefghjklmnopqrstuvwxyzdd123456', 'Shift+M', 'Shift+V', 'Shift+L', 'Alt+Enter']:
        black = key == 'b'
        deck.page.keyboard.press(key)
        assert deck.page.locator('body.deck-black').count() == black
        if black:
            deck.screenshot('black')
            deck.page.keyboard.press('Space')
            assert deck.page.locator('body.deck-black').count() == 0
    deck.page.keyboard.press('Control+Z')
    assert deck.cells() == before
    assert deck.active() == code
    forth = deck.press('PageDown')
    assert forth > code
    assert deck.press('PageUp') == code


def test_the_deck_stays_where_it_was(deck):
    deck.present(LESSON)
    walk_to_code(deck)
    place = deck.press('PageDown')
    for reopen in (deck.page.reload, lambda: deck.page.goto(deck.server.address)):
        reopen()
        deck.wait_for_notebook(f'presentation/{LESSON}')
        deck.wait_for_slide(place)
        place = deck.press('Space')
    deck.page.keyboard.press('Escape')
    deck.page.wait_for_function(IN_SIGHT)
    assert deck.active() == place


def test_the_next_lesson_is_shown_from_its_link(deck):
    deck.present(START.file)
    deck.press('End')
    deck.page.locator('.jp-deck-mod-onscreen a', has_text=NEXT.title).click()
    deck.wait_for_notebook(f'presentation/{NEXT.file}')
    deck.page.wait_for_function(SLIDES_SHOWN)
    deck.page.keyboard.press('Home')
    deck.wait_for_slide(0)
    place = deck.press('Space')
    assert not deck.page.locator('.jp-Deck-Remote-WidgetStack').is_visible()  # it covers code
    deck.page.reload()
    deck.wait_for_notebook(f'presentation/{NEXT.file}')
    deck.wait_for_slide(place)
    deck.page.keyboard.press('Escape')
    deck.page.wait_for_function(IN_SIGHT)
    assert deck.page.evaluate(f'() => {PANEL}.context.path') == f'presentation/{NEXT.file}'
    assert deck.active() == place


def test_a_clicker_steps_through_a_replay(deck):
    deck.present(LESSON)
    code = walk_to_code(deck)
    deck.write(REPLAY)
    deck.run_here()
    says = deck.page.locator('.jp-deck-mod-onscreen .replay-on [aria-live]')
    assert deck.page.evaluate(LETTERS, '.replay-on :is(p, li, b, button, label)') >= 20
    deck.page.keyboard.press('PageDown')
    for key in ('End', 'Home'):
        deck.page.locator('.replay-on').press(key)
        assert deck.page.evaluate(CUT_OFF) == []
    first = says.inner_text()
    for key in ('PageDown', 'ArrowRight'):
        deck.page.keyboard.press(key)
        assert says.inner_text() != first
        deck.page.keyboard.press('PageUp')
        assert says.inner_text() == first
    assert deck.active() == code
    deck.page.keyboard.press('PageDown')
    deck.page.evaluate(f'() => {{ {PANEL}.context.model.dirty = true }}')
    deck.page.evaluate(AUTOSAVE)
    assert deck.page.evaluate(IN_REPLAY)
    deck.screenshot('replay')
    deck.page.keyboard.press('Escape')
    deck.wait_for_slide(code)
    assert not deck.page.evaluate(IN_REPLAY)
    deck.page.keyboard.press('PageDown')
    deck.page.keyboard.press('End')
    assert deck.press('PageDown') > code
