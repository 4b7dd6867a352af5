"""The notes window, which follows the deck: a part of the server of `make present`.

presenter.js tells the server where the deck is. The rest is in the notebook.
"""

import html
import json
import time
from pathlib import Path

import nbformat
from jupyter_server.base.handlers import JupyterHandler
from jupyter_server.serverapp import ServerApp
from jupyter_server.utils import url_path_join
from nbconvert.filters import markdown2html
from tornado import web

from helpers.notebook import LOOK_FILE
from tools.classroom.class_page import page_file
from tools.classroom.notes import of_step
from tools.classroom.present import FOLDER, Copies, deck, deck_file, shown_cell
from tools.lessons.clean import write

HERE = Path(__file__).resolve().parent
FILES = {  # by the name in the address
    '': (HERE / 'window.html', 'text/html'),
    'look.css': (LOOK_FILE, 'text/css'),
    'window.css': (HERE / 'window.css', 'text/css'),
    'window.js': (HERE / 'window.js', 'text/javascript'),
}


def state(root: Path, deck: dict) -> dict:
    """Return what the window shows: of the notebook `deck['current']`, and of its cell.

    `root` is the folder with the copies, `deck` what presenter.js keeps. Without a deck the answer
    is empty.
    """
    place = shown_cell(root, deck)
    if place is None:
        return {}
    cells, at = place
    types = [cell.metadata.get('slideshow', {}).get('slide_type') for cell in cells]
    starts = [i for i, kind in enumerate(types) if kind in ('slide', 'subslide')]
    starts += [len(cells)] * 2  # the end of the last slide, and of the one after it, which is empty
    slide = sum(start <= at for start in starts)
    following = [cells[i] for i in range(*starts[slide : slide + 2]) if types[i] != 'skip']
    began = deck['began'].get(deck['current'])
    return of_step(cells, at) | {
        'slide': slide,
        'slides': len(starts) - 2,
        'cells': ''.join(map(_html, following)),
        'gone': int(time.time() - began) // 60 if began else 0,
    }


def _html(cell: nbformat.NotebookNode) -> str:
    if cell.cell_type == 'markdown':
        return markdown2html(cell.source)
    return f'<pre>{html.escape(cell.source)}</pre>'


class Window(JupyterHandler):
    """Answer the instructor, whom JupyterLab knows: the page, its files, the state as JSON."""

    def initialize(self, root: Path) -> None:
        """Take over the folder with the copies."""
        self.root = root

    @web.authenticated
    def get(self, name: str) -> None:
        """Answer a request for /notes/NAME."""
        self.set_header('Cache-Control', 'no-store')
        if name == 'state':
            self.finish(state(self.root, deck()))
        elif name in FILES:
            file, kind = FILES[name]
            self.set_header('Content-Type', f'{kind}; charset=UTF-8')
            self.finish(file.read_bytes())
        else:
            raise web.HTTPError(404)


class Deck(JupyterHandler):
    """Keep where the deck is, and make a copy anew."""

    def initialize(self, copies: Copies, used: dict[str, str]) -> None:
        """Take over the copies, and when something was typed in them before the server began."""
        self.copies, self.used = copies, used

    @web.authenticated
    def get(self, _name: str) -> None:
        """Answer with the place."""
        self.set_header('Cache-Control', 'no-store')
        self.finish(deck() | {'used': self.used})

    @web.authenticated
    def post(self, name: str) -> None:
        """Keep the place, or make the copy of a path anew."""
        body = self.get_json_body()
        if name == 'state':
            write(deck_file(), json.dumps(body))
            # Who goes on has seen that the copy was used.
            if body['places'].get(body['current']):
                self.used.pop(body['current'], None)
        else:
            file = Path(body['path']).name
            self.copies.make([self.copies.root / 'notebooks' / file], new=True)
            self.used.pop(body['path'], None)
        self.finish({})


class PageOfClass(JupyterHandler):
    """Give the slides the address of the class page; nothing if no class is open."""

    @web.authenticated
    def get(self) -> None:
        """Answer with the address."""
        self.set_header('Content-Type', 'text/plain')
        self.finish(page_file().read_text() if page_file().is_file() else '')


def _load_jupyter_server_extension(server: ServerApp) -> None:
    """Add the window to the server of `make present`."""
    base, root = server.web_app.settings['base_url'], Path(server.root_dir)
    copies = Copies(root)
    files = copies.folder.glob('*.ipynb')
    used = {f'{FOLDER}/{file.name}': when for file in files if (when := copies.used(file.name))}
    server.web_app.add_handlers(
        '.*',
        [
            (url_path_join(base, 'notes/(.*)'), Window, {'root': root}),
            (url_path_join(base, 'class'), PageOfClass),
            (url_path_join(base, 'deck/(state|fresh)'), Deck, {'copies': copies, 'used': used}),
        ],
    )
