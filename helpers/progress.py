"""The student's own progress: which exercises are solved, kept on this computer only.

`checks.check` records each exercise that passes, and lesson 00 shows the table. The file has one
line for each exercise, such as `lose_messages 1`: the lesson's name and not its number, which
changes when a lesson is added before it. Lines are only ever added, so kernels that write at once
lose nothing. Titles and exercises are read from the notebooks, as text: also from one that a
student has broken.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Collection, Iterable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from jupyter_core.paths import jupyter_data_dir

from helpers import text

FILE_VARIABLE = 'ROS2_NOTEBOOKS_PROGRESS'  # names another file; empty: no progress is kept
TITLE = re.compile(r'Exercise (\d+) of lesson (\d\d)')


class Lesson(NamedTuple):
    """What the table says of a notebook: '02', 'lose_messages', 'Lose messages', 2."""

    number: str
    name: str
    title: str
    exercises: int

    def lines(self) -> list[str]:
        """Return the lines of the progress file that this lesson may have."""
        return [f'{self.name} {count}' for count in range(1, self.exercises + 1)]


def title_of(lesson: str, exercise: int) -> str:
    """Return the title under which `checks.check` checks an exercise, and not its solution."""
    return f'Exercise {exercise} of lesson {lesson}'


def lessons() -> list[Lesson]:
    """Return the notebooks that have exercises, in teaching order.

    They are those in the folder of the running notebook, or else those of this checkout. What
    cannot be read of a notebook is taken from its file name.
    """
    found = []
    for path in _notebooks():
        source = path.read_text(encoding='utf-8', errors='replace')
        title = re.search(r'^\s*"# \d\d (.*?)(?:\\n)?",?$', source, re.MULTILINE)
        words = path.stem[3:].replace('_', ' ').capitalize()
        words = json.loads(f'"{title[1]}"') if title else words
        numbers = re.findall(r'^\s*"### Exercise (\d+)', source, re.MULTILINE)
        found.append(Lesson(path.name[:2], path.stem[3:], words, len(set(numbers))))
    return [lesson for lesson in found if lesson.exercises]


def file() -> Path | None:
    """Return the file that holds the progress, or None where none is kept.

    It lies where Jupyter keeps a user's data: after `make lab` in `.jupyter` of this checkout, on a
    JupyterHub in the student's home folder.
    """
    named = os.environ.get(FILE_VARIABLE)
    if named is None:
        return Path(jupyter_data_dir(), 'ros2_notebooks_progress.txt')
    return Path(named) if named else None


def record(title: str) -> None:
    """Keep that the exercise with this title is solved. Other titles are not kept.

    Where the file cannot be written nothing happens, since no lesson may fail because of it.
    `show` tells the reader.
    """
    path, found = file(), TITLE.fullmatch(title)
    if path is None or not found:
        return
    with suppress(OSError):
        for notebook in _notebooks(found[2]):
            key = f'{notebook.stem[3:]} {found[1]}'
            if key not in _read(path).splitlines():
                with path.open('ab', buffering=0) as lines:  # a short write is one system call
                    lines.write(f'{key}\n'.encode())


def show() -> None:
    """Print for each lesson which exercises are solved, and where progress cannot be kept, why."""
    path, lines, known = file(), [], lessons()
    if path is not None:
        try:
            lines = _read(path).splitlines()
        except OSError as error:
            why = f'Your progress is not kept, because {path} cannot be used: {error.strerror}.'
            print(*text.wrap(why), sep='\n')
    print(table(known, lines))


def start_again() -> None:
    """Begin with an empty table. The old file is kept beside the new one, as `.old`."""
    path = file()
    if path is not None:
        with suppress(FileNotFoundError):
            path.replace(path.with_suffix('.old'))
    print('Your table is empty again.')


def table(known: Iterable[Lesson], solved: Collection[str] = ()) -> str:
    """Return a row for each lesson, and a line with the sum; `solved` holds lines of the file."""
    known = list(known)
    states = [[line in solved for line in lesson.lines()] for lesson in known]
    most = max(map(len, states), default=0)
    rows = [['lesson', 'solved', *(f'exercise {count}' for count in range(1, most + 1))]]
    for lesson, done in zip(known, states, strict=True):
        words = ['solved' if one else 'open' for one in done] + [''] * (most - len(done))
        count = f'{sum(done)} of {len(done)}'
        rows.append([f'{lesson.number} {lesson.title}', count, *words])
    done = sum(states, [])
    return f'{text.table(rows)}\n{sum(done)} of {len(done)} exercises are solved.'


def _notebooks(number: str = '[0-9][0-9]') -> list[Path]:
    """Return the notebooks with this number: a student of a JupyterHub has a copy of their own."""
    here = Path.cwd()
    own = any(here.glob('00_*.ipynb'))
    folder = here if own else Path(__file__).resolve().parent.parent / 'notebooks'
    return sorted(folder.glob(f'{number}_*.ipynb'))


def _read(path: Path) -> str:
    """Return the text of the file, which is made where it does not exist."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open('a+b') as lines:
        lines.seek(0)
        return lines.read().decode(errors='replace')
