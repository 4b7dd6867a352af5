"""`make grade` in the container: hostile code reaches nothing, and the next student is judged."""

import csv
import json

from classroom.tests.support.containers import LIMITS

STARTER = 'task-00-1-starter'
# What an answer finds out where it runs: it is right if all of this fails, as it should.
LOCKED_UP = """
import os
import pathlib
import socket


def is_refused(action):
    try:
        action()
    except OSError:
        return True
    return False


refused = [
    is_refused(lambda: socket.create_connection(('192.0.2.1', 80), 2)),
    is_refused(lambda: pathlib.Path('/opt/ros2_notebooks/x').write_text('x')),
    is_refused(lambda: pathlib.Path('/home/student/x').write_text('x')),
    is_refused(lambda: pathlib.Path('/proc/1/fd/1').open('w')),
    os.getuid() == 1000,
]
speed = 0.5 if all(refused) else refused
"""
ANSWERS = {
    'Ada': 'speed = 0.5',
    'Bob': LOCKED_UP,
    'Cy': 'hoard = []\nwhile True:\n    hoard.append(bytearray(100_000_000))',
    'Di': 'import os\nwhile True:\n    os.fork()',
    'Eve': 'speed = 0.5  # after a fork bomb',
}


def test_students_are_judged_apart(make, image, folder):
    lesson = next(make.checkout.glob('notebooks/00_*.ipynb'))
    handed_in = folder / 'submissions'
    for name, answer in ANSWERS.items():
        content = json.loads(lesson.read_text(encoding='utf-8'))
        for cell in content['cells']:
            if cell['id'] == STARTER:
                cell['source'] = answer
        (handed_in / name).mkdir(parents=True)
        (handed_in / name / 'a.ipynb').write_text(json.dumps(content))
    done = make('grade', f'FOLDER={handed_in}', 'LIMIT=4', f'RUN_ARGS={LIMITS}')
    print(done.stdout)
    assert not done.returncode
    with (folder / 'submissions_graded/grades.csv').open() as table:
        points = {row['name']: row['start_here through_the_door'] for row in csv.DictReader(table)}
    assert points == {'Ada': '1', 'Bob': '1', 'Cy': '0', 'Di': '0', 'Eve': '1'}
