"""A student chooses answers of a quiz."""

from lab_page import PANEL


def test_answers_open_by_mouse_and_by_keyboard(lab):
    lab.open('02_lose_messages.ipynb')
    index = next(i for i, cell in enumerate(lab.cells()) if '<details>' in ''.join(cell['source']))
    cell = lab.show(index)
    answers = cell.query_selector_all('summary')

    def opened():
        return [answer.evaluate('summary => summary.parentElement.open') for answer in answers]

    assert opened() == [False] * 4
    answers[0].click()
    assert opened() == [True, False, False, False]
    lab.page.keyboard.press('Tab')
    lab.page.keyboard.press('Enter')
    assert opened() == [True, True, False, False]
    lab.screenshot('quiz_answers')
    answers[2].dblclick()
    assert lab.page.evaluate(f'index => {PANEL}.content.widgets[index].rendered', index)
    assert opened() == [True, True, False, False]
