"""The quiz at the end of a lesson: a student opens answers."""

from lab_page import PANEL


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
