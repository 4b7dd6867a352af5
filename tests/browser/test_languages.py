"""The summaries in four languages, unfolded by a student and on a slide."""

LONGEST = '05_keep_what_is_fresh.ipynb'
# The empty space to the left and to the right of the name of a language.
SPACE = """summary => {
    const name = document.createRange(), line = summary.getBoundingClientRect();
    name.selectNodeContents(summary);
    const box = name.getBoundingClientRect();
    return [box.left - line.left, line.right - box.right];
}"""


def test_a_student_unfolds_a_summary_with_keys(lab):
    lab.open(LONGEST)
    cell = lab.show(1)
    for language in ('fr', 'ur', 'vi'):
        details = cell.query_selector(f'details[lang={language}]')
        summary = details.query_selector('summary')
        summary.focus()
        lab.page.keyboard.press('Space')
        lab.page.wait_for_function('details => details.open', arg=details)
        left, right = summary.evaluate(SPACE)
        assert (right < left) == (language == 'ur')
    lab.screenshot('summaries_unfolded')
