"""The copies that `make present` shows: they keep what was typed, and lessons stay as they are."""

import socket
import subprocess

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook, new_output

from classroom.deck.copies import Copies
from classroom.plan import plan_of
from classroom.present import main
from helpers.lesson import ROOT, Lesson, lessons, minutes_of_note, path_of
from tools import lab
from tools.lessons.timetables import timetables

FILES = ('01_publish.ipynb', '02_lose.ipynb')


@pytest.fixture
def root(tmp_path):
    folder = tmp_path / 'notebooks'
    folder.mkdir()
    for name in FILES:
        output = new_output('stream', text='lost: 3\n')
        cell = new_code_cell('run()', outputs=[output], execution_count=4)
        nbformat.write(new_notebook(cells=[cell]), folder / name)
    return tmp_path


def copy_of(root, number=2, new=False):
    """Make the copies, and return the path of one."""
    path = root / 'notebooks' / FILES[number - 1]
    Copies(root).make([path], new)
    return root / 'presentation' / path.name


def change(path, source):
    notebook = nbformat.read(path, as_version=4)
    notebook.cells[0].source = source
    nbformat.write(notebook, path)


def code(path):
    return nbformat.read(path, as_version=4).cells[0]


def test_a_copy_has_no_outputs_and_the_lesson_keeps_its_own(root):
    before = (root / 'notebooks/02_lose.ipynb').read_bytes()
    copy = copy_of(root)
    assert code(copy).outputs == []
    assert code(copy).execution_count is None
    assert code(copy).metadata.slideshow.slide_type == 'slide'
    assert (root / 'notebooks/02_lose.ipynb').read_bytes() == before


def test_what_was_typed_is_kept_until_thrown_away(root):
    other, copy = copy_of(root, 1), copy_of(root)
    assert Copies(root).used(copy.name) == ''
    change(copy, 'typed()')
    change(other, 'typed()')
    change(root / 'notebooks/02_lose.ipynb', 'newer()')
    assert code(copy_of(root)).source == 'typed()'
    assert Copies(root).used(copy.name)
    assert nbformat.read(copy, as_version=4).metadata.deck.used  # the deck says it
    assert code(copy_of(root, new=True)).source == 'newer()'
    assert code(other).source == 'typed()'


def test_what_a_teacher_has_answered_in_the_lesson_is_not_in_the_copy(root):
    path = root / 'notebooks/02_lose.ipynb'
    cells = [
        new_code_cell('my_guess = guess("How many?", ...)', metadata={'tags': ['predict']}),
        new_code_cell('# Your code', metadata={'tags': ['exercise']}),
        new_code_cell('remember(one_name=..., other_name=...)'),
        new_code_cell('run()'),
    ]
    nbformat.write(new_notebook(cells=cells), path)
    for command in (['init', '-q'], ['add', '.'], ['commit', '-qm', 'Deliver']):
        author = ['-c', 'user.name=a', '-c', 'user.email=a@b.c']
        subprocess.run(['git', *author, *command], cwd=root, check=True)
    delivered = [cell.source for cell in nbformat.read(path, as_version=4).cells]
    notebook = nbformat.read(path, as_version=4)
    for cell in notebook.cells:
        cell.source = f'mine = {len(cell.source)}'
    nbformat.write(notebook, path)
    sources = [cell.source for cell in nbformat.read(copy_of(root), as_version=4).cells]
    # What a teacher has changed elsewhere is meant for the class.
    assert sources == [*delivered[:3], notebook.cells[3].source]


def test_what_was_run_is_kept_too(root):
    copy = copy_of(root)
    notebook = nbformat.read(copy, as_version=4)
    notebook.cells[0].execution_count = 1
    nbformat.write(notebook, copy)
    change(root / 'notebooks/02_lose.ipynb', 'newer()')
    assert code(copy_of(root)).source == 'run()'
    assert Copies(root).used(copy.name)


def test_a_copy_that_cannot_be_read_is_kept_until_thrown_away(root):
    copy = copy_of(root)
    copy.write_text('{ broken off')
    copy_of(root)
    assert copy.read_text() == '{ broken off'
    assert Copies(root).used(copy.name)
    assert code(copy_of(root, new=True)).source == 'run()'


def test_the_place_of_the_deck_is_no_use(root):
    copy = copy_of(root)
    notebook = nbformat.read(copy, as_version=4)
    notebook.metadata.deck |= {'place': notebook.cells[0].id, 'began': 1.5}
    nbformat.write(notebook, copy)
    assert Copies(root).used(copy.name) == ''
    copy_of(root)
    assert nbformat.read(copy, as_version=4).metadata.deck.began == 1.5
    copy_of(root, new=True)
    assert 'began' not in nbformat.read(copy, as_version=4).metadata.deck


def test_an_untouched_copy_follows_its_lesson(root):
    other, copy = copy_of(root, 1), copy_of(root)
    for file in FILES:
        change(root / 'notebooks' / file, 'newer()')
    copy_of(root)
    assert code(copy).source == code(other).source == 'newer()'


@pytest.mark.parametrize('title', [timetable.title for timetable in timetables()])
def test_a_timetable_has_its_steps_and_minutes_only(tmp_path, title):
    (tmp_path / 'notebooks').symlink_to(ROOT / 'notebooks')
    copies = Copies(tmp_path, title)
    copies.make([])
    plan = plan_of(title)
    shown = {name: nbformat.read(copies.folder / name, as_version=4) for name in plan.steps}
    minutes = {
        name: sum(minutes_of_note(cell.source) for cell in notebook.cells)
        for name, notebook in shown.items()
    }
    known = {lesson.file: lesson for lesson in lessons()}
    assert minutes == {name: known[name].minutes_of(steps) for name, steps in plan.steps.items()}
    for name, following in zip(plan.steps, [*plan.steps][1:], strict=False):
        assert f']({following})' in shown[name].cells[-1].source


def test_a_slide_says_whether_students_write_its_task_today(tmp_path):
    """As teaching.md says it of the 90 minutes: tasks 3 and 4 of lesson 02."""
    (tmp_path / 'notebooks').symlink_to(ROOT / 'notebooks')
    copies = Copies(tmp_path, '90 minutes')
    copies.make([])
    path = path_of('lose_messages')
    says = {}
    for task in Lesson(path.name, nbformat.read(copies.folder / path.name, as_version=4)).tasks:
        first, empty, said, *rest = task.heading.source.splitlines()
        assert first.startswith(f'### ✎ Task {task.number}')
        assert (empty, rest[0]) == ('', '')
        says[task.name] = said
    run = dict.fromkeys(says, '**Today: run the solution.**')
    write = dict.fromkeys(['two_executors', 'be_the_queue'], '**Today: write it.**')
    assert says == run | write
    other = nbformat.read(copies.folder / path_of('publish_and_subscribe').name, as_version=4)
    assert not any('Today:' in cell.source for cell in other.cells)


def test_a_timetable_is_named_by_a_word():
    assert plan_of('90').title == '90 minutes'
    assert plan_of('half').title == 'Half a day'


@pytest.mark.parametrize(
    'wrong',
    [['--lessons', ''], ['--lessons', '03'], ['--lessons', '01 03'], ['--plan', 'tomorrow']],
)
def test_a_wrong_name_gives_one_sentence(root, capsys, wrong):
    assert main([*wrong, '--root', str(root)]) == 1
    assert capsys.readouterr().err.count('\n') == 1


def test_a_port_in_use_gives_one_sentence(tmp_path):
    with socket.create_server(('localhost', 0)) as taken:
        port = taken.getsockname()[1]
        options = lab.parser('').parse_args(['--port', str(port), '--root', str(tmp_path)])
        with pytest.raises(SystemExit, match=rf'^Port {port} is in use[^\n]+$'):
            lab.open_lab(options, 'lab')
