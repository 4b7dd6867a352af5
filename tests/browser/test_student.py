"""A student's hour: open a lesson, run it, explore, solve, interrupt, start again."""

import pytest
from lab_page import PANEL, complaints
from lab_server import NOTEBOOKS


def assert_all_ran(lab):
    """Every code cell has its number, no error, and every picture of the lesson is there."""
    cells = lab.cells()
    assert [
        text for cell in cells if cell['cell_type'] == 'code' for text in complaints(cell)
    ] == []
    counts = [cell['execution_count'] for cell in cells if cell['cell_type'] == 'code']
    assert counts == list(range(1, len(counts) + 1))
    for index, cell in enumerate(cells):
        images = lab.show(index).query_selector_all('img')
        assert all(image.evaluate('img => img.naturalWidth > 0') for image in images)
        assert all(image.get_attribute('alt') for image in images)
        saved = [o for o in cell.get('outputs', []) if '<img ' in str(o.get('data', {}))]
        assert len(images) >= len(saved)


@pytest.mark.parametrize('name', [path.name for path in NOTEBOOKS])
def test_open_a_lesson_and_run_all(lab, name):
    lab.open(name)
    lab.run_all()
    assert_all_ran(lab)


def test_move_a_slider_and_see_the_figure_change(lab):
    lab.open('04_choose_the_number_of_threads.ipynb')
    sources = [''.join(cell['source']) for cell in lab.cells()]
    used = next(i for i, source in enumerate(sources) if 'interactive_output' in source)
    lab.run_all()
    cell = lab.show(used)
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


def test_interrupt_an_experiment_and_run_it_again(lab):
    lab.open('02_lose_messages.ipynb')
    sources = [''.join(cell['source']) for cell in lab.cells()]
    experiment = next(i for i, source in enumerate(sources) if source.startswith('def run('))
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
