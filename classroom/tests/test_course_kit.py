"""What a lecturer hands in and hands out: the syllabus, the exam, what is collected from a hub."""

import csv
import io
import os
import re
import shutil
import tarfile

import pytest
import yaml

from classroom import collect
from classroom.grade.submissions import submissions_of, workspace_files
from classroom.kit import exam, syllabus
from helpers.faults import FAULTS
from helpers.lesson import ROOT, lessons, path_of

# --- The syllabus ---------------------------------------------------------------------------------


def test_the_syllabus_has_all_lessons_goals_and_hours(tmp_path):
    assert syllabus.main(['--output', str(tmp_path / 'a.md')]) == 0
    text = (tmp_path / 'a.md').read_text(encoding='utf-8')
    for lesson in lessons():
        if lesson.tasks:
            assert f'### {lesson.number} {lesson.title} ({lesson.minutes} minutes' in text
    assert '](' not in text  # it is pasted where no link leads anywhere
    assert '| 14 | Exam: ' in text


def test_the_weeks_are_those_of_the_page_for_a_university():
    text = (ROOT / 'classroom/UNIVERSITY.md').read_text(encoding='utf-8')
    rows = re.findall(r'^\| (\d+) \| (.*?) \|(.*) \|$', text, re.MULTILINE)
    names = {lesson.number: lesson.name for lesson in lessons()}
    weeks = syllabus.course()['weeks']
    assert len(rows) == len(weeks)
    for (_, *cells), week in zip(rows, weeks, strict=True):
        for cell, part in zip(cells, ('class', 'home'), strict=True):
            for number in re.findall(r'notebooks/(\d\d)_', cell):
                assert names[number] in week.get(part, ()), (number, part)


def test_a_goal_begins_with_what_one_can_see(monkeypatch, tmp_path):
    course = yaml.safe_load(syllabus.COURSE.read_text(encoding='utf-8'))
    course['goals']['lose_messages'][0] = 'know what a queue is'
    monkeypatch.setattr(syllabus, 'COURSE', tmp_path / 'course.yaml')
    syllabus.COURSE.write_text(yaml.safe_dump(course), encoding='utf-8')
    with pytest.raises(ValueError, match="no verb of VERBS: 'know what a queue is'"):
        syllabus.course()


# --- The exam -------------------------------------------------------------------------------------


@pytest.fixture
def private(tmp_path):
    """Return a folder of faults that students do not have, and a file of students."""
    for name in ('slow_look', 'no_number', 'plain_twist', 'wrong_way'):
        shutil.copytree(FAULTS[name].folder, tmp_path / 'faults' / f'exam_{name}')
    (tmp_path / 'students.csv').write_text('number,name\n1,Ada\n2,Bob\n17,=Cy\n', encoding='utf-8')
    return tmp_path


def run(private, *more, seed='4711'):
    words = ['--faults', private / 'faults', '--students', private / 'students.csv']
    words += ['--seed', seed, '--output', private / 'out', *more]
    return exam.main([*map(str, words)])


def unpacked(path):
    with tarfile.open(path) as archive:
        return {one.name: archive.extractfile(one).read() for one in archive if one.isfile()}


def test_an_exam_is_drawn_from_a_seed_and_names_no_fault(private):
    assert run(private) == 0
    first = {path.name: unpacked(path) for path in (private / 'out').glob('*.tar.gz')}
    assert [*sorted(first)] == ['001.tar.gz', '002.tar.gz', '017.tar.gz']
    for files in first.values():
        assert len({name.split('/')[2] for name in files if '/src/' in name}) == exam.EACH
        assert not any('fault' in name or 'exam_' in name for name in files)
        text = b''.join(files.values()).decode()
        assert not any(word in text for word in ('exam_', 'broken', *FAULTS))
    assert run(private) == 0
    assert first == {p.name: unpacked(p) for p in (private / 'out').glob('*.tar.gz')}
    assert run(private, seed='4712') == 0
    assert first != {p.name: unpacked(p) for p in (private / 'out').glob('*.tar.gz')}


def test_an_exam_is_judged_by_evidence_and_shows_the_mend(private):
    assert run(private) == 0
    faults = exam.faults_of(private / 'faults')
    robots = exam.drawn(faults, '4711', '1')
    right, wrong, open_ = robots
    fault = robots[right]
    answers = {
        right: {
            'kind': fault.kind,
            'command': fault.look.replace('courier', right),
            'line': fault.line.replace('courier', right),
        },
        wrong: {'kind': 'domain', 'command': 'ros2 node list', 'line': '/brake'},
    }
    files = unpacked(private / 'out/001.tar.gz')
    files['exam/answers.yaml'] = yaml.safe_dump(answers).encode()
    mended = f'exam/src/{open_}/{open_}/brake.py'
    files[mended] = b'# mended\n' + files[mended]
    data = io.BytesIO()
    with tarfile.open(fileobj=data, mode='w:gz') as archive:
        for name, content in files.items():
            info = tarfile.TarInfo(name)
            info.size = len(content)
            archive.addfile(info, io.BytesIO(content))
    folder = private / 'handed_in/Ada_1_assignsubmission_file'
    folder.mkdir(parents=True)
    (folder / 'mine.tar.gz').write_bytes(data.getvalue())
    (private / 'handed_in/Bob_2_assignsubmission_file').mkdir()
    (private / 'handed_in/Bob_2_assignsubmission_file/answers.yaml').write_bytes(b'- [')
    assert run(private, '--folder', private / 'handed_in') == 0
    text = (private / 'out/judged.csv').read_text(encoding='utf-8')
    rows = {(row['number'], row['robot']): row for row in csv.DictReader(io.StringIO(text))}
    row = rows['1', right]
    assert (row['kind'], row['evidence'], row['said'], row['mend']) == ('1', '1', '', '')
    row = rows['1', wrong]
    assert (row['kind'], row['evidence']) == ('0', '0')
    assert "'domain' is not its kind; this line is no evidence" in row['said']
    assert '+# mended' in rows['1', open_]['mend']
    assert rows['1', open_]['said'] == 'not answered'
    assert 'answers.yaml is no YAML' in rows['2', exam.ROBOTS[0]]['said']
    assert 'nothing is handed in' in rows['17', exam.ROBOTS[0]]['said']
    assert rows['17', exam.ROBOTS[0]]['name'] == "'=Cy"


@pytest.mark.parametrize(
    'path', ['001.tar.gz', 'Ada_17_assignsubmission_file/001 (2).tar.gz', 'ada_5_90_001.tar.gz']
)
def test_the_archive_that_a_student_got_says_whose_it_is(private, path):
    """Whatever number Moodle or Canvas gives: here that of another student."""
    assert run(private) == 0
    files = unpacked(private / 'out/001.tar.gz')
    folder = private / 'handed_in'
    (folder / path).parent.mkdir(parents=True)
    with tarfile.open(folder / path, 'w:gz') as archive:
        for name, content in files.items():
            info = tarfile.TarInfo(name)
            info.size = len(content)
            archive.addfile(info, io.BytesIO(content))
    assert run(private, '--folder', folder) == 0
    text = (private / 'out/judged.csv').read_text(encoding='utf-8')
    said = {row['number']: row['said'] for row in csv.DictReader(io.StringIO(text))}
    assert said['1'] == 'not answered'
    assert said['17'].startswith('nothing is handed in')


def test_what_students_have_is_no_exam(private, capsys):
    shutil.copytree(FAULTS['two_clocks'].folder, private / 'faults/two_clocks')
    assert run(private) == 1
    assert capsys.readouterr().err == 'Students have these on their disks: two_clocks.\n'


# --- What is collected from a hub -----------------------------------------------------------------


def test_what_is_collected_from_homes_is_what_grade_reads(tmp_path, capsys):
    """From a home, a volume, a home without the lesson, and one with links to somebody else's."""
    lesson = next(one for one in lessons() if one.name == 'make_a_package')
    text = path_of('make_a_package').read_bytes()
    homes = tmp_path / 'home'
    for student, inside in (('ada', 'ros2_notebooks'), ('ros2_notebooks_bob', '_data')):
        course = homes / student / inside
        source = course / 'scratch/make_a_package/src/my_pkg'
        (source / '__pycache__').mkdir(parents=True)
        (course / lesson.file).write_bytes(text)
        os.utime(course / lesson.file, (1000, 1000))
        (source / 'setup.py').write_text('# mine')
        (source / '__pycache__/x.pyc').write_text('built')
        (source / 'stolen').symlink_to('/etc/passwd')
        (course / 'scratch/make_a_package/src/all').symlink_to('/etc')
    (homes / 'cy').mkdir()
    thief = homes / 'thief/ros2_notebooks'
    thief.mkdir(parents=True)
    (thief / lesson.file).symlink_to(homes / 'ada/ros2_notebooks' / lesson.file)
    (homes / 'thief2').mkdir()
    (homes / 'thief2/ros2_notebooks').symlink_to(homes / 'ada/ros2_notebooks')
    os.mkfifo(homes / 'cy' / lesson.file)
    to = tmp_path / 'submissions'
    assert collect.main([str(homes), '--lesson', '09', '--to', str(to)]) == 0
    said = capsys.readouterr().out
    assert said.splitlines()[:3] == ['cy: no lesson', 'thief: no lesson', 'thief2: no lesson']
    assert ': 2 students. Next: make grade FOLDER=' in said
    found, _ = submissions_of(to)
    assert [one.name for one in found] == ['ada', 'bob']
    for one in found:
        [notebook] = [file for file in one.files if file.name.endswith('.ipynb')]
        [archive] = [file for file in one.files if file.name.endswith('.tar.gz')]
        assert notebook.read() == text
        assert workspace_files(archive) == {'my_pkg/setup.py': b'# mine'}
    assert (to / 'ada' / lesson.file).stat().st_mtime == 1000
    assert collect.main([str(homes)]) == 1
    assert 'LESSON=02' in capsys.readouterr().err
