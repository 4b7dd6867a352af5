"""Show copies of lessons as a deck, slides whose cells run: `make present`.

    python -m tools.classroom.present --lessons 02 --saved-outputs
    python -m tools.classroom.present --lessons '02 03' --new

What happens in front of a class stays in the copies. All lessons have one, because slides link to
each other. A copy in which nothing has happened follows its lesson. Any other is kept.
"""

import hashlib
import json
import sys
import time
from pathlib import Path

import nbformat
from jupyter_core.paths import jupyter_config_dir

from helpers._plumbing.fresh import MARK
from tools.lab import open_lab, parser
from tools.lessons import lesson
from tools.lessons.clean import text_of, write
from tools.lessons.slides import folded

FOLDER = 'presentation'
DECK = 'deck-d830.jupyterlab-workspace'  # so JupyterLab calls the file of its workspace `deck`
EXTENSIONS = Path(__file__).with_name('deck')  # of JupyterLab
MADE = '.made.json'  # the hash of each copy as it was made, and of what it was made from


def deck() -> dict:
    """Return what presenter.js keeps of the slides: `current`, `places` and `began`.

    Nothing if there are no slides, or while JupyterLab writes the file. JupyterLab's own
    `WorkspacesManager` reads it, too, but takes a second to import.
    """
    try:
        return json.loads(Path(jupyter_config_dir(), 'lab/workspaces', DECK).read_text())['data']
    except (OSError, ValueError):
        return {}


def _copy_of(source: str, outputs: bool) -> str:
    notebook = nbformat.reads(source, as_version=4)
    notebook.metadata.pop(MARK, None)  # the slides show the outputs of this copy
    for cell in notebook.cells:
        if folded(cell):
            cell.metadata.jupyter = {'source_hidden': True}
        if cell.cell_type == 'code' and not outputs:
            cell.outputs, cell.execution_count = [], None
    return text_of(notebook)


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def copies_of(numbers: str, root: Path, *, new: bool = False, outputs: bool = False) -> list[Path]:
    """Make or keep the copies below `root`; return those of the lessons with these numbers.

    `new` makes those anew, whatever was typed in them. Raises ValueError with one sentence where
    there is no such lesson.
    """
    if not numbers.split():
        raise ValueError('Name a lesson, for example: make present LESSON=02')
    wanted = lesson.chosen(numbers, root / 'notebooks')
    folder = root / FOLDER
    folder.mkdir(exist_ok=True)
    record = folder / MADE
    try:
        made = json.loads(record.read_text())
    except (OSError, ValueError):  # none yet, or it was broken off: what is there is kept
        made = {}
    for path in lesson.paths(root / 'notebooks'):
        copy = folder / path.name
        touched = copy.is_file() and _hash(copy.read_text(encoding='utf-8')) != made.get(path.name)
        if touched and not (new and path in wanted):
            continue
        source, origin = path.read_text(encoding='utf-8'), f'{path.name}, made from'
        wanted_from = _hash(f'{outputs} {source}')
        if copy.is_file() and path not in wanted and made.get(origin) == wanted_from:
            continue
        text = _copy_of(source, outputs)
        write(copy, text)
        made[path.name], made[origin] = _hash(text), wanted_from
        write(record, json.dumps(made, indent=1))
    return [folder / path.name for path in wanted]


def forget_places(new: bool) -> None:
    """Delete what JupyterLab keeps of its windows, and if `new` also where the decks were."""
    for name in ('present-*', 'deck-*') if new else ('present-*',):
        for file in Path(jupyter_config_dir(), 'lab', 'workspaces').glob(name):
            file.unlink()


def main(arguments: list[str] | None = None) -> int:
    """Become the server that shows the copies, or return an exit status."""
    options = parser('Show copies of lessons as a deck, slides whose cells run.')
    options.add_argument(
        '--lessons', default='', help="numbers such as '02 03', the first is shown"
    )
    options.add_argument('--new', action='store_true', help='throw away what was typed')
    options.add_argument('--saved-outputs', action='store_true', help='with the saved outputs')
    options = options.parse_args(arguments)
    start = time.time()
    try:
        copies = copies_of(
            options.lessons, options.root, new=options.new, outputs=options.saved_outputs
        )
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    for copy in copies:
        said = 'is a copy: the lesson stays as it is.'
        if (changed := copy.stat().st_mtime) < start:
            when = time.strftime('%Y-%m-%d %H:%M', time.localtime(changed))
            said = f'goes on as it was saved on {when}. NEW=yes begins anew.'
        print(copy, said, file=sys.stderr)
    forget_places(options.new)
    open_lab(
        options,
        f'lab/workspaces/present/tree/{FOLDER}/{copies[0].name}',
        (
            f'--LabApp.extra_labextensions_path={EXTENSIONS}',
            '--ServerApp.jpserver_extensions=tools.classroom.notes_window=True',
        ),
        slides=True,
    )
    return 0


if __name__ == '__main__':
    sys.exit(main())
