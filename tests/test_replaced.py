"""The files in which a check has put other texts are given back, however the check ends."""

import os
import signal
import tempfile
import time
from contextlib import nullcontext

import pytest

from helpers.checks.tasks import Tasks
from helpers.workspace import Workspace

FILE, NEW = 'src/robot/setup.py', 'src/ours/test/test_ours.py'


@pytest.fixture
def workspace():
    workspace = Workspace('replaced')
    workspace.write(FILE, 'mine = "é"\r\n')
    workspace.file(FILE).chmod(0o755)
    workspace.file('src/robot/launch').mkdir()
    yield workspace
    workspace.close()


def files_of(workspace):
    """Return all that is in src: the bytes of a file and its mode, None for a folder."""
    return {
        str(path): (path.read_bytes(), path.stat().st_mode) if path.is_file() else None
        for path in workspace.file('src').rglob('*')
    }


def ends(_):
    pass


def raises(_):
    raise KeyError('a mistake of ours')


def exits(_):
    os._exit(0)


def never_ends(_):
    time.sleep(1000)


def is_interrupted(kernel):
    os.kill(kernel, signal.SIGINT)
    time.sleep(1000)


@pytest.mark.parametrize('how', [ends, raises, exits, never_ends, is_interrupted])
def test_a_check_gives_the_files_back_and_leaves_no_temporary_one(
    workspace, how, tmp_path, monkeypatch
):
    before, kernel, seen = files_of(workspace), os.getpid(), tmp_path / 'seen'
    temporary = tmp_path / 'temporary'
    temporary.mkdir()
    monkeypatch.setattr(tempfile, 'tempdir', str(temporary))

    def point():
        launch = 'src/robot/launch/a.launch.xml'
        with workspace.replaced({FILE: 'ours', NEW: 'ours', launch: '<launch/>'}):
            there = [workspace.file(file).exists() for file in (FILE, NEW, launch)]
            seen.write_text(f'{workspace.file(FILE).read_text()} {there}')
            tempfile.mkstemp('of the check')
            how(kernel)

    tasks = Tasks()
    tasks.add(lambda: [('it', point, '')], name='it', limit_s=2)
    with pytest.raises(KeyboardInterrupt) if how is is_interrupted else nullcontext():
        tasks.check('it')
    assert seen.read_text() == 'ours [True, True, True]'
    assert files_of(workspace) == before
    assert not [*temporary.iterdir()]


def killed_while_replaced(workspace, files):
    """Leave files replaced, as when the computer loses its power."""
    process = os.fork()
    if process == 0:
        with workspace.replaced(files):
            os._exit(0)
    os.waitpid(process, 0)


def test_a_kernel_that_opens_the_workspace_gives_them_back(workspace, monkeypatch):
    before = files_of(workspace)
    killed_while_replaced(workspace, {FILE: 'ours', NEW: 'ours'})
    assert files_of(workspace) != before
    monkeypatch.setattr('helpers.workspace.workspace.somebody_watches', lambda: True)
    Workspace('replaced')
    assert files_of(workspace) == before


def test_what_a_student_has_written_meanwhile_stays(workspace):
    with workspace.replaced({FILE: 'ours', NEW: 'ours'}):
        workspace.file(FILE).write_text('newer')
        workspace.file(NEW).write_text('newer')
    assert [workspace.file(file).read_text() for file in (FILE, NEW)] == ['newer', 'newer']


def test_make_sees_that_a_file_has_come_back(workspace):
    os.utime(workspace.file(FILE), (0, 0))
    with workspace.replaced({FILE: 'ours'}):
        built_ns = workspace.file(FILE).stat().st_mtime_ns
    assert workspace.file(FILE).stat().st_mtime_ns >= built_ns
