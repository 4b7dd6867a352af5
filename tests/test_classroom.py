"""What a lesson tells a class, and what it does without one."""

import socket

import pytest

from helpers import checks, classroom, progress

LESSON = '/home/student/notebooks/02_lose_messages.ipynb'
VALUES = [41, 0.2, True, 'the way is free', 'ABC', {'C', 'D'}, [0, 1, 2], ('a', 1), {'A': 1}]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Keep progress here, in the kernel of a lesson."""
    monkeypatch.setenv(progress.FILE_VARIABLE, str(tmp_path / 'progress.txt'))
    monkeypatch.setenv('JPY_SESSION_NAME', LESSON)
    return tmp_path


@pytest.fixture
def nobody():
    """Yield an address where nobody answers."""
    with socket.socket() as taken:  # bound, and not listening
        taken.bind(('127.0.0.1', 0))
        yield f'127.0.0.1:{taken.getsockname()[1]}'


@pytest.mark.parametrize('value', [*VALUES, None, ..., object(), float('nan'), 'x' * 9999])
def test_without_a_class_a_guess_is_the_value_and_nothing_else(folder, capsys, value):
    assert classroom.guess('How many?', value) is value
    checks.check('Exercise 1 of lesson 02', ('it is right', False, ''))
    assert list(folder.iterdir()) == []
    assert 'class' not in capsys.readouterr().out


@pytest.mark.parametrize(
    'call', [classroom.leave_class, classroom.raise_hand, classroom.lower_hand]
)
def test_without_a_class_a_sentence_says_so(folder, capsys, call):
    call()
    assert capsys.readouterr().out == f'{classroom.NOT_JOINED}\n'
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ('address', 'code'),
    [('', ''), ('192.0.2.5:8765', ''), ('', 'blue-otter-lamp'), ('file:///etc', 'a'), ('a b', 'c')],
)
def test_what_is_no_address_is_said_in_one_sentence(folder, capsys, address, code):
    classroom.join_class(address, code)
    assert capsys.readouterr().out.startswith('Copy it from the wall: join_class(')
    assert list(folder.iterdir()) == []


def test_an_address_where_nobody_answers(folder, capsys, nobody):
    classroom.join_class(nobody, 'blue-otter-lamp')
    said = ' '.join(capsys.readouterr().out.split())
    assert said.startswith(f'No class answers at {nobody} (')
    assert 'Compare the address with the wall' in said
    assert list(folder.iterdir()) == []


def test_a_file_that_is_damaged_fails_no_lesson(folder, capsys):
    folder.joinpath('ros2_notebooks_class.sqlite').write_text('This is no database. ' * 99)
    assert classroom.guess('How many?', 41) == 41
    checks.compare_prediction('How many?', 41, 41)
    capsys.readouterr()
    classroom.raise_hand()
    assert capsys.readouterr().out == f'{classroom.NOT_JOINED}\n'


def test_where_no_progress_is_kept_there_is_no_class(folder, capsys, monkeypatch, nobody):
    monkeypatch.setenv(progress.FILE_VARIABLE, '')
    classroom.join_class(nobody, 'blue-otter-lamp')
    assert classroom.guess('How many?', 41) == 41
    assert capsys.readouterr().out.startswith('There is no class here, because')
