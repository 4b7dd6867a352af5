"""What a lesson does without a class. classroom/tests has classes that students join."""

import contextlib
import queue
import socket

import pytest
from support.students import GUESSES, VALUES, in_kernel, student
from support.waits import LIMIT_S

from helpers.checks import classroom, guess


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Keep progress here, in the kernel of a lesson."""
    for name, value in student(tmp_path).items():
        if value is None:
            monkeypatch.delenv(name, raising=False)
        else:
            monkeypatch.setenv(name, value)
    return tmp_path


@pytest.mark.parametrize('value', [*VALUES, None, ..., object(), float('nan'), 'x' * 9999])
def test_without_a_class_a_guess_returns_its_value(folder, capsys, value):
    assert guess('How many?', value) is value
    classroom.tell_task(1, False)
    assert list(folder.iterdir()) == []
    said = capsys.readouterr().out
    assert 'class' not in said
    assert ('saved' in said) == (value not in (None, ...))


@pytest.mark.parametrize(
    'call', [classroom.leave_class, classroom.raise_hand, classroom.lower_hand]
)
def test_without_a_class_a_sentence_says_so(folder, capsys, call):
    call()
    assert capsys.readouterr().out == f'{classroom.NOT_JOINED}\n'
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(('address', 'code'), [('192.0.2.5:8765', ''), ('file:///etc', 'a')])
def test_a_bad_address_gets_one_sentence(folder, capsys, address, code):
    classroom.join_class(address, code)
    assert capsys.readouterr().out.startswith('Copy the line from the screen: join_class(')
    assert list(folder.iterdir()) == []


def test_an_address_where_nobody_answers(folder, capsys):
    with socket.socket() as taken:
        taken.bind(('127.0.0.1', 0))  # and does not listen
        nobody = f'127.0.0.1:{taken.getsockname()[1]}'
        classroom.join_class(nobody, 'blue-otter-lamp')
    said = ' '.join(capsys.readouterr().out.split())
    assert said.startswith(f'No class answers at {nobody} (')
    assert 'Compare the address with the one on the screen' in said
    assert list(folder.iterdir()) == []


def test_a_file_that_is_damaged_fails_no_lesson(tmp_path):
    tmp_path.joinpath('ros2_notebooks_class.sqlite').write_text('This is no database. ' * 99)
    said = in_kernel(tmp_path, GUESSES.format(0, 50, 'How many?') + 'leave_class()')
    assert 'Nothing is sent to the class, because ' in said
    assert 'remove this file, then join again.' in said
    assert said.endswith(classroom.NOT_JOINED)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_be_used_gets_one_sentence(folder, capsys):
    folder.joinpath('ros2_notebooks_class.sqlite').mkdir()
    classroom.leave_class()
    said = ' '.join(capsys.readouterr().out.split())
    assert said.startswith('Nothing is sent to the class, because ')
    assert said.endswith('remove this file, then join again.')


def test_a_class_that_is_joined_while_the_thread_ends(folder, monkeypatch):
    """The thread has just seen that there is no class when the student joins one and guesses."""
    outbox, told, real = classroom._Outbox(), queue.Queue(), classroom._class
    guesses = iter([{'id': 'b', 'kind': 'guess'}])

    def join(db):
        if (known := real(db)) is None and (guess := next(guesses, None)):
            with contextlib.closing(classroom._open(classroom._file())) as other, other:
                other.execute("INSERT INTO class VALUES ('', '', 1e12)")
            outbox.put(guess)
        return known

    monkeypatch.setattr(classroom, '_class', join)
    monkeypatch.setattr(classroom, '_ask', lambda known, what, body: told.put(body))
    outbox.put({'id': 'a', 'kind': 'guess'})
    thread = outbox._thread
    assert told.get(timeout=LIMIT_S)['events'][-1]['id'] == 'b'
    classroom.leave_class()
    outbox.put({'id': 'c', 'kind': 'guess'})
    thread.join(LIMIT_S)
    assert not thread.is_alive()
