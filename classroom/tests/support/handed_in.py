"""What students hand in, for the tests of grading: notebooks, downloads, and who judges them."""

import csv
import io
import json
import subprocess
import sys

import pytest

from classroom.grade import runner
from helpers.checks.verdict import KEY
from helpers.lesson import code_of_solution, path_of
from helpers.lesson import lessons as lessons_of_course

RIGHT, WRONG = 'speed = 1.75 / 3.5\nshow(speed)', 'speed = 1.75\nshow(speed)'
STARTER = 'task-00-1-starter'
NUMBER = {lesson.name: lesson.number for lesson in lessons_of_course()}
OF = len(lessons_of_course()[0].tasks)  # of lesson 00
_second = lessons_of_course()[0].tasks[1]
SECOND = {_second.exercises[0].id: code_of_solution(_second.solutions[0].source)}


def notebook(name='start_here', **sources):
    """Return a lesson as a student saves it, with other sources of some cells."""
    content = json.loads(path_of(name).read_text(encoding='utf-8'))
    for cell in content['cells']:
        cell['source'] = sources.get(cell['id'], cell['source'])
    return content


def with_answer(source):
    return json.dumps(notebook(**{STARTER: source})).encode()


@pytest.fixture
def submit(tmp_path):
    """Return a function that puts files into the folder of submissions, and returns that."""
    folder = tmp_path / 'submissions'

    def submit(**files):
        for name, data in files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        return folder

    return submit


class Stand(runner.Where):
    """Stands for the container: an answer with RIGHT is right. It counts what it has judged."""

    script = f"""
import json, sys
job = json.load(sys.stdin)
for cell in job['cells']:
    if cell['kind'] == 'exercise':
        ok = cell['source'].startswith('speed = 1.75 / 3.5')
    if cell['kind'] == 'check':
        verdict = {{'task': cell['task'], 'of': 'answer', 'solved': ok}}
        verdict['points'] = [{{'what': 'x', 'ok': ok}}]
        output = {{'output_type': 'display_data', 'data': {{'text/plain': 'x'}}}}
        output['metadata'] = {{{KEY!r}: verdict}}
        print(json.dumps({{'cell': cell['id'], 'outputs': [output]}}), flush=True)
print(json.dumps({{'end': True}}))
"""

    def __init__(self, script=None):
        super().__init__()
        self.count, self.script = 0, script or self.script

    def start(self, **pipes):
        self.count += 1
        process = subprocess.Popen([sys.executable, '-I', '-c', self.script], **pipes)
        return process, process.kill


def rows_of(folder, name='grades.csv'):
    text = (folder.with_name('submissions_graded') / name).read_text(encoding='utf-8')
    return list(csv.DictReader(io.StringIO(text)))


def moodle_class(count):
    names = [f'Student {n:03}_{n + 500}_assignsubmission_file/lesson.ipynb' for n in range(count)]
    return {name: with_answer(RIGHT if n % 2 else WRONG) for n, name in enumerate(names)}
