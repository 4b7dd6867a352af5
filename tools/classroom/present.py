"""Show copies of lessons as a deck, slides whose cells run: `make present`.

    python -m tools.classroom.present --lessons 2 --saved-outputs
    python -m tools.classroom.present --plan 90 --new

What happens in front of a class stays in the copies. All lessons have one, because slides link to
each other. A copy in which nothing has happened follows its lesson. Any other is kept, and the
deck says so.
"""

import hashlib
import json
import sys
import time
from functools import lru_cache
from pathlib import Path

import nbformat
from jupyter_core.paths import jupyter_config_dir
from nbformat.v4 import new_markdown_cell

from helpers.notebook import MARK
from tools.classroom.plan import NO_PLAN, Plan, plan_of
from tools.lab import open_lab, parser
from tools.lessons import lesson
from tools.lessons.clean import text_of, write
from tools.lessons.slides import folded, slide_types

FOLDER = 'presentation'
EXTENSIONS = Path(__file__).with_name('deck')  # of JupyterLab
MADE = '.made.json'  # the hash of each copy as it was made, and how it was made


def deck_file() -> Path:
    """Return the file that keeps the deck's place."""
    return Path(jupyter_config_dir(), 'deck.json')


def deck() -> dict:
    """Return the deck's place: `current`, `places`, `began`; nothing if there was no deck yet."""
    try:
        return json.loads(deck_file().read_text())
    except (OSError, ValueError):
        return {}


def shown_cell(root: Path, deck: dict) -> tuple[list[nbformat.NotebookNode], int] | None:
    """Return the cells of the copy that the deck shows, and its place in them; or None."""
    file = root / FOLDER / Path(deck.get('current', '')).name
    try:
        cells = _cells(file, file.stat().st_mtime_ns)
    except (OSError, ValueError):  # there is none, or JupyterLab is writing it
        return None
    return cells, min(deck['places'].get(deck['current'], 0), len(cells) - 1)


@lru_cache(maxsize=2)
def _cells(file: Path, _changed: int) -> list[nbformat.NotebookNode]:
    return nbformat.read(file, as_version=4).cells


class Copies:
    """The copies below `root`: all steps, or those of a timetable, with or without outputs.

    Without these arguments, they stay as they were made.
    """

    def __init__(self, root: Path, plan: str | None = None, outputs: bool = False) -> None:
        self.root, self.folder = root, root / FOLDER
        self._record = self.folder / MADE
        if plan is None:
            plan, outputs = self._made().get('how', ('', False))
        self._how = plan, outputs
        self.plan: Plan = plan_of(plan) if plan else NO_PLAN

    def make(self, wanted: list[Path], new: bool = False) -> None:
        """Make or keep all copies. `new` makes those of the wanted lessons anew."""
        self.folder.mkdir(exist_ok=True)
        write(self._record, json.dumps(self._made() | {'how': self._how}))
        for path in lesson.paths(self.root / 'notebooks'):
            if not self.used(path.name) or (new and path in wanted):
                self._make(path)

    def used(self, name: str) -> str:
        """Return when something was last typed or run in a copy; an empty text for never."""
        copy = self.folder / name
        if not copy.is_file() or _hash(copy.read_text(encoding='utf-8')) == self._made().get(name):
            return ''
        return time.strftime('%d %B, %H:%M', time.localtime(copy.stat().st_mtime))

    def _made(self) -> dict:
        try:
            return json.loads(self._record.read_text())
        except (OSError, ValueError):  # none yet, or it was broken off: what is there is kept
            return {}

    def _make(self, path: Path) -> None:
        source, made = path.read_text(encoding='utf-8'), self._made()
        how = _hash(f'{self._how} {self.plan} {source}')
        copy, origin = self.folder / path.name, f'{path.name}, made from'
        if made.get(origin) == how and copy.is_file() and not self.used(path.name):
            return
        text = self._copy_of(source, path.name)
        write(copy, text)
        write(self._record, json.dumps(made | {path.name: _hash(text), origin: how}, indent=1))

    def _copy_of(self, source: str, name: str) -> str:
        notebook = nbformat.reads(source, as_version=4)
        _, outputs = self._how
        notebook.metadata.pop(MARK, None)  # the slides show the outputs of this copy
        self._leave_out(notebook, name)
        for cell, kind in zip(notebook.cells, slide_types(notebook), strict=True):
            cell.metadata.pop('slideshow', None)
            if kind:
                cell.metadata.slideshow = nbformat.from_dict({'slide_type': kind})
            if folded(cell):
                cell.metadata.jupyter = {'source_hidden': True}
            if cell.cell_type == 'code' and (not outputs or 'solution' in lesson.tags(cell)):
                cell.outputs, cell.execution_count = [], None
        return text_of(notebook)

    def _leave_out(self, notebook: nbformat.NotebookNode, name: str) -> None:
        """Keep the opening and the steps of the timetable, and lead to its next lesson."""
        steps = self.plan.steps.get(name)
        if steps:
            known = lesson.Lesson(name, notebook)
            kept = {'', *map(str, range(steps[0], steps[1] + 1))}
            notebook.cells = [
                cell for cell, step in zip(notebook.cells, known.steps, strict=True) if step in kept
            ]
        names = list(self.plan.steps)
        if name in names[:-1]:
            following = names[names.index(name) + 1]
            path = self.root / 'notebooks' / following
            link = lesson.read(path.read_text(encoding='utf-8'), following).next_link
            notebook.cells.append(new_markdown_cell(f'Next: {link}', id='next'))


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def main(arguments: list[str] | None = None) -> int:
    """Become the server that shows the copies, or return an exit status."""
    options = parser('Show copies of lessons as a deck, slides whose cells run.')
    options.add_argument('--lessons', default='', help="numbers such as '2 3', the first is shown")
    options.add_argument('--plan', default='', help='a timetable of teaching.md, such as 90')
    options.add_argument('--new', action='store_true', help='throw away what was typed')
    options.add_argument('--saved-outputs', action='store_true', help='with the saved outputs')
    options = options.parse_args(arguments)
    root = options.root
    try:
        copies = Copies(root, options.plan, options.saved_outputs)
        wanted = [root / 'notebooks' / name for name in copies.plan.steps]
        if options.lessons.split():
            wanted = lesson.chosen(options.lessons, root / 'notebooks')
        elif not wanted:
            raise ValueError('Name a lesson, for example: make present LESSON=02')
        copies.make(wanted, options.new)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    for path in wanted:
        used = copies.used(path.name)
        said = f'was used on {used}. NEW=yes begins anew.' if used else 'is a copy of the lesson.'
        print(copies.folder / path.name, said, file=sys.stderr)
    for file in Path(jupyter_config_dir(), 'lab', 'workspaces').glob('present-*'):
        file.unlink()
    if options.new:
        deck_file().unlink(missing_ok=True)
    open_lab(
        options,
        f'lab/workspaces/present/tree/{FOLDER}/{wanted[0].name}',
        (
            f'--LabApp.extra_labextensions_path={EXTENSIONS}',
            '--ServerApp.jpserver_extensions=tools.classroom.notes_window=True',
        ),
        deck=True,
    )
    return 0


if __name__ == '__main__':
    sys.exit(main())
