"""The student's progress, with the notebooks of a folder made for it."""

import re
import subprocess
import sys

import pytest

from helpers import checks, progress

TITLE, OTHER = 'Exercise 1 of lesson 92', 'Exercise 2 of lesson 92'
NOTEBOOKS = {
    '00_start_here': ['# 00 Start here', '### Exercise 1: Two robots'],
    '01_publish': ['# 01 Publish'],
    '92_lose_them': ['# 92 Lose them\\n', '### Exercise 1: A\\n', '### Exercise 2: B\\n'],
    '93_share_cpp': ['# 93 Share \\"C++\\"', '### Exercise 1: A', '"### Exercise 1: A'],
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The folder of the notebooks, in which a kernel works."""
    folder = tmp_path / 'notebooks'
    folder.mkdir()
    for name, lines in NOTEBOOKS.items():
        source = ''.join(f'    "{line}",\n' for line in lines)
        (folder / f'{name}.ipynb').write_text(source, encoding='utf-8')
    monkeypatch.chdir(folder)
    return folder


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
    assert shown(capsys) == (
        'lesson          solved  exercise 1  exercise 2\n'
        '----------------------------------------------\n'
        '00 Start here   0 of 1  open\n'
        '92 Lose them    0 of 2  open        open\n'
        '93 Share "C++"  0 of 1  open\n'
        '0 of 4 exercises are solved.\n'
    )


def test_a_solved_exercise_is_in_the_table(kept, capsys):
    progress.record(OTHER)
    progress.record('Exercise 1 of lesson 00')
    text = shown(capsys)
    assert '92 Lose them    1 of 2  open        solved\n' in text
    assert '00 Start here   1 of 1  solved\n' in text
    assert text.endswith('\n2 of 4 exercises are solved.\n')


def test_what_is_solved_stays_so_when_the_lesson_gets_another_number(kept, capsys, folder):
    progress.record(OTHER)
    (folder / '92_lose_them.ipynb').rename(folder / '94_lose_them.ipynb')
    (folder / '92_count.ipynb').write_text('"# 92 Count",\n"### Exercise 1: A",\n')
    text = shown(capsys)
    assert '\n92 Count        0 of 1  open\n' in text
    assert '1 of 2  open        solved\n' in text


@pytest.mark.parametrize('broken', [b'', b'\xff\xfe{'])
def test_a_broken_notebook_breaks_nothing(kept, capsys, folder, broken):
    (folder / '92_lose_them.ipynb').write_bytes(broken)
    progress.record(TITLE)
    text = shown(capsys)
    assert re.search(r'^00 Start here +0 of 1 +open$', text, re.MULTILINE)
    assert kept.read_text() == 'lose_them 1\n'


def test_elsewhere_the_notebooks_are_those_of_the_checkout(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert 'lose_messages' in {lesson.name for lesson in progress.lessons()}


def test_a_check_that_passes_is_kept_and_no_other(kept):
    checks.check(TITLE, ('it is right', False, 'Try again.'))
    for other in ('Solution of exercise 2', 'Exercise 2', 'Exercise 2 of lesson 98'):
        checks.check(other, ('it is right', True, ''))
    assert not kept.exists()
    checks.check(TITLE, ('it is right', True, ''))
    checks.check(TITLE, ('it is right', False, 'It was right before.'))
    checks.check(TITLE, ('it is right', True, ''))
    assert kept.read_text() == 'lose_them 1\n'


def test_kernels_that_write_at_once_lose_nothing(kept, capsys):
    write = (
        'import random, sys; from helpers import progress; '
        'titles = [f"Exercise {n} of lesson {m}" for n in (1, 2, 3) for m in ("00", "92")]\n'
        'random.shuffle(titles); print(flush=True); sys.stdin.read(1)\n'
        'for title in titles: progress.record(title)'
    )
    options = {'stdin': subprocess.PIPE, 'stdout': subprocess.PIPE}
    writers = [subprocess.Popen([sys.executable, '-c', write], **options) for _ in range(4)]
    for writer in writers:
        writer.stdout.readline()  # it is ready
    for writer in writers:
        writer.stdin.close()
    for writer in writers:
        assert writer.wait(60) == 0
        writer.stdout.close()
    names = ('start_here', 'lose_them')
    lines = {f'{name} {count}' for name in names for count in (1, 2, 3)}
    assert set(kept.read_text().splitlines()) == lines
    assert '\n3 of 4 exercises are solved.\n' in shown(capsys)


def test_a_place_that_cannot_be_written_fails_no_lesson(tmp_path, monkeypatch, capsys):
    (tmp_path / 'file').touch()
    path = tmp_path / 'file' / 'progress.txt'
    monkeypatch.setenv(progress.FILE_VARIABLE, str(path))
    checks.check(TITLE, ('it is right', True, ''))
    assert capsys.readouterr().out == f'[ok] it is right\n{TITLE}: 1 of 1. All done.\n'
    text = ' '.join(shown(capsys).split())
    assert text.startswith('Your progress is not kept, because ')
    assert f'{path} cannot be used: ' in text
    assert text.endswith('0 of 4 exercises are solved.')


def test_start_again(kept, capsys):
    progress.start_again()
    assert capsys.readouterr().out == 'Your table is empty again.\n'
    progress.record(TITLE)
    progress.start_again()
    capsys.readouterr()
    assert '0 of 4' in shown(capsys)
    assert kept.with_suffix('.old').read_text() == 'lose_them 1\n'


def test_where_it_is_kept(tmp_path, monkeypatch):
    monkeypatch.delenv(progress.FILE_VARIABLE)
    monkeypatch.setenv('JUPYTER_DATA_DIR', str(tmp_path / 'data'))  # `make lab` sets it
    assert progress.file().parent == tmp_path / 'data'
    monkeypatch.delenv('JUPYTER_DATA_DIR')  # on a JupyterHub
    monkeypatch.setenv('HOME', str(tmp_path / 'home'))
    assert progress.file().is_relative_to(tmp_path / 'home')


def test_tests_keep_nothing(tmp_path, monkeypatch, capsys):
    assert progress.file() is None  # conftest.py
    monkeypatch.setenv('JUPYTER_DATA_DIR', str(tmp_path))
    progress.record(TITLE)
    assert '0 of 4' in shown(capsys)
    progress.start_again()
    assert [path.name for path in tmp_path.iterdir()] == ['notebooks']
