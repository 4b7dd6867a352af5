"""`make notebooks` loses nothing of an author, and saves no lesson that fails."""

import os

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

from helpers.lesson import called
from tools.lessons import run
from tools.lessons.clean import WIDGET, clean, text_of
from tools.lessons.comparison import masked
from tools.lessons.new import template


def saved(root, *sources):
    path = root / 'notebooks' / '00_try_it.ipynb'
    path.parent.mkdir(exist_ok=True)
    cells = [new_code_cell(source) for source in sources]
    path.write_text(text_of(new_notebook(cells=cells)), encoding='utf-8')
    return path


def stream(text):
    return new_output('stream', name='stdout', text=text)


def test_what_is_saved_while_a_lesson_runs_stays(tmp_path, capsys):
    path = saved(tmp_path, "from pathlib import Path\nPath('00_try_it.ipynb').write_text('{}')")
    assert run.main(['00'], tmp_path) == 1
    assert 'was changed while it ran: save it, then run it again.' in capsys.readouterr().err
    assert path.read_text() == '{}'


def test_what_is_cleaned():
    view = new_output('display_data', data={WIDGET: {'model_id': '1'}, 'text/plain': 'Slider()'})
    dirty = new_notebook(
        cells=[
            new_code_cell('1', id='same', outputs=[stream('1\n'), stream('2\n')]),
            new_code_cell('2', id='same', outputs=[view]),
            new_markdown_cell('<details>Why</details>', id='why'),
        ]
    )
    dirty.cells[0].metadata = nbformat.from_dict(
        {'tags': ['solution'], 'jupyter': {'source_hidden': True, 'outputs_hidden': True}}
    )
    dirty.cells[1].metadata = nbformat.from_dict({'collapsed': True, 'tags': [], 'editable': False})
    before = nbformat.writes(dirty)
    once = clean(dirty)
    assert nbformat.writes(dirty) == before
    assert clean(once) == once
    first, second, why = once.cells
    assert [output.text for output in first.outputs] == ['1\n2\n']
    assert second.outputs[0].data == {'text/plain': 'Slider()'}
    assert first.id == 'same' != second.id
    assert first.metadata == {
        'tags': ['solution'],
        'jupyter': {'source_hidden': True},
    }
    assert second.metadata == {}
    assert why.metadata.editable is False


@pytest.mark.parametrize(
    ('sources', 'limit', 'why'),
    [
        (['print("new")', '1 / 0'], 100, 'ZeroDivisionError: division by zero'),
        (['import os', 'os._exit(1)'], 100, 'the kernel ended'),
        (['import time\ntime.sleep(30)'], 1, 'it took longer than 1 s'),
    ],
)
def test_a_failing_cell_leaves_the_file_as_it_was(
    tmp_path, monkeypatch, capsys, sources, limit, why
):
    monkeypatch.setattr(run, 'CELL_TIMEOUT_S', limit)
    path = saved(tmp_path, *sources)
    assert run.main([], tmp_path) == 1
    after = nbformat.read(path, as_version=4)
    cell = called(after.cells[-1])
    assert capsys.readouterr().err == (
        f'00_try_it.ipynb: the cell {cell} failed: {why} (the file is as it was)\n'
    )
    assert [cell.source for cell in after.cells] == sources
    assert not any(cell.outputs for cell in after.cells)
    assert os.listdir(path.parent) == [path.name]


def test_a_solution_that_fails_is_not_saved(tmp_path, capsys):
    path = saved(tmp_path)
    notebook = template('00_try_it')
    for cell in notebook.cells:  # its module would be made by `make lesson`
        cell.source = cell.source.replace('helpers.checks.lessons.try_it', 'tools.lessons.template')
    solution = next(cell for cell in notebook.cells if cell.source.startswith('%%solution'))
    solution.source = solution.source.replace('append(message.data)', 'append(0)')
    path.write_text(before := text_of(notebook), encoding='utf-8')
    assert run.main([], tmp_path) == 1
    assert 'its solution does not pass' in capsys.readouterr().err
    assert path.read_text(encoding='utf-8') == before


def test_what_only_jupyterlab_would_show_is_reported(tmp_path, capsys):
    saved(tmp_path, 'import os\n_ = os.write(2, b"[WARN] of rcl")')
    assert run.main([], tmp_path) == 1
    sentence = "JupyterLab would show on red what C wrote: '[WARN] of rcl'"
    assert capsys.readouterr().err == f'00_try_it.ipynb: {sentence} (the file is as it was)\n'


def test_only_the_log_of_the_slow_subscriber_is_replaced():
    line = '[INFO] [slow_subscriber]: I heard: "Hello World: {}"\n'
    log = ''.join(line.format(count) for count in range(5))
    assert masked(f'before\n{log}after\n') == 'before\n<what slow_subscriber heard>\nafter\n'
    assert masked(log + line.format(17)) == masked(log)
    for compared in (
        log.replace('slow_subscriber', 'minimal_subscriber'),
        log.replace('INFO', 'WARN'),
        log.replace('I heard', 'I lost'),
    ):
        assert masked(compared) == compared
