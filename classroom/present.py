"""Show copies of lessons as a deck, slides whose cells run: `make present`.

    python -m classroom.present --lessons 2
    python -m classroom.present --plan 90 --new

A copy in which something was typed or run is kept, and the deck says so.
"""

import os
import sys
from pathlib import Path

from jupyter_core.paths import jupyter_config_dir

from classroom.deck.copies import FOLDER, Copies
from helpers import lesson
from helpers.machine import sentence_about
from helpers.notebook import BEGIN_EMPTY
from tools.lab import open_lab, parser

EXTENSIONS = Path(__file__).with_name('deck')  # of JupyterLab
SETTINGS = {
    # A slide needs all of its cells, also those that are not on the screen.
    'notebook-extension/tracker': {'windowingMode': 'none', 'scrollPastEnd': False},
    # The deck saves what is typed or run at once; see `keepSaved` in presenter.js.
    'docmanager-extension/plugin': {'autosave': False},
}


def main(arguments: list[str] | None = None) -> int:
    """Become the server that shows the copies, or return an exit status."""
    options = parser('Show copies of lessons as a deck, slides whose cells run.')
    options.add_argument('--lessons', default='', help="numbers such as '2 3', the first is shown")
    options.add_argument('--plan', default='', help='a timetable, such as 90')
    options.add_argument(
        '--class', dest='page', default='', help='the class of a hub, as its page says'
    )
    options.add_argument('--new', action='store_true', help='throw away what was typed')
    options = options.parse_args(arguments)
    root = options.root
    try:
        copies = Copies(root, options.plan)
        wanted = [root / 'notebooks' / name for name in copies.plan.steps]
        if options.lessons.split():
            wanted = lesson.chosen(options.lessons, root / 'notebooks')
        elif not wanted:
            raise ValueError('Name a lesson, for example: make present LESSON=02')
        copies.make(wanted, options.new)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    except OSError as error:
        print(sentence_about(error, root), file=sys.stderr)
        return 1
    for path in wanted:
        used = copies.used(path.name)
        state = f'was used on {used}. NEW=yes begins anew.' if used else 'is a copy of the lesson.'
        print(copies.folder / path.name, state, file=sys.stderr)
    for file in Path(jupyter_config_dir(), 'lab', 'workspaces').glob('present-*'):
        file.unlink()
    os.environ[BEGIN_EMPTY] = 'yes'  # a lesson is shown from its start, also the second time
    open_lab(
        options,
        f'lab/workspaces/present/tree/{FOLDER}/{wanted[0].name}',
        (
            f'--LabApp.extra_labextensions_path={EXTENSIONS}',
            '--ServerApp.jpserver_extensions=classroom.deck.server=True',
            f'--Deck.plan={options.plan}',
            f'--Deck.page={options.page}',
        ),
        name='presenter',
        settings=SETTINGS,
    )
    return 0


if __name__ == '__main__':
    sys.exit(main())
