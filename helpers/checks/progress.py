"""The student's own progress: which tasks are solved, kept on this computer only.

`checks.check` records each task that passes, and `show` prints the table. This module alone writes
and reads the file. Each of its lines is of one kind:

    LESSON TASK             a task that is solved: `lose_messages be_the_queue`
    LESSON TASK WORD        about what it was, each time that it differs: the robot of lesson 19
    borrowed LESSON TASK    a task that a student has gone on without, which is not solved by that
    guess LESSON [QUESTION, KIND, VALUE]    in JSON, as it was guessed
    gap LESSON {...}        in JSON: a guess against what came out, see `portrait.record_of`
    memory NAME LESSON      a question of `checks.memory` with a wrong answer; without LESSON it was
                            right after that

Names have no numbers, which change when a lesson or a task is added before them. Lines of version
0.3 had a number, and are read as the task that had it then; a task or a guess that has moved to
another lesson is read as one of that. Lines are only ever added, so kernels that write at once lose
nothing.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from IPython import get_ipython
from IPython.display import display
from jupyter_core.paths import jupyter_data_dir

from helpers import notebook as text
from helpers.checks.portrait import Map, portrait
from helpers.lesson import (
    FOLDER,
    Lesson,
    earlier_name,
    home_of_guess,
    home_of_task,
    outlines,
    paths,
)

# The first words of lines. No lesson has a name of one word.
BORROWED, GAP, GUESS, MEMORY = 'borrowed', 'gap', 'guess', 'memory'
IS_GRADED = 'ROS2_NOTEBOOKS_GRADED'  # a variable of the environment: nothing can be borrowed
FILE_VARIABLE = 'ROS2_NOTEBOOKS_PROGRESS'  # names another file; empty: no progress is kept
LESSON = re.compile(r'(?:^|/)\d\d_(\w+)\.ipynb$')


def this_lesson() -> str:
    """Return the name of the lesson that this kernel runs, empty if it runs none."""
    shell = get_ipython()
    # JupyterLab says the notebook's path in this variable, VS Code in that name.
    path = (shell.user_ns if shell else {}).get('__vsc_ipynb_file__', '')
    found = LESSON.search(path or os.environ.get('JPY_SESSION_NAME', ''))
    return found[1] if found else ''


def with_tasks() -> list[Lesson]:
    """Return the notebooks that have tasks, in teaching order.

    They are those in the folder of the running notebook, or else those of this checkout.
    """
    return [lesson for lesson in outlines(folder()) if lesson.tasks]


def file() -> Path | None:
    """Return the file that holds the progress, or None if none is kept.

    It is in Jupyter's folder of a user's data: after `make lab` in `.jupyter` of this checkout, on
    a JupyterHub in the student's home folder.
    """
    named = os.environ.get(FILE_VARIABLE)
    if named is None:
        return Path(jupyter_data_dir(), 'ros2_notebooks_progress.txt')
    return Path(named) if named else None


def record(task: str, about: str = '') -> None:
    """Keep that a task of the running lesson is solved, and about what it was, in one word.

    What it was about is kept each time that it differs from the time before: `about` returns it.
    If the file cannot be written nothing happens, since no lesson may fail because of it. `show`
    says so.
    """
    path, lesson = file(), this_lesson()
    if path is None or not lesson:
        return
    with suppress(OSError):
        key = f'{lesson} {task}'
        lines = _lines(path)
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


def keep_borrowed(lesson: str, task: str) -> None:
    """Keep that a student has gone on without this task."""
    add(f'{BORROWED} {lesson} {task}')


def keep_guess(question: str, kind: str, value: object) -> None:
    """Keep what was guessed in the running lesson, for the next kernel."""
    if lesson := this_lesson():
        add(f'{GUESS} {lesson} {json.dumps([question, kind, value])}')


def kept_guess(question: str, kind: str) -> object:
    """Return what was guessed last in the running lesson, None for nothing.

    A question that has another kind today, after an update, was not answered.
    """
    here, found = this_lesson(), None
    for line in lines_of(GUESS):
        with suppress(ValueError, TypeError, IndexError):
            _, lesson, text = line.split(' ', 2)
            asked, *rest = json.loads(text)
            if (asked, rest[0]) != (question, kind):
                continue
            # To look where a question has moved reads all lessons.
            if lesson == here or home_of_guess(lesson, question, outlines(folder())) == here:
                found = rest[1]
    return found


def keep_gap(record: Mapping) -> None:
    """Keep a guess of the running lesson against what came out."""
    if lesson := this_lesson():
        add(f'{GAP} {lesson} {json.dumps(record, ensure_ascii=False)}')


def gaps_in(lines: Iterable[str]) -> dict[str, dict[str, dict]]:
    """Return by lesson and question the newest record of each guess that was compared."""
    found: dict[str, dict[str, dict]] = {}
    for line in lines:
        if line.startswith(f'{GAP} '):
            with suppress(ValueError, KeyError, TypeError):
                _, lesson, text = line.split(' ', 2)
                record = json.loads(text)
                found.setdefault(lesson, {})[record['asked']] = record
    return found


def keep_memory(question: str, lesson: str = '') -> None:
    """Keep in which lesson a question was missed, or, without a lesson, that it was right."""
    add(' '.join(filter(None, (MEMORY, question, lesson))))


def memories() -> list[tuple[str, str]]:
    """Return these questions and lessons, the oldest first."""
    words = [line.split()[1:3] for line in lines_of(MEMORY)]
    return [(*found, '')[:2] for found in words if found]


def solved_of(lesson: Lesson) -> set[str]:
    """Return the names of the tasks of a lesson that are solved."""
    return _names_of(lesson, f'{lesson.name} ')


def borrowed_of(lesson: Lesson) -> set[str]:
    """Return the names of the tasks of a lesson that a student has once gone on without."""
    return _names_of(lesson, f'{BORROWED} {lesson.name} ')


def _names_of(lesson: Lesson, begin: str) -> set[str]:
    path, lines = file(), []
    if path is not None:
        with suppress(OSError):
            lines = in_their_lessons(_lines(path), with_tasks())
    return {task.name for task in lesson.tasks if f'{begin}{task.name}' in lines}


def number_of(lesson: str) -> str:
    """Return the number of a lesson by its name, such as '02'; empty if there is no notebook."""
    return next((path.name[:2] for path in paths(folder()) if path.stem[3:] == lesson), '')


def about(task: str) -> list[str]:
    """Return what this task of the running lesson was about whenever it was solved, in order.

    It is never the same twice in a row: to check an answer again is not to solve another task.
    """
    path, start = file(), f'{this_lesson()} {task} '
    if path is None:
        return []
    with suppress(OSError):
        return [line[len(start) :] for line in _lines(path) if line.startswith(start)]
    return []


def show() -> None:
    """Show for each lesson which tasks are solved, and each guess against what came out.

    Where progress cannot be kept, it says why.
    """
    path, lines, known = file(), [], with_tasks()
    if path is not None:
        try:
            lines = in_their_lessons(_lines(path), known)
        except OSError as error:
            why = f'Your progress is not kept, because {path} cannot be used: {error.strerror}.'
            print(*text.wrap(why), sep='\n')
    solved = {lesson.name: _solved(lesson, lines) for lesson in known}
    display(Map(known, solved, table(known, lines), portrait(known, gaps_in(lines))))


def total() -> str:
    """Return how many tasks are solved: `12 of 169 tasks`; empty if no progress is kept here."""
    path = file()
    if path is None or not this_lesson():
        return ''
    lessons = with_tasks()
    known = {line for lesson in lessons for line in _lines_of(lesson)}
    with suppress(OSError):
        lines = in_their_lessons(_lines(path), lessons)
        return f'{len(known.intersection(lines))} of {len(known)} tasks'
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
        own = _solved(lesson, solved)
        left = [task.number for task in lesson.tasks if task.number not in own]
        done = len(own)
        sums = [sums[0] + done, sums[1] + len(lesson.tasks)]
        words = f'task{"s" * (len(left) > 1)} {_runs(left)}' if left else ''
        borrowed = [
            task.number
            for task in lesson.tasks
            if task.number in left and f'{BORROWED} {lesson.name} {task.name}' in solved
        ]
        if borrowed:
            words += f' (borrowed: {_runs(borrowed)})'
        rows.append(
            [f'{lesson.number} {lesson.title_or_name}', f'{done} of {len(lesson.tasks)}', words]
        )
    return f'{text.table(rows)}\n{sums[0]} of {sums[1]} tasks are solved.'


def _solved(lesson: Lesson, lines: Collection[str]) -> list[int]:
    """Return the numbers of the tasks that are solved."""
    tasks = zip(lesson.tasks, _lines_of(lesson), strict=True)
    return [task.number for task, line in tasks if line in lines]


def _lines_of(lesson: Lesson) -> list[str]:
    """Return the lines of the progress file that a lesson may have, one for each task."""
    return [f'{lesson.name} {task.name}' for task in lesson.tasks]


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


def folder() -> Path:
    """Return the folder of the notebooks: a student of a JupyterHub has a copy of their own."""
    here = Path.cwd()
    return here if any(here.glob('00_*.ipynb')) else FOLDER


def _lines(path: Path) -> list[str]:
    """Return the lines of the file, which is made if it does not exist; numbers of 0.3 as names."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open('a+b') as lines:
        lines.seek(0)
        return [_with_name(line) for line in lines.read().decode(errors='replace').splitlines()]


def in_their_lessons(lines: Iterable[str], known: Iterable[Lesson]) -> list[str]:
    """Return lines of the file as they would be written today.

    A task or a guess may have moved to another lesson: it is found by its name, or its question.
    """
    known, found = [*known], []
    for line in lines:
        words = line.split(' ', 2)
        with suppress(ValueError, IndexError, KeyError, TypeError):
            if words[0] == GAP:
                words[1] = home_of_guess(words[1], json.loads(words[2])['asked'], known)
            elif words[0] == GUESS:
                words[1] = home_of_guess(words[1], json.loads(words[2])[0], known)
            elif words[0] == BORROWED:
                words[1] = home_of_task(words[1], words[2], known)
            else:
                words[0] = home_of_task(words[0], words[1], known)
        found.append(' '.join(words))
    return found


def _with_name(line: str) -> str:
    """Return a line of version 0.3, `lose_messages 4`, with the name of the task."""
    words = line.split(' ')
    if len(words) > 1 and words[1].isdecimal():
        words[1] = earlier_name(words[0], int(words[1])) or words[1]
    return ' '.join(words)
