"""A class that a test opens: the real server, its page as data, and students that are processes."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import nbformat
import requests
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_raw_cell
from support.students import LESSON
from support.waits import LIMIT_S, wait_for

from helpers.lesson import ROOT

NAME = 'lose_messages'
QUESTION = 'How many are heard?'
OTHER = 'Which ones?'
# What a class has said when it has started: how to join, the address of its page, and the port.
STARTED = r"join_class\('(.*)', '(.*)'\)[\s\S]*?(http://localhost:(\d+)/\w+/)[\s\S]*Ctrl\+C"
STEP, LATER = 'step-1', 'step-2'  # ids of cells
PREDICT = {'tags': ['predict']}
TASK = 'try_it'
WEB = requests.Session()
WEB.trust_env = False  # no proxy


def write_lesson(root: Path) -> None:
    """Write a lesson with two steps, two guesses and a task below `root`."""
    cells = [
        new_markdown_cell('# 02 Lose messages', id='title'),
        new_markdown_cell('## 1. Count', id='heading'),
        new_raw_cell(
            'For the instructor: 4 minutes. Ask **before** the run.',
            id='note',
            metadata={'tags': ['notes']},
        ),
        new_code_cell(f'my_guess = guess({QUESTION!r}, 41)', id=STEP, metadata=PREDICT),
        new_code_cell(
            f'%matplotlib inline\nmy_ones = guess({OTHER!r}, {{2, 10}})',
            id='magic',
            metadata=PREDICT,
        ),
        new_markdown_cell('## 2. Look', id='heading-2'),
        new_code_cell(f'compare_prediction({QUESTION!r}, my_guess, 14)', id=LATER),
        new_code_cell('this is no Python', id='broken', metadata=PREDICT),
        new_markdown_cell('### ✎ Task 1: Try', id='task'),
        new_code_cell(f'check({TASK!r}, mine)', id='check', metadata={'tags': ['check']}),
    ]
    (root / 'notebooks').mkdir(parents=True, exist_ok=True)
    nbformat.write(new_notebook(cells=cells), root / 'notebooks' / LESSON)


def event(kind: str = 'guess', number: int = 0, **what: object) -> dict:
    """Return an event as a student's computer sends it."""
    if kind == 'guess':
        what = {'question': QUESTION, 'value': 41} | what
    return {'id': f'{number:016x}', 'kind': kind, 'lesson': NAME} | what


class RunningClass:
    """A class in a process of its own, whose file is in `folder`."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.folder = folder
        self.port = 0
        self._arguments = arguments
        if not (folder / 'notebooks').is_dir():
            write_lesson(folder)

    def start(self) -> None:
        """Start the server, and wait until it says how to join."""
        self.process = subprocess.Popen(
            # If this test is killed, the class is, too.
            ['setpriv', '--pdeathsig', 'KILL', sys.executable, '-m', 'classroom.class_page']
            + ['--root', self.folder, '--port', str(self.port), '--no-browser', *self._arguments],
            cwd=ROOT,
            env=os.environ | {'JUPYTER_CONFIG_DIR': str(self.folder / 'jupyter')},
            stdout=subprocess.PIPE,
            text=True,
        )
        self.said = ''
        for line in self.process.stdout:
            self.said += line
            if found := re.search(STARTED, self.said):
                break
        else:
            raise RuntimeError(f'The class did not start: {self.said}')
        self.address, self.code, self.page, port = found.groups()
        self.port = int(port)
        self.url = f'http://127.0.0.1:{self.port}'

    def kill(self) -> None:
        """End the server as a crash does."""
        self.process.kill()
        self.wait()

    def stop(self) -> str:
        """End the class with Ctrl+C, and return what it said."""
        self.process.send_signal(signal.SIGINT)
        return self.wait()

    def wait(self) -> str:
        """Wait for the end of the server, and return what it said."""
        return self.process.communicate(timeout=LIMIT_S)[0]

    # What a student's computer says

    def post(self, path: str, body: object, token: str = '') -> tuple[int, dict]:
        """Send a message, bytes or what becomes JSON, and return the answer."""
        data = body if isinstance(body, bytes) else json.dumps(body).encode()
        headers = {'Authorization': f'token {token}'}
        answer = WEB.post(f'{self.url}/{path}', data, headers=headers, timeout=LIMIT_S)
        return answer.status_code, answer.json()

    def join(self, **what: str) -> str:
        """Take a seat, and return its token."""
        status, answer = self.post('join', {'code': self.code, 'name': ''} | what)
        assert status == 200, answer
        return answer['token']

    def tell(self, token: str, *events: dict) -> str:
        """Tell events, and return why some were refused."""
        status, answer = self.post('events', {'events': events}, token)
        assert status == 200, answer
        return answer['refused']

    # What the instructor does and sees

    def do(self, what: str, **body: object) -> int:
        """Press a button of the page."""
        return self.post(f'{self.page.rstrip("/").rpartition("/")[2]}/{what}', body)[0]

    def go(self, step: int) -> None:
        """Show a step of the lesson."""
        assert self.do('go', lesson=NAME, step=step) == 200

    def view(self) -> dict:
        """Return what the page shows now."""
        with WEB.get(f'{self.page}live', stream=True, timeout=LIMIT_S) as live:
            return json.loads(next(live.iter_lines(1)).removeprefix(b'data: '))

    def bars(self, question: str = QUESTION) -> dict[str, int]:
        """Return the bars of a question after "show"."""
        self.do('show', question=question)
        [found] = [one for one in self.view()['guesses'] if one['question'] == question]
        return {bar['label']: bar['count'] for bar in found['bars']}

    def events(self) -> list[tuple]:
        """Return what the class keeps: kind, what it is about, and the value, in their order."""
        file = self.folder / 'jupyter/class/class.sqlite'
        with contextlib.closing(sqlite3.connect(file)) as db:
            rows = db.execute('SELECT kind, what, value FROM events ORDER BY n').fetchall()
        return [(kind, what, json.loads(value)) for kind, what, value in rows]

    def wait_for(self, condition) -> dict:
        """Wait until the page shows what fulfils a condition, and return it."""
        return wait_for(self.view, condition)


@contextlib.contextmanager
def running_class(folder: Path, *arguments: str) -> Iterator[RunningClass]:
    """Hold a class for a block."""
    opened = RunningClass(folder, *arguments)
    opened.start()
    try:
        yield opened
    finally:
        opened.kill()
