"""The student's own progress: which exercises are solved, kept on this computer only.

`checks.check` records each exercise that passes, and lesson 00 shows the table. The file has one
line for each exercise. Lines are only ever added, so kernels that write at once lose nothing.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from jupyter_core.paths import jupyter_data_dir

from helpers.text import wrap

LESSONS = {  # number: title, exercises
    '00': ('Start here', 1),
    '01': ('Publish and subscribe', 1),
    '02': ('Lose messages', 2),
    '03': ('Run callbacks in parallel', 2),
    '04': ('Choose the number of threads', 2),
    '05': ('Call a service from a callback', 2),
    '06': ('Make a package', 2),
    '07': ('Use a message in your own interface', 2),
    '08': ('Share code in a C++ library', 2),
    '09': ('Fuse odometry, IMU and GPS', 2),
}
FILE_VARIABLE = 'ROS2_NOTEBOOKS_PROGRESS'  # names another file; empty: no progress is kept


def title_of(lesson: str, exercise: int) -> str:
    """Return the title under which `checks.check` checks an exercise, and not its solution."""
    return f'Exercise {exercise} of lesson {lesson}'


TITLES = {
    title_of(lesson, exercise)
    for lesson, (_, exercises) in LESSONS.items()
    for exercise in range(1, exercises + 1)
}


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
    path = file()
    if path is None or title not in TITLES:
        return
    try:
        text = _read(path)
        if title not in text.splitlines():
            # After a line without an end, begin a new one. A short write is one step of the system.
            line = f'{title}\n' if text.endswith('\n') or not text else f'\n{title}\n'
            with path.open('ab', buffering=0) as lines:
                lines.write(line.encode())
    except OSError:
        pass


def show() -> None:
    """Print for each lesson which exercises are solved, and where progress cannot be kept, why."""
    path, lines = file(), []
    if path is not None:
        try:
            lines = _read(path).splitlines()
        except OSError as error:
            _print(f'Your progress is not kept, because {path} cannot be used: {error.strerror}.')
    print(_table(set(lines)))
    unknown = [line for line in lines if line and line not in TITLES]
    if unknown:
        _print(
            f'Not understood in {path}, and left as it is: {len(unknown)} of {len(lines)} lines.'
        )


def start_again() -> None:
    """Begin with an empty table. The old file is kept beside the new one, as `.old`."""
    path = file()
    if path is not None:
        with suppress(FileNotFoundError):
            path.replace(path.with_suffix('.old'))
    print('Your table is empty again.')


def _read(path: Path) -> str:
    """Return the text of the file, which is made where it does not exist."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open('a+b') as lines:
        lines.seek(0)
        return lines.read().decode(errors='replace')


def _table(solved: set[str]) -> str:
    rows = [f'{"lesson":<40}{"solved":<9}exercise 1  exercise 2']
    for lesson, (name, exercises) in LESSONS.items():
        done = [title_of(lesson, exercise) in solved for exercise in range(1, exercises + 1)]
        states = ''.join(f'{"solved" if one else "open":<12}' for one in done)
        count = f'{sum(done)} of {exercises}'
        rows.append(f'{lesson} {name:<37}{count:<9}{states}'.rstrip())
    rows.append(f'{len(solved & TITLES)} of {len(TITLES)} exercises are solved.')
    return '\n'.join(rows)


def _print(text: str) -> None:
    print(*wrap(text), sep='\n')
