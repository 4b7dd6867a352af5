"""Replays as they are used: in JupyterLab, on a phone, by keys alone."""

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, output_from_msg
from support.lab_page import PANEL, WIDER
from support.runs import assert_is_the_run

from helpers.notebook.fresh import MARK
from helpers.recording import predict
from helpers.replay import replay
from tools.lessons.clean import NOTEBOOK_METADATA

SOURCE = """from helpers.recording import predict
from helpers.replay import replay
replay(predict(0.05, 0.2, 10, 1, 41), 10)"""
PUSHED_OUT = 'Message 14 arrives. Ten wait, so the oldest, 4, is pushed out.'
# What a screen reader is told at each step, from the first to the last.
READ = """() => {
    const replay = document.querySelector('.replay');
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
# The deck asks for the next stop of a replay. False: there was none.
NEXT_STOP = """() => !document.querySelector('.replay').dispatchEvent(
    new CustomEvent('next-stop', { cancelable: true }))"""
# The texts with too little contrast (WCAG 2.2, 1.4.3) or one that axe cannot tell; and the others.
# In an SVG it cannot tell any; there they have the colour of the other texts.
CONTRAST = """async () => {
    const shown = { include: '.replay-on', exclude: '.replay-on svg' };
    const found = await axe.run(shown, { runOnly: 'color-contrast' });
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
    saved_by_a_student = {k: v for k, v in NOTEBOOK_METADATA.items() if k != MARK}
    return new_notebook(cells=cells, metadata=saved_by_a_student)


@pytest.fixture
def prediction():
    return replay(predict(0.05, 0.2, 10, 1, 41), 10)


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


def test_a_run_is_read_back_step_by_step(phone, prediction):
    read = states(phone(prediction).evaluate(READ))
    assert_is_the_run(read, predict(0.05, 0.2, 10, 1, 41), 10, accuracy_s=1e-3)


def test_keys_alone_on_a_phone(phone, artefacts, prediction):
    page = phone(prediction, prediction)
    for _ in range(40):
        page.keyboard.press('Tab')
        if page.evaluate("() => document.activeElement.matches('.replay')"):
            break
    replays = page.locator('.replay')
    first, second = replays.nth(0), replays.nth(1)
    outline = '() => getComputedStyle(document.activeElement).outlineStyle'
    assert page.evaluate(outline) == 'solid'
    says = first.locator('.replay-says')
    # It opens at the last loss, and plays from the start.
    assert says.inner_text() == 'Message 40 arrives. Ten wait, so the oldest, 30, is pushed out.'
    page.keyboard.press('Home')
    for _ in range(21):
        page.keyboard.press('ArrowRight')
    while says.inner_text() != PUSHED_OUT:
        page.keyboard.press('ArrowRight')
    queue = first.get_by_role('list', name='queue').get_by_role('listitem')
    assert queue.all_inner_texts() == [str(seq) for seq in range(5, 15)]
    assert first.get_by_role('list', name='lost').get_by_role('listitem').count() == 1
    assert first.get_by_role('list', name='threads').inner_text() == 'thread 1: 3'
    assert second.get_by_role('list', name='lost').get_by_role('listitem').count() == 21
    # At rest: a message that is on its way flies over the edge for a moment.
    moves = "one => one.playState === 'running'"
    page.wait_for_function(f'() => !document.getAnimations().some({moves})')
    page.screenshot(path=artefacts / 'replay_phone.png')
    assert not page.evaluate(WIDER)
    page.keyboard.press('ArrowLeft')
    assert says.inner_text() != PUSHED_OUT
    page.keyboard.press('End')
    assert says.inner_text() == 'The callback of message 40 ends. Thread 1 is free.'
    page.keyboard.press('Home')
    assert says.inner_text().startswith('Nothing has happened yet.')
    page.keyboard.press('End')
    page.keyboard.press('Space')
    page.wait_for_function("() => /arrives/.test(document.querySelector('.replay-says').innerText)")
    # While it plays, it says losses only, and a screen reader is silent.
    assert says.inner_text() == PUSHED_OUT
    assert says.get_attribute('aria-live') == 'off'
    page.keyboard.press('Space')
    assert first.get_by_role('button', name='Play').is_visible()
    assert says.get_attribute('aria-live') == 'polite'


PLAY = """() => new Promise(resolve => {
    const replay = document.querySelector('.replay');
    const [says, play] = ['.replay-says', '.replay-play'].map(name => replay.querySelector(name));
    const [found, heights, start] = [[], new Set(), performance.now()];
    play.click();
    const look = () => {
        heights.add(replay.offsetHeight);
        if (found.at(-1)?.[1] !== says.innerText) found.push([performance.now(), says.innerText]);
        if (/again/.test(play.innerText)) {
            resolve({ found, heights: [...heights], seconds: (performance.now() - start) / 1000 });
        } else requestAnimationFrame(look);
    };
    look();
})"""


def test_a_run_plays_steadily(phone, prediction):
    played = phone(prediction).evaluate(PLAY)
    assert len(played['heights']) == 1
    assert played['seconds'] > 8  # a slow machine draws fewer pictures, and takes longer
    times, texts = zip(*played['found'], strict=True)
    assert all('is pushed out' in text for text in texts[1:-1])
    shown_ms = [after - before for before, after in zip(times[1:-2], times[2:-1], strict=True)]
    assert all(ms > 1100 for ms in shown_ms)
    assert texts[-1] == 'The callback of message 40 ends. Thread 1 is free.'


def test_a_deck_walks_by_its_stops(phone, prediction):
    page = phone(prediction)
    says = page.locator('.replay [aria-live]')
    seen = []
    while page.evaluate(NEXT_STOP):
        seen.append(says.inner_text())
    assert seen == [PUSHED_OUT, 'The callback of message 40 ends. Thread 1 is free.']


def test_in_jupyterlab(lab, axe, prediction):
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
    lab.page.keyboard.press('Home')
    for key in ['ArrowRight'] * 22:
        lab.page.keyboard.press(key)
    says = shown.locator('.replay-says')
    assert says.inner_text() == PUSHED_OUT
    # No key reaches the commands of the notebook.
    before = [(c['cell_type'], c['source']) for c in lab.cells()]
    for key in ['d', 'd', 'b', 'a', 'x', 'm', 'Shift+M', 'Enter', 'ArrowDown']:
        lab.page.keyboard.press(key)
    assert [(c['cell_type'], c['source']) for c in lab.cells()] == before
    assert says.inner_text() == PUSHED_OUT
    lab.page.add_script_tag(path=axe)
    # JupyterLab's body has no height: for axe, nothing in it can be seen.
    lab.page.add_style_tag(content='body { height: 100vh }')
    for theme in lab.themes():
        shown.evaluate('shown => shown.scrollIntoView()')  # what is covered has no contrast
        pale, clear = lab.page.evaluate(CONTRAST)
        assert pale == []
        assert any(PUSHED_OUT in text for text in clear)
        lab.screenshot(f'replay_{theme}')
    # A notebook that this server has saved is trusted when it is opened again, if all was run here.
    lab.page.evaluate(f'() => {PANEL}.content.model.sharedModel.deleteCell({saved})')
    lab.page.evaluate(f'() => {PANEL}.context.save()')
    lab.page.reload()
    lab.wait_for_notebook(f'notebooks/{path.name}')
    lab.show(run)
    lab.page.wait_for_selector('.replay-on')
