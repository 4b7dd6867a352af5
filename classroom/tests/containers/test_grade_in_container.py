"""`make grade` in the container: hostile code reaches nothing, and the next student is judged."""

import csv
import json

import pytest

from classroom.grade import limits
from classroom.grade.answers import handed_out
from classroom.tests.support.containers import LIMITS
from helpers.lesson import code_of_solution, path_of

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
# What each of three programs takes is less than one may have.
TOGETHER = """
import subprocess
import sys

code = 'held = bytearray(b"x") * 1_500_000_000; input()'
started = [subprocess.Popen([sys.executable, '-c', code], stdin=subprocess.PIPE) for _ in range(3)]
print([one.wait() for one in started[:1]])
"""
SHARED = """
import mmap

held = mmap.mmap(-1, 4_000_000_000)
for place in range(0, len(held), 4096):
    held[place] = 1
"""
THREADS = """
import threading

stop = threading.Event()
for _ in range(500):
    threading.Thread(target=stop.wait, daemon=True).start()
"""
FILL = """
with open('{}', 'wb') as file:
    while True:
        file.write(bytes(2**20))
"""
# Two programs are busy for 3 s. With half a core they get 1.5 s of it.
BUSY = """
import subprocess
import sys
import time

import psutil

busy = [subprocess.Popen([sys.executable, '-c', 'while True: pass']) for _ in range(2)]
time.sleep(3)
used_s = sum(sum(psutil.Process(one.pid).cpu_times()[:2]) for one in busy)
for one in busy:
    one.kill()
speed = 0.5 if used_s < 2 else used_s
"""
# Answers of a task, and what the table says of it. All have solved the next task as well, which is
# judged in the same container: what is left of the first one must not be in its way.
ANSWERS = {
    'Ada': ('speed = 0.5', ''),
    'Bob': (LOCKED_UP, ''),
    'Cy': ('hoard = []\nwhile True:\n    hoard.append(bytearray(10**8))', limits.MUCH_MEMORY),
    'Di': (TOGETHER, limits.ALL_MEMORY),
    'Eve': (SHARED, limits.ALL_MEMORY),
    'Fay': ('import os\nwhile True:\n    os.fork()', limits.MANY_PROGRAMS),
    'Gus': (THREADS, limits.MANY_PROGRAMS),
    'Hal': (FILL.format('large'), limits.MANY_FILES),
    'Ida': (FILL.format('/dev/shm/large'), limits.MANY_FILES),
    'Jo': ('while True:\n    print("x" * 1000)', 'printed without end'),
    'Kay': ('import os\nos._exit(0)', 'ended the kernel'),
    'Leo': ('speed = 0.5  # after all of that', ''),
}


@pytest.fixture
def grade(make, image, folder):
    """Return a function that judges answers, and returns the rows of the table by name."""
    [lesson] = [one for one in handed_out() if one.lesson.name == 'start_here']
    task = [*lesson.tasks.values()][1]
    second = {task.exercises[0].id: code_of_solution(task.solutions[0].source)}

    def grade(name, answers, *arguments):
        handed_in = folder / name
        for student, answer in answers.items():
            content = json.loads(path_of('start_here').read_text(encoding='utf-8'))
            for cell in content['cells']:
                cell['source'] = ({STARTER: answer} | second).get(cell['id'], cell['source'])
            (handed_in / student).mkdir(parents=True)
            (handed_in / student / 'a.ipynb').write_text(json.dumps(content))
        done = make('grade', f'FOLDER={handed_in}', f'RUN_ARGS={LIMITS}', *arguments)
        print(done.stdout)
        assert not done.returncode
        with (folder / f'{name}_graded/grades.csv').open() as table:
            return {row['name']: row for row in csv.DictReader(table)}

    return grade


def test_each_student_meets_a_limit_and_nobody_notices(grade):
    answers = {name: answer for name, (answer, _) in ANSWERS.items()}
    rows = grade('submissions', answers, 'LIMIT=6', 'JOBS=2')
    for name, (_, limit) in ANSWERS.items():
        row = rows[name]
        points = row['start_here through_the_door'], row['start_here a_first_node']
        assert points == ('0' if limit else '1', '1'), name
        assert limit in row['said'], name


def test_an_answer_has_so_many_cores(grade):
    assert grade('busy', {'Ada': BUSY}, 'CPUS=0.5')['Ada']['points'] == '2'
