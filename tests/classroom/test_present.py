"""The copies that `make present` shows: they keep what was typed, and lessons stay as they are."""

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook, new_output

from tools.classroom.present import MADE, copies_of, main


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


def test_a_copy_has_no_outputs_and_the_lesson_keeps_its_own(root):
    before = (root / 'notebooks/02_lose.ipynb').read_bytes()
    [copy] = copies_of('02', root)
    assert code(copy).outputs == []
    assert code(copy).execution_count is None
    assert code(*copies_of('02', root, outputs=True)).outputs[0].text == 'lost: 3\n'
    assert (root / 'notebooks/02_lose.ipynb').read_bytes() == before


def test_what_was_typed_is_kept_until_thrown_away(root):
    other, copy = copies_of('01 02', root)
    change(copy, 'typed()')
    change(other, 'typed()')
    change(root / 'notebooks/02_lose.ipynb', 'newer()')
    (root / 'presentation' / MADE).write_text('')  # it was broken off
    assert code(*copies_of('02', root)).source == 'typed()'
    assert code(*copies_of('02', root, new=True)).source == 'newer()'
    assert code(other).source == 'typed()'


def test_an_untouched_copy_follows_its_lesson(root):
    other, copy = copies_of('01 02', root)
    for file in ('01_publish.ipynb', '02_lose.ipynb'):
        change(root / 'notebooks' / file, 'newer()')
    copies_of('02', root)
    assert code(copy).source == code(other).source == 'newer()'


@pytest.mark.parametrize('number', ['', '03', '01 03'])
def test_a_wrong_number_gives_one_sentence(root, capsys, number):
    assert main(['--lessons', number, '--root', str(root)]) == 1
    assert capsys.readouterr().err.count('\n') == 1
