"""What the class page shows of the notes of each lesson."""

import pytest
from nbconvert.filters import markdown2html

from classroom.class_page.lessons import Known
from helpers.lesson import GLOSSARY, lessons, tags, without_links

LESSONS = [lesson for lesson in lessons() if lesson.number != GLOSSARY]


@pytest.mark.parametrize('lesson', LESSONS, ids=[lesson.file for lesson in LESSONS])
def test_minutes_grow_to_those_of_the_lesson_and_each_note_is_shown(lesson):
    notes = Known(lesson).notes
    for step in notes:
        number, dot, _ = step['step'].partition('. ')
        assert step['number'] == (int(number) if dot and number.isdigit() else 0), step['step']
    planned = [step['planned'] for step in notes]
    assert planned == sorted(planned)
    assert sum(step['own'] for step in notes) == planned[-1] == notes[-1]['all'] == lesson.minutes
    shown = ''.join(step['notes'] for step in notes)
    for cell in lesson.notebook.cells:
        if 'notes' in tags(cell):
            lines = [
                markdown2html(line)[3:-5]
                for line in without_links(cell.source).splitlines()
                if line
            ]
            assert all(f'>{line}<' in shown or f'\n{line}<' in shown for line in lines)
