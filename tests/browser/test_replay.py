"""Replays as they are used: in JupyterLab, on slides, on an exported page, by keys alone."""

import nbformat
import pytest
from lab_page import AXE, PANEL, WIDER
from nbconvert.exporters import HTMLExporter
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, output_from_msg
from support.runs import assert_is_the_run, real_runs

from helpers.queue_model import predict
from helpers.replay import replay, side_by_side
from tools.lessons.clean import NOTEBOOK_METADATA

SOURCE = """from helpers.queue_model import predict
from helpers.replay import replay
replay(predict(0.05, 0.2, 10, 1, 41), 10)"""
PUSHED_OUT = 'Message 14 arrives. Ten wait, so the oldest, 4, is pushed out.'
# What a screen reader is told at each step, from the first to the last.
READ = """index => {
    const replay = document.querySelectorAll('.replay')[index];
    const press = key => replay.dispatchEvent(
        new KeyboardEvent('keydown', { key, bubbles: true, cancelable: true }));
    const texts = (run, name) =>
        [...run.querySelectorAll(`[aria-label="${name}"] > li`)].map(item => item.textContent);
    const found = [];
    press('Home');
    for (let step = 0; step <= +replay.querySelector('[type=range]').max; step += 1) {
        found.push([...replay.querySelectorAll('.replay-run')].map(run => ({
            now: parseFloat(run.querySelector('.replay-time').textContent),
            threads: texts(run, 'threads').map(text => text.split(': ')[1]),
            queue: texts(run, 'queue').map(Number),
            lost: texts(run, 'lost').map(Number),
            says: replay.querySelector('[aria-live]').textContent,
        })));
        press('ArrowRight');
    }
    return found;
}"""
# The texts with too little contrast (WCAG 2.2, 1.4.3) or one that axe cannot tell; and the others.
CONTRAST = """async () => {
    const found = await axe.run('.replay-on', { runOnly: 'color-contrast' });
    const texts = (...kinds) => kinds.flatMap(kind => found[kind])
        .flatMap(rule => rule.nodes.map(node => node.html));
    return [texts('violations', 'incomplete'), texts('passes')];
}"""


def notebook(*shown):
    """Return a notebook with the saved outputs of replays, of which nothing was run here."""
    cells = [new_markdown_cell('# 98 Step'), new_code_cell(SOURCE)]
    for number, one in enumerate(shown):
        data = one._repr_mimebundle_()
        content = {'data': data, 'metadata': {}, 'execution_count': number + 1}
        message = {'header': {'msg_type': 'execute_result'}, 'content': content}
        cells.append(new_code_cell('shown', outputs=[output_from_msg(message)]))
    return new_notebook(cells=cells, metadata=NOTEBOOK_METADATA)


@pytest.fixture
def prediction():
    return replay(predict(0.05, 0.2, 10, 1, 41), 10)


@pytest.fixture
def exported(file_page, tmp_path):
    """Return a function that opens replays on a page exported by nbconvert."""
    # The page asks for its mathematics and its own loader in vain; replays ask for nothing.
    with file_page(1280, 720, expected=('require', 'MathJax')) as page:

        def open_page(*shown):
            html, _ = HTMLExporter().from_notebook_node(notebook(*shown))
            file = tmp_path / 'exported.html'
            file.write_text(html)
            page.goto(file.as_uri(), wait_until='domcontentloaded')
            page.wait_for_selector('.replay-on')
            return page

        yield open_page


def states(read, run=0):
    """Return what was read as `assert_is_the_run` wants it."""
    return [
        {
            **step[run],
            'threads': [None if text == 'free' else int(text) for text in step[run]['threads']],
            'lost': [[seq, seq] for seq in step[run]['lost']],
        }
        for step in read
    ]


@pytest.mark.parametrize(
    ('threads', 'group', 'depth'),
    [(1, 'mutually exclusive', 4), (2, 'mutually exclusive', 2), (4, 'reentrant', 3)],
)
def test_recorded_runs_are_read_back_step_by_step(exported, threads, group, depth):
    tables = real_runs(threads, group, depth, 7)
    page = exported(*(replay(table, depth, threads, group) for table in tables))
    for index, table in enumerate(tables):
        read = states(page.evaluate(READ, index))
        assert_is_the_run(read, table, depth, accuracy_s=1e-3)


def test_two_runs_go_together(exported, artefacts):
    slow, fast = predict(0.05, 0.2, 10, 1, 41), predict(0.05, 0.2, 10, 8, 41)
    both = {'A': replay(slow, 10), 'D': replay(fast, 10, 8, 'reentrant')}
    page = exported(side_by_side(both))
    read = page.evaluate(READ, 0)
    for before, after in zip(read, read[1:], strict=False):
        changed = [b != {**a, 'says': b['says']} for b, a in zip(before, after, strict=True)]
        assert sum(changed) <= 1
        assert after[0]['says'][:3] in ('A: ', 'D: ')
    assert read[-1][0]['lost'] == slow.loc[slow['started_s'].isna(), 'seq'].tolist()
    assert read[-1][1]['lost'] == []
    page.keyboard.press('Tab')
    page.screenshot(path=artefacts / 'replay_two.png')


def test_keys_alone(exported, artefacts, prediction):
    page = exported(prediction, prediction)
    for _ in range(40):
        page.keyboard.press('Tab')
        if page.evaluate("() => document.activeElement.matches('.replay')"):
            break
    replays = page.locator('.replay')
    first, second = replays.nth(0), replays.nth(1)
    outline = '() => getComputedStyle(document.activeElement).outlineStyle'
    assert page.evaluate(outline) == 'solid'
    for _ in range(21):
        page.keyboard.press('ArrowRight')
    says = first.locator('[aria-live=polite]')
    while says.inner_text() != PUSHED_OUT:
        page.keyboard.press('ArrowRight')
    queue = first.get_by_role('list', name='queue').get_by_role('listitem')
    assert queue.all_inner_texts() == [str(seq) for seq in range(5, 15)]
    assert first.get_by_role('list', name='lost').get_by_role('listitem').count() == 1
    assert first.get_by_role('list', name='threads').inner_text() == 'thread 1: 3'
    assert second.get_by_role('list', name='lost').get_by_role('listitem').count() == 0
    page.screenshot(path=artefacts / 'replay_exported.png')
    page.keyboard.press('ArrowLeft')
    assert says.inner_text() != PUSHED_OUT
    page.keyboard.press('End')
    assert says.inner_text() == 'The callback of message 40 ends. Thread 1 is free.'
    page.keyboard.press('Home')
    assert says.inner_text().startswith('Nothing has happened yet.')
    page.keyboard.press('Space')
    page.wait_for_function("() => /arrives/.test(document.querySelector('.replay-says').innerText)")
    page.keyboard.press('Space')
    assert first.get_by_role('button', name='Play').is_visible()


def test_buttons_slider_and_numbers(exported, prediction):
    page = exported(prediction)
    shown = page.locator('.replay')
    says = shown.locator('[aria-live=polite]')
    shown.get_by_role('button', name='Next loss').click()
    assert says.inner_text() == PUSHED_OUT
    shown.get_by_role('button', name='back').click()
    assert says.inner_text() != PUSHED_OUT
    shown.get_by_role('button', name='forward').click()
    assert says.inner_text() == PUSHED_OUT
    # The line of time stays in the plot: below the legend, above the numbers of the axis.
    picture, line = (shown.locator(part).bounding_box() for part in ('img', '.replay-cursor'))
    assert picture['y'] + 20 < line['y']
    assert line['y'] + line['height'] < picture['y'] + picture['height'] - 30
    number = shown.get_by_role('spinbutton', name='message')
    number.fill('30')
    number.press('Enter')
    assert says.inner_text().startswith('Message 30 arrives.')
    number.fill('99')
    number.press('Enter')
    assert says.inner_text() == 'There is no message 99.'
    slider = shown.get_by_role('slider', name='step')
    slider.fill(slider.get_attribute('max'))
    assert says.inner_text().startswith('The callback of message 40 ends.')
    shown.get_by_role('button', name='Next loss').click()
    assert says.inner_text() == 'No message is lost after this.'
    shown.get_by_role('button', name='Speed').click()
    shown.get_by_role('button', name='Play').click()
    page.wait_for_function("() => /arrives/.test(document.querySelector('.replay-says').innerText)")
    shown.get_by_role('button', name='Pause').click()


@pytest.mark.parametrize('width', [360, 640])  # 640: as 1280 at 200 %
def test_a_small_page_is_not_wider_than_it_is(exported, artefacts, prediction, width):
    page = exported(prediction)
    page.evaluate("() => document.body.replaceChildren(document.querySelector('.replay'))")
    page.set_viewport_size({'width': width, 'height': 720})
    page.locator('.replay').focus()
    for _ in range(30):
        page.keyboard.press('ArrowRight')
    page.screenshot(path=artefacts / f'replay_{width}.png')
    assert not page.evaluate(WIDER)


def test_ten_thousand_messages(exported):
    """The cheapest of many batches: what it costs on a busy machine, too."""
    page = exported(replay(predict(0.001, 0.004, 100, 1, 10_000), 100))
    step_ms = page.evaluate("""() => {
        const replay = document.querySelector('.replay');
        const batch = () => {
            const start = performance.now();
            for (const key of ['Right', 'Right', 'Left', 'Right', 'Right']) {
                replay.dispatchEvent(new KeyboardEvent('keydown', { key: `Arrow${key}` }));
                replay.getBoundingClientRect();
            }
            return (performance.now() - start) / 5;
        };
        return Math.min(...Array.from({ length: 100 }, batch));
    }""")
    opening_ms = page.evaluate("""() => {
        const open = () => {
            const old = document.querySelector('.replay');
            const fresh = document.createElement('div');
            fresh.className = 'replay';
            fresh.dataset.record = old.dataset.record;
            fresh.innerHTML = '<p></p><figure><img alt=""></figure>';
            const script = document.createElement('script');
            script.textContent = old.querySelector('script').textContent;
            old.replaceWith(fresh);
            const start = performance.now();
            fresh.append(script);
            fresh.getBoundingClientRect();
            return performance.now() - start;
        };
        return Math.min(...Array.from({ length: 10 }, open));
    }""")
    print(f'a step {step_ms:.1f} ms, opening {opening_ms:.0f} ms')
    assert step_ms <= 16
    assert opening_ms <= 200


def test_in_jupyterlab(lab, prediction):
    path = lab.server.folder / 'notebooks' / '98_step.ipynb'
    nbformat.write(notebook(prediction), path)
    lab.open(path.name)
    saved, run = 2, 1
    # Not trusted: no script, and the picture with its text.
    cell = lab.show(saved)
    assert cell.query_selector('.replay-on') is None
    assert 'One row for each message' in cell.query_selector('img').get_attribute('alt')
    assert '41 messages, depth 10' in cell.inner_text()
    lab.screenshot('replay_not_trusted')
    for _ in range(2):  # again: nothing of the first output is left
        lab.run(run)
        cell = lab.show(run)
        assert len(cell.query_selector_all('.replay-on')) == 1
    shown = lab.page.locator('.replay-on')
    shown.focus()
    for key in ['ArrowRight'] * 22:
        lab.page.keyboard.press(key)
    says = shown.locator('[aria-live=polite]')
    assert says.inner_text() == PUSHED_OUT
    # No key reaches the commands of the notebook.
    before = [(c['cell_type'], c['source']) for c in lab.cells()]
    for key in ['d', 'd', 'b', 'a', 'x', 'm', 'Enter', 'ArrowDown']:
        lab.page.keyboard.press(key)
    assert [(c['cell_type'], c['source']) for c in lab.cells()] == before
    assert says.inner_text() == PUSHED_OUT
    lab.page.add_script_tag(path=AXE)
    # JupyterLab's body has no height: for axe, nothing in it can be seen.
    lab.page.add_style_tag(content='body { height: 100vh }')
    for theme, is_light in (('Dark', 'false'), ('Light', 'true')):
        lab.page.evaluate(
            "theme => window.jupyterapp.commands.execute('apputils:change-theme', { theme })",
            f'JupyterLab {theme}',
        )
        lab.page.wait_for_function(
            'is_light => document.body.dataset.jpThemeLight === is_light', arg=is_light
        )
        lab.page.wait_for_selector('#jupyterlab-splash', state='detached')
        pale, clear = lab.page.evaluate(CONTRAST)
        assert pale == []
        assert any(PUSHED_OUT in text for text in clear)
        lab.screenshot(f'replay_{theme.lower()}')
    # A notebook that this server has saved is trusted when it is opened again, if all was run here.
    lab.page.evaluate(f'() => {PANEL}.content.model.sharedModel.deleteCell({saved})')
    lab.page.evaluate(f'() => {PANEL}.context.save()')
    lab.page.reload()
    lab.wait_for_notebook(f'notebooks/{path.name}')
    lab.show(run)
    lab.page.wait_for_selector('.replay-on')
