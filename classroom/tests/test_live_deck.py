"""In front of a class: each key of teaching.md, and nothing that was typed or run is lost."""

import re
import urllib.request

import pytest
from support.lab_page import PANEL, printed
from support.lab_server import ROOT
from support.waits import wait_for

from classroom.tests.support.deck_page import SLIDES_SHOWN
from helpers.lesson import lessons, path_of

LESSON = path_of('lose_messages').name
START, NEXT = lessons()[:2]
SAVED = f'() => !{PANEL}.context.model.dirty'
SOURCE = f'() => {PANEL}.content.activeCell.model.sharedModel.getSource()'
KERNELS = """async () => {
    const { kernels } = window.jupyterapp.serviceManager;
    await kernels.refreshRunning();
    return [...kernels.running()].length;
}"""
REPLAY = """from helpers.recording import predict
from helpers.replay import replay
replay(predict(0.05, 0.2, 10, 1, 41), 10)"""
LEVEL = """from helpers.replay import level
level('depth')"""
# The smallest letters in these parts of the slide, in pixels of a slide of 1280 x 720.
LETTERS = """parts => {
    const pixel = Math.min(innerHeight, 0.5625 * innerWidth) / 720;
    const size = part => parseFloat(getComputedStyle(part).fontSize) / pixel;
    return Math.min(...[...document.querySelectorAll(parts)].map(size));
}"""
# Of a traceback: it is cut, its end is not, and it is on the screen.
LAST_LINE = """() => {
    const seen = document.querySelector('.deck-on [data-mime-type$="jupyter.stderr"]');
    const text = document.createRange();
    text.selectNodeContents(seen);
    const end = Math.max(...[...text.getClientRects()].map(line => line.bottom));
    const box = seen.getBoundingClientRect();
    return [seen.scrollHeight > box.height, end <= box.bottom + 1, box.bottom <= innerHeight];
}"""
END_IN_SIGHT = """() => document.querySelector('.deck-on.jp-mod-active .jp-OutputArea')
    .getBoundingClientRect().bottom < innerHeight + 1"""
CALLS = ''.join(f'def f{n}():\n    f{n + 1}()\n' for n in range(9)) + 'f0()'
PRINTS = """import time
for number in range(60):
    print(number)
    time.sleep(0.05)"""
# Which cell of a task is on the stage, whether its output is seen, and how much of the slide is
# not.
STAGE = f"""() => {{
    const {{ widgets, outerNode }} = {PANEL}.content;
    const stage = widgets.findIndex(cell => cell.node.matches('.deck-on.deck-stage'));
    const output = widgets[stage]?.node.querySelector('.jp-OutputArea-output');
    const below = outerNode.scrollHeight - outerNode.clientHeight;
    return [stage, !output || output.checkVisibility(), below];
}}"""
CODE_OF_SLIDE = f"""() => {PANEL}.content.widgets.flatMap((cell, index) =>
    (cell.node.classList.contains('deck-on') && cell.model.type === 'code' ? [index] : []))"""
BLACK = 'body.deck-black'


class Deck:
    """What a row of the table is tried with."""

    def __init__(self, page):
        self.page, self.tab, self.key = page, page.page, page.page.keyboard.press

    @property
    def slide(self):
        return int(self.tab.text_content('#deck-head span').split('/')[0])

    @property
    def step(self):
        return self.tab.text_content('#deck-head b')

    def says(self, words):
        self.tab.locator('#deck-says', has_text=words).wait_for()

    def walk_to_code(self):
        """Walk to the first cell whose source is seen, and return its index."""
        self.key('ArrowRight')
        code = self.page.find('SPEED = 10')
        while self.page.active() != code:
            self.key('ArrowDown')
        self.page.wait_for_slide(code)
        return code

    def show(self, source):
        code = self.walk_to_code()
        self.page.write(source)
        self.page.run_here()
        return code


def forward(deck):
    for number, key in enumerate(('Space', 'PageDown'), 2):
        deck.key(key)
        if deck.slide < number:  # texts that wait for a cell
            deck.key(key)
        assert deck.slide == number

    deck.page.command('notebook:clear-all-cell-outputs')
    deck.page.write('1')
    deck.page.run_here()
    frame, slide = deck.page.active(), deck.slide
    cells = deck.tab.evaluate(CODE_OF_SLIDE)
    for cell in cells[cells.index(frame) + 1 :]:  # none is left out
        deck.key('PageDown')
        assert (deck.slide, deck.page.active()) == (slide, cell)
        deck.page.run_here()
    deck.key('PageDown')
    assert deck.slide == slide + 1
    deck.tab.wait_for_function(SAVED)


def back(deck):
    deck.key('End')
    last = deck.slide
    deck.key('PageUp')
    deck.key('Shift+Space')
    assert deck.slide == last - 2


def steps(deck):
    titles = []
    for key in ['ArrowRight'] * 3 + ['ArrowLeft'] * 3:
        deck.key(key)
        titles.append(deck.step)
    assert [title[:2] for title in titles] == ['1.', '2.', '3.', '2.', '1.', '02']
    deck.key('ArrowRight')
    start = deck.slide
    deck.key('Space')
    deck.key('Space')
    assert deck.slide > start
    deck.key('ArrowLeft')
    assert deck.slide == start


def cells(deck):
    code = deck.walk_to_code()
    deck.key('ArrowUp')
    assert deck.page.active() < code
    deck.key('ArrowDown')
    assert deck.page.active() == code


def ends(deck):
    deck.key('End')
    assert deck.slide == int(deck.tab.text_content('#deck-head span').split('/')[1])
    deck.key('Home')
    assert deck.slide == 1


def in_a_replay(deck):
    code = deck.show(REPLAY)
    replay = deck.tab.locator('.deck-on .replay-on')
    step = replay.locator('input[type=range]')
    assert deck.tab.evaluate(LETTERS, '.replay-on :is(p, li, b, button, label)') >= 18
    stops = []
    for _ in range(2):
        deck.key('PageDown')
        stops.append(step.input_value())
    assert 0 < int(stops[0]) < int(stops[1]) == int(step.get_attribute('max'))
    box = replay.bounding_box()
    assert 0 < box['y'] < 720 - box['height']
    deck.page.screenshot('replay')
    replay.click(position={'x': 5, 'y': 5})
    deck.key('ArrowLeft')
    assert int(step.input_value()) == int(stops[1]) - 1
    deck.key('Control+S')
    deck.key('ArrowRight')
    assert deck.page.active() == code
    deck.key('n')  # a key of the deck, in the replay
    deck.key('Shift+B')
    assert deck.tab.locator(BLACK).count() == 1
    deck.key('Space')
    deck.key('Escape')
    deck.page.wait_for_slide(code)
    assert not deck.tab.evaluate("() => document.activeElement.closest('.replay-on')")
    here = deck.slide
    deck.key('PageDown')
    deck.key('PageDown')
    assert deck.slide > here


def runs(deck):
    code = deck.walk_to_code()
    deck.key('ArrowUp')
    deck.key('Shift+Enter')
    deck.page.wait_until_ran(code - 1)
    assert deck.page.active() == code
    deck.page.write('print(6 * 7)')
    deck.page.run_here()
    assert printed(deck.page.cells()[code]).strip() == '42'
    assert deck.tab.evaluate(SOURCE) == 'print(6 * 7)'
    deck.key('Escape')
    assert deck.tab.evaluate(SLIDES_SHOWN)


def runs_above(deck):
    deck.walk_to_code()
    deck.page.write('above = 41')
    deck.key('Escape')
    code = deck.page.go_on()
    deck.page.write('print(above + 1)')
    deck.key('Escape')
    deck.key('a')
    deck.says('A again')
    deck.key('a')
    deck.says('The cells above have run.')
    deck.key('Control+Enter')
    deck.page.wait_until_ran(code)
    assert printed(deck.page.cells()[code]).strip() == '42'


def stops(deck):
    code = deck.walk_to_code()
    deck.page.write('import time\nheld = 1\ntime.sleep(60)')
    deck.key('Control+Enter')
    deck.tab.locator('.deck-runs').wait_for()
    deck.key('i')
    deck.key('i')
    deck.page.wait_until_ran(code)
    deck.key('0')
    deck.key('0')
    deck.says('The kernel is restarted')
    deck.page.wait_for_notebook(f'presentation/{LESSON}')
    deck.page.write("print('held' in globals())")
    deck.page.run_here()
    assert printed(deck.page.cells()[code]).strip() == 'False'


def into_a_cell(deck):
    code = deck.walk_to_code()
    deck.key('ArrowUp')
    assert deck.tab.locator('.jp-mod-active .cm-line').count() == 0
    deck.key('Enter')
    deck.tab.locator('.jp-mod-active .cm-line').first.wait_for()
    deck.key('Escape')
    deck.key('ArrowDown')
    deck.tab.locator('.jp-mod-active .cm-line').first.click()
    deck.tab.keyboard.type('n.b')
    assert 'n.b' in deck.tab.evaluate(SOURCE)
    deck.key('Escape')
    assert deck.page.active() == code
    deck.key('End')
    deck.key('Enter')
    following = lessons()[[one.file for one in lessons()].index(LESSON) + 1]
    deck.page.wait_for_notebook(f'presentation/{following.file}')
    deck.page.wait_for_slide(0)
    deck.key('Space')
    place = deck.page.active()
    assert place > 0
    with deck.tab.expect_navigation():
        deck.key('Control+R')
    deck.page.wait_for_notebook(f'presentation/{following.file}')
    deck.page.wait_for_slide(place)


def whole_texts(deck):
    needs = deck.tab.locator('.deck-on strong', has_text='You need')
    for count in (0, 1, 0):
        assert needs.count() == count
        deck.key('t')


def without_a_class(deck):
    """With one: see test_class_in_browser.py."""
    deck.key('s')
    deck.says('No guesses of a class on this slide.')
    deck.key('j')
    deck.says('No class is open')


def black(deck):
    for key in ('b', 'Shift+B', '.'):
        deck.key(key)
        assert deck.tab.locator(BLACK).count() == 1
        deck.key('Space')
        assert deck.tab.locator(BLACK).count() == 0
    assert deck.slide == 1
    deck.show(LEVEL)
    deck.tab.locator('.level button').first.focus()
    deck.key('.')
    assert deck.tab.locator(BLACK).count() == 1
    deck.page.screenshot('black')


def opens_notes(deck):
    with deck.tab.expect_popup() as opened:
        deck.key('Shift+N')
    assert opened.value.url.endswith('/notes.html')


def a_fresh_copy(deck):
    code = deck.walk_to_code()
    deck.page.write('typed = 1')
    deck.page.run_here()
    deck.key('r')
    deck.key('r')
    deck.page.wait_for_slide(0)
    deck.page.wait_for_notebook(f'presentation/{LESSON}')  # its kernel starts again
    assert 'typed' not in ''.join(deck.page.cells()[code]['source'])


def leave(deck):
    code = deck.walk_to_code()
    deck.key('Escape')
    deck.says('Escape again')
    deck.key('Escape')
    assert deck.tab.locator('.jp-Deck').count() == 0
    deck.tab.wait_for_function(
        f'() => {PANEL}.content.activeCell.node.getBoundingClientRect().top > 0'
    )
    assert deck.page.active() == code


def start_button(deck):
    code = deck.walk_to_code()
    deck.page.write('typed = 1')
    deck.key('F5')
    deck.tab.wait_for_function(SAVED)
    assert deck.tab.evaluate(SOURCE) == 'typed = 1'
    for key in ('Escape', 'Escape', 'Escape', 'F5'):
        deck.key(key)
    deck.page.wait_for_slide(code)


ROWS = {
    'Space, PageDown, a clicker': forward,
    'Shift+Space, PageUp': back,
    '→, ←': steps,
    '↑, ↓': cells,
    'Home, End': ends,
    'Space or PageDown at a replay': in_a_replay,
    'Ctrl+Enter, Shift+Enter': runs,
    'A A': runs_above,
    'I I, 0 0': stops,
    'Enter, or a click': into_a_cell,
    'T': whole_texts,
    'S, J': without_a_class,
    'B, or .': black,
    'N': opens_notes,
    'R R': a_fresh_copy,
    'Escape Escape': leave,
    "F5, a clicker's start button": start_button,
}


def test_each_row_of_the_table_is_walked():
    text = (ROOT / 'teaching.md').read_text(encoding='utf-8')
    table = text.partition('### Slides')[2].partition('| | |\n|---|---|\n')[2].partition('\n\n')[0]
    assert re.findall(r'^\| (.+?) \| .+ \|$', table, re.MULTILINE) == list(ROWS)


@pytest.mark.parametrize('walk', ROWS.values(), ids=[walk.__name__ for walk in ROWS.values()])
def test_the_keys_do_what_their_row_says(deck, walk):
    deck.present(LESSON)
    walk(Deck(deck))


def test_other_letters_do_nothing(deck):
    deck.present(LESSON)
    code = Deck(deck).walk_to_code()
    before = deck.cells()
    for key in [*'cdefghklmopquvwxyzdd123456', 'Shift+M', 'Shift+V', 'Shift+L', 'Alt+Enter']:
        deck.page.keyboard.press(key)
    deck.page.keyboard.press('Control+Z')
    assert deck.cells() == before
    assert deck.active() == code


def test_typing_goes_on_during_saves_and_outputs(deck):
    deck.present(LESSON)
    code = Deck(deck).walk_to_code()
    deck.page.keyboard.press('Enter')
    deck.page.keyboard.press('Control+A')
    typed = 'import time\nfor number in range(9):\ntime.sleep(0.2)\nprint(number)'
    deck.page.keyboard.type(typed[:5])
    deck.page.keyboard.press('Control+S')
    deck.page.wait_for_function(SAVED)
    for part in (typed[5:9], typed[9:20], typed[20:]):
        deck.page.keyboard.type(part)
        deck.page.keyboard.press('Control+S')
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
    copy, lesson = (deck.server.folder / name / LESSON for name in ('presentation', 'notebooks'))
    # Without a key that saves, for a crash.
    wait_for(lambda: all(text in copy.read_text() for text in ('# abxd', '"8\\n"')))
    assert lesson.read_bytes() == (ROOT / 'notebooks' / LESSON).read_bytes()


def test_a_reload_loses_nothing_and_the_kernel_is_waited_for(deck):
    deck.present(LESSON)
    code = Deck(deck).walk_to_code()
    deck.write("runs = globals().get('runs', 0) + 1\nprint(runs)")
    deck.run_here()
    deck.page.keyboard.press('Enter')
    deck.page.keyboard.press('Control+End')
    deck.page.keyboard.type('  # typed')

    def number():
        return int(printed(deck.cells()[code]) or 0)

    runs = number()
    for _ in range(3):
        with deck.page.expect_event('load'):  # JupyterLab changes the address, too
            deck.page.keyboard.press('Control+R')
        deck.page.wait_for_function(SLIDES_SHOWN)
        for _ in range(5):  # while the kernel connects
            deck.page.keyboard.press('Control+Enter')
            assert deck.page.locator('.jp-Dialog').count() == 0
        deck.wait_for_notebook(f'presentation/{LESSON}')
        # The kernel is that of before, and counts on. Until it answers, the saved output is shown.
        wait_for(number, runs.__lt__)
        deck.wait_until_ran(code)
        runs = number()
    assert ''.join(deck.cells()[code]['source']).endswith('# typed')
    assert deck.page.evaluate(KERNELS) == 1
    assert deck.active() == code


def test_the_end_of_an_output_is_seen(deck):
    deck.present(LESSON)
    code = Deck(deck).walk_to_code()
    deck.page.keyboard.press('Enter')
    assert deck.page.evaluate(LETTERS, '.cm-focused .cm-line') >= 18
    deck.page.keyboard.press('Control+A')
    deck.page.keyboard.insert_text(CALLS)
    deck.run_here()
    assert deck.page.evaluate(LAST_LINE) == [True, True, True]
    deck.screenshot('traceback')
    deck.write(PRINTS)
    deck.run_here()
    assert deck.active() == code
    assert deck.page.evaluate(END_IN_SIGHT)


def test_a_task_is_one_thing_at_a_time(deck):
    """Starter, check and solution run one after the other, and nothing scrolls away."""
    deck.present(LESSON)
    deck.command('notebook:clear-all-cell-outputs')
    starter, check, solution = (deck.find(tag=tag) for tag in ('exercise', 'check', 'solution'))
    while deck.active() != starter:
        deck.page.keyboard.press('Space')
    for key in 'aa':
        deck.page.keyboard.press(key)
    deck.page.locator('#deck-says', has_text='have run').wait_for()
    seen = []
    for cell in (starter, check, solution):
        deck.page.keyboard.press('Shift+Enter')
        deck.wait_until_ran(cell)
        seen += [(cell, size, deck.page.evaluate(STAGE)) for size in sizes(deck)]
    for cell in (check, starter):
        deck.page.keyboard.press('ArrowUp')
        seen += [(cell, size, deck.page.evaluate(STAGE)) for size in sizes(deck)]
    deck.screenshot('task')
    # Each is on the stage with its output, and all of the slide is seen.
    assert [stage for *_, stage in seen] == [[cell, True, 0] for cell, *_ in seen]


def sizes(deck):
    """Yield the sizes of a projector and of an old one, each while the deck has it."""
    for width, height in ((1920, 1080), (1024, 768)):
        deck.page.set_viewport_size({'width': width, 'height': height})
        deck.page.wait_for_timeout(300)  # the letters follow the size
        yield width, height


def test_no_key_stops_at_notes_that_nobody_sees(deck):
    deck.present(LESSON)
    deck.page.keyboard.press('ArrowRight')
    code = deck.active()
    assert deck.cells()[code - 1]['cell_type'] == 'raw'
    deck.page.keyboard.press('Enter')
    deck.page.keyboard.press('Control+Home')
    deck.page.keyboard.press('ArrowUp')
    assert deck.page.evaluate(f"() => {PANEL}.content.activeCell.node.matches('.deck-on')")
    deck.page.keyboard.press('Escape')
    deck.page.keyboard.press('ArrowDown')
    assert deck.active() == code


def test_a_dialog_becomes_a_line(deck):
    deck.present(LESSON)
    deck.page.evaluate("""() => {
        const { commands } = window.jupyterapp;
        void commands.execute('kernelmenu:restart');
    }""")
    deck.page.locator('#deck-says', has_text=re.compile('kernel', re.IGNORECASE)).wait_for()
    deck.page.locator('.jp-Dialog').wait_for(state='detached')
    deck.press('Space')


def test_the_deck_loads_only_what_is_public(deck):
    """JupyterLab hands its packages over; nothing below them begins with an underscore."""
    address = f'{deck.server.url}lab/extensions/presenter/presenter.js'
    script = urllib.request.urlopen(address).read().decode()
    assert set(re.findall(r'\._\w+', script)) == {'._JUPYTERLAB'}
