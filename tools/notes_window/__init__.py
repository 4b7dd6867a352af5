"""The instructor's window, which follows the live deck: a part of the server of `make present`.

It has a port and a secret of its own, and can be read only. JupyterLab's token would let everybody
who sees it on a tablet run programs here. JupyterLab itself stays on this machine, also where
`TABLET=yes` opens the window to the network.

Where the deck is, presenter.js keeps in a workspace of JupyterLab. The rest stands in the notebook.
"""

import hmac
import html
import os
import secrets
import socket
import sys
import time
from functools import lru_cache
from pathlib import Path

import nbformat
from jupyter_server.base.handlers import JupyterHandler
from jupyter_server.utils import url_path_join
from nbconvert.filters import markdown2html
from tornado import web
from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets

from tools.addresses import in_networks
from tools.class_server import page_file
from tools.lessons.notes import of_step
from tools.lessons.present import FOLDER, deck

HERE = Path(__file__).resolve().parent
PORTS = range(8900, 8950)
FILES = {  # by the name in the address
    '': ('window.html', 'text/html'),
    'window.css': ('window.css', 'text/css'),
    'window.js': ('window.js', 'text/javascript'),
}
HEADERS = {
    'Cache-Control': 'no-store',
    'Content-Security-Policy': "default-src 'self' data:; style-src 'self' 'unsafe-inline'",
    'Referrer-Policy': 'no-referrer',
}


def state(root: Path, deck: dict) -> dict:
    """Return what the window shows: of the notebook `deck['current']`, and of its cell.

    `root` is the folder with the copies, `deck` what presenter.js keeps. Without a deck the answer
    is empty.
    """
    file = root / FOLDER / Path(deck.get('current', '')).name
    if not file.is_file():
        return {}
    try:
        cells = _cells(file, file.stat().st_mtime_ns)
    except (OSError, ValueError):  # JupyterLab is writing it
        return {}
    at = min(deck['places'].get(deck['current'], 0), len(cells) - 1)
    types = [cell.metadata.get('slideshow', {}).get('slide_type') for cell in cells]
    starts = [i for i, kind in enumerate(types) if kind in ('slide', 'subslide')]
    starts += [len(cells)] * 2  # the end of the last slide, and of the one after it, which is empty
    slide = sum(start <= at for start in starts)
    on_slide = range(at + 1, starts[slide])
    on_slide = [cells[i] for i in on_slide if types[i] == 'fragment']
    following = [cells[i] for i in range(*starts[slide : slide + 2]) if types[i] != 'skip']
    began = deck['began'].get(deck['current'])
    return of_step(cells, at) | {
        'slide': slide,
        'slides': len(starts) - 2,
        'next': 'On this slide' if on_slide else 'Next slide',
        'cells': ''.join(map(_html, on_slide or following)),
        'gone': int(time.time() - began) // 60 if began else 0,
    }


@lru_cache(maxsize=2)
def _cells(file: Path, _changed: int) -> list[nbformat.NotebookNode]:
    """Return the cells of a notebook. It is read again where the time of its change is another."""
    return nbformat.read(file, as_version=4).cells


def _html(cell: nbformat.NotebookNode) -> str:
    if cell.cell_type == 'markdown':
        return markdown2html(cell.source)
    return f'<pre>{html.escape(cell.source)}</pre>'


class Window(web.RequestHandler):
    """Answers who knows the secret: with the page, its files, and the state as JSON."""

    def initialize(self, root: Path, secret: str) -> None:
        """Take over what `serve` knows."""
        self.root, self.secret = root, secret

    def get(self, secret: str, name: str) -> None:
        """Answer a request for /SECRET/NAME."""
        if not hmac.compare_digest(secret.encode(), self.secret.encode()):
            raise web.HTTPError(404)
        for header, value in HEADERS.items():
            self.set_header(header, value)
        if name == 'state':
            self.finish(state(self.root, deck()))
        elif name in FILES:
            file, kind = FILES[name]
            self.set_header('Content-Type', f'{kind}; charset=UTF-8')
            self.finish((HERE / file).read_bytes())
        else:
            raise web.HTTPError(404)


class PageOfClass(JupyterHandler):
    """Tells the slides the address of the page of the class; nothing where `make class` is not."""

    @web.authenticated
    def get(self) -> None:
        """Answer with the address."""
        self.set_header('Content-Type', 'text/plain')
        self.finish(page_file().read_text() if page_file().is_file() else '')


def serve(root: Path, address: str) -> tuple[int, str]:
    """Serve the window on an address of this machine; return the port and the secret."""
    secret = secrets.token_hex(6)
    handlers = [(r'/(\w+)/(.*)', Window, {'root': root, 'secret': secret})]
    # Two requests a second would push the addresses out of the terminal.
    application = web.Application(handlers, log_function=lambda handler: None)
    for port in PORTS:
        try:
            sockets = bind_sockets(port, address, socket.AF_INET)
        except OSError:  # it is taken
            continue
        HTTPServer(application).add_sockets(sockets)
        return port, secret
    raise ValueError(f'No port from {PORTS[0]} to {PORTS[-1]} is free for the notes.')


def _load_jupyter_server_extension(server) -> None:
    """Serve the window beside the server of `make present`, and say where.

    With TABLET=yes in the environment, it is open to the networks of this machine.
    """
    tablet = os.environ.get('TABLET') == 'yes'
    port, secret = serve(Path(server.root_dir), '0.0.0.0' if tablet else '127.0.0.1')
    others = in_networks() if tablet else []
    page_config = server.web_app.settings.setdefault('page_config_data', {})
    page_config['notesWindow'] = f':{port}/{secret}/'  # for presenter.js
    path = url_path_join(server.web_app.settings['base_url'], 'class')
    server.web_app.add_handlers('.*', [(path, PageOfClass)])
    lines = [f'http://{address}:{port}/{secret}/' for address in ['localhost', *others]]
    # After all that JupyterLab prints at its start.
    server.io_loop.add_callback(print, 'Your notes:', *lines, sep='\n    ', file=sys.stderr)
