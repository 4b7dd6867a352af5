"""What a student unfolds in JupyterLab: the answers of a quiz."""

from support.lab_page import PANEL

IS_OPEN = 'summary => summary.parentElement.open'


def test_answers_open_by_mouse_and_stay_rendered(lab):
    lab.open('01_publish_and_subscribe.ipynb')
    question = lab.find('### Question 1')
    answers = lab.show(question).query_selector_all('summary')
    answers[0].click()
    assert [answer.evaluate(IS_OPEN) for answer in answers] == [True, False, False]
    lab.screenshot('quiz_answers')
    answers[2].dblclick()
    assert lab.page.evaluate(f'index => {PANEL}.content.widgets[index].rendered', question)
    assert [answer.evaluate(IS_OPEN) for answer in answers] == [True, False, False]
