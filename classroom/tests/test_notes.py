"""What the notes window shows for each place in each lesson."""

import nbformat
import pytest
from nbconvert.filters import markdown2html

from classroom import notes_window
from classroom.present import Copies
from tools.lessons.lesson import GLOSSARY, ROOT, lessons, tags
from tools.lessons.slides import slide_types

LESSONS = [lesson for lesson in lessons() if lesson.number != GLOSSARY]


@pytest.mark.parametrize('lesson', LESSONS, ids=[lesson.file for lesson in LESSONS])
def test_slides_and_minutes_only_grow_and_end_at_those_of_the_lesson(tmp_path, lesson):
    (tmp_path / 'notebooks').symlink_to(ROOT / 'notebooks')
    Copies(tmp_path, '').make([])
    path = f'presentation/{lesson.file}'
    cells = lesson.notebook.cells
    types = slide_types(lesson.notebook)
    walked = [index for index, kind in enumerate(types) if kind != 'skip']
    states = [
        notes_window.state(tmp_path, {'current': path, 'places': {path: at}, 'began': {}})
        for at in walked
    ]
    for name in ('slide', 'planned'):
        values = [state[name] for state in states]
        assert values == sorted(values)
    assert all(state['cells'] for state in states if state['slide'] < state['slides'])
    assert states[0]['slide'] == 1
    assert (
        states[-1]['slide']
        == states[-1]['slides']
        == sum(t in ('slide', 'subslide') for t in types)
    )
    assert states[-1]['planned'] == states[-1]['all'] == lesson.minutes
    assert states[-1]['cells'] == ''
    assert states[-1]['notes'] == ''  # those of an earlier step do not stay
    shown = ''.join(state['notes'] for state in states)
    for cell in cells:
        if 'notes' in tags(cell):
            lines = [markdown2html(line)[3:-5] for line in cell.source.splitlines() if line]
            assert all(f'>{line}<' in shown or f'\n{line}<' in shown for line in lines)


def test_only_a_copy_is_read(tmp_path):
    nbformat.write(nbformat.v4.new_notebook(), tmp_path / 'other.ipynb')
    (tmp_path / 'presentation').mkdir()
    for path in ('', 'other.ipynb', '../other.ipynb', 'presentation/../other.ipynb'):
        assert notes_window.state(tmp_path, {'current': path, 'places': {}, 'began': {}}) == {}
    assert notes_window.state(tmp_path, {}) == {}
    path = 'presentation/saved.ipynb'
    (tmp_path / path).touch()  # as while JupyterLab saves it
    assert notes_window.state(tmp_path, {'current': path, 'places': {}, 'began': {}}) == {}
