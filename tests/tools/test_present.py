"""The copies that `make present` shows: they keep what was typed, and lessons stay as they are."""

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook, new_output

from tools.lessons import present


@pytest.fixture
def root(tmp_path):
    folder = tmp_path / 'notebooks'
    folder.mkdir()
    for name in ('01_publish.ipynb', '02_lose.ipynb'):
        output = new_output('stream', text='lost: 3\n')
        cell = new_code_cell('run()', outputs=[output], execution_count=4)
        nbformat.write(new_notebook(cells=[cell]), folder / name)
    return tmp_path


def change(path, source):
    notebook = nbformat.read(path, as_version=4)
    notebook.cells[0].source = source
    nbformat.write(notebook, path)


def code(path):
    return nbformat.read(path, as_version=4).cells[0]


def made(root, *options):
    assert present.main([*options, '--root', str(root)]) == 0
    return root / 'presentation/02_lose.ipynb'


def test_a_copy_has_no_outputs_and_the_lesson_keeps_its_own(root, capsys):
    before = (root / 'notebooks/02_lose.ipynb').read_bytes()
    copy = made(root, '02')
    assert capsys.readouterr().out == 'presentation/02_lose.ipynb\n'
    assert code(copy).outputs == []
    assert code(copy).execution_count is None
    assert code(made(root, '02', '--saved-outputs')).outputs[0].text == 'lost: 3\n'
    assert (root / 'notebooks/02_lose.ipynb').read_bytes() == before


def test_what_was_typed_is_kept_until_it_is_thrown_away(root, capsys):
    copy, other = made(root, '02'), root / 'presentation/01_publish.ipynb'
    change(copy, 'typed()')
    change(other, 'typed()')
    change(root / 'notebooks/02_lose.ipynb', 'newer()')
    assert code(made(root, '02')).source == 'typed()'
    assert 'NEW=yes' in capsys.readouterr().err
    assert code(made(root, '02', '--new')).source == 'newer()'
    assert code(other).source == 'typed()'
    made(root, '01 02', '--new')
    assert code(other).source == 'run()'


def test_a_copy_in_which_nothing_happened_follows_its_lesson(root):
    other = root / 'presentation/01_publish.ipynb'
    made(root, '02')
    for file in ('01_publish.ipynb', '02_lose.ipynb'):
        change(root / 'notebooks' / file, 'newer()')
    assert code(made(root, '02')).source == code(other).source == 'newer()'
    other.unlink()
    made(root, '02')
    assert code(other).source == 'newer()'


def test_a_record_that_was_broken_off_keeps_what_was_typed(root):
    copy = made(root, '02')
    change(copy, 'typed()')
    (root / 'presentation' / present.MADE).write_text('')
    assert code(made(root, '02')).source == 'typed()'
    assert code(made(root, '02', '--new')).source == 'run()'


@pytest.mark.parametrize('number', ['', '03', '01 03'])
def test_a_wrong_number_is_told_in_one_sentence(root, capsys, number):
    assert present.main([number, '--root', str(root)]) == 1
    assert capsys.readouterr().err.count('\n') == 1
