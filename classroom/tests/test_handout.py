"""`make handout`: what students get, and what they get with it for a room without a network."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output, new_raw_cell
from support.checkouts import git
from support.small_checkout import ALL, Checkout

from classroom import handout, update
from helpers.lesson import PICTURES, ROOT, kept_solution, lessons

SOLVED = '%%solution 1\nsolved = 2'
FILES = {'README.md', 'Makefile', 'notebooks/01_publish.ipynb', 'classroom/update.py'}
LESSONS = '<!-- made by `make notebooks`: lessons -->\n\n| 01 |\n\n<!-- end -->'


@pytest.fixture
def checkout(tmp_path):
    """Return a clone with a lesson, and with files that no student needs."""
    root = tmp_path / 'check out'
    (root / 'notebooks').mkdir(parents=True)
    said = [new_output('stream', text='1')]
    cells = [
        new_code_cell('start = 1', id='start', outputs=said, metadata={'tags': ['exercise']}),
        new_raw_cell('For the instructor', id='note', metadata={'tags': ['notes']}),
        new_code_cell(SOLVED, id='solution', metadata={'tags': ['solution']}),
        new_markdown_cell('## 7. For instructors', id='instructors'),
    ]
    nbformat.write(new_notebook(cells=cells), root / 'notebooks/01_publish.ipynb')
    others = 'tests/test_a.py', 'classroom/hub/set_up.sh', handout.STUDENTS, handout.COMMANDS
    for name in (*FILES, *others):
        if not name.endswith('.ipynb'):
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(name)
    (root / 'README.md').write_text(f'for all: {LESSONS}')
    (root / handout.STUDENTS).write_text('for students: <!-- the lessons -->')
    git(root, 'init')
    git(root, 'add', '.')
    git(root, 'commit', '-m', 'all')
    (root / 'my draft').write_text('not in git')
    return root


def unpack(root, folder, *options):
    assert handout.main(['--root', str(root), *options]) == 0
    with tarfile.open(root / 'handout/ros2_notebooks.tar.gz') as archive:
        archive.extractall(folder)
    return folder / 'ros2_notebooks'


def cells_of(course):
    return [c.source for c in nbformat.read(course / 'notebooks/01_publish.ipynb', 4).cells]


def test_a_handout_is_a_students(checkout, tmp_path, capsys):
    course = unpack(checkout, tmp_path / 'home')
    printed = capsys.readouterr().out
    assert re.search(r'ros2_notebooks\.tar\.gz: 0\.0 MB, no packages\.', printed)
    files = {str(p.relative_to(course)) for p in course.rglob('*') if p.is_file()}
    assert files == FILES | {f'{update.BASE}/{name}' for name in FILES}
    assert cells_of(course) == ['start = 1', SOLVED]
    assert '"output_type"' not in (course / 'notebooks/01_publish.ipynb').read_text()
    assert (course / 'README.md').read_text() == 'for students: | 01 |'
    assert (course / 'Makefile').read_text() == handout.COMMANDS


@pytest.fixture(scope='module')
def archive(tmp_path_factory):
    """Return the unpacked archive of this checkout, as it was committed."""
    folder = tmp_path_factory.mktemp('archive')
    with tarfile.open(handout.handout(ROOT, folder / 'ros2_notebooks.tar.gz')) as files:
        files.extractall(folder)
    return folder / 'ros2_notebooks'


def test_its_documents_name_only_what_it_has(archive):
    for name in ('README.md', 'environment.md'):
        text = (archive / name).read_text(encoding='utf-8')
        links = re.findall(r'\]\((?!https?:)([^)#]*)(?:#([^)]*))?\)', text)
        assert links
        for file, heading in links:
            target = archive / (file or name)
            assert target.exists(), f'{name} links to {file}'
            if heading:
                headings = re.findall(r'^#+ (.+)$', target.read_text(encoding='utf-8'), re.M)
                slugs = {re.sub(r'[^\w -]', '', h).lower().replace(' ', '-') for h in headings}
                assert heading in slugs, f'{name} links to #{heading}'
        commands = {*re.findall(r'`make ([a-z-]+)', text)}
        assert commands <= {'help', 'lab', 'update', 'set_up'}, name
    assert 'For instructors' not in (archive / 'notebooks/00_start_here.ipynb').read_text()


def test_it_installs_itself(archive, wheels, tmp_path):
    course = Checkout(tmp_path, wheels, archive)
    answer = course.set_up()
    assert answer.returncode == 0, answer.stderr
    assert course.installed() == ALL


def test_its_commands_work(archive):
    """Only what a student needs; and what it starts is there."""
    # Without what a `make` around the tests would add.
    make = ['make', '--no-print-directory']
    said = subprocess.run([*make, 'help'], cwd=archive, capture_output=True, text=True).stdout
    assert re.findall(r'^  make ([a-z]+)', said, re.M) == ['help', 'lab', 'update']
    assert 'OUTPUTS' not in said
    assert 'pytest' not in (archive / 'Makefile').read_text()
    assert len(said.splitlines()) == 3
    for command in ('lab', 'update'):
        planned = [*make, '--dry-run', command]
        said = subprocess.run(planned, cwd=archive, capture_output=True, text=True)
        assert not said.returncode, said.stderr
    environment = {'PATH': os.environ['PATH'], 'PYTHONPATH': str(archive)}
    for module in ('tools.lab', 'classroom.update', 'helpers.machine.doctor'):
        code = f'import {module}; assert {module}.__file__.startswith({str(archive)!r})'
        command = [sys.executable, '-c', code]
        done = subprocess.run(command, cwd=archive, env=environment, capture_output=True, text=True)
        assert not done.returncode, done.stderr
    locks = [path.name for path in archive.glob('**/*.lock') if update.BASE not in path.parts]
    assert sorted(locks) == ['requirements-uv.lock', 'requirements.lock']


def test_what_is_not_committed_is_named_and_left_out(checkout, tmp_path, capsys):
    (checkout / handout.COMMANDS).write_text('half done')
    course = unpack(checkout, tmp_path / 'home')
    assert (course / 'Makefile').read_text() == handout.COMMANDS
    said = capsys.readouterr().out
    assert re.search(r'^Not committed, so not in it: classroom/handout.mk, .*my draft', said, re.M)


def test_solutions_may_come_later(checkout, tmp_path, capsys):
    course = unpack(checkout, tmp_path / 'home', '--solutions', 'no')
    assert cells_of(course) == ['start = 1']
    lesson = course / 'notebooks/01_publish.ipynb'
    lesson.write_text(lesson.read_text().replace('start = 1', 'start = 99'))
    unpack(checkout, tmp_path / 'later')
    archive = checkout / 'handout/ros2_notebooks.tar.gz'
    assert update.main([str(archive), '--to', str(course)]) == 0
    assert cells_of(course) == ['start = 99', SOLVED]
    assert 'Lessons 01 now have their solutions.' in capsys.readouterr().out


def test_a_lesson_that_is_new_is_none_whose_solutions_came(checkout, tmp_path, capsys):
    course = unpack(checkout, tmp_path / 'home')
    shutil.copy(checkout / 'notebooks/01_publish.ipynb', checkout / 'notebooks/02_lose.ipynb')
    git(checkout, 'add', '.')
    git(checkout, 'commit', '-m', 'another')
    unpack(checkout, tmp_path / 'later')
    capsys.readouterr()
    archive = checkout / 'handout/ros2_notebooks.tar.gz'
    assert update.main([str(archive), '--to', str(course)]) == 0
    assert 'solutions' not in capsys.readouterr().out


def test_solutions_of_the_weeks_before(checkout, tmp_path):
    second = checkout / 'notebooks/02_lose.ipynb'
    shutil.copy(checkout / 'notebooks/01_publish.ipynb', second)
    for solutions, have in (('01', [True, False]), ('01 lose', [True, True]), ('no', [False] * 2)):
        handout.write_lessons(checkout / 'notebooks', tmp_path / 'hub', solutions=solutions)
        lessons = sorted((tmp_path / 'hub').glob('*.ipynb'))
        assert ['solved = 2' in lesson.read_text() for lesson in lessons] == have


@pytest.mark.parametrize('borrow', [True, False])
def test_without_solutions_no_cell_speaks_of_them(tmp_path, borrow):
    handout.write_lessons(ROOT / 'notebooks', tmp_path, solutions='no', borrow=borrow)
    texts, lent = '', 0
    for one in lessons(tmp_path):
        texts += '\n'.join(cell.source for cell in one.cells)
        lent += sum(bool(kept_solution(cell)) for task in one.tasks for cell in task.checks)
    assert re.findall(r'.*\bsolutions?\b.*', texts, re.IGNORECASE) == []
    assert ('%borrow' in texts) == borrow
    assert bool(lent) == borrow


def test_the_lessons_of_a_hub_have_their_pictures(tmp_path):
    source, lessons = ROOT / 'notebooks', tmp_path / 'lessons'
    for _ in range(2):  # a hub starts again
        handout.write_lessons(source, lessons)
    names = {path.name for path in (source / PICTURES).iterdir()}
    assert {path.name for path in (lessons / PICTURES).iterdir()} == names


def test_packages_are_those_of_the_wanted_pythons(tmp_path, monkeypatch):
    """Also if the folder for temporary files has one with the name of one of Python's modules."""
    (tmp_path / 'copy.py').write_text('raise RuntimeError')
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    monkeypatch.setenv('TMPDIR', str(tmp_path))
    head, *blocks = re.split(r'\n(?=[a-z])', (ROOT / 'tools/locks/requirements.lock').read_text())
    names = ('cycler', 'markupsafe', 'empy')
    # One that only some Pythons need, by their last number, too: 3.11.2 of Debian 12 is one.
    some = [block for block in blocks if "python_full_version < '3.11.5'" in block.splitlines()[0]]
    chosen = [block for block in blocks if block.startswith(names)] + some
    lock = tmp_path / 'requirements.lock'
    lock.write_text('\n'.join([head, *chosen]))
    shutil.copy(ROOT / 'tools/locks/requirements-uv.lock', tmp_path)
    handout.download(lock, tmp_path / 'wheels', ('3.11', '3.12'))
    found = sorted(path.name for path in (tmp_path / 'wheels').iterdir())
    assert [sum('cp311-' in n for n in found), sum('cp312-' in n for n in found)] == [1, 1]
    assert sum(name.startswith('cycler') for name in found) == 1
    assert sum(name.startswith('empy') for name in found) == 1
    assert (tmp_path / 'wheels/pythons').read_text() == '3.12 3.11'  # newest first
    assert len(found) == len(chosen) + 3  # one for each Python, uv, and the list


def test_bad_input_gives_one_sentence(checkout, tmp_path, capsys):
    assert handout.main(['--root', str(tmp_path)]) == 1
    assert 'clone' in capsys.readouterr().err
    locks = checkout / 'tools/locks'
    locks.mkdir(parents=True, exist_ok=True)
    (locks / 'requirements.lock').write_text('# Every wheel exists for Python 3.12 3.11\na==1\n')
    (locks / 'requirements-uv.lock').write_text('\nuv==1\n')
    git(checkout, 'add', '.')
    git(checkout, 'commit', '-m', 'locks')
    assert handout.main(['--root', str(checkout), '--solutions', 'of week 1']) == 1
    assert "no single lesson 'of'" in capsys.readouterr().err
    assert handout.main(['--root', str(checkout), '--wheels', '3.9']) == 1
    assert capsys.readouterr().err.count('\n') == 1
    assert not (checkout / 'handout').exists()
