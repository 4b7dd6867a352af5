"""What Moodle and Canvas take back from `make grade`, by the rules of their importers."""

import json
import zipfile

import pytest

from classroom.grade import tables
from classroom.grade.__main__ import main
from classroom.tests.support.handed_in import (
    OF,
    RIGHT,
    Stand,
    moodle_class,
    notebook,
    rows_of,
    with_answer,
)
from classroom.tests.support.importers import (
    canvas_takes,
    moodle_takes,
    moodle_takes_feedback,
    worksheet,
)

PLUGIN = 'assignsubmission_file'
LATE = 'Submitted for grading - 2 days 3 hours late'


def graded(folder, name):
    return (folder.with_name('submissions_graded') / name).read_text(encoding='utf-8')


def test_moodle_takes_its_worksheet_back(submit, capsys):
    header = 'Identifier,"Full name","Email address",Status,Grade,"Maximum Grade",'
    header += '"Grade can be changed","Last modified (submission)","Last modified (grade)"'
    lines = [
        header,
        '"Participant 501","Student 001",a@b.c,Submitted,,100.00,Yes,"Friday, 1",-',
        '"Participant 777","Not There",d@e.f,"No submission",,100.00,Yes,-,-',
        '"Participant 500","Somebody Else",d@e.f,Submitted,,100.00,Yes,-,-',
    ]
    sheet = '\ufeff' + '\n'.join(lines)
    folder = submit(**moodle_class(2), **{'Grades-X.csv': sheet.encode()})
    assert main([str(folder)], Stand()) == 0
    one, absent, other = rows_of(folder, 'moodle.csv')
    assert 'Student 000 is not in Grades-X.csv, by number and name' in capsys.readouterr().out
    assert float(one['Grade']) == 100 / OF
    assert one['Email address'] == 'a@b.c'
    assert one['Last modified (grade)'] == '-'
    assert absent['Grade'] == other['Grade'] == ''


def test_two_assignments_in_one_folder_are_refused(submit, capsys):
    sheet = b'Identifier,Grade,Last modified (grade)\n'
    folder = submit(**moodle_class(1), **{'one.csv': sheet, 'two.csv': sheet})
    assert main([str(folder)], Stand()) == 1
    assert 'FOLDER=submissions_02' in capsys.readouterr().err


def test_moodle_without_a_worksheet(submit):
    folder = submit(**moodle_class(2))
    assert main([str(folder)], Stand()) == 0
    rows = rows_of(folder, 'moodle.csv')
    assert {*rows[0]} >= tables.MOODLE_NEEDS
    assert [row['Identifier'] for row in rows] == ['Participant 500', 'Participant 501']
    assert [row['Grade'] for row in rows] == ['0.00', '1.00']


def test_canvas_takes_its_gradebook_back(submit, capsys):
    lines = [
        'Student,ID,SIS User ID,SIS Login ID,Section,Start here (71),Essay (72),Final Score',
        '    Points Possible,,,,,50,10,(read only)',
        '"Lovelace, Ada",55,s1,ada,A,,9,40',
        '"Turing, Alan",56,s2,alan,A,3,,40',
    ]
    files = {'lovelaceada_LATE_55_9_x.ipynb': with_answer(RIGHT), 'book.csv': '\n'.join(lines)}
    folder = submit(**files | {'book.csv': files['book.csv'].encode()})
    assert main([str(folder)], Stand()) == 0
    possible, ada, alan = rows_of(folder, 'canvas.csv')
    assert list(ada) == [*tables.CANVAS, 'Start here (71)']
    assert possible['Start here (71)'] == '50'
    assert (ada['Start here (71)'], alan['Start here (71)']) == (f'{50 / OF:.2f}', '3')
    assert rows_of(folder)[0]['late'] == 'late'
    assert main([str(folder), '--assignment', 'none of them'], Stand()) == 0
    assert 'Start here (71), Essay (72). Name yours with ASSIGNMENT=' in capsys.readouterr().out


def test_canvas_without_a_gradebook(submit):
    folder = submit(**{'lovelaceada_55_9_x.ipynb': with_answer(RIGHT)})
    assert main([str(folder)], Stand()) == 0
    possible, ada = rows_of(folder, 'canvas.csv')
    assert (ada['ID'], ada['Start here'], possible['Start here']) == ('55', '1', str(OF))


# --- By the rules of Moodle -----------------------------------------------------------------------


def test_moodle_takes_all_grades_and_then_all_feedback(submit):
    """By its rules: `locallib.php` of the worksheet, `importziplib.php` of the feedback."""
    folder = submit(**moodle_class(4), **{'Grades.csv': worksheet(range(500, 505), maximum=100)})
    assert main([str(folder)], Stand()) == 0
    moodle = dict.fromkeys(map(str, range(500, 505)))  # of no student there is a grade yet
    assert moodle_takes(graded(folder, 'moodle.csv'), moodle, 100) == 4
    right = round(100 / OF, 2)
    assert [one and one.grade for one in moodle.values()] == [0, right, 0, right, None]
    with zipfile.ZipFile(folder.with_name('submissions_graded') / 'feedback.zip') as archive:
        assert moodle_takes_feedback(archive.namelist(), moodle) == 4


def test_moodle_skips_grades_that_come_after_the_feedback(submit, capsys):
    """So the tool says in which order, and which box to tick, where one needs it."""
    folder = submit(**moodle_class(2), **{'Grades.csv': worksheet([500, 501], maximum=100)})
    assert main([str(folder)], Stand()) == 0
    said = capsys.readouterr().out
    assert said.index('first moodle.csv') < said.index('then feedback.zip')
    assert 'Allow updating records that have been modified more recently in Moodle' in said
    moodle = {'500': None, '501': None}
    with zipfile.ZipFile(folder.with_name('submissions_graded') / 'feedback.zip') as archive:
        assert moodle_takes_feedback(archive.namelist(), moodle) == 2
    text = graded(folder, 'moodle.csv')
    assert moodle_takes(text, moodle, 100) == 0
    assert moodle_takes(text, moodle, 100, ignore_modified=True) == 2


def test_a_student_is_late_by_the_status_of_the_worksheet(submit):
    sheet = worksheet(range(500, 503), maximum=10, status={501: f'{LATE} - Graded', 502: LATE})
    folder = submit(**moodle_class(3), **{'Grades.csv': sheet})
    assert main([str(folder)], Stand()) == 0
    assert [row['late'] for row in rows_of(folder)] == ['', 'late', 'late']


def test_a_worksheet_in_another_language_stops(submit, capsys):
    """Else there would be a file whose maximum is not that of the assignment."""
    header = 'Teilnehmer-ID,Vollständiger Name,Status,Bewertung,Bestwertung,Bearbeitet am'
    lines = [header, 'Teilnehmer/in 500,Student 000,Zur Bewertung abgegeben,,"100,00",-']
    folder = submit(**moodle_class(2), **{'Bewertungen.csv': '\n'.join(lines).encode()})
    where = Stand()
    assert main([str(folder)], where) == 1
    said = capsys.readouterr()
    assert said.err.startswith('Bewertungen.csv is a grading worksheet in another language')
    assert said.err.count('\n') == 1
    assert where.count == 0
    assert not folder.with_name('submissions_graded').exists()


def test_a_list_of_the_class_beside_it_is_no_worksheet(submit, capsys):
    folder = submit(**moodle_class(2), **{'class.csv': b'number,name\n500,Student 000\n'})
    assert main([str(folder)], Stand()) == 0
    said = capsys.readouterr().out
    assert 'class.csv is neither a grading worksheet of Moodle nor a gradebook of Canvas' in said
    assert f'so the maximum grade in Moodle must be {OF}, too' in said


@pytest.mark.parametrize('name', ['Participant', 'Teilnehmerin'])
@pytest.mark.parametrize('names_are_shown', [False, True])
def test_anonymous_students_of_moodle_have_their_numbers(submit, capsys, name, names_are_shown):
    """Also if the worksheet tells a manager who they are."""
    files = {f'{name}_{n}_{PLUGIN}/a.ipynb': with_answer(RIGHT) for n in (500, 501)}
    names = {500: 'Participant 500 (Ada)', 501: 'Bob'} if names_are_shown else None
    folder = submit(**files, **{'Grades.csv': worksheet([500, 501], maximum=100, names=names)})
    assert main([str(folder)], Stand()) == 0
    assert f'{name} 500: lesson 00: 1 of {OF}' in capsys.readouterr().out
    assert [row['name'] for row in rows_of(folder)] == [f'{name} 500', f'{name} 501']
    moodle = {'500': None, '501': None}
    assert moodle_takes(graded(folder, 'moodle.csv'), moodle, 100) == 2
    assert main([str(folder), '--retry', f'{name} 501'], where := Stand()) == 0
    assert where.count == 1


def test_one_student_keeps_the_name(submit):
    folder = submit(**moodle_class(1))
    assert main([str(folder)], Stand()) == 0
    assert [row['name'] for row in rows_of(folder)] == ['Student 000']


# --- By the rules of Canvas -----------------------------------------------------------------------


@pytest.mark.parametrize('head', ['Student,ID', 'LastName,FirstName,ID'])
def test_canvas_takes_the_grades_of_both_forms_of_its_gradebook(submit, head):
    """By `lib/gradebook_importer.rb`."""
    name = ['"Lovelace, Ada"', 'Lovelace,Ada'][head.startswith('Last')]
    empty = ',' * head.count(',')
    lines = [
        f'{head},SIS User ID,SIS Login ID,Section,Start here (71),Essay (72),Final Score',
        f'{empty},,,,Manual Posting,,',
        f'    Points Possible{empty},,,,50,10,(read only)',
        f'{name},55,s1,ada,A,,9,40',
    ]
    book = '\n'.join(lines).encode()
    folder = submit(**{'lovelaceada_55_9_x.ipynb': with_answer(RIGHT), 'book.csv': book})
    assert main([str(folder)], Stand()) == 0
    took = canvas_takes(graded(folder, 'canvas.csv'), {'Start here (71)', 'Essay (72)'})
    assert took == {('55', 'Start here (71)'): f'{50 / OF:.2f}'}


def test_canvas_takes_no_grades_of_anonymous_students_and_it_is_said(submit, capsys):
    """`gradeable?` in the importer: no grade of an assignment whose names are hidden."""
    files = {f'anon_{one}_4567_x.ipynb': with_answer(RIGHT) for one in ('x7Yz1', 'LATE')}
    folder = submit(**files, **{'LATE_anon_b2C_9_x.ipynb': json.dumps(notebook()).encode()})
    assert main([str(folder)], Stand()) == 0
    said = capsys.readouterr().out
    assert 'These are anon_b2C, anon_LATE, anon_x7Yz1.' in said
    assert 'canvas.csv' not in said
    assert not (folder.with_name('submissions_graded') / 'canvas.csv').exists()
    points = {row['name']: (row['points'], row['late']) for row in rows_of(folder)}
    assert points == {'anon_x7Yz1': ('1', ''), 'anon_LATE': ('1', ''), 'anon_b2C': ('0', 'late')}


def test_only_students_with_a_name_in_canvas_are_in_its_gradebook(submit):
    """A folder may also have anonymous students, and those of another system."""
    known, hidden = 'lovelaceada_55_4567_x.ipynb', 'anon_x7Yz1_4567_x.ipynb'
    files = {one: with_answer(RIGHT) for one in (known, hidden, 'Bob/x.ipynb')}
    folder = submit(**files, **moodle_class(1))
    assert main([str(folder)], Stand()) == 0
    _, ada = rows_of(folder, 'canvas.csv')
    assert ada['ID'] == '55'
