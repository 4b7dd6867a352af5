"""The timetables of a class: how they are written, and that teaching.md has each one."""

import re

import pytest

from tools.lessons import tables, timetables
from tools.lessons.timetables import Row, Timetable, minutes_and_lesson, read

TEXTS = tables.texts_of()


def test_a_timetable_is_read():
    text = (
        'A day:\n- {minutes: 8, text: Welcome}\n- {lesson: one_thing, steps: [2, 3]}\n'
        '- {lesson: another_thing}\n- {lesson: last, steps: [1, 2], write: [one, two]}\n'
    )
    rows = Row(minutes=8, text='Welcome'), Row('one_thing', (2, 3)), Row('another_thing')
    last = Row('last', (1, 2), write=('one', 'two'))
    assert read(text) == [Timetable('A day', (*rows, last))]


@pytest.mark.parametrize(
    ('text', 'says'),
    [
        ('', 'needs a title'),
        ('- one', 'needs a title'),
        ('A day:', "'A day' needs a list of rows"),
        ('A day: {lesson: one}', "'A day' needs a list of rows"),
        ('A day:\n- {lesson: one', 'line 2: this is no YAML'),
        ('A day:\n- one_thing', "row 1 of 'A day' is 'one_thing'"),
        ('A day:\n- {lesson: one_thing}\n- {minutes: 8}', "row 2 of 'A day'"),
        ('A day:\n- {lesson: one_thing, steps: [3, 2]}', "row 1 of 'A day'"),
        ('A day:\n- {lesson: one_thing, steps: 3}', "row 1 of 'A day'"),
        ('A day:\n- {lesson: one_thing, minutes: 3}', "row 1 of 'A day'"),
        ('A day:\n- {lesson: one_thing, steps: [1, 2], read: [x]}', "row 1 of 'A day'"),
        ('A day:\n- {lesson: one_thing, steps: [1, 2], write: x}', "row 1 of 'A day'"),
        ('A day:\n- {minutes: many, text: Break}', "row 1 of 'A day'"),
        ('A day:\n- {minutes: 0, text: Break}', "row 1 of 'A day'"),
    ],
)
def test_bad_data_gives_one_sentence(text, says):
    with pytest.raises(ValueError, match=re.escape(says)) as raised:
        read(text)
    assert str(raised.value).startswith('tools/lessons/timetables.yaml')
    assert '\n' not in str(raised.value)


def test_what_no_notebook_has_gives_one_sentence():
    known = tables.lessons_of(TEXTS)
    for row, says in (
        (Row('lose_the_way'), 'names lose_the_way, which is no lesson'),
        (Row('lose_messages', (1, 40)), 'step 40 has no note'),
        (Row('lose_messages', (1, 2), write=('fly',)), 'lose_messages has no task fly'),
    ):
        with pytest.raises(ValueError, match=says):
            minutes_and_lesson(row, known)


def test_teaching_md_has_each_timetable_below_its_title():
    text = TEXTS['teaching.md']
    for timetable in timetables.timetables():
        heading, table = f'### {timetable.title}\n', f': timetable of {timetable.title} -->\n'
        assert text.count(heading) == text.count(table) == 1
        assert '\n### ' not in text.split(heading)[1].split(table)[0]


def test_a_table_of_an_unknown_timetable_gives_one_sentence():
    texts = {**TEXTS, 'teaching.md': TEXTS['teaching.md'].replace('of Two days -->', 'of Ten -->')}
    with pytest.raises(ValueError, match="no timetable 'Ten'"):
        tables.updated(texts)
