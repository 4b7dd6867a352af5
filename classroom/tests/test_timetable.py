"""The slides of a timetable: a clicker walks from lesson to lesson, and the minutes go on."""

from support.lab_page import PANEL
from support.lab_server import server

from classroom.plan import plan_of
from classroom.tests.support.deck_page import DeckPage

PLAN = plan_of('90')
FILES = list(PLAN.steps)
ROWS = PLAN.from_first_lesson
BEGAN = f"() => {PANEL}.model.getMetadata('deck').began"
SAYS = "() => document.querySelector('#deck-says').textContent"
# Both at once: another lesson may open between two questions.
STATE = f"() => [{PANEL}.context.path, document.querySelector('#deck-says').textContent]"
IS_SHOWN = f"""file => {PANEL}.context.path.endsWith(file)
    && {PANEL}.node.matches('.jp-Deck')"""


def planned_minutes(window, step):
    """Wait until the notes window shows a step, and return its minutes: to its end, and in all."""
    window.locator('#step', has_text=step).wait_for()
    return [int(window.locator(f'#{name}').inner_text()) for name in ('planned', 'all')]


def test_pagedown_leads_through_a_timetable(lab_page, tmp_path):
    def walk_out(deck, edge, key, file):
        """Press a key at an edge of a lesson, also for texts that wait there, until it is left."""
        deck.page.keyboard.press(edge)
        here = [deck.page.evaluate(STATE)[0], '']
        while deck.page.evaluate(STATE) == here:
            deck.page.keyboard.press(key)
        deck.wait_for_notebook(f'presentation/{file}')
        deck.page.wait_for_function(IS_SHOWN, arg=file)

    with (
        server(tmp_path, 'present', 'PLAN=90') as running,
        lab_page(running, 'timetable', DeckPage) as deck,
    ):
        deck.present(FILES[0])
        with deck.page.expect_popup() as opened:
            deck.page.keyboard.press('n')
        window = opened.value
        deck.go_on()
        began = deck.page.evaluate(BEGAN)
        for file in FILES[1:]:
            walk_out(deck, 'End', 'PageDown', file)
            deck.wait_for_slide(0)
            deck.screenshot(f'title_of_{file}')
            deck.press('ArrowRight')
            assert deck.page.evaluate(BEGAN) == began
        deck.page.keyboard.press('ArrowRight')
        before = sum(row.minutes for row in ROWS[: [row.file for row in ROWS].index(FILES[-1])])
        all_minutes = sum(row.minutes for row in ROWS)
        planned, in_all = planned_minutes(window, '2. ')
        assert before < planned < all_minutes == in_all
        deck.page.keyboard.press('End')
        while not deck.page.evaluate(SAYS):
            deck.page.keyboard.press('PageDown')
        assert deck.page.evaluate(SAYS) == 'The end of the timetable.'
        for file in FILES[-2::-1]:
            walk_out(deck, 'Home', 'PageUp', file)
            number, count = deck.page.text_content('#deck-head span').split('/')
            assert int(number) == int(count)
        deck.page.keyboard.press('Home')
        deck.page.keyboard.press('PageUp')
        deck.page.locator('#deck-says', has_text='The first slide.').wait_for()
