"""`make grade`: from the downloads of Moodle and Canvas to tables and feedback."""

import io
import json
import os
import subprocess
import sys
import tarfile
import zipfile

import nbformat
import psutil
import pytest

from classroom.grade import alike, limits, runner
from classroom.grade.__main__ import main
from classroom.grade.answers import answers_of, handed_out, lesson_of
from classroom.grade.judge import FULL, LIMIT_MET, HungError, Kernel, Witness, what_is_forged
from classroom.grade.marking import Marking
from classroom.grade.results import Kept, Outcome, Result, digest_of, job_of, result_of
from classroom.grade.source import code_only
from classroom.grade.submissions import submissions_of, workspace_files
from classroom.grade.uses import digest_of_uses, files_used
from classroom.tests.support.handed_in import (
    NUMBER,
    OF,
    RIGHT,
    SECOND,
    STARTER,
    WRONG,
    Stand,
    moodle_class,
    notebook,
    rows_of,
    with_answer,
)
from classroom.update import YOURS
from helpers.checks.verdict import KEY
from helpers.lesson import ROOT, cells_of, tags


@pytest.fixture(scope='module')
def lessons():
    return {one.lesson.name: one for one in handed_out()}


# --- Whose file is it? ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('path', 'expected'),
    [
        ('Ada Lovelace_101_assignsubmission_file/02_x.ipynb', ('Ada Lovelace', '101', 'moodle')),
        ('Ada Lovelace_101_assignsubmission_file_/02_x.ipynb', ('Ada Lovelace', '101', 'moodle')),
        ('Ada Lovelace_101_assignsubmission_file_02_x.ipynb', ('Ada Lovelace', '101', 'moodle')),
        ('Ada_7_101_assignsubmission_file_a/b.ipynb', ('Ada_7', '101', 'moodle')),
        ('lovelaceada_55_4567_02_x.ipynb', ('lovelaceada', '55', 'canvas')),
        ('lovelaceada_LATE_55_4567_02_x-1.ipynb', ('lovelaceada', '55', 'canvas')),
        ('anon_x7Yz1_4567_02_x.ipynb', ('anon_x7Yz1', '', 'canvas')),
        ('Ada/02_x.ipynb', ('Ada', '', '')),
        ('Zoë.ipynb', ('Zoë', '', '')),
    ],
)
def test_names_say_whose_file_it_is(submit, path, expected):
    [one], sheets = submissions_of(submit(**{path: b'{}'}))
    assert (one.name, one.number, one.system) == expected
    assert one.late == ('LATE' in path)
    assert not sheets
    assert one.files[0].name in ('02_x.ipynb', '02_x-1.ipynb', 'a/b.ipynb', 'Zoë.ipynb')


def test_a_download_may_be_a_zip_or_in_the_folder(submit, tmp_path):
    names = 'Ada_1_assignsubmission_file/a.ipynb', 'Bob_2_assignsubmission_file/__MACOSX/b.ipynb'
    data = io.BytesIO()
    with zipfile.ZipFile(data, 'w') as archive:
        for name in names:
            archive.writestr(name, '{}')
    folder = submit(**{'Course-Task-12.zip': data.getvalue(), 'grades.csv': b'a,b'})
    for place in (folder, folder / 'Course-Task-12.zip'):
        found, sheets = submissions_of(place)
        assert [one.name for one in found] == ['Ada']
        assert len(sheets) == (place == folder)
    (tmp_path / 'broken.zip').write_bytes(b'PK')
    with pytest.raises(ValueError, match='cannot be read as a zip'):
        submissions_of(tmp_path / 'broken.zip')


def archive_of(files, kind='tar'):
    data = io.BytesIO()
    if kind == 'zip':
        with zipfile.ZipFile(data, 'w') as archive:
            for name, content in files.items():
                archive.writestr(name, content)
    else:
        with tarfile.open(fileobj=data, mode='w:gz') as archive:
            for name, content in files.items():
                info = tarfile.TarInfo(name)
                info.size = len(content)
                archive.addfile(info, io.BytesIO(content))
            link = tarfile.TarInfo('src/link')
            link.type, link.linkname = tarfile.SYMTYPE, '/etc/passwd'
            archive.addfile(link)
    return data.getvalue()


@pytest.mark.parametrize('kind', ['zip', 'tar'])
@pytest.mark.parametrize(
    'above',
    ['', 'src/', 'make_a_package/src/', 'scratch/make_a_package/src/', 'scratch/lesson_09/src/'],
)
def test_the_files_of_a_workspace(submit, kind, above):
    files = {f'{above}pkg/src/a.cpp': b'//', f'{above}pkg/package.xml': b'<'}
    if above.startswith(('make_a_package', 'scratch')):
        files[above.replace('src/', 'build/x')] = b'built'
    ending = 'zip' if kind == 'zip' else 'tar.gz'
    folder = submit(**{f'Ada/work.{ending}': archive_of(files, kind)})
    [[file]] = (one.files for one in submissions_of(folder)[0])
    found = workspace_files(file)
    found.pop('link', None)
    assert {*found} == {'pkg/src/a.cpp', 'pkg/package.xml'}
    assert 'link' not in found


@pytest.mark.parametrize('name', ['../../x', '/etc/x'])
def test_no_file_leads_out_of_its_archive(submit, name):
    folder = submit(**{'Ada/a.zip': archive_of({name: b''}, 'zip'), 'Ada/b.tgz': b'none'})
    [[bad, none]] = (one.files for one in submissions_of(folder)[0])
    with pytest.raises(ValueError, match='leads out of it'):
        workspace_files(bad)
    with pytest.raises(ValueError, match='cannot be read as an archive'):
        workspace_files(none)


# --- What has the student written? ----------------------------------------------------------------


def read(content, lessons):
    cells = cells_of(json.dumps(content).encode())
    lesson = lesson_of(cells, lessons.values())
    return lesson, answers_of(cells, lesson)


def test_a_lesson_is_found_by_what_is_in_it(lessons):
    content = notebook('lose_messages')
    assert read(content, lessons)[0] is lessons['lose_messages']
    for cell in content['cells']:
        cell.pop('id')  # as another program may save it
    assert read(content, lessons)[0] is lessons['lose_messages']
    assert lesson_of(cells_of(b'{"cells": [{"cell_type": "code", "source": "1"}]}'), ()) is None


@pytest.mark.parametrize(
    'change',
    [
        lambda cell: None,
        lambda cell: cell.pop('id'),
        lambda cell: (cell.pop('id'), cell['metadata'].clear()),
        lambda cell: cell.update(source=cell['source'].splitlines(keepends=True)),
    ],
)
def test_answers_go_into_the_cells_of_the_lesson(lessons, change):
    """By the id of a cell, else by the heading of its task and the tag, else by the place."""
    first = next(iter(lessons['lose_messages'].tasks.values())).exercises[0].id
    content = notebook('lose_messages', **{first: 'mine = 1\n'})
    for cell in content['cells']:
        if isinstance(cell['source'], list):
            cell['source'] = ''.join(cell['source'])
        change(cell)
    _, answers = read(content, lessons)
    assert answers.sources[first] == 'mine = 1\n'
    assert [n for n, task in lessons['lose_messages'].tasks.items() if answers.changed(task)] == [
        'publish_numbers'
    ]
    assert not answers.said


def test_missing_and_doubled_cells_are_named(lessons):
    content = notebook(**{STARTER: WRONG})
    [cell] = [one for one in content['cells'] if one['id'] == STARTER]
    content['cells'].append(cell | {'source': RIGHT})
    _, answers = read(content, lessons)
    assert answers.sources[STARTER] == RIGHT
    assert answers.said == ['task 1 has its cell twice: the last one that was changed counts']
    content['cells'] = [one for one in content['cells'] if one['id'] != STARTER]
    _, answers = read(content, lessons)
    assert answers.said == ['task 1 has no cell']
    assert job_of(lessons['start_here'], answers, {}) is None


def test_an_answer_beside_its_cell_is_named(lessons):
    content = notebook()
    [at] = [n for n, one in enumerate(content['cells']) if one['id'] == STARTER]
    content['cells'].insert(at + 1, {'cell_type': 'code', 'source': RIGHT, 'id': 'new'})
    _, answers = read(content, lessons)
    assert answers.said == [
        'task 1 is as it was handed out, but a cell was added to it: read that yourself'
    ]


def test_a_notebook_in_an_archive_or_with_another_ending_is_read(submit, capsys):
    data = io.BytesIO()
    with zipfile.ZipFile(data, 'w') as archive:
        archive.writestr('homework/00.ipynb', with_answer(RIGHT))
    owners = 'Ada_1_assignsubmission_file_', 'Bob_2_assignsubmission_file_'
    names = f'{owners[0]}/homework.zip', f'{owners[1]}/00.ipynb.txt'
    folder = submit(**{names[0]: data.getvalue(), names[1]: with_answer(RIGHT)})
    assert main([str(folder)], Stand()) == 0
    assert [row['points'] for row in rows_of(folder)] == ['1', '1']
    with zipfile.ZipFile(folder.with_name('submissions_graded') / 'feedback.zip') as archive:
        assert archive.namelist() == [f'{names[0]}-00.ipynb', names[1]]


@pytest.mark.parametrize(
    ('output', 'why'),
    [
        ({'text': 'Interrupted after 100 s.\n'}, 'its cell did not end in 100 s'),
        (
            {'output_type': 'error', 'ename': 'SyntaxError', 'evalue': 'no (3538.py, line 2)'},
            'its cell ended with SyntaxError: no (line 2)',
        ),
    ],
)
def test_why_there_is_no_verdict_is_said_in_words(lessons, output, why):
    _, answers = read(notebook(**{STARTER: 'x = 1'}), lessons)
    said = runner.Said({STARTER: [output]}, begun=True, ended=True)
    assert (
        result_of(lessons['start_here'], answers, {}, said, '').tasks['through_the_door'].why == why
    )


def test_only_exercise_cells_are_taken(lessons):
    content = notebook(**{STARTER: RIGHT, 'check-00-1': 'evil()', 'the-door-way': 'evil()'})
    content['cells'].append({'cell_type': 'code', 'source': 'evil()', 'id': 'new'})
    lesson, answers = read(content, lessons)
    job = job_of(lesson, answers, {})
    assert 'evil' not in json.dumps(job)
    assert job['cells'][-1]['id'] == 'check-00-1'  # what follows is not run


def test_what_reaches_for_the_checks_is_named(lessons):
    _, answers = read(notebook(**{STARTER: 'import sys\nsys.modules.clear()'}), lessons)
    [said] = answers.said
    assert said.startswith('task 1 reaches for what judges it (')
    assert 'sys.modules' in said


@pytest.mark.parametrize(
    ('data', 'why'),
    [
        (b'', 'it is empty'),
        (b'{"cells": [', 'it is broken: it is no JSON'),
        (b'\xff\xfe', 'it is broken: it is no JSON'),
        (b'[' * 100_000, 'it is broken: it is no JSON'),
        (b'<!doctype html><title>Log in</title>', 'it is a web page, no notebook'),
        (b'{\n<<<<<<< HEAD\n', 'git has left its marks of a conflict in it'),
        (b'{"worksheets": []}', 'it is no notebook: it has no cells'),
    ],
)
def test_broken_notebooks(data, why):
    with pytest.raises(ValueError, match=why):
        cells_of(data)


def test_strange_cells_are_read():
    data = b'{"cells": [1, {"source": [1, "a"], "metadata": [], "id": 3}, {"source": "\\ud800"}]}'
    assert [cell.source for cell in cells_of(data)] == ['a', '?']


# --- Verdicts -------------------------------------------------------------------------------------


def said_of(*verdicts):
    outputs = [{'output_type': 'display_data', 'metadata': {KEY: one}} for one in verdicts]
    return runner.Said({'check-00-1': outputs}, ended=True)


GOOD = {
    'task': 'through_the_door',
    'of': 'answer',
    'solved': True,
    'points': [{'what': 'x', 'ok': True}],
}


@pytest.mark.parametrize(
    ('verdicts', 'solved'),
    [
        ([GOOD], True),
        ([GOOD, GOOD], False),  # one of them is forged
        ([GOOD | {'task': 'a_first_node'}], False),
        ([GOOD | {'of': 'solution'}], False),
        ([GOOD | {'points': []}], False),
        ([GOOD | {'points': [{'ok': False}]}], False),
        ([GOOD | {'points': 'all'}], False),
        ([GOOD | {'solved': 'yes'}], False),
        ([], False),
    ],
)
def test_a_verdict_counts_if_it_is_one(lessons, verdicts, solved):
    _, answers = read(notebook(**{STARTER: RIGHT}), lessons)
    result = result_of(lessons['start_here'], answers, {}, said_of(*verdicts), 'digest')
    assert result.tasks['through_the_door'].solved == solved


@pytest.mark.parametrize('verdict', [{}, {'solved': True}, {'points': 7}])
def test_a_verdict_without_points_is_none_that_a_check_shows(verdict):
    assert what_is_forged('be_the_queue', [{'metadata': {KEY: verdict}}], '', [])


def test_without_a_verdict_the_error_is_said(lessons):
    _, answers = read(notebook(**{STARTER: 'speed = input()'}), lessons)
    error = {'output_type': 'error', 'ename': 'NameError', 'evalue': 'speed', 'traceback': []}
    said = runner.Said({STARTER: [error | {'ename': 'KeyboardInterrupt', 'evalue': ''}]})
    result = result_of(lessons['start_here'], answers, {}, said, 'digest')
    assert result.tasks['through_the_door'].why == 'its cell ended with KeyboardInterrupt'
    said = runner.Said({'check-00-1': [error]})
    result = result_of(lessons['start_here'], answers, {}, said, 'digest')
    assert result.tasks['through_the_door'].why == 'its check ended with NameError: speed'


def test_hostile_lines_are_left_out():
    said = runner.Said()
    for line in (
        b'no JSON',
        b'[]',
        b'{"cell": 1, "outputs": []}',
        b'{"cell": "a", "outputs": [1]}',
    ):
        runner._read(line, said)
    assert said == runner.Said({'a': []})


@pytest.mark.parametrize(
    ('script', 'limit_s', 'trouble'),
    [
        ('import time; time.sleep(60)', 0.5, 'it was ended after'),
        ('while True: print("x" * 100_000)', 60, 'it said too much'),
        ('raise SystemExit("no such image")', 60, 'it could not be judged: no such image'),
        ('print(\'{"begin": true}\', flush=True); exit(9)', 60, 'it was ended: exit status 9'),
    ],
)
def test_what_does_not_end_is_ended(monkeypatch, script, limit_s, trouble):
    monkeypatch.setattr(runner, 'MOST_SAID', 1_000_000)
    said = runner.run({}, Stand(script), limit_s)
    assert said.trouble.startswith(trouble)
    assert said.is_ours == ('image' in script)  # tried again


def test_no_job_goes_on_after_ctrl_c():
    """Neither one that starts at this moment, nor that of the student's next lesson."""

    class Interrupted(Stand):
        def start(self, **pipes):
            started = super().start(**pipes)
            self.stop()
            return started

    where = Interrupted('import time; time.sleep(60)')
    for _ in range(2):
        said = runner.run({}, where, limit_s=5)
        assert (said.trouble, said.is_ours) == ('it was interrupted', True)
        assert said.seconds < 5
    assert where.count == 1


# --- A class --------------------------------------------------------------------------------------


def test_a_second_run_goes_on_where_the_first_one_ended(submit, capsys):
    files = moodle_class(4)
    where = Stand()
    folder = submit(**files)
    assert main([str(folder)], where) == 0
    assert where.count == 4 + 2  # each wrong answer once more
    assert f'Student 001: lesson 00: 1 of {OF}\n' in capsys.readouterr().out
    changed = next(iter(files))
    submit(**{changed: with_answer(RIGHT), 'New_9_assignsubmission_file/a.ipynb': files[changed]})
    assert main([str(folder), '--jobs', '2'], where) == 0
    assert where.count == 6 + 1 + 2
    assert f'Student 001: lesson 00: 1 of {OF}, judged before' in capsys.readouterr().out
    assert [row['points'] for row in rows_of(folder)] == ['0', '1', '1', '0', '1']


def test_two_hundred_students(submit, capsys):
    files = moodle_class(200)
    broken = list(files)[7]
    files[broken] = b'{'
    where = Stand()
    assert main([str(submit(**files)), '--jobs', '4'], where) == 0
    assert where.count == 199 + 100  # each wrong answer once more
    lines = capsys.readouterr().out.splitlines()
    assert sum(line.startswith('Student') for line in lines) == 200
    assert 'Student 007: lesson.ipynb cannot be read: it is broken: it is no JSON' in lines
    rows = rows_of(submit())
    assert sum(row['start_here through_the_door'] == '1' for row in rows) == 99
    assert [row['points'] for row in rows if row['name'] == 'Student 007'] == ['']


def test_a_line_for_each_strange_submission(submit, capsys):
    folder = submit(
        **{
            'Ada/x.ipynb': with_answer(RIGHT),
            'Bob/02.ipynb': json.dumps(notebook('lose_messages')).encode(),
            'Cy/notes.txt': b'I was ill',
            'Di/00.ipynb': json.dumps(notebook()).encode(),
            'Eve/a.ipynb': with_answer(WRONG),
            'Eve/a (1).ipynb': json.dumps(notebook()).encode(),
            'Fay/own.ipynb': b'{"cells": []}',
            '=cmd()/a.ipynb': with_answer(WRONG),
        }
    )
    assert main([str(folder)], Stand()) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:8] == [
        f'=cmd(): lesson 00: 0 of {OF}',
        f'Ada: lesson 00: 1 of {OF}',
        f'Bob: 02.ipynb is lesson {NUMBER["lose_messages"]}, not asked for; lesson 00 is not there',
        'Cy: no notebook, but notes.txt',
        f'Di: lesson 00: 0 of {OF}; nothing is written in lesson 00',
        f'Eve: lesson 00: 0 of {OF}; lesson 00 is there twice: a.ipynb counts',
        'Fay: own.ipynb is no lesson of this course',
        f'{folder}_graded: grades.csv, feedback.zip, alike.csv',
    ]
    assert rows_of(folder)[0]['name'] == "'=cmd()"  # no formula


def test_without_a_container_it_says_so(submit, monkeypatch, capsys, tmp_path):
    monkeypatch.setenv('CONTAINER', 'no-such-command')
    folder = submit(**moodle_class(1))
    assert main([str(folder)]) == 1
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert 'no-such-command' in said
    assert 'TRUST=yes' in said
    assert main([str(tmp_path / 'nothing')]) == 1
    assert capsys.readouterr().err.startswith('There is no ')


@pytest.mark.parametrize('options', [[], ['--no-stars']])
def test_tasks_with_a_star_count_or_not(submit, capsys, lessons, options):
    tasks = lessons['publish_and_subscribe'].lesson.tasks
    starred = [task for task in tasks if task.star]
    of = len(tasks) - (len(starred) if options else 0)
    points = 1 if options else 2
    core = next(task for task in tasks[1:] if not task.star)
    solved = (task.exercises[0].id for task in (core, starred[0]))
    data = json.dumps(notebook('publish_and_subscribe', **dict.fromkeys(solved, RIGHT))).encode()
    folder = submit(**{'Student_500_assignsubmission_file/lesson.ipynb': data})
    assert main([str(folder), *options], Stand()) == 0
    assert (
        f'Student: lesson {NUMBER["publish_and_subscribe"]}: {points} of {of}\n'
        in capsys.readouterr().out
    )
    [row] = rows_of(folder)
    counts = row['points'], row['of'], row[f'publish_and_subscribe {starred[0].name}']
    assert counts == (str(points), str(of), '1')
    [row] = rows_of(folder, 'moodle.csv')
    assert float(row['Grade']) == points


def test_an_exam_of_two_tasks(submit, capsys):
    """What a student has run to look at the robot is run again; two tasks are all points."""
    data = notebook(
        'find_the_fault', **{'find-next': RIGHT, 'mend-next': RIGHT, 'next': 'SEED = 7  # mine'}
    )
    at = next(i for i, cell in enumerate(data['cells']) if cell['id'] == 'find-next')
    look = {
        'cell_type': 'code',
        'id': 'own',
        'metadata': {},
        'source': '%%terminal\nros2 node list',
    }
    data['cells'].insert(at, look | {'outputs': [], 'execution_count': None})
    path = 'Student_500_assignsubmission_file/19_first.ipynb'
    folder = submit(**{path: json.dumps(data).encode()})
    assert main([str(folder), '--tasks', '9 10'], Stand()) == 0
    assert (
        f'Student: lesson {NUMBER["find_the_fault"]}: 2 of 2; SEED 7\n' in capsys.readouterr().out
    )
    [handed] = [one for one in handed_out() if one.lesson.name == 'find_the_fault']
    cells = job_of(handed, answers_of(cells_of(json.dumps(data).encode()), handed), {})['cells']
    ids = [cell['id'] for cell in cells]
    assert ids[ids.index('find-next') - 1] == 'find-next-look-0'
    assert 'SEED = 7' in next(cell['source'] for cell in cells if cell['id'] == 'next')
    assert main([str(folder), '--tasks', '99'], Stand()) == 1
    assert "_find_the_fault.ipynb has no task '99'" in capsys.readouterr().err


def test_feedback_has_verdicts_and_no_solution(submit):
    folder = submit(**moodle_class(2))
    assert main([str(folder)], Stand()) == 0
    with zipfile.ZipFile(folder.with_name('submissions_graded') / 'feedback.zip') as archive:
        assert archive.namelist() == list(moodle_class(2))  # the names of the download
        text = archive.read(archive.namelist()[1]).decode()
    found = nbformat.reads(text, as_version=4)
    nbformat.validate(found)
    assert found.cells[0].source.startswith(f'# 1 of {OF} tasks are solved')
    [answer] = [cell for cell in found.cells if cell.id == STARTER]
    [check] = [cell for cell in found.cells if cell.id == 'check-00-1']
    assert answer.source == RIGHT
    assert check.outputs[0].metadata[KEY]['solved']
    assert not {'solution', 'notes'} & {tag for cell in found.cells for tag in tags(cell)}


OWN = """for my_own_number in range(100, 10_000, 7):
    print("What I think", my_own_number)
my_second_thought = [my_own_number for _ in range(12)]
if my_second_thought[3] > 700:
    print("more", sum(my_second_thought) / 7)
while my_own_number > 3:
    my_own_number = my_own_number // 2 - 1
"""


def test_answers_that_are_alike_are_named(lessons):
    task = next(iter(lessons['lose_messages'].tasks.values()))
    [cell] = task.exercises
    renamed = OWN.replace('my_own_number', 'n').replace('my_second_thought', 'thoughts')
    renamed = renamed.replace('What I think', 'Mine').replace('\n', '   # a comment\n\n')
    solution = task.solutions[0].source.split('\n', 1)[1]
    other = 'total = 0\nfor k in range(20):\n    total += k ** 2\nassert total > 7, [total] * 9\n'
    written = {
        'Ada': OWN,
        'Bob': renamed + cell.source,
        'Cy': OWN.replace('"', "'"),
        'Di': solution,
        'Eve': solution,
        'Fay': cell.source,
        'Gus': 'x = 1',
        'Hal': 'x = 1',
        'Ida': OWN.replace('700', '800'),
        'Jo': other * 2,
    }
    students = []
    for name, source in written.items():
        students.append((name, read(notebook('lose_messages', **{cell.id: source}), lessons)[1]))
    found = [(one.students, one.how) for one in alike.alike(lessons['lose_messages'], students)]
    assert found == [
        (('Ada', 'Bob', 'Cy'), alike.RENAMED),
        (('Ada', 'Bob', 'Cy', 'Ida'), '6 of 7 statements'),
    ]


def test_what_is_alike_is_a_table(submit, capsys):
    folder = submit(**{f'{who}/a.ipynb': with_answer(OWN) for who in ('Ada', '=Bob')})
    assert main([str(folder)], Stand()) == 0
    assert 'Alike: lesson 00, task 1: =Bob, Ada: the same' in capsys.readouterr().out
    [row] = rows_of(folder, 'alike.csv')
    assert row['students'] == "'=Bob, Ada"  # no formula
    assert (row['what is alike'], row['statements of their own']) == ('the same', '7')


def test_what_is_kept_is_that_of_the_same_answers_and_lesson(lessons, tmp_path):
    _, answers = read(notebook(**{STARTER: RIGHT}), lessons)
    digest = digest_of(lessons['start_here'], answers, {})
    result = result_of(lessons['start_here'], answers, {}, said_of(GOOD), digest)
    kept = Kept(tmp_path / 'judged')
    kept.put('ada', result)
    assert kept.get('ada', digest, 20) == result
    assert kept.get('ada', digest_of(lessons['start_here'], answers, {'a': b''}), 20) is None
    result.trouble, result.minutes = 'it was ended after 5 min', 5.0
    kept.put('ada', result)
    assert kept.get('ada', digest, 5) == result
    assert kept.get('ada', digest, 20) is None  # it has more time now
    (tmp_path / 'judged/ada.json').write_text('{')
    assert kept.get('ada', digest, 20) is None


START = 'helpers/checks/lessons/start_here.py'


@pytest.mark.parametrize(
    ('file', 'old', 'new', 'is_new'),
    [
        ('helpers/checks/bench.py', '', '\nMORE = 1\n', True),
        ('helpers/checks/bench.py', '', '\n# a comment\n', False),
        ('helpers/ros/session.py', '', '\nMORE = 1\n', True),
        ('helpers/checks/lessons/lose_messages.py', '', '\nMORE = 1\n', False),
        ('helpers/replay/replays.py', '', '\nMORE = 1\n', False),
        ('helpers/workspace/cmake/FindPython3.cmake', '', '# new', True),
        ('helpers/checks/__pycache__/bench.pyc', '', 'new', False),
        (START, 'BEHIND_THE_WALL_M = 2.61', 'BEHIND_THE_WALL_M = 2.7', True),
        (START, "'the robot goes through the door", "'it goes through the door", True),
        (START, "hint = 'Speed is distance", "hint = 'A speed is a distance", False),
        ('ros2/ros2_command/main.py', '', '\nMORE = 1\n', True),
    ],
)
def test_what_is_kept_is_that_of_the_files_it_depends_on(tmp_path, file, old, new, is_new):
    """Not of a hint, a comment, or the checks of another lesson."""
    digests = []
    for folder in (tmp_path / 'before', tmp_path / 'after'):
        for path in files_used(ROOT, 'start_here', ''):
            copy = folder / path.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(path.read_bytes())
    changed = tmp_path / 'after' / file
    changed.parent.mkdir(parents=True, exist_ok=True)
    text = changed.read_text(encoding='utf-8') if changed.exists() else ''
    assert old in text
    changed.write_text(text.replace(old, new, 1) if old else text + new)
    for folder in (tmp_path / 'before', tmp_path / 'after'):
        digests.append(digest_of_uses(folder, 'start_here', []))
    assert (digests[0] != digests[1]) == is_new


def test_a_comment_that_changes_in_a_starter_changes_nothing(lessons):
    """A student has the starter of last week: it is no answer, and a verdict is kept."""
    lesson = lessons['start_here']
    old = notebook(
        **{STARTER: f'# as it was last week\n{task_of(lesson).exercises[0].source}  # x'}
    )
    assert not read(old, lessons)[1].changed(task_of(lesson))
    _, answers = read(notebook(**{STARTER: RIGHT}), lessons)
    before = digest_of(lesson, answers, {})
    cell = next(one for one in lesson.cells if one.id == STARTER)
    cell.source += '\n# another comment'
    try:
        assert digest_of(lesson, answers, {}) == before
    finally:
        cell.source = cell.source.removesuffix('\n# another comment')


def task_of(lesson):
    return lesson.tasks['through_the_door']


@pytest.mark.parametrize(
    ('one', 'other', 'is_same'),
    [
        ('x = 1  # old', 'x = 1', True),
        ('# old\nx  =  1', 'x = 1\n', True),
        ('if x:\n    y()\nz()', 'if x:\n    y()\n    z()', False),
        ("s = '# no comment'", "s = '# another'", False),
        ('%%write a.xml\n<a>\n', '%%write a.xml\n<a>', True),
        ('%%write a.cpp\n// old\n#include <a>', '%%write a.cpp\n#include <a>', True),
        ('%%write a.cpp part 2\n// old\n#include <a>', '%%write a.cpp part 2\n#include <a>', True),
        ('%%write a.cpp\n#include <b>', '%%write a.cpp\n#include <a>', False),
        ('%%terminal\n# old\nros2 topic list', '%%terminal\nros2 topic list', True),
    ],
)
def test_two_sources_that_differ_in_comments_only(one, other, is_same):
    assert (code_only(one) == code_only(other)) == is_same


def test_an_answer_below_the_newer_cell_counts(lessons):
    """`make update` has put it there, because the lesson has another starter now."""
    content = notebook()
    at = next(n for n, cell in enumerate(content['cells']) if cell['id'] == STARTER)
    marker = {'cell_type': 'markdown', 'id': 'm', 'metadata': {}, 'source': YOURS}
    own = {'cell_type': 'code', 'id': 'o', 'metadata': {}, 'source': RIGHT, 'outputs': []}
    content['cells'][at + 1 : at + 1] = [marker, own | {'execution_count': None}]
    lesson, answers = read(content, lessons)
    assert answers.sources[STARTER] == RIGHT
    assert answers.changed(task_of(lesson))
    assert answers.said == [
        'task 1 has its answer below the newer cell, from before an update: that one counts'
    ]


# --- Points ---------------------------------------------------------------------------------------


def marked(lesson, **words):
    """Return what a lesson gives: its first task has met 1 of 4 points, its second all."""
    tasks = [*lesson.tasks]
    outcomes = {name: Outcome() for name in tasks}
    outcomes[tasks[0]], outcomes[tasks[1]] = Outcome(met=1, of=4), Outcome(True, 3, 3)
    marking = Marking.of(words.get('weights', ''), words.get('partial', False), [lesson])
    return marking.said(lesson, Result('', outcomes)), marking


def test_points_of_a_part_and_of_weights(lessons):
    lesson = lessons['lose_messages']
    first, second = [*lesson.tasks][:2]
    count = len(lesson.counted)
    assert marked(lesson)[0] == f'1 of {count}'
    assert marked(lesson, partial=True)[0] == f'1.25 of {count}'
    weights = f'{first}=4 {lesson.tasks[second].number}=0.5'
    assert marked(lesson, partial=True, weights=weights)[0] == f'1.5 of {count + 2.5:.10g}'
    for wrong in ('a_driver', f'{first}=-1', f'{first}=much', 'none=2'):
        with pytest.raises(ValueError, match=r'WEIGHTS=|has no task'):
            Marking.of(wrong, False, [lesson])


def test_what_is_forged_gives_no_part_of_a_point(lessons):
    lesson = lessons['start_here']
    outcomes = {name: Outcome(met=1, of=1, forged=True) for name in lesson.tasks}
    assert Marking(partial=True).points(lesson, Result('', outcomes)) == 0


def test_a_student_is_judged_anew_by_name(submit, capsys):
    folder, where = submit(**moodle_class(3)), Stand()
    assert main([str(folder)], where) == 0
    before = where.count
    assert main([str(folder), '--retry', '001, 502'], where) == 0
    assert where.count == before + 1 + 2  # the second of the two is wrong, and judged twice
    said = capsys.readouterr().out
    assert said.count('judged before') == 1
    assert main([str(folder), '--retry', 'Nobody'], where) == 1
    assert 'RETRY=' in capsys.readouterr().err


def test_all_counts_agree_if_some_tasks_give_no_point(submit):
    folder = submit(**moodle_class(2))
    assert main([str(folder), '--tasks', 'a_first_node'], Stand()) == 0
    assert [(row['points'], row['of']) for row in rows_of(folder)] == [('0', '1')] * 2
    with zipfile.ZipFile(folder.with_name('submissions_graded') / 'feedback.zip') as archive:
        text = archive.read(archive.namelist()[1]).decode()
    found = nbformat.reads(text, as_version=4)
    assert found.cells[0].source.startswith('# 0 of 1 tasks are solved')
    assert '| 1 | ✔ | 1 of 1 | no points for it |' in found.cells[0].source


def error(name, text=''):
    return {'output_type': 'error', 'ename': name, 'evalue': text}


@pytest.mark.parametrize(
    ('output', 'why'),
    [
        (error('MemoryError'), 'used more than 2 GB of memory'),
        ({'text': LIMIT_MET.format(limits.MUCH_MEMORY)}, 'used more than 2 GB of memory'),
        ({'text': LIMIT_MET.format(limits.ALL_MEMORY)}, 'used more than 3 GB of memory, with all'),
        ({'text': 'Interrupted: it printed without end.\n'}, 'printed without end'),
        (error('RuntimeError', "can't start new thread"), 'started more than 400 programs and'),
        ({'text': LIMIT_MET.format(limits.MANY_PROGRAMS)}, 'started more than 400 programs and'),
        (error('OSError', '[Errno 28] No space left on'), 'ended with OSError'),
        (error('OSError', 'No space left on device'), 'wrote more than 1 GB to /tmp, or more than'),
        (error('OSError', '[Errno 27] File too large'), 'wrote a file of more than 1 GB'),
    ],
)
def test_each_limit_has_its_own_sentence(lessons, output, why):
    _, answers = read(notebook(**{STARTER: 'x = 1'}), lessons)
    said = runner.Said({STARTER: [output]}, begun=True, ended=True)
    result = result_of(lessons['start_here'], answers, {}, said, '')
    assert f'its cell {why}' in result.tasks['through_the_door'].why


@pytest.mark.parametrize(
    ('place', 'text', 'limit'),
    [
        ('pids.events', 'max {}', limits.MANY_PROGRAMS),
        ('pids/pids.events', 'max {}', limits.MANY_PROGRAMS),
        ('memory.events', 'low 0\noom 9\noom_kill {}\n', limits.ALL_MEMORY),
        ('memory/memory.oom_control', 'under_oom 0\noom_kill {}\n', limits.ALL_MEMORY),
    ],
)
def test_what_a_container_counts_is_read(tmp_path, place, text, limit):
    """Control groups have two versions, and a machine without a container has neither file."""
    assert limits.met_since(limits.counts(tmp_path), tmp_path) == ''
    file = tmp_path / place
    file.parent.mkdir(exist_ok=True)
    file.write_text(text.format(1))
    before = limits.counts(tmp_path)
    assert limits.met_since(before, tmp_path) == ''
    file.write_text(text.format(2))
    assert limits.met_since(before, tmp_path) == limit


def test_a_kernel_without_memory_is_known_from_outside():
    hold = 'held = bytearray({}); print(flush=True); input()'
    for size, is_full in ((2_147_000_000, True), (1_900_000_000, False)):
        command = [sys.executable, '-c', hold.format(size)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
            process.stdout.readline()
            assert (limits.memory_taken(process.pid) > FULL) == is_full
            process.kill()
    assert not limits.memory_taken(process.pid)


def test_a_container_that_the_system_killed_has_its_sentence():
    """Its exit status is 137. If that was before any code of a student, it is to be tried again."""
    killed = 'import sys; sys.stdin.read(); print({!r}, flush=True); sys.exit(137)'
    said = runner.run({}, Stand(killed.format('{"begin": true}')), 60)
    assert said.trouble == f'it was ended: its code {limits.ALL_MEMORY}'
    assert not said.is_ours
    said = runner.run({}, Stand(killed.format('')), 60)
    assert said.trouble == 'it could not be judged: exit status 137'
    assert said.is_ours


def test_what_an_answer_did_is_said_of_its_task_and_lesson(submit, capsys):
    did = "print(json.dumps({'did': 'a_first_node', 'what': 'os.kill'}))\n"
    folder = submit(**moodle_class(1))
    assert main([str(folder)], Stand(Stand.script.replace('print(', did + 'print(', 1))) == 0
    [line] = capsys.readouterr().out.splitlines()[:1]
    assert ': lesson 00: ' in line
    assert 'task 2: its code did what no answer needs: os.kill' in line


def test_the_number_of_a_lesson_that_draws_its_task(lessons):
    lesson = lessons['lose_messages']
    first = lesson.tasks['publish_numbers'].exercises[0].id
    _, answers = read(notebook('lose_messages', **{first: 'mine = 1'}), lessons)
    answers.seed = '7'
    cells = [cell.copy() for cell in lesson.cells]
    cells[[cell.cell_type for cell in cells].index('code')].source = 'SEED = 1\nother(SEED)'
    drawn = type(lesson)(lesson.lesson)
    drawn.cells = cells
    assert 'SEED = 7\\nother(SEED)' in json.dumps(job_of(drawn, answers, {}))


# --- A real kernel --------------------------------------------------------------------------------

HOSTILE = """
def check(*answer):
    print('forged')


import os

os._exit(3)
"""


def test_real_checks_judge_and_survive(submit, capsys):
    """A right answer, a wrong one, and one that ends the kernel: each gets its line.

    A student who has solved only another task is not accused of what the lesson's own solution
    does.
    """
    files = {'Ada/a.ipynb': with_answer(RIGHT), 'Bob/b.ipynb': with_answer(WRONG)}
    other = json.dumps(notebook(**SECOND)).encode()
    folder = submit(**files, **{'Cy/c.ipynb': with_answer(HOSTILE), 'Di/d.ipynb': other})
    assert main([str(folder), '--trust']) == 0
    assert capsys.readouterr().out.splitlines()[:4] == [
        f'Ada: lesson 00: 1 of {OF}',
        f'Bob: lesson 00: 0 of {OF}',
        f'Cy: lesson 00: 0 of {OF}; task 1: its code ended the kernel',
        f'Di: lesson 00: 1 of {OF}',
    ]
    with zipfile.ZipFile(folder.with_name('submissions_graded') / 'feedback.zip') as archive:
        told = archive.read('Bob/b.ipynb').decode()
    assert 'Speed is distance' in told  # the hint of that point, at once


FORGERY = """
import sys

judge = sys.modules['helpers.checks.points']
judge._result = lambda test: True
"""


def test_a_forged_pass_is_in_the_table(submit, capsys):
    """What else is forged, and how it is noticed: test_forgeries.py."""
    folder = submit(**{'Ada/a.ipynb': with_answer(FORGERY + WRONG)})
    assert main([str(folder), '--trust']) == 0
    [line] = capsys.readouterr().out.splitlines()[:1]
    assert line.startswith(f'Ada: lesson 00: 0 of {OF}')
    assert (
        'task 1 reaches for what judges it (helpers.checks, modules, sys.modules): read it yourself'
        in line
    )


LIMITED = {
    'Ada': (
        'hoard = []\nwhile True:\n    hoard.append(bytes(200_000_000) + b"x")',
        'used more than 2 GB',
    ),
    'Bob': ('while True:\n    print("x" * 1000)', 'printed without end'),
    'Cy': (
        'with open("large", "wb") as file:\n    while True:\n        file.write(bytes(2**20))',
        'wrote a file of more than 1 GB',
    ),
}


def test_a_cell_meets_its_limits_in_a_real_kernel(submit, capsys):
    folder = submit(**{f'{n}/a.ipynb': with_answer(one) for n, (one, _) in LIMITED.items()})
    assert main([str(folder), '--trust']) == 0
    lines = capsys.readouterr().out.splitlines()
    for line, (name, (_, why)) in zip(lines, LIMITED.items(), strict=False):
        assert line.startswith(f'{name}: lesson 00: 0 of {OF}')
        assert f'task 1: its cell {why}' in line


def test_a_kernel_that_ends_without_memory_has_its_sentence(tmp_path):
    """It ends without a word, and the system does not count it: it was full when last looked at."""
    kernel = Kernel(tmp_path)
    witness = Witness(kernel, tmp_path, 'start_here')
    take = 'import os, time\nhoard = bytearray(2_100_000_000)\ntime.sleep(1)\nos._exit(1)'
    try:
        with pytest.raises(HungError, match=limits.MUCH_MEMORY):
            kernel.run(take, 60)
    finally:
        witness.close()
        kernel.close()


STUBBORN = """
import time

while True:
    try:
        time.sleep(1)
    except KeyboardInterrupt:
        pass
"""


@pytest.mark.parametrize(
    ('source', 'why'),
    [
        ('while True:\n    pass', 'its cell did not end in 10 s'),
        (STUBBORN, 'its code did not end in 10 s, nor by an interrupt'),
    ],
)
def test_a_cell_has_so_much_time(lessons, source, why):
    _, answers = read(notebook(**{STARTER: source}), lessons)
    job = job_of(lessons['start_here'], answers, {}, cell_s=10)
    said = runner.run(job, runner.Trusted(), 300)
    result = result_of(lessons['start_here'], answers, {}, said, '')
    assert result.tasks['through_the_door'].why == why


def test_an_answer_has_so_many_cores_without_a_container(submit, capsys):
    cores = 'import os\nspeed = 0.5 / len(os.sched_getaffinity(0))'
    folder = submit(**{'Ada/a.ipynb': with_answer(cores)})
    assert main([str(folder), '--trust', '--cpus', '1']) == 0
    assert capsys.readouterr().out.startswith(f'Ada: lesson 00: 1 of {OF}')
    assert main([str(folder), '--trust', '--cpus', '0']) == 1
    assert 'CPUS= is a number above 0' in capsys.readouterr().err


PROGRAMS = """
import os
import subprocess

if os.fork() == 0:  # what it has started belongs to nobody when it has ended
    for _ in range(200):
        subprocess.Popen(['sleep', '1000'])
    os._exit(0)
os.wait()
for _ in range(300):
    subprocess.Popen(['sleep', '1000'])
"""
SOMEBODY = 12345  # root may start any number of programs; this user may not


def test_an_answer_starts_so_many_programs_and_leaves_none(submit, tmp_path):
    folder = submit(**{'Ada/a.ipynb': with_answer(PROGRAMS)})
    user, become = os.getuid(), []
    if not user:
        user = SOMEBODY
        os.chown(tmp_path, user, user)
        become = ['setpriv', f'--reuid={user}', f'--regid={user}', '--clear-groups']
        # It may read this checkout and its Python, wherever they are, and nothing else.
        become += ['--inh-caps=+dac_read_search', '--ambient-caps=+dac_read_search']
    command = [sys.executable, '-m', 'classroom.grade', folder, '--trust']
    home = {'HOME': str(tmp_path), 'TMPDIR': str(tmp_path), 'PYTHONPATH': str(ROOT)}
    done = subprocess.run(
        [*become, *command], cwd=tmp_path, env=os.environ | home, capture_output=True, text=True
    )
    assert 'task 1: its cell started more than 400 programs and threads' in done.stdout, done
    sleeping = psutil.process_iter(['uids', 'cmdline'])
    left = [one.pid for one in sleeping if one.info['cmdline'] == ['sleep', '1000']]
    assert left == []


ONCE = """
from pathlib import Path

once = Path({!r})
if not once.exists():
    once.touch()
    raise OSError('the machine is busy')
"""


def test_an_answer_that_fails_once_is_judged_again_alone(submit, capsys, tmp_path):
    folder = submit(**{'Ada/a.ipynb': with_answer(ONCE.format(str(tmp_path / 'once')) + RIGHT)})
    assert main([str(folder), '--trust']) == 0
    [line] = capsys.readouterr().out.splitlines()[:1]
    assert line == (
        f'Ada: lesson 00: 1 of {OF}; task 1: it failed beside the other answers, and passed when '
        'it was judged alone: it counts'
    )
