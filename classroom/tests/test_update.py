"""`make update`: newer lessons come in, and no word that a student has written is lost."""

import os
import shutil
import tarfile
from itertools import count

import nbformat
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nbformat.v4 import new_code_cell, new_notebook, new_output
from support.checkouts import git

from classroom import update
from helpers.notebook import AS_SAVED, MARK

LESSON = '02_lose.ipynb'


def notebook(cells):
    return new_notebook(cells=[new_code_cell(source, id=id_) for id_, source in cells])


def sources(cells):
    return [cell.source for cell in cells]


@st.composite
def changed(draw, cells, who):
    """Return cells after a few changes: written, added, removed, moved."""
    cells, numbers = list(cells), count()
    for what in draw(st.lists(st.sampled_from(['write', 'add', 'remove', 'move']), max_size=6)):
        at = draw(st.integers(0, len(cells)))
        word = f'{who}{next(numbers)}'
        if what == 'add':
            cells.insert(at, (word, f'# {word}'))
        elif at < len(cells):
            id_, source = cells.pop(at)
            if what == 'write':
                cells.insert(at, (id_, draw(st.sampled_from([f'{source}\n{word}', word, '']))))
            elif what == 'move':
                cells.insert(draw(st.integers(0, len(cells))), (id_, source))
    return cells


@st.composite
def histories(draw):
    """Return what was handed out, what a student and a teacher made of it, and what came next."""
    base = [(f'cell{i}', f'line {i}\nsame') for i in range(draw(st.integers(0, 5)))]
    mine, newer = draw(changed(base, 'mine')), draw(changed(base, 'teacher'))
    newest = draw(changed(newer, 'later'))
    return tuple(notebook(cells) for cells in (base, mine, newer, newest))


@settings(max_examples=200)
@given(histories())
def test_no_word_is_lost(history):
    base, mine, newer, newest = history
    old = {cell.id: cell.source for cell in base.cells}
    merged = update.merge(base, mine, newer)
    written = [cell for cell in mine.cells if cell.source != old.get(cell.id)]
    came = [cell for cell in newer.cells if cell.source != old.get(cell.id)]
    assert {*sources(written), *sources(came)} <= {*sources(merged.cells)}
    assert len({cell.id for cell in merged.cells}) == len(merged.cells)
    nbformat.validate(merged)
    # Nothing comes twice, and a later update keeps it, too.
    assert sources(update.merge(newer, merged, newer).cells) == sources(merged.cells)
    later = update.merge(newer, merged, newest)
    assert {*sources(written)} - {*sources(newer.cells)} <= {*sources(later.cells)}


@settings(max_examples=50)
@given(histories())
def test_what_one_side_changed_is_taken_as_it_is(history):
    base, mine, newer, _ = history
    assert sources(update.merge(base, base, newer).cells) == sources(newer.cells)
    kept = update.merge(base, mine, base)
    assert sorted(sources(kept.cells)) == sorted(sources(mine.cells))


def write(folder, name, cells):
    folder.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook(cells), folder / name)


def read(folder, name=LESSON):
    return sources(nbformat.read(folder / name, as_version=4).cells)


OLD = [('a', 'first'), ('b', 'second'), ('c', 'third')]
WRITTEN = [('a', 'first'), ('b', 'mine'), ('own', 'own'), ('c', 'third')]
NEWER = [('a', 'first'), ('b', 'newer'), ('c', 'newer third'), ('d', 'solution')]
BOTH = ['first', 'newer', update.YOURS, 'mine', 'own', 'newer third', 'solution']


def fill(folder, number, cells, helper):
    write(folder / 'notebooks', f'{number}_lose.ipynb', cells)
    (folder / 'helper.py').write_text(helper)
    (folder / 'run.sh').write_text('')
    (folder / 'run.sh').chmod(0o755)


@pytest.fixture
def mine(tmp_path):
    """Return what a student has made of a handout: a cell, an own file, a changed helper."""
    fill(tmp_path / 'mine', '02', OLD, 'old')
    shutil.copytree(tmp_path / 'mine', tmp_path / 'base')
    (tmp_path / 'base').rename(tmp_path / 'mine' / update.BASE)
    write(tmp_path / 'mine/notebooks', LESSON, WRITTEN)
    write(tmp_path / 'mine/notebooks', 'my_own.ipynb', [('x', 'x')])
    return tmp_path / 'mine'


def archive_of(folder):
    """Pack a folder as `make handout` does."""
    course = folder.parent / 'course'
    shutil.copytree(folder, course)
    shutil.copytree(folder, course / update.BASE)
    file = folder.parent / 'newer course.tar.gz'
    with tarfile.open(file, 'w:gz') as archive:
        archive.add(course, 'ros2_notebooks')
    return file


def test_an_archive_brings_newer_and_renumbered_lessons(tmp_path, mine, capsys):
    fill(tmp_path / 'newer', '03', NEWER, 'newer')
    archive = archive_of(tmp_path / 'newer')
    for _ in range(2):
        assert update.main([str(archive), '--to', str(mine)]) == 0
        assert read(mine / 'notebooks', '03_lose.ipynb') == BOTH
        names = {path.name for path in (mine / 'notebooks').iterdir()}
        assert names == {'03_lose.ipynb', 'my_own.ipynb'}
        assert (mine / 'helper.py').read_text() == 'newer'
        assert os.access(mine / 'run.sh', os.X_OK)
    assert len(list(mine.iterdir())) == 4
    assert '.yours' not in capsys.readouterr().out


def test_a_lesson_with_another_number_and_nothing_else_stays(tmp_path, mine):
    write(mine / 'notebooks', LESSON, OLD)
    fill(tmp_path / 'newer', '03', OLD, 'newer')
    assert update.main([str(tmp_path / 'newer'), '--to', str(mine)]) == 0
    assert read(mine / 'notebooks', '03_lose.ipynb') == sources(notebook(OLD).cells)
    assert not (mine / 'notebooks' / LESSON).exists()


def test_a_file_that_both_changed_is_set_aside(tmp_path, mine, capsys):
    (mine / 'helper.py').write_text('my helper')
    (mine / 'notebooks' / LESSON).write_text('{ no notebook')
    fill(tmp_path / 'newer', '02', NEWER, 'newer')
    assert update.main([str(tmp_path / 'newer'), '--to', str(mine)]) == 0
    assert capsys.readouterr().out.count('yours is now') == 2
    assert (mine / 'helper.py.yours').read_text() == 'my helper'
    assert (mine / 'helper.py').read_text() == 'newer'
    assert (mine / 'notebooks' / f'{LESSON}.yours').read_text() == '{ no notebook'
    assert read(mine / 'notebooks') == sources(notebook(NEWER).cells)


def test_a_clone_follows_its_origin(tmp_path, capsys):
    origin, clone = tmp_path / 'origin', tmp_path / 'clone'
    fill(origin, '02', OLD, 'old')
    git(origin, 'init')
    git(origin, 'add', '.')
    git(origin, 'commit', '-m', 'old')
    git(tmp_path, 'clone', str(origin), str(clone))
    write(clone / 'notebooks', LESSON, WRITTEN)
    (origin / 'notebooks' / LESSON).unlink()
    fill(origin, '03', NEWER, 'newer')
    git(origin, 'add', '--all', '.')
    git(origin, 'commit', '-m', 'newer')
    for _ in range(2):
        assert update.main(['--to', str(clone)]) == 0
        assert read(clone / 'notebooks', '03_lose.ipynb') == BOTH
        assert [path.name for path in (clone / 'notebooks').iterdir()] == ['03_lose.ipynb']
        git(clone, 'diff', '--exit-code', 'HEAD', '--', 'helper.py')
    git(clone, 'commit', '-am', 'mine')
    fill(origin, '03', OLD, 'newest')
    git(origin, 'commit', '-am', 'newest')
    before = read(clone / 'notebooks', '03_lose.ipynb')
    capsys.readouterr()
    assert update.main(['--to', str(clone)]) == 1
    assert 'commits of its own' in capsys.readouterr().err
    assert read(clone / 'notebooks', '03_lose.ipynb') == before


def shown(cells):
    """Return a lesson of the repository, whose cells printed something there."""
    lesson = notebook(cells)
    lesson.metadata[MARK] = AS_SAVED
    for cell in lesson.cells:
        cell.outputs = [new_output('stream', text='what the repository saw')]
    return lesson


def test_outputs_are_those_that_the_student_saw(tmp_path):
    """As JupyterLab shows no outputs of a lesson that is marked as the repository's."""
    mine = notebook(WRITTEN)
    for cell in mine.cells:
        cell.outputs = [new_output('stream', text='what I saw')]
    for folder, lesson in (('mine', mine), (f'mine/{update.BASE}', shown(OLD))):
        (tmp_path / folder).mkdir(exist_ok=True)
        nbformat.write(lesson, tmp_path / folder / LESSON)
    (tmp_path / 'newer').mkdir()
    nbformat.write(shown(NEWER), tmp_path / 'newer' / LESSON)
    for _ in range(2):  # the next update changes nothing
        assert update.main([str(tmp_path / 'newer'), '--to', str(tmp_path / 'mine')]) == 0
        lesson = nbformat.read(tmp_path / 'mine' / LESSON, as_version=4)
        assert sources(lesson.cells) == BOTH
        assert MARK not in lesson.metadata
        saw = {c.source for c in lesson.cells if c.cell_type == 'code' and c.outputs}
        assert saw == {'first', 'mine', 'own'}
        assert 'what the repository saw' not in str(lesson)


@pytest.mark.parametrize('name', ['../mine/helper.py', '/tmp/helper.py', 'link/helper.py', 'pipe'])
def test_an_archive_that_writes_elsewhere_is_refused(tmp_path, mine, capsys, name):
    file = tmp_path / 'a.tar'
    with tarfile.open(file, 'w') as archive:
        if name.startswith('link'):
            link = tarfile.TarInfo('link')
            link.type, link.linkname = tarfile.SYMTYPE, str(mine)
            archive.addfile(link)
        member = tarfile.TarInfo(name)
        if name == 'pipe':
            member.type = tarfile.FIFOTYPE
        archive.addfile(member)
    assert update.main([str(file), '--to', str(mine)]) == 1
    assert 'is no archive of `make handout`' in capsys.readouterr().err
    assert (mine / 'helper.py').read_text() == 'old'
    assert len(list(mine.iterdir())) == 4


def test_an_unreadable_archive_gives_one_sentence(tmp_path, mine, capsys):
    text, other = tmp_path / 'a.tar.gz', tmp_path / 'b.tar.gz'
    text.write_text('no archive')
    with tarfile.open(other, 'w:gz') as archive:
        archive.add(text, 'a.txt')
    for arguments in ([], [str(text)], [str(other)], [str(tmp_path / 'missing')]):
        assert update.main([*arguments, '--to', str(mine)]) == 1
        assert capsys.readouterr().err.count('\n') == 1
    assert read(mine / 'notebooks') == sources(notebook(WRITTEN).cells)
    assert len(list(mine.iterdir())) == 4
