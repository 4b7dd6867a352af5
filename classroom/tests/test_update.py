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


IMPORTS_OF_0_2 = """import math

from helpers.checks import check, compare_prediction
from helpers.classroom import guess
from helpers.session import ros_session"""
STARTER = """class MinimalSubscriber(Node):
    def listener_callback(self, message):
        # Your code: keep the text, and log it.
        pass"""
PART_1_OF_0_2 = """# ✔ Check of task 1, part 1 of 2
def hear(*texts):
    return ask(MinimalSubscriber, texts)"""
PART_2_OF_0_2 = """# ✔ Check of task 1, part 2 of 2
def keeps(*texts):
    return hear(*texts) == [*texts] or 'self.heard is not that'


check(1, ('it keeps one text', lambda: keeps('one'), 'A list has .append(...).'))"""
CHECK_OF_TASK_2_OF_0_2 = """# ✔ Check of task 2
check(2, ('nodes spin', lambda: all_tick(2), 'One executor.'))"""
HARNESS_OF_0_2 = """# Ask nodes
def ask(node, texts):
    return ros_session(node, texts)"""


def lesson_of_0_2():
    """Return a piece of lesson 01 of version 0.2, which had the code of its checks in it."""
    cells = [
        tagged('lesson-01-03', IMPORTS_OF_0_2),
        tagged('support', HARNESS_OF_0_2, 'harness'),
        tagged('lesson-01-07', STARTER, 'exercise'),
        tagged('check-01-1', PART_1_OF_0_2, 'check'),
        tagged('check-01-1-b', PART_2_OF_0_2, 'check'),
        tagged('check-01-2', CHECK_OF_TASK_2_OF_0_2, 'check'),
    ]
    return new_notebook(cells=cells, metadata={MARK: AS_SAVED})


def newer_lesson():
    """Return the same piece with checks of one line."""
    imports = 'from helpers.checks.lessons.publish_and_subscribe import check'
    cells = [
        tagged('lesson-01-03', imports),
        tagged('lesson-01-07', STARTER, 'exercise'),
        tagged('check-01-1', 'check(1, MinimalSubscriber)', 'check'),
        tagged('check-01-2', 'check(2, spin_together)', 'check'),
    ]
    return new_notebook(cells=cells, metadata={MARK: AS_SAVED})


def tagged(id_, source, *tags):
    output = new_output('stream', text=f'what {id_} printed for the repository')
    return new_code_cell(source, id=id_, metadata={'tags': [*tags]}, outputs=[output])


def by_student(lesson, **written):
    """Return a lesson as JupyterLab saves it, with text that a student has written into cells."""
    lesson = nbformat.from_dict(lesson)
    del lesson.metadata[MARK]
    for cell in lesson.cells:
        cell.source += written.get(cell.id.replace('-', '_'), '')
        cell.outputs = [new_output('stream', text='what I saw')]
    lesson.cells.insert(3, new_code_cell('print("my own")', id='own'))
    return lesson


def put(folder, lesson):
    folder.mkdir(parents=True, exist_ok=True)
    nbformat.write(lesson, folder / '01_publish_and_subscribe.ipynb')


def bring_over(tmp_path, mine, base):
    """Update a student's lesson, of which `base` was handed out, and return what it then is."""
    put(tmp_path / 'mine', mine)
    put(tmp_path / 'mine' / update.BASE, base)
    put(tmp_path / 'newer', newer_lesson())
    assert update.main([str(tmp_path / 'newer'), '--to', str(tmp_path / 'mine')]) == 0
    return nbformat.read(tmp_path / 'mine/01_publish_and_subscribe.ipynb', as_version=4)


ANSWERED = {'lesson_01_07': '\n        self.heard.append(message.data)'}
CHANGED = {
    'lesson_01_03': '\nimport numpy  # mine',
    'support': '\n# a slip in what supports',
    'check_01_1': '\n# a slip in part 1',
    'check_01_1_b': '\n# a slip in part 2',
}


def test_a_lesson_of_version_0_2_gets_checks_of_one_line(tmp_path, capsys):
    lesson = bring_over(tmp_path, by_student(lesson_of_0_2(), **ANSWERED), lesson_of_0_2())
    answer = STARTER + ANSWERED['lesson_01_07']
    newer = sources(newer_lesson().cells)
    assert sources(lesson.cells) == [newer[0], answer, 'print("my own")', *newer[2:]]
    assert 'kept as text' not in capsys.readouterr().out
    # JupyterLab shows no outputs of a lesson that is marked as the repository's.
    assert MARK not in lesson.metadata
    outputs = [cell.outputs[0].text if cell.get('outputs') else '' for cell in lesson.cells]
    assert outputs == ['', 'what I saw', '', '', '']


@pytest.mark.parametrize('after_program_of_0_2', [False, True])
def test_changed_checks_of_version_0_2_are_kept_as_text(tmp_path, capsys, after_program_of_0_2):
    mine = by_student(lesson_of_0_2(), **ANSWERED, **CHANGED)
    base = lesson_of_0_2()
    if after_program_of_0_2:  # it has merged, and left as code what no longer runs
        mine, base = update.merge(base, mine, newer_lesson()), newer_lesson()
    lesson = bring_over(tmp_path, mine, base)
    assert 'now kept as text: 4.' in capsys.readouterr().out
    code = sources(cell for cell in lesson.cells if cell.cell_type == 'code')
    newer = sources(newer_lesson().cells)
    own = 'print("my own")'
    assert code == [newer[0], STARTER + ANSWERED['lesson_01_07'], own, *newer[2:]]
    text = sources(cell for cell in lesson.cells if cell.cell_type == 'markdown')
    assert all(update.NO_LONGER_RUNS in cell for cell in text)
    kept = (IMPORTS_OF_0_2, HARNESS_OF_0_2, PART_1_OF_0_2, PART_2_OF_0_2)
    for cell, source, slip in zip(text, kept, CHANGED.values(), strict=True):
        assert f'```python\n{source}{slip}\n```' in cell
    # The next update changes nothing, and has nothing to say.
    assert bring_over(tmp_path, lesson, newer_lesson()) == lesson
    assert 'kept as text' not in capsys.readouterr().out


def test_a_copy_of_a_check_stays_code(tmp_path):
    mine = by_student(newer_lesson())
    mine.cells.append(tagged('copy', 'check(1, Another)', 'check'))
    assert bring_over(tmp_path, mine, newer_lesson()) == mine


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
