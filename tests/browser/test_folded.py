"""What a student unfolds in JupyterLab: a summary in other languages, the answers of a quiz."""

from lab_page import PANEL

LONGEST = '05_keep_what_is_fresh.ipynb'
# The empty space to the left and to the right of the name of a language.
SPACE = """summary => {
    const name = document.createRange(), line = summary.getBoundingClientRect();
    name.selectNodeContents(summary);
    const box = name.getBoundingClientRect();
    return [box.left - line.left, line.right - box.right];
}"""
IS_OPEN = 'summary => summary.parentElement.open'


def test_summaries_open_by_keys_and_answers_by_mouse(lab):
    lab.open(LONGEST)
    cell = lab.show(1)
    for language in ('fr', 'ur', 'vi'):
        summary = cell.query_selector(f'details[lang={language}] summary')
        summary.focus()
        lab.page.keyboard.press('Space')
        lab.page.wait_for_function(IS_OPEN, arg=summary)
        left, right = summary.evaluate(SPACE)
        assert (right < left) == (language == 'ur')
    lab.screenshot('summaries_unfolded')
    question = lab.find('### Question 1')
    answers = lab.show(question).query_selector_all('summary')
    answers[0].click()
    assert [answer.evaluate(IS_OPEN) for answer in answers] == [True, False, False]
    lab.screenshot('quiz_answers')
    answers[2].dblclick()
    assert lab.page.evaluate(f'index => {PANEL}.content.widgets[index].rendered', question)
    assert [answer.evaluate(IS_OPEN) for answer in answers] == [True, False, False]
