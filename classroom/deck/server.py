"""What the server of `make present` does for the deck in the browser.

POST deck/fresh     {"path": "presentation/02_lose_messages.ipynb"}: makes a copy anew
GET deck/class      the address of the page of the class: of a hub's, if one was named, else of the
                    one that is open here, or nothing
GET deck/plan       the rows of the timetable from its first lesson on, as JSON; none without one:
                    [{"minutes": 15, "file": "01_publish_and_subscribe.ipynb", "steps": [1, 3]},
                     {"minutes": 10, "file": "", "steps": null}]
GET deck/steps      ?file=02_lose_messages.ipynb: the steps of a copy, with their notes and minutes,
                    and the index of the step of each cell by its id, as JSON
GET deck/look.css   colours and fonts of the lessons
"""

import json
from pathlib import Path

from jupyter_server.base.handlers import JupyterHandler
from jupyter_server.serverapp import ServerApp
from jupyter_server.utils import url_path_join
from tornado import web

from classroom.class_page import page_file
from classroom.class_page.lessons import Known
from classroom.deck.copies import Copies
from classroom.plan import Plan
from helpers.lesson import read
from helpers.notebook import LOOK_CSS


class Fresh(JupyterHandler):
    """Make a copy anew."""

    def initialize(self, copies: Copies) -> None:
        """Take over the copies."""
        self.copies = copies

    @web.authenticated
    def post(self) -> None:
        """Throw away what was typed and run in a copy."""
        file = Path(self.get_json_body()['path']).name
        self.copies.make([self.copies.root / 'notebooks' / file], new=True)
        self.finish({})


class PageOfClass(JupyterHandler):
    """Give the deck the address of the class page; nothing if no class is open."""

    def initialize(self, page: str) -> None:
        """Take over the address of a hub's."""
        self.page = page

    @web.authenticated
    def get(self) -> None:
        """Answer with the address."""
        self.set_header('Content-Type', 'text/plain')
        self.set_header('Cache-Control', 'no-store')
        here = page_file().read_text() if page_file().is_file() else ''
        self.finish(self.page or here)


class Rows(JupyterHandler):
    """Give the deck its timetable."""

    def initialize(self, plan: Plan) -> None:
        """Take over the timetable."""
        self.plan = plan

    @web.authenticated
    def get(self) -> None:
        """Answer with its rows."""
        self.finish(json.dumps([row._asdict() for row in self.plan.from_first_lesson]))


class Steps(JupyterHandler):
    """Give the deck the steps of a lesson, with the notes of the instructor."""

    def initialize(self, copies: Copies) -> None:
        """Take over the copies."""
        self.copies = copies

    @web.authenticated
    def get(self) -> None:
        """Answer with what is known of them."""
        file = Path(self.get_argument('file')).name
        try:
            text = (self.copies.folder / file).read_text(encoding='utf-8')
            known = Known(read(text, file))
        except (OSError, ValueError) as error:
            raise web.HTTPError(404, str(error)) from None
        self.finish({'steps': known.notes, 'step_of': known.step_of})


class Look(JupyterHandler):
    """Give the deck and the notes window their colours and fonts."""

    @web.authenticated
    def get(self) -> None:
        """Answer with a style sheet."""
        self.set_header('Content-Type', 'text/css; charset=UTF-8')
        self.finish(LOOK_CSS)


def _load_jupyter_server_extension(server: ServerApp) -> None:
    """Let the server of `make present` answer the deck."""
    base = server.web_app.settings['base_url']
    copies = Copies(Path(server.root_dir), server.config.Deck.get('plan', ''))
    page = server.config.Deck.get('page', '')
    server.web_app.add_handlers(
        '.*',
        [
            (url_path_join(base, 'deck/fresh'), Fresh, {'copies': copies}),
            (url_path_join(base, 'deck/class'), PageOfClass, {'page': page}),
            (url_path_join(base, 'deck/plan'), Rows, {'plan': copies.plan}),
            (url_path_join(base, 'deck/steps'), Steps, {'copies': copies}),
            (url_path_join(base, 'deck/look.css'), Look),
        ],
    )
