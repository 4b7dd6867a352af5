"""The student's progress, with the notebooks of a folder made for it."""

import subprocess
import sys

import nbformat
import pytest

from helpers.checks import compare_prediction, guess, progress
from helpers.checks.portrait import Map, portrait
from helpers.checks.tasks import Tasks
from helpers.robot import EMPTY


def notebook(title, *tasks):
    """Return the text of a notebook with these tasks, by their names."""
    cells = [nbformat.v4.new_markdown_cell(f'# {title}')]
    for number, task in enumerate(tasks, 1):
        cells.append(nbformat.v4.new_markdown_cell(f'### ✎ Task {number}: {task}\n\nDo it.'))
        source = f"check('{task}', answer)"
        cells.append(nbformat.v4.new_code_cell(source, metadata={'tags': ['check']}))
    return nbformat.writes(nbformat.v4.new_notebook(cells=cells))


NOTEBOOKS = {
    '00_start_here': notebook('00 Start here', 'two_robots'),
    '01_publish': notebook('01 Publish'),
    '92_lose_them': notebook('92 Lose them', 'a_queue', 'b_thread'),
    '93_share_cpp': notebook('93 Share "C++"', 'a_library'),
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The folder of the notebooks, in which a kernel works."""
    folder = tmp_path / 'notebooks'
    folder.mkdir()
    for name, text in NOTEBOOKS.items():
        (folder / f'{name}.ipynb').write_text(text, encoding='utf-8')
    monkeypatch.chdir(folder)
    monkeypatch.setenv('JPY_SESSION_NAME', 'notebooks/92_lose_them.ipynb')
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
        'lesson          solved  open\n'
        '----------------------------------\n'
        '00 Start here   0 of 1  task 1\n'
        '92 Lose them    0 of 2  tasks 1, 2\n'
        '93 Share "C++"  0 of 1  task 1\n'
        '0 of 4 tasks are solved.\n'
    )


def test_progress_survives_a_new_lesson_number(kept, capsys, folder):
    progress.record('b_thread')
    (folder / '92_lose_them.ipynb').rename(folder / '94_lose_them.ipynb')
    (folder / '92_count.ipynb').write_text(notebook('92 Count', 'b_thread'))
    text = shown(capsys)
    assert '\n92 Count        0 of 1  task 1\n' in text
    assert '94 Lose them    1 of 2  task 1\n' in text


def test_a_task_keeps_its_progress_whatever_its_number_is(kept, capsys, folder):
    progress.record('a_queue')
    inserted = notebook('92 Lose them', 'new_one', 'b_thread', 'a_queue')
    (folder / '92_lose_them.ipynb').write_text(inserted)
    assert '\n92 Lose them    1 of 3  tasks 1, 2\n' in shown(capsys)
    (folder / '92_lose_them.ipynb').write_text(notebook('92 Lose them', 'b_thread'))
    assert '\n92 Lose them    0 of 1  task 1\n' in shown(capsys)  # it was taken out: not credited
    (folder / '92_lose_them.ipynb').write_text(NOTEBOOKS['92_lose_them'])
    assert '\n92 Lose them    1 of 2  task 2\n' in shown(capsys)


def test_progress_of_version_0_3_is_read_by_its_numbers(kept, capsys, folder):
    kept.parent.mkdir()
    kept.write_text('lose_messages 4\nfind_the_fault 10 deaf_brake\nlose_messages 99\n')
    text = notebook('92 Lose messages', 'inserted', 'publish_numbers', 'be_the_queue')
    (folder / '92_lose_them.ipynb').rename(folder / '92_lose_messages.ipynb')
    (folder / '92_lose_messages.ipynb').write_text(text)
    assert '\n92 Lose messages  1 of 3  tasks 1, 2\n' in shown(capsys)


@pytest.mark.parametrize('broken', [b'', b'\xff\xfe{'])
def test_a_broken_notebook_breaks_nothing(kept, capsys, folder, broken):
    (folder / '92_lose_them.ipynb').write_bytes(broken)
    progress.record('a_queue')
    assert '\n00 Start here ' in shown(capsys)
    assert kept.read_text() == 'lose_them a_queue\n'


def test_a_borrowed_task_is_open_and_named(kept, capsys, folder):
    progress.add('borrowed lose_them a_queue')
    assert '\n92 Lose them    0 of 2  tasks 1, 2 (borrowed: 1)\n' in shown(capsys)
    progress.record('a_queue')
    assert '\n92 Lose them    1 of 2  task 2\n' in shown(capsys)


def pressed(solved):
    tasks = Tasks()
    tasks.add(lambda: [('it is right', lambda: solved or 'it is not', '')], name='a_queue')
    tasks.check('a_queue')


def test_passed_tasks_are_kept(kept):
    pressed(False)
    assert not kept.exists()
    pressed(True)
    pressed(False)
    pressed(True)
    assert kept.read_text() == 'lose_them a_queue\n'


def test_the_total_counts_tasks(kept):
    progress.add('another_lesson a_queue')
    progress.record('a_queue', 'ada')
    assert progress.total() == '1 of 4 tasks'


def test_without_a_file_there_is_no_total(monkeypatch):
    monkeypatch.setenv(progress.FILE_VARIABLE, '')
    assert progress.total() == ''


def test_what_a_task_was_about_is_kept_if_it_differs(kept):
    tasks = Tasks()
    tasks.add(
        lambda word: [('it is right', lambda: word != 'WRONG' or 'it is wrong', '')],
        name='a_queue',
        about=str.lower,
    )
    for word in ('WRONG', 'ADA', 'ADA', 'BO', 'ADA'):
        tasks.check('a_queue', word)
    assert progress.about('a_queue') == ['ada', 'bo', 'ada']
    assert progress.about('b_thread') == []
    assert kept.read_text().splitlines().count('lose_them a_queue') == 1


def test_kernels_that_write_at_once_lose_nothing(kept, capsys):
    write = (
        'import random, sys; from helpers.checks import progress; '
        'tasks = ["a_queue", "b_thread", "other"]; random.shuffle(tasks); print(flush=True)\n'
        'sys.stdin.read(1)\n'
        'for task in tasks: progress.record(task)'
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
    assert set(kept.read_text().splitlines()) == {
        f'lose_them {task}' for task in ('a_queue', 'b_thread', 'other')
    }
    assert '\n2 of 4 tasks are solved.\n' in shown(capsys)


def test_an_unwritable_file_fails_no_lesson(tmp_path, monkeypatch, capsys):
    (tmp_path / 'file').touch()
    path = tmp_path / 'file' / 'progress.txt'
    monkeypatch.setenv(progress.FILE_VARIABLE, str(path))
    pressed(True)
    assert capsys.readouterr().out == '[ok] it is right\nTask 1: 1 of 1. All done.\n'
    text = ' '.join(shown(capsys).split())
    assert text.startswith('Your progress is not kept, because ')
    assert f'{path} cannot be used: ' in text
    assert text.endswith('0 of 4 tasks are solved.')


def test_start_again(kept, capsys):
    for _ in range(2):  # first there is nothing to keep
        progress.start_again()
        progress.record('a_queue')
    assert capsys.readouterr().out == 2 * 'Your table is empty again.\n'
    assert '1 of 4' in shown(capsys)
    assert kept.with_suffix('.old').read_text() == kept.read_text() == 'lose_them a_queue\n'


def test_where_it_is_kept(tmp_path, monkeypatch):
    monkeypatch.delenv(progress.FILE_VARIABLE)
    monkeypatch.setenv('JUPYTER_DATA_DIR', str(tmp_path / 'data'))  # `make lab` sets it
    assert progress.file().parent == tmp_path / 'data'
    monkeypatch.delenv('JUPYTER_DATA_DIR')  # on a JupyterHub
    monkeypatch.setenv('HOME', str(tmp_path / 'home'))
    assert progress.file().is_relative_to(tmp_path / 'home')


# --- The portrait


class Asked:
    """Compares guesses as the cells of a lesson do."""

    def __init__(self, monkeypatch):
        self.monkeypatch = monkeypatch

    def level(self, question, said, was):
        self._compare(question, said, was, on=(0.0, 10.0), unit='s')

    def choice(self, question, said, was):
        self._compare(question, said, was, on=bool)

    def _compare(self, question, said, was, **options):
        compare_prediction(question, guess(question, said, **options), was)

    def in_lesson(self, file):
        self.monkeypatch.setenv('JPY_SESSION_NAME', f'notebooks/{file}.ipynb')


@pytest.fixture
def asked(kept, monkeypatch):
    return Asked(monkeypatch)


def portrait_of(capsys):
    capsys.readouterr()
    return shown(capsys).partition('are solved.\n')[2]


def test_without_a_guess_there_is_no_portrait(kept, capsys):
    assert portrait_of(capsys) == ''


def test_the_portrait_says_what_the_guesses_say_together(asked, capsys):
    for number in range(3):
        asked.level(f'How old is {number}?', 2.0, 5.0)
    asked.in_lesson('93_share_cpp')
    for number in range(3):
        asked.choice(f'Does {number} build?', 'yes', True)
    assert portrait_of(capsys) == (
        'Of your 6 guesses, 3 came out right. Of 3 wrong numbers, 3 were too low. '
        'You were right most often in Share "C++", least in Lose them.\n'
    )


def test_two_numbers_are_chance(asked, capsys):
    asked.level('How old is it?', 2.0, 5.0)
    asked.level('How late is it?', 2.0, 5.0)
    assert portrait_of(capsys) == 'Of your 2 guesses, 0 came out right.\n'


def test_a_question_that_was_answered_again_counts_once(asked, capsys):
    asked.choice('Does it build?', 'no', True)
    asked.choice('Does it build?', 'yes', True)
    assert portrait_of(capsys) == 'Of your 1 guess, 1 came out right.\n'


def test_the_pictures_have_words_and_a_lesson_with_its_link(asked):
    asked.level('How old <is> it?', 2.0, 12.0)
    asked.choice('Does it build?', 'no', True)
    made = guess('Where is it?', (1.0, 0.5), on=EMPTY, point=True)
    compare_prediction('Where is it?', made, (2.0, -0.5))
    gaps = progress.gaps_in(progress.lines_of(progress.GAP))
    known = progress.with_tasks()
    solved = {lesson.name: [1] for lesson in known}
    seen = Map(known, solved, 'a table\n5 of 9 tasks.', portrait(known, gaps))
    html = seen.html()
    assert 'href="92_lose_them.ipynb"' in html
    assert html.count(', solved">') == len(known)
    assert '5 of 9 tasks.' in html
    assert '<title>How old &lt;is&gt; it? You said 2, and it was 12.</title>' in html
    assert '<title>Does it build? You said no, and it was yes.</title>' in html
    point = html.partition('<title>Where is it? You said 1.0, 0.5, and it was 2.0, -0.5.</title>')[
        2
    ]
    assert '<circle cx="42.4" cy="12.9" r="3"' in point


def test_a_line_that_was_not_written_to_its_end_is_passed_over(asked, kept, capsys):
    asked.choice('Does it build?', 'yes', True)
    with kept.open('a') as lines:
        lines.write('gap lose_them {"asked": "Does\ngap\n')
    assert portrait_of(capsys) == 'Of your 1 guess, 1 came out right.\n'
