"""The notebooks of a folder: read, and found by what somebody calls them."""

from __future__ import annotations

from pathlib import Path

from helpers.lesson.cells import Node, cells_of
from helpers.lesson.lesson import Lesson, Task

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / 'notebooks'
PICTURES = 'images'  # of the lessons, beside them


def paths(folder: Path = FOLDER) -> list[Path]:
    """Return the notebooks of a folder, in teaching order."""
    return sorted(folder.glob('[0-9][0-9]_*.ipynb'))


def read(text: str, file: str) -> Lesson:
    """Return the lesson of a notebook's text, as nbformat reads it. Raises ValueError if none."""
    import nbformat  # a kernel has no need for it, and it takes a while

    try:
        return Lesson(file, nbformat.reads(text, as_version=4))
    except (nbformat.reader.NotJSONError, nbformat.ValidationError, AttributeError) as error:
        raise ValueError(f'{file} is no notebook: {str(error).splitlines()[0][:80]}.') from None


def lessons(folder: Path = FOLDER) -> list[Lesson]:
    """Return the notebooks of a folder, as nbformat reads them. Raises ValueError."""
    return [read(path.read_text(encoding='utf-8'), path.name) for path in paths(folder)]


def outline(path: Path) -> Lesson:
    """Return the lesson of a file, quickly. One that cannot be read has no cells."""
    try:
        cells = cells_of(path.read_bytes())
    except (OSError, ValueError):
        cells = []
    return Lesson(path.name, Node(cells=cells))


def outlines(folder: Path = FOLDER) -> list[Lesson]:
    """Return the notebooks of a folder, quickly: 0.15 s for this course."""
    return [outline(path) for path in paths(folder)]


def path_of(name: str, folder: Path = FOLDER) -> Path:
    """Return the notebook of a lesson, by its name. Raises ValueError if there is none."""
    found = [path for path in paths(folder) if path.stem[3:] == name]
    if len(found) != 1:
        raise ValueError(f'There is no lesson called {name} in {folder}.')
    return found[0]


def chosen(words: str, folder: Path = FOLDER) -> list[Path]:
    """Return the notebooks with these numbers or names, such as '02 set_parameters'.

    An empty text chooses all. Raises ValueError if a word is not that of exactly one notebook.
    """
    known = paths(folder)
    if not known:
        raise ValueError(f'There is no notebook in {folder}.')
    notebooks = set()
    for word in words.split():
        number = f'{word:0>2}'
        match = [
            path for path in known if word in (path.stem, path.stem[3:]) or number == path.stem[:2]
        ]
        if len(match) != 1:
            names = ', '.join(path.stem for path in known)
            raise ValueError(
                f'There is no single lesson {word!r}. Give a number or a name: {names}.'
            )
        notebooks |= {*match}
    return sorted(notebooks) or known


def chosen_tasks(words: str, lesson: Lesson) -> list[Task]:
    """Return the tasks of a lesson with these numbers or names, such as '3 be_the_queue'.

    Raises ValueError if a word is not that of a task.
    """
    found = []
    for word in words.split():
        match = [task for task in lesson.tasks if word in (task.name, str(task.number))]
        if not match:
            names = ', '.join(f'{task.number} {task.name}' for task in lesson.tasks)
            raise ValueError(f'{lesson.file} has no task {word!r}. It has: {names or "none"}.')
        found += match
    return found
