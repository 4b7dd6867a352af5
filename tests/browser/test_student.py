"""A student's hour: open a lesson, run it, explore, interrupt, start again.

That each lesson runs is what nbval checks, with the same kernel, and `make notebooks` that nothing
else reaches JupyterLab. Here is what only a browser shows.
"""

from support.lab_page import PANEL, complaints

from helpers.lesson import path_of

IS_OPEN = 'summary => summary.parentElement.open'
WITH_A_SLIDER = path_of('choose_the_number_of_threads').name


def test_run_all_and_move_a_slider(lab):
    lab.open(WITH_A_SLIDER)
    lab.command('notebook:clear-all-cell-outputs')
    lab.command('notebook:run-all-cells')
    cells = lab.cells()
    code = [cell for cell in cells if cell['cell_type'] == 'code']
    assert [text for cell in code for text in complaints(cell)] == []
    assert [cell['execution_count'] for cell in code] == list(range(1, len(code) + 1))
    for index, cell in enumerate(cells):
        shown = lab.show(index)
        images = shown.query_selector_all('img')
        assert all(image.evaluate('img => img.naturalWidth > 0') for image in images)
        drawn = shown.query_selector_all('.replay svg')  # by the script of a replay
        asked = [o for o in cell.get('outputs', []) if '<img ' in str(o.get('data', {}))]
        assert len(images) + len(drawn) >= len(asked)
    cell = lab.show(lab.find('model_with_sliders('))
    picture = cell.query_selector('.jp-RenderedHTML img')
    before = picture.get_attribute('src')
    lab.screenshot('slider_before')
    cell.query_selector('.noUi-handle').focus()
    lab.page.keyboard.press('ArrowRight')
    lab.page.wait_for_function(
        """([cell, before]) => {
            const image = cell.querySelector('.jp-RenderedHTML img');
            return image && image.complete && image.src !== before;
        }""",
        arg=[cell, before],
    )


def test_answers_of_a_quiz_open_and_stay_rendered(lab):
    lab.open(path_of('publish_and_subscribe').name)
    question = lab.find('### Question 1')
    first, _, third = lab.show(question).query_selector_all('summary')
    first.click()
    third.dblclick()  # opens and closes it
    assert lab.page.evaluate(f'index => {PANEL}.content.widgets[index].rendered', question)
    assert [answer.evaluate(IS_OPEN) for answer in (first, third)] == [True, False]


def test_interrupt_an_experiment_and_run_it_again(lab):
    lab.open(path_of('lose_messages').name)
    experiment = lab.find('as first_session')
    for index in range(experiment):
        if lab.cells()[index]['cell_type'] == 'code':
            lab.run(index)
    lab.start(experiment)
    lab.page.wait_for_function(f"() => {PANEL}.sessionContext.session.kernel.status === 'busy'")
    lab.page.locator('.jp-NotebookPanel-toolbar [data-command="notebook:interrupt-kernel"]').click()
    lab.wait_until_ran(experiment)
    assert any('KeyboardInterrupt' in text for text in complaints(lab.cells()[experiment]))
    lab.screenshot('interrupted')
    lab.run(experiment)
    assert complaints(lab.cells()[experiment]) == []
