"""Lessons and tasks are put in, moved and taken out: what a student did stays the student's.

In the student's edition, in the progress, in a class that goes on, and in graded work.
"""

import json

import nbformat
import pytest
from support.lessons import lesson, task

from classroom import update
from classroom.class_page.lessons import Known
from classroom.class_page.store import ClassStore
from classroom.grade.answers import Handed, answers_of, lesson_of
from classroom.grade.results import job_of
from classroom.tests.support.classes import event
from helpers.checks import progress
from helpers.lesson import Node, cells_of, outline

MINE = 'x = 2  # mine'
# As it was handed out: lesson 05 has the tasks a, b and c. The student has solved b.
OLD = lesson(*task('a', 1, 'Aim'), *task('b', 2, 'Brake'), *task('c', 3, 'Count'))
CHANGES = {
    'a task was put in above': [*task('new', 1, 'New'), *task('a', 2, 'Aim')]
    + [*task('b', 3, 'Brake'), *task('c', 4, 'Count')],
    'the task was moved to the end': [*task('a', 1, 'Aim'), *task('c', 2, 'Count')]
    + task('b', 3, 'Brake', ' ★'),
    'another one was taken out': [*task('b', 1, 'Brake'), *task('c', 2, 'Count')],
    'it was taken out itself': [*task('a', 1, 'Aim'), *task('c', 2, 'Count')],
}


@pytest.fixture(params=CHANGES, ids=list(CHANGES))
def newer(request):
    """The lesson after a change, which is lesson 06 now."""
    return lesson(*CHANGES[request.param], file='06_keep_it.ipynb')


def has_b(newer):
    return 'b' in [one.name for one in newer.tasks]


def handed_in():
    """Return the notebook of the old edition as the student hands it in, as bytes."""
    notebook = json.loads(nbformat.writes(OLD.notebook))
    for cell in notebook['cells']:
        if cell['id'] == 'b-exercise':
            cell['source'] = MINE
    return json.dumps(notebook).encode()


def test_in_the_edition_of_the_student(newer, tmp_path):
    for folder, one in (('base', OLD), ('newer', newer)):
        (tmp_path / folder / 'notebooks').mkdir(parents=True)
        nbformat.write(one.notebook, tmp_path / folder / 'notebooks' / one.file)
    mine = tmp_path / 'mine'
    (mine / 'notebooks').mkdir(parents=True)
    (mine / 'notebooks' / OLD.file).write_bytes(handed_in())
    update.merge_folders(tmp_path / 'base', mine, tmp_path / 'newer')
    [path] = (mine / 'notebooks').glob('*.ipynb')
    merged = outline(path)
    assert merged.file == newer.file
    written = [one.name for one in merged.tasks for c in one.exercises if c.source == MINE]
    assert written == (['b'] if has_b(newer) else [])
    assert MINE in [cell.source for cell in merged.code_cells()]  # never lost


def test_in_the_progress(newer, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('JPY_SESSION_NAME', OLD.file)
    monkeypatch.setenv(progress.FILE_VARIABLE, str(tmp_path / 'progress.txt'))
    nbformat.write(lesson(file='00_start.ipynb').notebook, '00_start.ipynb')
    progress.record('b')
    nbformat.write(newer.notebook, newer.file)
    assert progress.total() == f'{int(has_b(newer))} of {len(newer.tasks)} tasks'


def test_in_a_class_that_goes_on(newer, tmp_path):
    file = tmp_path / 'class.sqlite'
    store = ClassStore(file, [Known(OLD)])
    seat = store.join('ada', '')
    told = event('task', task='b', solved=True) | {'lesson': OLD.name}
    assert store.take(seat, [told]) == ''
    store.close()
    store = ClassStore(file, [Known(newer)])
    numbers = {one.number: one.name for one in newer.tasks}
    solved = [numbers[t['number']] for t in store.view(newer.name, 0)['tasks'] if t['solved']]
    assert solved == (['b'] if has_b(newer) else [])
    store.close()


@pytest.mark.parametrize('with_ids', [True, False])
def test_in_graded_work(newer, with_ids):
    """Also in a notebook whose editor has left out ids and tags: then by the name in its check."""
    cells = cells_of(handed_in())
    for cell in cells if not with_ids else ():
        cell.id, cell.metadata = '', Node(tags=[])
    handed = Handed(newer)
    if with_ids:
        assert lesson_of(cells, [Handed(lesson(*task('z'))), handed]) is handed
    answers = answers_of(cells, handed)
    changed = [name for name, one in handed.tasks.items() if answers.changed(one)]
    assert changed == (['b'] if has_b(newer) else [])
    job = job_of(handed, answers, {})
    if has_b(newer):
        answered = [c for c in job['cells'] if c['kind'] == 'exercise' and c['source'] == MINE]
        assert [cell['task'] for cell in answered] == ['b']
    else:
        assert job is None
