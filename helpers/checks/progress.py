"""The student's own progress: which tasks are solved, kept on this computer only.

`checks.check` records each task that passes, and lesson 00 shows the table. The file has one line
for each task, such as `lose_messages 1`: the lesson's name and not its number, which changes when
a lesson is added before it. What `checks.remember` keeps are lines that begin with `memory`. Lines
are only ever added, so kernels that write at once lose nothing. Titles and tasks are read from the
notebooks, as text: also from one that a student has broken.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Collection, Iterable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from IPython import get_ipython
from jupyter_core.paths import jupyter_data_dir

from helpers import notebook as text

FILE_VARIABLE = 'ROS2_NOTEBOOKS_PROGRESS'  # names another file; empty: no progress is kept
LESSON = re.compile(r'(?:^|/)\d\d_(\w+)\.ipynb$')


class Lesson(NamedTuple):
    """What the table says of a notebook: '02', 'lose_messages', 'Lose messages', 2."""

    number: str
    name: str
    title: str
    tasks: int

    def lines(self) -> list[str]:
        """Return the lines of the progress file that this lesson may have."""
        return [f'{self.name} {count}' for count in range(1, self.tasks + 1)]


def this_lesson() -> str:
    """Return the name of the lesson that this kernel runs, empty if it runs none."""
    shell = get_ipython()
    # JupyterLab says the notebook's path in this variable, VS Code in that name.
    path = (shell.user_ns if shell else {}).get('__vsc_ipynb_file__', '')
    found = LESSON.search(path or os.environ.get('JPY_SESSION_NAME', ''))
    return found[1] if found else ''


def with_tasks() -> list[Lesson]:
    """Return the notebooks that have tasks, in teaching order.

    They are those in the folder of the running notebook, or else those of this checkout. A title
    that cannot be read is taken from the file name.
    """
    found = []
    for path in _notebooks():
        source = path.read_text(encoding='utf-8', errors='replace')
        title = re.search(r'^\s*"# \d\d (.*?)(?:\\n)?",?$', source, re.MULTILINE)
        words = path.stem[3:].replace('_', ' ').capitalize()
        words = json.loads(f'"{title[1]}"') if title else words
        numbers = re.findall(r'^\s*"### ✎ Task (\d+)', source, re.MULTILINE)
        found.append(Lesson(path.name[:2], path.stem[3:], words, len(set(numbers))))
    return [lesson for lesson in found if lesson.tasks]


def file() -> Path | None:
    """Return the file that holds the progress, or None if none is kept.

    It is in Jupyter's folder of a user's data: after `make lab` in `.jupyter` of this checkout, on
    a JupyterHub in the student's home folder.
    """
    named = os.environ.get(FILE_VARIABLE)
    if named is None:
        return Path(jupyter_data_dir(), 'ros2_notebooks_progress.txt')
    return Path(named) if named else None


def record(task: int, about: str = '') -> None:
    """Keep that this task of the running lesson is solved, and about what it was, in one word.

    What it was about is kept each time that it differs from the time before: `about` returns it.
    If the file cannot be written nothing happens, since no lesson may fail because of it. `show`
    says so.
    """
    path, lesson = file(), this_lesson()
    if path is None or not lesson:
        return
    with suppress(OSError):
        key = f'{lesson} {task}'
        lines = _read(path).splitlines()
        if key not in lines:
            add(key)
        earlier = [line for line in lines if line.startswith(f'{key} ')]
        if about and earlier[-1:] != [f'{key} {about}']:
            add(f'{key} {about}')


def add(line: str) -> None:
    """Add a line to the file, if there is one and it can be written."""
    if (path := file()) is not None:
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open('ab', buffering=0) as lines:  # a short write is one system call
                lines.write(f'{line}\n'.encode())


def lines_of(first_word: str) -> list[str]:
    """Return the lines that begin with this word, the oldest first. No file is made for it."""
    if (path := file()) is not None:
        with suppress(OSError):
            lines = path.read_text(encoding='utf-8', errors='replace').splitlines()
            return [line for line in lines if line.startswith(f'{first_word} ')]
    return []


def number_of(lesson: str) -> str:
    """Return the number of a lesson by its name, such as '02'; empty if there is no notebook."""
    return next((path.name[:2] for path in _notebooks() if path.stem[3:] == lesson), '')


def about(task: int) -> list[str]:
    """Return what this task of the running lesson was about whenever it was solved, in order.

    It is never the same twice in a row: to check an answer again is not to solve another task.
    """
    path, start = file(), f'{this_lesson()} {task} '
    if path is None:
        return []
    with suppress(OSError):
        return [line[len(start) :] for line in _read(path).splitlines() if line.startswith(start)]
    return []


def show() -> None:
    """Print for each lesson which tasks are solved, and where progress cannot be kept, why."""
    path, lines, known = file(), [], with_tasks()
    if path is not None:
        try:
            lines = _read(path).splitlines()
        except OSError as error:
            why = f'Your progress is not kept, because {path} cannot be used: {error.strerror}.'
            print(*text.wrap(why), sep='\n')
    print(table(known, lines))


def total() -> str:
    """Return how many tasks are solved: `12 of 169 tasks`; empty if no progress is kept here."""
    path = file()
    if path is None or not this_lesson():
        return ''
    known = {line for lesson in with_tasks() for line in lesson.lines()}
    with suppress(OSError):
        return f'{len(known.intersection(_read(path).splitlines()))} of {len(known)} tasks'
    return ''


def start_again() -> None:
    """Begin with an empty table. The old file is kept beside the new one, as `.old`."""
    path = file()
    if path is not None:
        with suppress(FileNotFoundError):
            path.replace(path.with_suffix('.old'))
    print('Your table is empty again.')


def table(known: Iterable[Lesson], solved: Collection[str] = ()) -> str:
    """Return a row for each lesson, and a line with the sum; `solved` holds lines of the file."""
    rows, sums = [['lesson', 'solved', 'open']], [0, 0]
    for lesson in known:
        tasks = enumerate(lesson.lines(), 1)
        left = [count for count, line in tasks if line not in solved]
        done = lesson.tasks - len(left)
        sums = [sums[0] + done, sums[1] + lesson.tasks]
        words = f'task{"s" * (len(left) > 1)} {_runs(left)}' if left else ''
        rows.append([f'{lesson.number} {lesson.title}', f'{done} of {lesson.tasks}', words])
    return f'{text.table(rows)}\n{sums[0]} of {sums[1]} tasks are solved.'


def _runs(numbers: list[int]) -> str:
    """Return rising numbers in words: `1, 2, 4 to 8`."""
    found = []
    for number in numbers:
        if found and number == found[-1][-1] + 1:
            found[-1].append(number)
        else:
            found.append([number])
    return ', '.join(
        f'{run[0]} to {run[-1]}' if len(run) > 2 else ', '.join(map(str, run)) for run in found
    )


def _notebooks(number: str = '[0-9][0-9]') -> list[Path]:
    """Return the notebooks with this number: a student of a JupyterHub has a copy of their own."""
    here = Path.cwd()
    own = any(here.glob('00_*.ipynb'))
    folder = here if own else Path(__file__).resolve().parents[2] / 'notebooks'
    return sorted(folder.glob(f'{number}_*.ipynb'))


def _read(path: Path) -> str:
    """Return the text of the file, which is made if it does not exist."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open('a+b') as lines:
        lines.seek(0)
        return lines.read().decode(errors='replace')
