"""The quiz at the end of a lesson: a student opens answers, an instructor shows them."""

import pytest
from lab_page import CUT_OFF, PANEL
from lab_server import NOTEBOOKS

QUIZZES = [path for path in NOTEBOOKS if '## Quiz' in path.read_text(encoding='utf-8')]
ACTIVATE = f'index => {{ {PANEL}.content.activeCellIndex = index; {PANEL}.content.activate() }}'
OPEN_ALL = f"""index => {{
    const answers = [...{PANEL}.content.widgets[index].node.querySelectorAll('details')];
    answers.forEach(answer => answer.open = true);
    return answers.length;
}}"""


def questions(lab):
    sources = [''.join(cell['source']) for cell in lab.cells()]
    return [i for i, source in enumerate(sources) if source.startswith('### Question ')]


def test_answers_open_by_mouse_and_by_keyboard(lab):
    lab.open('02_lose_messages.ipynb')
    index = questions(lab)[0]
    answers = lab.show(index).query_selector_all('summary')

    def opened():
        return [answer.evaluate('summary => summary.parentElement.open') for answer in answers]

    assert opened() == [False, False, False]
    answers[0].click()
    assert opened() == [True, False, False]
    lab.page.keyboard.press('Tab')
    lab.page.keyboard.press('Enter')
    assert opened() == [True, True, False]
    lab.screenshot('quiz_answers')
    answers[2].dblclick()
    assert lab.page.evaluate(f'index => {PANEL}.content.widgets[index].rendered', index)
    assert opened() == [True, True, False]


@pytest.mark.parametrize('path', QUIZZES, ids=[path.name for path in QUIZZES])
def test_a_slide_has_room_for_all_answers(deck, path):
    deck.present(path.name)
    for index in questions(deck):
        deck.page.evaluate(ACTIVATE, index)
        deck.wait_for_slide(index)
        assert deck.on_screen() == [index]
        assert deck.page.evaluate(OPEN_ALL, index) >= 3
        deck.screenshot(path.stem, f'{index:02d}_answers')
        assert deck.page.evaluate(CUT_OFF) == []
