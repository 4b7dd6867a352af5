import subprocess
import sys

import pytest
from nbformat.v4 import new_code_cell, new_notebook

from helpers import checks, progress
from tools import notebooks

TITLE, OTHER = 'Exercise 1 of lesson 02', 'Exercise 2 of lesson 02'


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """The file of this test's student."""
    path = tmp_path / 'data' / 'progress.txt'
    monkeypatch.setenv(progress.FILE_VARIABLE, str(path))
    return path


def shown(capsys):
    progress.show()
    return capsys.readouterr().out


def test_a_new_student(kept, capsys):
    text = shown(capsys)
    assert text.count('open') == len(progress.TITLES) == 18
    assert text.endswith('\n0 of 18 exercises are solved.\n')
    assert max(map(len, text.splitlines())) <= 94


def test_a_solved_exercise_is_in_the_table(kept, capsys):
    progress.record(OTHER)
    progress.record('Exercise 1 of lesson 00')
    text = shown(capsys)
    assert '02 Lose messages                        1 of 2   open        solved\n' in text
    assert '00 Start here                           1 of 1   solved\n' in text
    assert text.endswith('\n2 of 18 exercises are solved.\n')


def test_solved_again_is_one_line(kept):
    for title in (TITLE, OTHER, TITLE, OTHER):
        progress.record(title)
    assert kept.read_text() == f'{TITLE}\n{OTHER}\n'


@pytest.mark.parametrize(
    'title',
    ['Solution of exercise 1', 'Exercise 1', 'Exercise 3 of lesson 02', 'Exercise 1 of lesson 10'],
)
def test_other_titles_are_not_kept(kept, title):
    progress.record(title)
    assert not kept.exists()


def test_a_check_that_passes_is_kept_and_no_other(kept, capsys):
    checks.check(TITLE, ('it is right', False, 'Try again.'))
    checks.check('Solution of exercise 2', ('it is right', True, ''))
    assert not kept.exists()
    checks.check(TITLE, ('it is right', True, ''))
    checks.check(TITLE, ('it is right', False, 'It was right before.'))
    assert kept.read_text() == f'{TITLE}\n'


def test_kernels_that_write_at_once_lose_nothing(kept, capsys):
    write = (
        'import random, sys; from helpers import progress; titles = sorted(progress.TITLES)\n'
        'random.shuffle(titles); print(flush=True); sys.stdin.read(1)\n'
        'for title in titles: progress.record(title)'
    )
    options = {'stdin': subprocess.PIPE, 'stdout': subprocess.PIPE}
    writers = [subprocess.Popen([sys.executable, '-c', write], **options) for _ in range(6)]
    for writer in writers:
        writer.stdout.readline()  # it is ready
    for writer in writers:
        writer.stdin.close()
    for writer in writers:
        assert writer.wait(60) == 0
        writer.stdout.close()
    assert set(kept.read_text().splitlines()) == progress.TITLES
    assert shown(capsys).endswith('\n18 of 18 exercises are solved.\n')


def test_a_place_that_cannot_be_written_fails_no_lesson(tmp_path, monkeypatch, capsys):
    (tmp_path / 'file').touch()
    path = tmp_path / 'file' / 'progress.txt'
    monkeypatch.setenv(progress.FILE_VARIABLE, str(path))
    checks.check(TITLE, ('it is right', True, ''))
    assert capsys.readouterr().out == f'[ok] it is right\n{TITLE}: 1 of 1. All done.\n'
    text = ' '.join(shown(capsys).split())
    assert text.startswith('Your progress is not kept, because ')
    assert f'{path} cannot be used: ' in text
    assert text.endswith('0 of 18 exercises are solved.')


def test_a_corrupt_file_is_told_and_left_as_it_is(kept, capsys):
    kept.parent.mkdir()
    damaged = f'{TITLE}\n'.encode() + b'\xff\x00?\n\nExercise 2 of les'
    kept.write_bytes(damaged)
    progress.record(OTHER)
    assert kept.read_bytes() == damaged + f'\n{OTHER}\n'.encode()
    text = ' '.join(shown(capsys).split())
    assert '02 Lose messages 2 of 2 solved solved' in text
    assert text.endswith(f'Not understood in {kept}, and left as it is: 2 of 5 lines.')


def test_start_again(kept, capsys):
    progress.start_again()
    assert capsys.readouterr().out == 'Your table is empty again.\n'
    progress.record(TITLE)
    progress.start_again()
    capsys.readouterr()
    assert '0 of 18' in shown(capsys)
    assert kept.with_suffix('.old').read_text() == f'{TITLE}\n'


def test_where_it_is_kept(tmp_path, monkeypatch):
    monkeypatch.delenv(progress.FILE_VARIABLE)
    monkeypatch.setenv('JUPYTER_DATA_DIR', str(tmp_path / 'data'))  # `make lab` sets it
    assert progress.file().parent == tmp_path / 'data'
    monkeypatch.delenv('JUPYTER_DATA_DIR')  # on a JupyterHub
    monkeypatch.setenv('HOME', str(tmp_path / 'home'))
    assert progress.file().is_relative_to(tmp_path / 'home')


def test_tests_and_make_notebooks_keep_nothing(tmp_path, monkeypatch, capsys):
    assert progress.file() is None  # conftest.py
    monkeypatch.setenv('JUPYTER_DATA_DIR', str(tmp_path))
    progress.record(TITLE)
    assert '0 of 18' in shown(capsys)
    progress.start_again()
    assert list(tmp_path.iterdir()) == []
    monkeypatch.delenv(progress.FILE_VARIABLE)
    cell = new_code_cell('from helpers import progress\nprogress.file()')
    executed = notebooks.execute(new_notebook(cells=[cell]), tmp_path)
    assert executed.cells[0].outputs == []
