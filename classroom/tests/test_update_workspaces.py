"""`make update`: a student's files in `scratch` follow the name of their workspace."""

import fcntl
import json
import os
import shutil
import tempfile
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook
from support.checkouts import git

from classroom import update
from classroom.tests.support.editions import archive_of
from helpers.checks import progress
from helpers.machine import OWNED

LAUNCH, LIBRARY = 'launch_a_system', 'share_code_in_a_cpp_library'
PACKAGES = {LAUNCH: 'fleet_pkg', LIBRARY: 'scan_tools'}
# By the lesson: its number, and the name of its workspace.
OLD = {LAUNCH: ('12', 'lesson_12'), LIBRARY: ('14', 'lesson_14')}
BY_NAME = {LAUNCH: ('13', LAUNCH), LIBRARY: ('12', LIBRARY)}
SWAPPED = {LAUNCH: ('14', 'lesson_14'), LIBRARY: ('12', 'lesson_12')}


def course(folder, edition):
    """Write the lessons of an edition."""
    (folder / 'notebooks').mkdir(parents=True)
    for name, (number, workspace) in edition.items():
        cells = [
            new_code_cell(f"workspace = Workspace('{workspace}')", id='open'),
            new_code_cell("copy = Workspace('copy', underlay=workspace)", id='overlay'),
            new_code_cell(f'%%write src/{PACKAGES[name]}/setup.py\nsetup()', id='write'),
        ]
        nbformat.write(new_notebook(cells=cells), folder / f'notebooks/{number}_{name}.ipynb')
    return folder


def write(scratch, *names):
    """Write files that say where they were written, into workspaces of a person."""
    for name in names:
        path = scratch / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
        (scratch / Path(name).parts[0] / OWNED).touch()


def written(scratch):
    """Return the files below `scratch` that are not empty, with what they say."""
    files = {str(p.relative_to(scratch)): p for p in scratch.rglob('*') if p.is_file()}
    return {name: path.read_text() for name, path in files.items() if path.stat().st_size}


@pytest.fixture
def mine(tmp_path):
    """Return a student's edition of version 0.3.0, with files in two workspaces."""
    folder = course(tmp_path / 'mine', OLD)
    shutil.copytree(folder, tmp_path / 'base')
    (tmp_path / 'base').rename(folder / update.BASE)
    write(
        folder / 'scratch',
        *('lesson_12/src/fleet_pkg/setup.py', 'lesson_12/.parts.json', 'lesson_12/notes.txt'),
        *('lesson_12.before_1/src/fleet_pkg/old.py', 'lesson_12_2/src/fleet_pkg/second.py'),
        *('lesson_14/src/scan_tools/package.xml', 'by_hand/src/mine/setup.py'),
    )
    return folder


IN_THEIR_PLACES = {
    f'{LAUNCH}/src/fleet_pkg/setup.py': 'lesson_12/src/fleet_pkg/setup.py',
    f'{LAUNCH}/.parts.json': 'lesson_12/.parts.json',
    f'{LAUNCH}/notes.txt': 'lesson_12/notes.txt',
    f'{LAUNCH}.before_1/src/fleet_pkg/old.py': 'lesson_12.before_1/src/fleet_pkg/old.py',
    f'{LAUNCH}_2/src/fleet_pkg/second.py': 'lesson_12_2/src/fleet_pkg/second.py',
    f'{LIBRARY}/src/scan_tools/package.xml': 'lesson_14/src/scan_tools/package.xml',
    'by_hand/src/mine/setup.py': 'by_hand/src/mine/setup.py',
}


def test_a_workspace_gets_the_name_of_its_lesson(tmp_path, mine, capsys):
    write(mine / 'scratch', 'lesson_12/build/CMakeCache.txt', 'lesson_12/copy/install/setup.bash')
    write(mine / 'scratch', 'lesson_12/copy/src/one/setup.py')
    archive = archive_of(course(tmp_path / 'newer', BY_NAME))
    for said in (True, False):  # the second update changes nothing
        assert update.main([str(archive), '--to', str(mine)]) == 0
        assert (f'now in scratch/{LAUNCH}, ' in capsys.readouterr().out) == said
        found = written(mine / 'scratch')
        # What was built held the old path.
        assert found.pop(f'{LAUNCH}/copy/src/one/setup.py')
        assert found == IN_THEIR_PLACES
        assert (mine / 'scratch' / LAUNCH / OWNED).exists()
        assert {path.name for path in (mine / 'notebooks').iterdir()} == {
            f'13_{LAUNCH}.ipynb',
            f'12_{LIBRARY}.ipynb',
        }


def test_two_workspaces_change_their_names(tmp_path, mine):
    archive = archive_of(course(tmp_path / 'newer', SWAPPED))
    for _ in range(2):
        assert update.main([str(archive), '--to', str(mine)]) == 0
        found = written(mine / 'scratch')
        assert found['lesson_14/src/fleet_pkg/setup.py'] == 'lesson_12/src/fleet_pkg/setup.py'
        assert found['lesson_12/src/scan_tools/package.xml'].startswith('lesson_14/')
        assert len(found) == len(IN_THEIR_PLACES)


def test_files_of_another_lesson_are_not_taken(tmp_path, mine, capsys):
    """Such as those of an older version, whose lesson 12 was another one."""
    shutil.rmtree(mine / 'scratch')
    write(mine / 'scratch', 'lesson_12/src/scan_tools/half_done.cpp')
    archive = archive_of(course(tmp_path / 'newer', BY_NAME))
    assert update.main([str(archive), '--to', str(mine)]) == 0
    assert 'scratch/lesson_12 has files of another lesson' in capsys.readouterr().out
    assert [*written(mine / 'scratch')] == ['lesson_12/src/scan_tools/half_done.cpp']
    assert not (mine / 'scratch' / LAUNCH).exists()


def test_after_the_program_of_version_0_3(tmp_path, mine):
    """It has brought the newer lessons, and knew nothing of workspaces."""
    newer = course(tmp_path / 'newer', BY_NAME)
    update.merge_folders(mine / update.BASE, mine, newer)
    update.merge_folders(mine / update.BASE, mine / update.BASE, newer)
    (mine / 'scratch' / LAUNCH / 'src').mkdir(parents=True)  # it was opened meanwhile
    (mine / 'scratch' / LAUNCH / OWNED).touch()
    assert update.main([str(archive_of(newer)), '--to', str(mine)]) == 0
    assert written(mine / 'scratch') == IN_THEIR_PLACES


def test_a_workspace_in_which_somebody_has_begun_anew_stays(tmp_path, mine):
    write(mine / 'scratch', f'{LAUNCH}/src/fleet_pkg/setup.py')
    archive = archive_of(course(tmp_path / 'newer', BY_NAME))
    assert update.main([str(archive), '--to', str(mine)]) == 0
    found = written(mine / 'scratch')
    at = f'{LAUNCH}/src/fleet_pkg/setup.py'
    assert found.pop(at) == at
    assert {*found.values()} == {*IN_THEIR_PLACES.values()}
    before = f'{LAUNCH}.before_2/src/fleet_pkg/setup.py'
    assert found[before] == IN_THEIR_PLACES[at]


@pytest.mark.parametrize('edition', [BY_NAME, SWAPPED])
@pytest.mark.parametrize('number', range(12))  # four workspaces, twice, and four notebooks
def test_an_interrupted_update_goes_on(tmp_path, mine, monkeypatch, edition, number):
    """An Interrupt before each change of a name, of notebooks and of workspaces."""
    archive = archive_of(course(tmp_path / 'newer', edition))
    count, real = 0, {name: getattr(Path, name) for name in ('rename', 'replace')}

    def interrupted(name):
        def change(path, target):
            nonlocal count
            count += 1
            if count == number + 1:
                raise KeyboardInterrupt
            return real[name](path, target)

        return change

    for name in real:
        monkeypatch.setattr(Path, name, interrupted(name))
    assert update.main([str(archive), '--to', str(mine)]) == 130
    assert {*written(mine / 'scratch').values()} == {*IN_THEIR_PLACES.values()}
    assert update.main([str(archive), '--to', str(mine)]) == 0
    found = written(mine / 'scratch')
    if edition is BY_NAME:
        assert found == IN_THEIR_PLACES
    else:
        assert found['lesson_14/src/fleet_pkg/setup.py'] == 'lesson_12/src/fleet_pkg/setup.py'
        assert found['lesson_12/src/scan_tools/package.xml'].startswith('lesson_14/')


def test_a_workspace_in_use_stops_the_update(tmp_path, mine, capsys):
    archive = archive_of(course(tmp_path / 'newer', BY_NAME))
    before = written(mine)
    lock = os.open(mine / 'scratch/.lesson_14.lock', os.O_CREAT | os.O_RDWR)
    fcntl.flock(lock, fcntl.LOCK_EX)
    assert update.main([str(archive), '--to', str(mine)]) == 1
    said = capsys.readouterr().err
    assert said == 'A lesson uses scratch/lesson_14: shut down its kernel, then try again.\n'
    assert written(mine) == before
    os.close(lock)
    assert update.main([str(archive), '--to', str(mine)]) == 0
    found = written(mine / 'scratch')
    assert found == IN_THEIR_PLACES


def test_a_clone(tmp_path):
    origin, clone = course(tmp_path / 'origin', OLD), tmp_path / 'clone'
    git(origin, 'init')
    git(origin, 'add', '.')
    git(origin, 'commit', '-m', 'old')
    git(tmp_path, 'clone', str(origin), str(clone))
    write(clone / 'scratch', *IN_THEIR_PLACES.values())
    shutil.rmtree(origin / 'notebooks')
    course(origin, BY_NAME)
    git(origin, 'add', '--all', '.')
    git(origin, 'commit', '-m', 'newer')
    for _ in range(2):
        assert update.main(['--to', str(clone)]) == 0
        assert written(clone / 'scratch') == IN_THEIR_PLACES


def test_on_a_hub_the_workspaces_are_apart_from_the_lessons(tmp_path, mine, monkeypatch):
    monkeypatch.setattr(update, 'ROOT', tmp_path / 'not_writable')
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    scratch = tmp_path / f'ros2_notebooks_{os.getuid()}'
    (mine / 'scratch').rename(scratch)
    newer = course(tmp_path / 'newer', BY_NAME)
    assert update.main([str(newer), '--to', str(mine)]) == 0
    assert written(scratch) == IN_THEIR_PLACES


def test_the_first_copy_of_the_lessons_renames_nothing(tmp_path, mine):
    newer = course(tmp_path / 'newer', BY_NAME)
    shutil.rmtree(mine / update.BASE)
    before = written(mine / 'scratch')
    assert update.update_from_folder(newer, mine, course=mine) == []
    assert written(mine / 'scratch') == before


def test_bad_notebooks_have_no_workspace(tmp_path, mine):
    bad = mine / update.BASE / f'notebooks/12_{LAUNCH}.ipynb'
    newer = course(tmp_path / 'newer', BY_NAME)
    for text in ('{ no notebook', json.dumps({'cells': 3})):
        bad.write_text(text)
        [one] = update.renamed_workspaces(mine / update.BASE, newer)
        assert (one.old, one.new, one.packages) == ('lesson_14', LIBRARY, {'scan_tools'})


# --- Version 0.3 with all that a student has ------------------------------------------------------


def lesson(workspace, *tasks):
    """Return a lesson. A task is its title, the id of its cells, and how its check is called."""
    cells = [new_code_cell(f"workspace = Workspace('{workspace}')", id='open')]
    for number, (title, id_, check) in enumerate(tasks, 1):
        cells += [
            new_markdown_cell(f'### ✎ Task {number}: {title}\n\nDo it.', id=f'{id_}-text'),
            new_code_cell('answer = 0', id=id_, metadata={'tags': ['exercise']}),
            new_code_cell(
                f'check({check}, answer)', id=f'{id_}-check', metadata={'tags': ['check']}
            ),
        ]
    return new_notebook(cells=cells)


OF_0_3 = lesson('lesson_02', ('Be the queue', 'queue', 4), ('Two executors', 'thread', 3))
SINCE = lesson(
    'lose_messages',
    ('Two executors', 'thread', "'two_executors'"),
    ('A new one', 'new', "'count_them'"),
    ('Be the queue', 'queue', "'be_the_queue'"),
)


@pytest.fixture
def solved(tmp_path):
    """Return an edition of version 0.3 whose two tasks a student has solved."""
    for folder in (tmp_path / 'mine', tmp_path / 'mine' / update.BASE):
        (folder / 'notebooks').mkdir(parents=True)
        nbformat.write(OF_0_3, folder / 'notebooks/02_lose_messages.ipynb')
    file = tmp_path / 'mine/notebooks/02_lose_messages.ipynb'
    file.write_text(file.read_text().replace('answer = 0', 'answer = 99'))
    write(tmp_path / 'mine/scratch', 'lesson_02/first.py')
    (tmp_path / 'progress.txt').write_text('lose_messages 3\nlose_messages 4\n')
    return tmp_path / 'mine'


def test_an_edition_of_version_0_3_loses_nothing(tmp_path, solved, monkeypatch, capsys):
    """Its lesson has another number, its tasks changed places, and one was put between them."""
    newer = tmp_path / 'newer'
    (newer / 'notebooks').mkdir(parents=True)
    nbformat.write(new_notebook(), newer / 'notebooks/00_start_here.ipynb')
    nbformat.write(SINCE, newer / 'notebooks/05_lose_messages.ipynb')
    assert update.main([str(archive_of(newer)), '--to', str(solved)]) == 0
    lesson = nbformat.read(solved / 'notebooks/05_lose_messages.ipynb', as_version=4)
    assert [cell.source for cell in lesson.cells if cell.cell_type == 'code'][1:] == [
        *('answer = 99', "check('two_executors', answer)"),
        *('answer = 0', "check('count_them', answer)"),
        *('answer = 99', "check('be_the_queue', answer)"),
    ]
    assert written(solved / 'scratch') == {'lose_messages/first.py': 'lesson_02/first.py'}
    monkeypatch.setenv(progress.FILE_VARIABLE, str(tmp_path / 'progress.txt'))
    monkeypatch.chdir(solved / 'notebooks')
    capsys.readouterr()
    progress.show()
    assert ' 2 of 3  task 2\n' in capsys.readouterr().out
