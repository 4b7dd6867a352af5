"""`make notebooks` loses nothing of an author, and saves no lesson that fails."""

import base64
import io
import os
import shutil
from uuid import uuid4

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from PIL import Image
from support.checkouts import git

from helpers.lesson import called
from tools.lessons import outputs, run, tables
from tools.lessons.clean import MADE_FROM, WIDGET, clean, text_of
from tools.lessons.comparison import masked
from tools.lessons.first_pictures.__main__ import is_same
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


def test_a_lesson_is_made_from_its_own_judges(tmp_path):
    judges = tmp_path / 'helpers/checks/lessons'
    files = [judges / 'build_it/parts.py', judges / 'build_it/whole.py', judges / 'try_it.py']
    for file in [*files, tmp_path / 'helpers/checks/tasks.py', tmp_path / 'helpers/robot/body.py']:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text('')
    files[1].write_text('import helpers.robot\n')
    code = 'from helpers.checks.lessons.{} import check'
    lessons = [
        new_notebook(cells=[new_code_cell(code.format(name))]) for name in ('build_it', 'try_it')
    ]

    def digests():
        return [outputs.made_from(lesson, tmp_path) for lesson in lessons]

    before = digests()
    assert ['helpers/robot' in made for made in before] == [True, False]
    for file, changed in ((files[0], [True, False]), (files[2], [False, True])):
        file.write_text('NEW = 1\n')
        after = digests()
        assert [one != two for one, two in zip(before, after, strict=True)] == changed
        before = after


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


# What stays, and what is new

# A replay whose record is another one in each run, as real times are.
REPLAY = """
from uuid import uuid4
from IPython.display import HTML

def replay(words):
    \"\"\"Show a run.\"\"\"
    return HTML(f"<p data-record='{uuid4()}'>{words}</p>")
"""
SOURCES = [
    'from helpers.replay import replay',
    "print('two')",
    "replay('a run')",
    'print(3)',
    "replay('a second run')",
]


@pytest.fixture(scope='module')
def run_once(tmp_path_factory):
    """Return a folder with a lesson that has been run: text, a replay, text, a replay."""
    root = tmp_path_factory.mktemp('run')
    (root / 'helpers' / 'replay').mkdir(parents=True)
    # A kernel of this environment loads helpers.notebook when it starts.
    (root / 'helpers' / '__init__.py').write_text(
        'from pkgutil import extend_path\n__path__ = extend_path(__path__, __name__)\n'
    )
    (root / 'helpers' / 'replay' / '__init__.py').write_text(REPLAY)
    path = saved(root, *SOURCES)
    notebook = nbformat.read(path, as_version=4)
    notebook.cells.insert(0, new_markdown_cell('# 00 Try it\n\nTwo sentences. Here is one.'))
    path.write_text(text_of(notebook), encoding='utf-8')
    assert run.main([], root) == 0
    return root


@pytest.fixture
def lesson(run_once, tmp_path):
    shutil.copytree(run_once, tmp_path, dirs_exist_ok=True)
    return next(tmp_path.glob('notebooks/*.ipynb'))


@pytest.fixture
def no_kernel(lesson, monkeypatch):
    def execute(*_):
        pytest.fail('a kernel was started')

    monkeypatch.setattr(run, 'execute', execute)


def edit(path, change):
    """Let `change` change the code cells of a notebook's file, as JupyterLab would save it."""
    notebook = nbformat.read(path, as_version=4)
    change(outputs.code_cells(notebook))
    path.write_text(text_of(notebook), encoding='utf-8')


def again(path, capsys, *arguments):
    """Run the lesson; return what was printed, and the outputs of its cells before and after."""
    before = shown(path)
    capsys.readouterr()
    assert run.main([*arguments], path.parent.parent) == 0
    return capsys.readouterr().out, before, shown(path)


def shown(path):
    cells = outputs.code_cells(nbformat.read(path, as_version=4))
    return [[*map(dict, cell.outputs)] for cell in cells]


def differing(before, after):
    return [place for place, (old, new) in enumerate(zip(before, after, strict=True)) if old != new]


@pytest.mark.usefixtures('no_kernel')
def test_a_changed_sentence_is_one_line_and_runs_nothing(lesson, capsys):
    before = lesson.read_text(encoding='utf-8')
    lesson.write_text(before.replace('Here is one.', 'Here is another.'), encoding='utf-8')
    printed, _, _ = again(lesson, capsys)
    assert 'only its text may have changed, so its outputs stay (RUN=yes runs it)' in printed
    lines = zip(before.splitlines(), lesson.read_text(encoding='utf-8').splitlines(), strict=True)
    ((old, new),) = [(old, new) for old, new in lines if old != new]
    assert (old.strip(), new.strip()) == (
        '"Two sentences. Here is one."',
        '"Two sentences. Here is another."',
    )


@pytest.mark.usefixtures('no_kernel')
def test_what_jupyterlab_has_saved_is_replaced_by_what_was_committed(lesson, capsys):
    committed = lesson.read_text(encoding='utf-8')
    folder = lesson.parent
    git(folder, 'init', '-q')
    git(folder, 'add', lesson.name)
    git(folder, 'commit', '-qm', 'All')

    def run_it_by_hand(cells):
        cells[1].outputs, cells[1].execution_count = [stream('not two')], 17
        cells[2].outputs = []

    edit(lesson, run_it_by_hand)
    again(lesson, capsys)
    assert lesson.read_text(encoding='utf-8') == committed


def test_outputs_that_this_tool_has_not_saved_are_new(lesson, capsys):
    def clear(cells):
        cells[2].outputs, cells[2].execution_count = [], None

    edit(lesson, clear)
    printed, before, after = again(lesson, capsys)
    assert differing(before, after) == [2, 4]
    assert 'picture: the outputs that were saved from "replay(\'a run\')" (' in printed
    assert ') on are of another run' in printed


def test_of_a_lesson_that_was_never_saved_all_is_new(lesson, capsys):
    notebook = nbformat.read(lesson, as_version=4)
    del notebook.metadata[MADE_FROM]
    lesson.write_text(text_of(notebook), encoding='utf-8')
    printed, before, after = again(lesson, capsys)
    assert differing(before, after) == [2, 4]
    assert 'all outputs are new: no earlier ones were saved by this tool' in printed


def test_a_run_keeps_what_is_equal(lesson, capsys):
    before = lesson.read_text(encoding='utf-8')
    printed, _, _ = again(lesson, capsys, '--run', 'yes')
    assert lesson.read_text(encoding='utf-8') == before
    assert 'unchanged' in printed
    assert 'new' not in printed
    printed, old, new = again(lesson, capsys, '--run', 'new')
    assert differing(old, new) == [2, 4]
    assert 'all outputs are new, as you asked' in printed


def test_below_changed_code_outputs_are_new(lesson, capsys):
    def print_four(cells):
        cells[3].source = 'print(4)'

    edit(lesson, print_four)
    printed, before, after = again(lesson, capsys)
    assert differing(before, after) == [3, 4]
    third, fourth = printed.splitlines()[1:]
    assert third.startswith('  new outputs of "print(4)" (')
    assert third.endswith('): text')
    assert fourth.startswith('  new outputs of "replay(\'a second run\')" (')
    assert '): picture: the code has changed at "print(4)" (' in fourth


def test_a_new_cell_is_said_and_only_below_it_outputs_are_new(lesson, capsys):
    notebook = nbformat.read(lesson, as_version=4)
    notebook.cells.insert(4, new_code_cell('print(2.5)'))
    lesson.write_text(text_of(notebook), encoding='utf-8')
    printed, before, after = again(lesson, capsys)
    assert differing(before, after) == [3, 5]
    assert len(printed.splitlines()) == 3
    assert 'new outputs of "print(2.5)"' in printed
    assert 'new outputs of "replay(\'a second run\')"' in printed


@pytest.mark.parametrize(
    ('file', 'text', 'where'),
    [
        ('helpers/replay/__init__.py', REPLAY.replace('<p ', "<p class='new' "), [2, 4]),
        ('helpers/replay/__init__.py', REPLAY + 'NOT_SEEN = 1\n', [2, 4]),
        ('helpers/replay/look.css', 'p { color: red }', [2, 4]),
    ],
)
def test_a_changed_helper_makes_new_pictures(lesson, capsys, file, text, where):
    (lesson.parents[1] / file).write_text(text)
    printed, before, after = again(lesson, capsys)
    assert differing(before, after) == where
    is_text = 'class' in text
    assert printed.count('): text') == (2 if is_text else 0)
    assert printed.count('): picture: helpers/replay has changed') == (0 if is_text else 2)
    assert 'only its text' in again(lesson, capsys)[0]


@pytest.mark.usefixtures('no_kernel')
def test_words_about_a_helper_change_nothing(lesson, capsys):
    file = lesson.parents[1] / 'helpers' / 'replay' / '__init__.py'
    file.write_text(f'# Why\n{REPLAY.replace("Show a run.", "Show the run of a robot.")}')
    _, before, after = again(lesson, capsys)
    assert before == after


def test_a_helper_of_a_helper_counts(lesson, capsys):
    helpers = lesson.parents[1] / 'helpers'
    (helpers / 'recording').mkdir()
    (helpers / 'recording' / '__init__.py').write_text('DEPTH = 1\n')
    (helpers / 'replay' / '__init__.py').write_text(f'import helpers.recording\n{REPLAY}')
    assert 'helpers/recording and helpers/replay have changed' in again(lesson, capsys)[0]
    (helpers / 'recording' / '__init__.py').write_text('DEPTH = 2\n')
    assert 'picture: helpers/recording has changed' in again(lesson, capsys)[0]


@pytest.mark.parametrize(
    'line',
    [
        'import helpers.plots',
        'from helpers.plots.runs import latency',
        'from helpers import plots  # a picture',
        'from helpers import (\n    replay,\n    plots as drawn,\n)',
        '%%solution 1\nfrom helpers import plots',
    ],
)
def test_each_form_of_an_import_counts(line, tmp_path):
    (tmp_path / 'helpers' / 'plots').mkdir(parents=True)
    notebook = new_notebook(cells=[new_code_cell(line)])
    assert 'helpers/plots' in outputs.made_from(notebook, tmp_path)


def test_what_gives_texts_only_changes_no_picture(lesson, capsys):
    command = lesson.parents[1] / 'ros2' / 'ros2_command'
    command.mkdir(parents=True)
    (command / 'names.py').write_text('WORD = 1\n')
    printed, before, after = again(lesson, capsys)
    assert before == after
    assert 'only its text' not in printed  # it was run
    assert 'only its text' in again(lesson, capsys)[0]


@pytest.mark.usefixtures('no_kernel')
def test_a_person_vouches_for_outputs(lesson, capsys):
    def rename(cells):
        cells[1].source = "print('t' + 'wo')"

    edit(lesson, rename)
    _, before, after = again(lesson, capsys, '--keep-outputs')
    assert before == after
    printed, _, after = again(lesson, capsys)
    assert before == after
    assert 'only its text may have changed' in printed


def test_the_versions_of_what_draws_count(tmp_path):
    lock = tmp_path / 'tools' / 'locks' / 'requirements.lock'
    lock.parent.mkdir(parents=True)
    notebook = new_notebook(cells=[new_code_cell('1')])
    made = []
    for pins in ('numpy==1 ; x\nargon==1', 'numpy==2\nargon==1', 'numpy==1\nargon==2'):
        lock.write_text(f'{pins} \\\n    --hash=sha256:{uuid4().hex}\n')
        made.append(outputs.made_from(notebook, tmp_path))
    first, numpy, argon = made
    assert {name for name in first if first[name] != numpy[name]} == {'versions'}
    assert {name for name in first if first[name] != argon[name]} == {'other versions'}


@pytest.mark.usefixtures('no_kernel')
def test_tables_and_links_change_nothing_else(lesson):
    """What another notebook says of a lesson changes a line of text there, and no output."""
    head = '| lesson | you can then | minutes |\n|---|---|---|'
    gone = '| 02 It is gone | lose it | 40 |'
    block = f'<!-- made by `make notebooks`: map of nodes -->\n\n{head}\n{gone}\n\n<!-- end -->'
    notebook = nbformat.read(lesson, as_version=4)
    notebook.cells[0].source += f'\n\n{block}'
    texts = {'notebooks/00_try_it.ipynb': text_of(clean(notebook))}
    (after,) = tables.updated(texts).values()
    lines = set(texts['notebooks/00_try_it.ipynb'].splitlines()) ^ set(after.splitlines())
    assert [line.strip() for line in lines] == [rf'"{gone}\n",']
    notebook = nbformat.reads(after, as_version=4)
    now = outputs.made_from(notebook, lesson.parents[1])
    assert outputs.is_made_from(notebook, now)


def test_a_first_picture_stays_where_only_its_compression_differs():
    def picture(colour, **how):
        png = io.BytesIO()
        Image.new('RGB', (40, 40), colour).save(png, 'PNG', **how)
        return f'<image href="data:image/png;base64,{base64.b64encode(png.getvalue()).decode()}"/>'

    assert picture('red', compress_level=0) != picture('red', compress_level=9)
    assert is_same(picture('red', compress_level=0), picture('red', compress_level=9))
    assert not is_same(picture('red'), picture('blue'))
    assert not is_same(picture('red'), picture('red') + '<text/>')
    assert not is_same(picture('red'), picture('red') * 2)
