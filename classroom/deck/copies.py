"""The copies of lessons that the deck shows.

What happens in front of a class stays in the copies. All lessons have one, because slides link to
each other. A copy in which nothing has happened follows its lesson. Any other is kept. Whatever a
teacher has answered in the lesson: guesses and tasks begin as they were delivered.

A copy says of itself, in its metadata `deck`, how it was made (`origin`, `made`), and the deck
keeps its place there (`place`, `began`), and whether it was used before (`used`).
"""

import hashlib
import json
import shutil
import time
from pathlib import Path

import nbformat
from nbformat import NotebookNode
from nbformat.v4 import new_markdown_cell

from classroom.deck.slides import folded, slide_types
from classroom.deck.texts import shortened
from classroom.plan import NO_PLAN, Plan, plan_of
from helpers import lesson
from helpers.notebook import MARK
from tools.lessons.answers import delivered
from tools.lessons.clean import text_of, write

FOLDER = 'presentation'
KEY = 'deck'  # in the metadata of a copy
WRITE, RUN = '**Today: write it.**', '**Today: run the solution.**'


class Copies:
    """The copies below `root`: all steps, or those of a timetable."""

    def __init__(self, root: Path, plan: str = '') -> None:
        self.root, self.folder = root, root / FOLDER
        self.plan: Plan = plan_of(plan) if plan else NO_PLAN

    def make(self, wanted: list[Path], new: bool = False) -> None:
        """Make or keep all copies. `new` makes those of the wanted lessons anew."""
        self.folder.mkdir(exist_ok=True)
        pictures = self.root / 'notebooks' / lesson.PICTURES
        if pictures.is_dir():
            shutil.copytree(pictures, self.folder / lesson.PICTURES, dirs_exist_ok=True)
        for path in lesson.paths(self.root / 'notebooks'):
            if new and path in wanted:
                self._make(path)
            elif used := self.used(path.name):
                self._note_used(path.name, used)
            elif new or self._origin(path.name) != self._origin_of(path):
                self._make(path)

    def used(self, name: str) -> str:
        """Return when something was last typed or run in a copy; an empty text for never."""
        copy = self.folder / name
        if not copy.is_file():
            return ''
        notebook = _read(copy)
        if notebook and _state(notebook) == notebook.metadata.get(KEY, {}).get('made'):
            return ''
        return time.strftime('%d %B, %H:%M', time.localtime(copy.stat().st_mtime))

    def _note_used(self, name: str, used: str) -> None:
        """Let the deck say that a copy was used before."""
        copy = self.folder / name
        notebook = _read(copy)
        if notebook and 'used' not in notebook.metadata.get(KEY, {}):
            notebook.metadata.setdefault(KEY, {})['used'] = used
            write(copy, text_of(notebook))

    def _origin(self, name: str) -> str:
        """Return what a copy was made from, an empty text if there is none."""
        notebook = _read(self.folder / name)
        return notebook.metadata.get(KEY, {}).get('origin', '') if notebook else ''

    def _origin_of(self, path: Path) -> str:
        return _hash(f'{self.plan} {path.read_text(encoding="utf-8")}')

    def _make(self, path: Path) -> None:
        notebook = nbformat.read(path, as_version=4)
        notebook.metadata.pop(MARK, None)  # the slides show the outputs of this copy
        as_delivered = delivered(path)
        for cell in notebook.cells:
            cell.source = as_delivered.get(cell.id, cell.source)
        self._leave_out(notebook, path.name)
        types = slide_types(notebook)
        for cell, kind in zip(notebook.cells, types, strict=True):
            cell.metadata.pop('slideshow', None)
            if kind:
                cell.metadata.slideshow = nbformat.from_dict({'slide_type': kind})
            if folded(cell):
                cell.metadata.update(nbformat.from_dict(lesson.FOLD))
            if cell.cell_type == 'code':
                cell.outputs, cell.execution_count = [], None
        notebook.cells = shortened(notebook.cells, types)
        about = {'origin': self._origin_of(path), 'made': _state(notebook)}
        notebook.metadata[KEY] = nbformat.from_dict(about)
        write(self.folder / path.name, text_of(notebook))

    def _leave_out(self, notebook: NotebookNode, name: str) -> None:
        """Keep the opening and the steps of the timetable, and lead to its next lesson."""
        steps = self.plan.steps.get(name)
        if steps:
            known = lesson.Lesson(name, notebook)
            kept = {'', *map(str, range(steps[0], steps[1] + 1))}
            notebook.cells = [
                cell for cell, step in zip(notebook.cells, known.steps, strict=True) if step in kept
            ]
            # The first slide promises what is shown.
            shown = [
                lesson.first_heading(c.source)
                for c in notebook.cells
                if lesson.has_heading(c, '## ')
            ]
            notebook.cells[0].source = '\n'.join([f'# {known.number} {known.title}', '', *shown])
        self._advise(notebook, name)
        names = list(self.plan.steps)
        if name in names[:-1]:
            following = names[names.index(name) + 1]
            path = self.root / 'notebooks' / following
            link = lesson.read(path.read_text(encoding='utf-8'), following).next_link
            notebook.cells.append(new_markdown_cell(f'Next: {link}', id='next'))

    def _advise(self, notebook: NotebookNode, name: str) -> None:
        """Say at each task whether students write it today, if the timetable says so."""
        if not (write_today := self.plan.write(name)):
            return
        for task in lesson.Lesson(name, notebook).tasks:
            said = WRITE if task.name in write_today else RUN
            task.heading.source = task.heading.source.replace('\n', f'\n\n{said}\n', 1)


def _read(copy: Path) -> NotebookNode | None:
    """Return a copy, None if there is none that can be read."""
    try:
        return nbformat.read(copy, as_version=4)
    except (OSError, ValueError, nbformat.ValidationError, AttributeError):
        return None


def _state(notebook: NotebookNode) -> str:
    """Return the hash of what is typed and run: the sources, and which cells have outputs."""
    cells = [
        (cell.id, cell.source, bool(cell.get('execution_count') or cell.get('outputs')))
        for cell in notebook.cells
    ]
    return _hash(json.dumps(cells))


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
