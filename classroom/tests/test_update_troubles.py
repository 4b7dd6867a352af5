"""`make update`: whatever fails, one sentence, and all is as it was; the next one brings all."""

import shutil
import signal
import subprocess
import sys

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook
from support.checkouts import git
from support.troubles import another_user, as_root, folder_of_all, full, read_only, small_disk, take

from classroom import handout, update
from classroom.tests.support.editions import archive_of
from helpers.lesson import ROOT
from helpers.machine import OWNED

LESSON = 'notebooks/02_lose_messages.ipynb'
NEWER = 'notebooks/03_lose_messages.ipynb'
CELL = "workspace = Workspace('{}')"
# What a student has written: in a cell, in a file of the course, beside it, in a workspace.
WRITTEN = {
    'cell': "print('mine')",
    'helper.py': 'my helper',
    'my_own.txt': 'mine',
    'lesson_02/src/mine.py': 'my node',
}


def edition(folder, lesson, workspace, helper):
    """Write a course of one lesson."""
    (folder / 'notebooks').mkdir(parents=True)
    cells = [new_code_cell(CELL.format(workspace), id='open'), new_code_cell('...', id='task')]
    nbformat.write(new_notebook(cells=cells), folder / lesson)
    (folder / 'helper.py').write_text(helper)
    (folder / 'large.txt').write_text(helper * 10_000)
    return folder


def write(mine):
    """Do what a student does in an edition."""
    lesson = nbformat.read(mine / LESSON, as_version=4)
    lesson.cells[1].source = WRITTEN['cell']
    nbformat.write(lesson, mine / LESSON)
    (mine / 'helper.py').write_text(WRITTEN['helper.py'])
    (mine / 'my_own.txt').write_text(WRITTEN['my_own.txt'])
    (mine / 'scratch/lesson_02/src').mkdir(parents=True)
    (mine / 'scratch/lesson_02' / OWNED).touch()
    (mine / 'scratch/lesson_02/src/mine.py').write_text(WRITTEN['lesson_02/src/mine.py'])


def student(folder):
    """Return an edition in which a student has written."""
    mine = edition(folder, LESSON, 'lesson_02', 'old')
    shutil.copytree(mine, folder.parent / 'base')
    shutil.move(folder.parent / 'base', mine / update.BASE)
    write(mine)
    return mine


@pytest.fixture
def newer(tmp_path):
    return archive_of(edition(tmp_path / 'newer', NEWER, 'lose_messages', 'new'))


def files(mine):
    """Return all files with what is in them, but those of git."""
    found = {str(p.relative_to(mine)): p.read_bytes() for p in mine.rglob('*') if p.is_file()}
    return {name: data for name, data in found.items() if not name.startswith('.git/')}


def assert_all_is_there(mine):
    """Newer lessons have come, and all that was written is still there."""
    found = {name: data.decode() for name, data in files(mine).items()}
    assert LESSON not in found
    assert {*found} == {
        *(NEWER, 'helper.py', 'helper.py.yours', 'large.txt', 'my_own.txt'),
        *(f'{update.BASE}/{name}' for name in (NEWER, 'helper.py', 'large.txt')),
        *(f'scratch/lose_messages/{name}' for name in (OWNED, 'src/mine.py')),
    }
    cells = [cell.source for cell in nbformat.reads(found[NEWER], as_version=4).cells]
    assert cells == [CELL.format('lose_messages'), WRITTEN['cell']]
    assert found['helper.py.yours'] == WRITTEN['helper.py']
    assert found['my_own.txt'] == WRITTEN['my_own.txt']
    assert found['scratch/lose_messages/src/mine.py'] == WRITTEN['lesson_02/src/mine.py']


@as_root
@pytest.mark.parametrize('room', [0, 20_000, 60_000, 100_000, 140_000])
def test_a_full_disk_changes_nothing(tmp_path, newer, capsys, room):
    with small_disk(tmp_path / 'disk', '2m') as disk:
        mine = student(disk / 'mine')
        before = files(mine)
        with full(disk, but=room):
            assert update.main([str(newer), '--to', str(mine)]) == 1
            said = capsys.readouterr()
            assert (said.out, said.err.count('\n')) == ('', 1)
            assert said.err.startswith('There is no room left in ')
            assert files(mine) == before
        assert update.main([str(newer), '--to', str(mine)]) == 0
        assert_all_is_there(mine)


@as_root
def test_a_folder_that_nobody_can_write_stays_as_it_is(tmp_path, newer, capsys):
    mine = student(tmp_path / 'mine')
    before = files(mine)
    with read_only(mine):
        assert update.main([str(newer), '--to', str(mine)]) == 1
    assert capsys.readouterr().err == (
        f'The folder {mine} cannot be written: copy it to one of your own, then try again.\n'
    )
    assert files(mine) == before
    assert update.main([str(newer), '--to', str(mine)]) == 0
    assert_all_is_there(mine)


@as_root
@pytest.mark.parametrize('what', ['notebooks', LESSON, update.BASE])
def test_what_another_user_owns_is_named_before_anything_changes(tmp_path, newer, capsys, what):
    with folder_of_all() as folder:
        archive = shutil.copy(newer, folder)
        mine = student(folder / 'mine')
        take(mine)
        take(mine / what, 0)
        (mine / what).chmod(0o700)
        before = files(mine)
        with another_user():
            assert update.main([str(archive), '--to', str(mine)]) == 1
        assert capsys.readouterr().err == (
            f"{mine / what} is another user's: take it with "
            f'`sudo chown -R "$(id -u)" "{mine}"`, then try again.\n'
        )
        assert files(mine) == before
        take(mine)
        with another_user():
            assert update.main([str(archive), '--to', str(mine)]) == 0
        assert_all_is_there(mine)


KILLED = """
import os, signal, sys
from itertools import count
from pathlib import Path
from classroom import update

counter, at = count(), int(sys.argv.pop(1))

def killed(change):
    def or_killed(*arguments, **options):
        if next(counter) == at:
            os.kill(os.getpid(), signal.SIGKILL)
        return change(*arguments, **options)
    return or_killed

for name in ('rename', 'replace', 'unlink'):
    setattr(Path, name, killed(getattr(Path, name)))
update.main(sys.argv[1:])
"""


@pytest.mark.parametrize('number', range(0, 22, 2))
def test_after_kill_9_the_next_update_goes_on(tmp_path, newer, number):
    """Before a change of a name."""
    mine = student(tmp_path / 'mine')
    command = [sys.executable, '-c', KILLED, str(number), str(newer), '--to', str(mine)]
    assert subprocess.run(command, cwd=ROOT).returncode == -signal.SIGKILL
    assert update.main([str(newer), '--to', str(mine)]) == 0
    assert_all_is_there(mine)


def test_ctrl_c_gets_one_sentence_and_the_next_update_goes_on(tmp_path, newer, capsys, monkeypatch):
    mine = student(tmp_path / 'mine')
    before = files(mine)

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(update, 'set_apart', interrupted)
        assert update.main([str(newer), '--to', str(mine)]) == 130
    assert capsys.readouterr().err == (
        'Interrupted: nothing is lost. Type the same again to go on.\n'
    )
    assert files(mine) == before
    assert update.main([str(newer), '--to', str(mine)]) == 0
    assert_all_is_there(mine)


def test_two_at_once_bring_all(tmp_path, newer):
    mine = student(tmp_path / 'mine')
    command = [sys.executable, '-m', 'classroom.update', str(newer), '--to', str(mine)]
    two = [subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    answers = sorted(process.communicate()[0] for process in two)
    assert [process.returncode for process in two] == [0, 0]
    assert_all_is_there(mine)
    assert answers[0].startswith('Both have changed helper.py')
    assert answers[1].startswith('The lessons are up to date.'), 'both did the work'


@pytest.mark.parametrize(
    ('address', 'proxy'),
    [('http://127.0.0.1:9/', ''), ('http://a.invalid/', 'http://127.0.0.1:9')],
)
def test_without_a_network_a_clone_stays_as_it_is(tmp_path, capsys, monkeypatch, address, proxy):
    monkeypatch.setenv('http_proxy', proxy)
    origin, mine = edition(tmp_path / 'origin', LESSON, 'lesson_02', 'old'), tmp_path / 'mine'
    git(origin, 'init')
    git(origin, 'add', '.')
    git(origin, 'commit', '-m', 'old')
    git(tmp_path, 'clone', str(origin), str(mine))
    write(mine)
    git(mine, 'remote', 'set-url', 'origin', address)
    before = files(mine)
    assert update.main(['--to', str(mine)]) == 1
    said = capsys.readouterr().err
    assert said.startswith('Nothing could be fetched: check the network, and what git says.')
    assert '127.0.0.1 port 9' in said
    assert said.count('\n') == 1
    assert files(mine) == before
    git(mine, 'remote', 'set-url', 'origin', str(origin))
    shutil.rmtree(origin / 'notebooks')
    (origin / 'helper.py').unlink()
    edition(origin, NEWER, 'lose_messages', 'new')
    git(origin, 'add', '--all', '.')
    git(origin, 'commit', '-m', 'newer')
    assert update.main(['--to', str(mine)]) == 0
    cells = nbformat.read(mine / NEWER, as_version=4).cells
    assert cells[1].source == WRITTEN['cell']


@pytest.mark.parametrize('makefile', ['Makefile', handout.COMMANDS])
@pytest.mark.parametrize('fails', [False, True])
def test_the_command_installs_before_and_after_unless_it_fails(tmp_path, makefile, fails):
    """The newer lessons may need other packages."""
    (tmp_path / 'tools').mkdir()
    shutil.copy(ROOT / makefile, tmp_path / 'Makefile')
    shutil.copy(ROOT / 'tools/environment.mk', tmp_path / 'tools')
    for name, script in (
        ('tools/set_up.sh', 'echo set up'),
        ('python', f'echo "$*"; exit {int(fails)}'),
    ):
        (tmp_path / name).write_text(f'#!/bin/sh\n{script}\n')
        (tmp_path / name).chmod(0o755)
    command = [
        'make',
        '--no-print-directory',
        'update',
        'PYTHON=./python',
        'FROM=my archive.tar.gz',
    ]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert bool(done.returncode) == fails
    steps = ['set up', '-m classroom.update my archive.tar.gz', 'set up']
    assert done.stdout.splitlines() == (steps[:2] if fails else steps)
