"""`make update`: what a student wrote for a task goes with the task to another lesson."""

import json
import shutil
import tempfile
from pathlib import Path

import nbformat
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from classroom import update
from classroom.tests.support.editions import archive_of
from helpers.checks import progress

BUILD, PUT = 'build_a_robot_program', 'put_a_program_on_a_robot'
OLD_PATH, BUILD_PATH, PUT_PATH = (
    f'notebooks/{name}.ipynb' for name in (f'20_{BUILD}', f'21_{BUILD}', f'22_{PUT}')
)


def task(number, name, check):
    """Return the cells of a task; `check` is how its check calls it."""
    return [
        new_markdown_cell(f'### ✎ Task {number}: {name}\n\nDo it.', id=f'{name}-text'),
        new_code_cell('answer = 0', id=name, metadata={'tags': ['exercise']}),
        new_code_cell(f'check({check}, answer)', id=f'{name}-check', metadata={'tags': ['check']}),
    ]


ENDS = [
    new_code_cell(
        "my_ends = guess('Which ends?', ..., on=range(5))",
        id='ends',
        metadata={'tags': ['predict']},
    )
]


def memory():
    return [new_markdown_cell('## From memory', id='from-memory')]


def lesson(title, *cells):
    return new_notebook(cells=[new_markdown_cell(title, id='title'), *cells])


def old():
    """Version 0.3: one lesson has all tasks, which are called by their numbers."""
    tasks = task(1, 'the_job', 9), task(2, 'install_it', 14), ENDS, task(3, 'the_guard', 18)
    return {OLD_PATH: lesson('# 20 Build', *memory(), *sum(tasks, []))}


def newer():
    of_build = memory() + task(1, 'the_job', "'the_job'")
    install, guard = task(1, 'install_it', "'install_it'"), task(2, 'the_guard', "'the_guard'")
    return {
        'notebooks/00_start_here.ipynb': new_notebook(),
        BUILD_PATH: lesson('# 21 Build', *of_build),
        PUT_PATH: lesson('# 22 Put', *memory(), *install, *ENDS, *guard),
    }


def fill(folder, notebooks):
    for name, notebook in notebooks.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        nbformat.write(notebook, path)
    return folder


def sources(file):
    return [cell.source for cell in nbformat.read(file, as_version=4).cells]


def answers(file):
    """Return what stands in the cells in which a student writes."""
    cells = nbformat.read(file, as_version=4).cells
    tags = [{*cell.metadata.get('tags', ())} for cell in cells]
    return [
        cell.source
        for cell, tags in zip(cells, tags, strict=True)
        if tags & {'exercise', 'predict'} or cell.source.startswith('own')
    ]


@pytest.fixture
def mine(tmp_path):
    """Return a student's edition of version 0.3, with answers in three tasks and a guess."""
    folder = fill(tmp_path / 'mine', old())
    shutil.copytree(folder, tmp_path / 'base')
    (tmp_path / 'base').rename(folder / update.BASE)
    notebook = nbformat.read(folder / OLD_PATH, as_version=4)
    written = {'the_job': 'answer = 9', 'install_it': 'answer = 14', 'the_guard': 'answer = 18'}
    written['ends'] = "my_ends = guess('Which ends?', 4, on=range(5))"
    cells = []
    for cell in notebook.cells:
        cell.source = written.get(cell.id, cell.source)
        cells.append(cell)
        if cell.id == 'the_guard-check':
            cells.append(new_code_cell('own = 1', id='own'))
    notebook.cells = cells
    nbformat.write(notebook, folder / OLD_PATH)
    return folder


IN_PUT = ['answer = 14', "my_ends = guess('Which ends?', 4, on=range(5))", 'answer = 18', 'own = 1']


def test_what_was_written_is_in_the_lesson_of_its_task(tmp_path, mine, capsys):
    archive = archive_of(fill(tmp_path / 'newer', newer()))
    for said in (True, False):  # the second update changes nothing
        assert update.main([str(archive), '--to', str(mine)]) == 0
        printed = capsys.readouterr().out
        assert ('Some tasks of 21_build' in printed) == said
        assert answers(mine / BUILD_PATH) == ['answer = 9']
        assert answers(mine / PUT_PATH) == IN_PUT
        assert sources(mine / PUT_PATH)[:2] == ['# 22 Put', '## From memory']
        assert len(sources(mine / PUT_PATH)) == 2 + 3 + 1 + 3 + 1
        assert len(sources(mine / BUILD_PATH)) == 2 + 3
        assert not (mine / OLD_PATH).exists()
        base = mine / update.BASE
        assert (base / PUT_PATH).read_bytes() == (tmp_path / 'newer' / PUT_PATH).read_bytes()


def test_after_the_program_of_version_0_3(tmp_path, mine, monkeypatch):
    """It knows nothing of such tasks, and leaves what was written where it was."""
    newest = fill(tmp_path / 'newer', newer())
    nothing_moves = update.Moved(Path(), Path(), {})
    with monkeypatch.context() as of_0_3:
        of_0_3.setattr(update.Moved, 'between', lambda *folders: nothing_moves)
        update.merge_folders(mine / update.BASE, mine, newest)
        update.merge_folders(mine / update.BASE, mine / update.BASE, newest)
    assert answers(mine / PUT_PATH)[0] == 'answer = 0'
    assert 'answer = 14' in sources(mine / BUILD_PATH)
    # In the meantime one task was solved where it is now.
    put = mine / PUT_PATH
    text = put.read_text()
    assert text.count('answer = 0') == 2
    at = text.rindex('answer = 0')
    put.write_text(f'{text[:at]}answer = 180{text[at + len("answer = 0") :]}')
    for _ in range(2):
        assert update.main([str(archive_of(newest)), '--to', str(mine)]) == 0
        assert answers(mine / BUILD_PATH) == ['answer = 9']
        assert answers(mine / PUT_PATH) == [*IN_PUT[:2], 'answer = 180', IN_PUT[2], 'own = 1']


@pytest.mark.parametrize('number', range(6))
def test_an_interrupted_update_goes_on(tmp_path, mine, monkeypatch, number):
    archive = archive_of(fill(tmp_path / 'newer', newer()))
    count, replace = 0, Path.replace

    def interrupted(path, target):
        nonlocal count
        count += 1
        if count == number + 1:
            raise KeyboardInterrupt
        return replace(path, target)

    with monkeypatch.context() as once:
        once.setattr(Path, 'replace', interrupted)
        update.main([str(archive), '--to', str(mine)])
    assert update.main([str(archive), '--to', str(mine)]) == 0
    assert answers(mine / BUILD_PATH) == ['answer = 9']
    assert answers(mine / PUT_PATH) == IN_PUT


def test_a_lesson_that_cannot_be_read_is_set_aside(tmp_path, mine):
    (mine / OLD_PATH).write_text('{ broken')
    archive = archive_of(fill(tmp_path / 'newer', newer()))
    assert update.main([str(archive), '--to', str(mine)]) == 0
    assert (mine / f'{OLD_PATH}.yours').read_text() == '{ broken'
    assert answers(mine / PUT_PATH)[0] == 'answer = 0'


def test_a_cell_that_all_lessons_have_stays(tmp_path, mine):
    """Of two lessons each has a cell of this id: it has not moved."""
    notebook = nbformat.read(mine / OLD_PATH, as_version=4)
    notebook.cells[1].source = '## From memory: mine'
    nbformat.write(notebook, mine / OLD_PATH)
    archive = archive_of(fill(tmp_path / 'newer', newer()))
    assert update.main([str(archive), '--to', str(mine)]) == 0
    assert sources(mine / BUILD_PATH)[1] == '## From memory: mine'
    assert sources(mine / PUT_PATH)[1] == '## From memory'


def test_progress_and_guesses_are_those_of_the_lesson_of_today(tmp_path, monkeypatch, capsys):
    folder = fill(tmp_path / 'newer', newer())
    gap = {'asked': 'Which ends?', 'said': '4', 'was': '3', 'right': False, 'axis': None}
    lines = [f'{BUILD} 14', f'{BUILD} the_guard', f'{BUILD} the_job', f'{BUILD} no_such_task']
    lines += [
        f'{progress.BORROWED} {BUILD} install_it',
        f'{progress.GUESS} {BUILD} {json.dumps(["Which ends?", "options", 4])}',
        f'{progress.GAP} {BUILD} {json.dumps(gap)}',
    ]
    (tmp_path / 'progress.txt').write_text('\n'.join(lines) + '\n')
    monkeypatch.setenv(progress.FILE_VARIABLE, str(tmp_path / 'progress.txt'))
    monkeypatch.setenv('JPY_SESSION_NAME', BUILD_PATH)
    monkeypatch.chdir(folder / 'notebooks')
    progress.show()
    printed = capsys.readouterr().out
    assert '3 of 3 tasks are solved.' in printed
    assert progress.total() == '3 of 3 tasks'
    known = progress.with_tasks()
    found = progress.in_their_lessons(lines, known)
    assert found[-1].startswith(f'{progress.GAP} {PUT} ')
    assert found[-2].startswith(f'{progress.GUESS} {PUT} ')
    assert found[-3] == f'{progress.BORROWED} {PUT} install_it'
    assert found[3] == lines[3]
    assert progress.solved_of(known[0]) == {'the_job'}
    assert progress.solved_of(known[1]) == {'install_it', 'the_guard'}
    monkeypatch.setenv('JPY_SESSION_NAME', PUT_PATH)
    assert progress.kept_guess('Which ends?', 'options') == 4


CELLS = [f'cell{i}' for i in range(6)]


@st.composite
def histories(draw):
    """Return two lessons, what a student has made of them, and the cells that move."""
    split = draw(st.integers(0, len(CELLS)))
    here, there = CELLS[:split], CELLS[split:]
    moves = draw(st.sets(st.sampled_from(CELLS)))
    written = draw(st.dictionaries(st.sampled_from(CELLS), st.sampled_from(['x = 1', 'y = 2', ''])))
    own = draw(st.sets(st.sampled_from(CELLS)))
    removed = draw(st.sets(st.sampled_from(CELLS)))
    return here, there, moves, written, own, removed


def notebook(names, written, own=(), removed=()):
    cells = []
    for name in names:
        if name not in removed or name in written:
            cells.append(new_code_cell(written.get(name, f'# {name}'), id=name))
        if name in own:
            cells.append(new_code_cell(f'own of {name}', id=f'own-{name}'))
    return new_notebook(cells=cells)


@settings(max_examples=150, deadline=None)
@given(histories())
def test_no_word_is_lost_and_none_comes_twice(history):
    here, there, moves, written, own, removed = history
    new_here = [name for name in here if name not in moves] + [n for n in there if n in moves]
    new_there = [name for name in there if name not in moves] + [n for n in here if n in moves]
    with tempfile.TemporaryDirectory() as folder:
        base, mine, newest = (Path(folder, name) for name in ('base', 'mine', 'newer'))
        one, two = 'notebooks/05_one.ipynb', 'notebooks/06_two.ipynb'
        fill(base, {one: notebook(here, {}), two: notebook(there, {})})
        mine_of = [notebook(names, written, own, removed) for names in (here, there)]
        fill(mine, dict(zip((one, two), mine_of, strict=True)))
        fill(newest, {one: notebook(new_here, {}), two: notebook(new_there, {})})
        for _ in range(2):
            update.merge_folders(base, mine, newest)
            for file, names in ((one, new_here), (two, new_there)):
                found = nbformat.read(mine / file, as_version=4).cells
                ids = [cell.id for cell in found]
                assert len(ids) == len({*ids})
                for name in names:
                    if name in written:
                        assert written[name] in [c.source for c in found if c.id == name]
            every = sources(mine / one) + sources(mine / two)
            for name in own:
                assert every.count(f'own of {name}') == 1
            update.merge_folders(base, base, newest)
