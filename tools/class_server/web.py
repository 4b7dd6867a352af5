"""The two doors of a class: students tell, and hear no more than that; the instructor sees.

The instructor's page is below a secret. It asks for nothing again and again: the server sends it
each change as a server-sent event, at most four times a second.
"""

import asyncio
import hmac
import json
import secrets
import time
from contextlib import suppress
from pathlib import Path

from jupyter_core.paths import jupyter_config_dir
from tornado import web
from tornado.httpserver import HTTPServer
from tornado.iostream import StreamClosedError

from tools.class_server import events
from tools.class_server.events import Limit, parse
from tools.class_server.store import Class
from tools.lessons.notes import of_step

HERE = Path(__file__).resolve().parent
FILES = {'': 'text/html', 'class.css': 'text/css', 'class.js': 'text/javascript'}
HEADERS = {
    'Cache-Control': 'no-store',
    # Slides of `make present` show a part of the page; their server has another port.
    'Content-Security-Policy': "default-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data:; frame-ancestors http://localhost:* http://127.0.0.1:*",
    'Referrer-Policy': 'no-referrer',
    'X-Content-Type-Options': 'nosniff',
}
DECK = 'deck-*.jupyterlab-workspace'  # presenter.js keeps there where the slides are
PAGE_EVERY_S = 0.25
DECK_EVERY_S = 0.5
SIGN_OF_LIFE_S = 15.0
TOO_FAST = 'Too much at once: wait a minute.'
WRONG_A_MINUTE = 10  # codes from an address; ten times as many from all together
EVENTS_A_S, EVENTS_AT_ONCE = 20, 300  # of a seat


class Room:
    """What all handlers share: the class, where it is in the lesson, and how fast one may ask."""

    def __init__(self, store: Class, stop=lambda: None) -> None:
        self.store, self.stop = store, stop
        self.joins: list[str] = []  # what students type, for the wall
        self.present = store.busiest()
        self.follows_students = True  # until a deck or the instructor says where the class is
        self._deck: object = self._place_of_deck()
        self._began: dict[str, float] = {}
        self._limits: dict[tuple, Limit] = {}
        self._all_wrong = Limit(WRONG_A_MINUTE / 6, 10 * WRONG_A_MINUTE)

    def limit(self, what: str, who: object, rate: float, burst: int) -> Limit:
        """Return the limit of somebody for something."""
        if len(self._limits) > 10_000:  # of addresses that nobody has
            self._limits.clear()
        return self._limits.setdefault((what, who), Limit(rate, burst))

    def wrong_codes(self, address: str) -> list[Limit]:
        """Return the limits of wrong codes: of an address, and of all."""
        return [self._all_wrong, self.limit('wrong', address, WRONG_A_MINUTE / 60, WRONG_A_MINUTE)]

    def go_to(self, lesson: str, step: int) -> None:
        """Show this step. Raises LookupError where there is none."""
        self.store.lessons[lesson].steps[step]
        self.present, self.follows_students = (lesson, step), False
        self.store.changes += 1

    def _place_of_deck(self) -> tuple[str, int] | None:
        """Return the lesson and the cell at which `make present` is."""
        with suppress(OSError, ValueError, LookupError):
            [file] = Path(jupyter_config_dir(), 'lab', 'workspaces').glob(DECK)
            deck = json.loads(file.read_text())['data']
            lesson = Path(deck['current']).stem[3:]
            if lesson in self.store.lessons:
                return lesson, deck['places'].get(deck['current'], 0)
        return None

    def follow(self) -> None:
        """Go where the deck has gone since the last time, or else where most students are."""
        deck = self._place_of_deck()
        if deck != self._deck and deck:
            lesson, cell = deck
            steps = self.store.lessons[lesson].steps
            self.go_to(lesson, sum(start <= cell for start in steps) - 1)
        elif self.follows_students:
            self.present = self.store.busiest()
        self._deck = deck

    def view(self) -> dict:
        """Return all that the page shows."""
        lesson, step = self.present
        known = self.store.lessons[lesson]
        notes = of_step(known.cells, known.steps[step])
        began = self._began.setdefault(lesson, time.monotonic())
        gone = int(time.monotonic() - began) // 60
        return self.store.view(lesson, step) | notes | {'gone': gone, 'joins': self.joins}


class Handler(web.RequestHandler):
    """What both doors have: headers, and one sentence for each error."""

    def initialize(self, room: Room) -> None:
        """Take over what all handlers share."""
        self.room = room

    def set_default_headers(self) -> None:
        """Let nobody keep the answer, and let the page load nothing from elsewhere."""
        for header, value in HEADERS.items():
            self.set_header(header, value)
        self.clear_header('Server')

    def refuse(self, status: int, sentence: str) -> None:
        """Answer with a sentence."""
        self.set_status(status)
        self.finish({'error': sentence})

    def write_error(self, status_code: int, **_unused: object) -> None:
        """Say nothing of what happened inside."""
        self.finish({'error': f'This cannot be answered ({status_code}).'})


class Nowhere(Handler):
    """All other addresses."""

    def prepare(self) -> None:
        """Say that there is nothing."""
        raise web.HTTPError(404)


class Student(Handler):
    """The door of the students: what they tell comes in. Of others nothing goes out."""

    def token(self) -> str:
        """Return the token that the request brings."""
        return self.request.headers.get('Authorization', '').removeprefix('token ')[:200]

    def post(self, what: str) -> None:
        """Take a message."""
        try:
            getattr(self, what)()
        except ValueError as problem:
            self.refuse(400, str(problem))

    def join(self) -> None:
        """Give who knows the code a seat; who has one keeps it."""
        store, address = self.room.store, self.request.remote_ip
        wanted = parse(self.request.body, events.NAME)
        wrong = self.room.wrong_codes(address)
        if any(limit.left() < 1 for limit in wrong):
            self.refuse(429, TOO_FAST)
        elif not hmac.compare_digest(_letters(wanted['code']), _letters(store.code)):
            for limit in wrong:
                limit.take()
            self.refuse(401, 'This is not the code of the class. Compare it with the wall.')
        elif not self.room.limit('join', address, 1, 60).take():
            self.refuse(429, TOO_FAST)
        else:
            token = self.token()
            if store.seat(token) is None:
                token = secrets.token_hex(16)
            self.finish({'seat': store.join(token, wanted.get('name', '')), 'token': token})

    def events(self) -> None:
        """Take the events of a seat."""
        seat = self.room.store.seat(self.token())
        if seat is None:
            self.refuse(403, 'The class that you joined is over. To tell a new one, join it.')
            return
        limit = self.room.limit('events', seat, EVENTS_A_S, EVENTS_AT_ONCE)
        if not limit.take():  # before anything is read
            self.refuse(429, TOO_FAST)
            return
        messages = parse(self.request.body, events.ENVELOPE)['events']
        if not limit.take(len(messages)):
            self.refuse(429, TOO_FAST)
            return
        self.finish({'refused': self.room.store.take(seat, messages)})

    def leave(self) -> None:
        """Forget a seat."""
        if (seat := self.room.store.seat(self.token())) is not None:
            self.room.store.leave(seat)
        self.finish({})


class Instructor(Handler):
    """The door of the instructor, who knows the secret."""

    def prepare(self) -> None:
        """Let nobody else in. They cannot tell this from an address that is not there."""
        secret = self.path_args[0]
        if not hmac.compare_digest(secret.encode(), self.room.store.secret.encode()):
            raise web.HTTPError(404)

    async def get(self, _secret: str, name: str) -> None:
        """Answer with the page, one of its files, its changes as they come, or all as CSV."""
        if name in FILES:
            self.set_header('Content-Type', f'{FILES[name]}; charset=UTF-8')
            self.finish((HERE / (name or 'class.html')).read_bytes())
        elif name == 'live':
            await self._send_changes()
        elif name == 'class.csv':
            self.set_header('Content-Type', 'text/csv; charset=UTF-8')
            self.set_header('Content-Disposition', 'attachment; filename="class.csv"')
            self.finish(self.room.store.as_csv())
        else:
            raise web.HTTPError(404)

    async def _send_changes(self) -> None:
        self.set_header('Content-Type', 'text/event-stream')
        sent, sent_at = None, 0.0
        with suppress(StreamClosedError):
            while True:
                view = json.dumps(self.room.view())
                if view != sent or time.monotonic() - sent_at > SIGN_OF_LIFE_S:
                    self.write(f'data: {view}\n\n')
                    await self.flush()
                    sent, sent_at = view, time.monotonic()
                changes = self.room.store.changes
                for _ in range(4):
                    await asyncio.sleep(PAGE_EVERY_S)
                    if changes != self.room.store.changes:
                        break

    def post(self, _secret: str, name: str) -> None:
        """Do what a button of the page says."""
        store = self.room.store
        try:
            wanted = json.loads(self.request.body)
            match name:
                case 'show' | 'hide':
                    change = store.shown.add if name == 'show' else store.shown.discard
                    change((self.room.present[0], str(wanted['question'])))
                case 'go':
                    self.room.go_to(wanted['lesson'], int(wanted['step']))
                case 'lower':
                    store.lower(int(wanted['seat']))
                case 'forget':
                    store.forget()
                case 'end':
                    self.room.stop()
                case _:
                    raise web.HTTPError(404)
        except (ValueError, LookupError, TypeError):
            self.refuse(400, 'The page asked for what is not there.')
            return
        store.changes += 1
        self.finish({})


def _letters(code: str) -> bytes:
    """Return a code as it is compared: with blanks for dashes, or in capitals, it is the same."""
    return '-'.join(code.lower().replace('-', ' ').split()).encode()


def application(room: Room) -> web.Application:
    """Return the pages of a class."""
    return web.Application(
        [
            (r'/(join|events|leave)', Student, {'room': room}),
            (r'/(\w+)/(.*)', Instructor, {'room': room}),
            (r'.*', Nowhere, {'room': room}),
        ],
        log_function=lambda handler: None,  # addresses of students are kept nowhere
    )


def serve(
    application: web.Application, sockets: list, ssl_options: dict | None = None
) -> HTTPServer:
    """Answer on these sockets. A message must be small, and come in a few seconds."""
    server = HTTPServer(
        application,
        ssl_options=ssl_options,
        max_buffer_size=2 * events.LARGEST_BODY,
        max_body_size=events.LARGEST_BODY,
        max_header_size=16 * 1024,
        body_timeout=10,
        idle_connection_timeout=60,
    )
    server.add_sockets(sockets)
    return server


async def follow_class(room: Room) -> None:
    """Look again and again where the deck and the students are."""
    while True:
        room.follow()
        await asyncio.sleep(DECK_EVERY_S)
