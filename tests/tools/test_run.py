"""What `make notebooks` saves, and that nbval compares it."""

import os
import subprocess
import sys
from html import unescape

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

from tools.lessons import rules, run
from tools.lessons.clean import WIDGET, clean, text_of
from tools.lessons.comparison import MASKS, masked

RANDOM_LOG = """\
import random
for number in random.sample(range(1000), k=random.randint(5, 15)):
    print(f'[INFO] [slow_subscriber]: I heard: "Hello World: {number}"')"""
RANDOM_FIGURE = """\
import random
import matplotlib.pyplot as plt
from helpers.plots.alt_text import describe
_, axes = plt.subplots()
line = axes.plot([random.random() for _ in range(9)])
describe(axes, 'A line through <nine> "points".')"""


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
        (['print("new")', '1 / 0', '2'], 100, '2 failed: ZeroDivisionError: division by zero'),
        (['import os', 'os._exit(1)'], 100, '2 failed: the kernel ended'),
        (['import time\ntime.sleep(30)'], 1, '1 failed: it took longer than 1 s'),
    ],
)
def test_a_failing_cell_leaves_the_file_as_it_was(
    tmp_path, monkeypatch, capsys, sources, limit, why
):
    monkeypatch.setattr(run, 'CELL_TIMEOUT_S', limit)
    path = saved(tmp_path, *sources)
    assert run.main([], tmp_path) == 1
    assert capsys.readouterr().err == f'00_try_it.ipynb: code cell {why} (the file is as it was)\n'
    after = nbformat.read(path, as_version=4)
    assert [cell.source for cell in after.cells] == sources
    assert not any(cell.outputs for cell in after.cells)
    assert os.listdir(path.parent) == [path.name]


def test_what_only_jupyterlab_would_show_is_reported(tmp_path, capsys):
    saved(tmp_path, 'import os\n_ = os.write(2, b"[WARN] of rcl")')
    assert run.main([], tmp_path) == 1
    said = "JupyterLab would show on red what C wrote: '[WARN] of rcl'"
    assert capsys.readouterr().err == f'00_try_it.ipynb: {said} (the file is as it was)\n'


def test_an_unknown_lesson_or_no_notebook_is_reported(tmp_path, capsys):
    saved(tmp_path, '1').with_name('01_try_it.ipynb').write_text('<<<<<<< HEAD\n')
    assert run.main(['07'], tmp_path) == 1
    assert capsys.readouterr().err == "There is no single lesson '07'. Give one of 00, 01.\n"
    assert run.main([], tmp_path) == 1
    assert capsys.readouterr().err.startswith('01_try_it.ipynb is no notebook: ')


def test_nbval_agrees_with_what_the_tool_saves(tmp_path, monkeypatch):
    path = saved(
        tmp_path,
        'import sys\nfrom pathlib import Path\nPath.cwd().name, sys.executable',
        'import atexit, os\nprint("seen")\n_ = os.write(1, b"at C level")\n'
        '_ = atexit.register(os.write, 2, b"at the end")',
        'import ipywidgets\nout = ipywidgets.Output()\nwith out:\n    print("in")\nout',
        RANDOM_FIGURE,
        RANDOM_LOG,
        'print("first")',
        f'%matplotlib inline\n{RANDOM_FIGURE}\nplt.show()',
    )
    ids = [cell.id for cell in nbformat.read(path, as_version=4).cells]
    spec = tmp_path / 'jupyter' / 'kernels' / 'python3' / 'kernel.json'
    spec.parent.mkdir(parents=True)
    spec.write_text('{"argv": ["false"], "display_name": "another Python", "language": "python"}')
    with monkeypatch.context() as environment:  # as the tool may find it on a user's machine
        environment.setenv('JUPYTER_PATH', str(tmp_path / 'jupyter'))
        environment.delenv('PYTEST_CURRENT_TEST')
        assert run.main(['00'], tmp_path) == 0
    notebook = nbformat.read(path, as_version=4)
    assert path.read_text(encoding='utf-8') == text_of(clean(notebook))
    assert [cell.execution_count for cell in notebook.cells] == list(range(1, 8))
    assert [cell.id for cell in notebook.cells] == ids
    assert notebook.cells[0].outputs[0].data['text/plain'] == f'{("notebooks", sys.executable)}'
    assert [output.text for output in notebook.cells[1].outputs] == ['seen\n']
    for figure in (notebook.cells[3], notebook.cells[6]):
        [alt] = rules.alternative_texts(figure)
        assert unescape(alt) == 'A line through <nine> "points".'
    notebook.cells[5].outputs[0].text = 'second\n'
    data = notebook.cells[6].outputs[0].data
    data['text/html'] = data['text/html'].replace('A line', 'A curve')
    nbformat.write(notebook, path)
    report = nbval(path)
    assert '2 failed, 5 passed' in report
    assert 'Cell 5 - ' in report
    assert 'Cell 6 - ' in report


def nbval(path):
    """Run nbval as `make test` does; return what it printed."""
    options = ['--nbval', '--nbval-current-env', f'--nbval-sanitize-with={MASKS}']
    command = [sys.executable, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', *options, str(path)]
    return subprocess.run(command, cwd=path.parent, capture_output=True, text=True).stdout


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
