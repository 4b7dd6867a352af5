"""The two doors of a class: students tell, and hear no more than that; the instructor sees.

The instructor's page is below a secret. It asks for nothing again and again: the server sends it
each change as a server-sent event, at most four times a second.
"""

import asyncio
import hmac
import json
import secrets
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

from tornado import web
from tornado.httpserver import HTTPServer
from tornado.iostream import StreamClosedError

from helpers.notebook import LOOK_CSS
from tools.classroom.class_page import events
from tools.classroom.class_page.events import parse
from tools.classroom.class_page.store import ClassStore
from tools.classroom.notes import of_step
from tools.classroom.present import deck, shown_cell
from tools.lessons.lesson import ROOT

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
PAGE_EVERY_S = 0.25
TOO_FAST = 'Too much at once: wait a minute.'
WRONG_A_MINUTE = 10  # codes from an address
EVENTS_A_MINUTE = 1200  # of a seat


class Room:
    """What all handlers share: the class, where it is in the lesson, and how fast one may ask."""

    def __init__(self, store: ClassStore, stop=lambda: None, root: Path = ROOT) -> None:
        self.store, self.stop, self._root = store, stop, root
        self.over = False  # the pages say it
        self.joins: list[str] = []  # what students type, for the wall
        self.present = next(iter(store.lessons)), 0
        self.follows_students = True  # until a deck or the instructor says where the class is
        # Slides of another day may be there. Those of a class that was broken off are its own.
        self._deck = None if store.went_on else self._place_of(deck())
        self._minutes: dict[tuple[str, int], dict] = {}  # of the step that the deck shows
        self._began_s: dict[str, float | None] = {}  # by lesson, as the slides say, or when shown
        self._counts, self._until_s = Counter(), 0.0

    def count(self) -> Counter:
        """Return how often somebody has done something in this minute: by address, or by seat."""
        if time.monotonic() > self._until_s:
            self._counts, self._until_s = Counter(), time.monotonic() + 60
        return self._counts

    def go_to(self, lesson: str, step: int) -> None:
        """Show this step. Raises LookupError where there is none."""
        self.store.lessons[lesson].starts[step]
        self.present, self.follows_students = (lesson, step), False

    def _place_of(self, slides: dict) -> tuple[str, int, float | None] | None:
        """Return lesson and step of the slides, and since when: None on the first slide."""
        path = slides.get('current', '')
        known = self.store.lessons.get(Path(path).stem[3:])
        if not known:
            return None
        # The slides of a timetable have fewer cells than the lesson.
        copy = shown_cell(self._root, slides)
        at = slides['places'].get(path, 0)
        step = known.step_of.get(copy[0][copy[1]].id, 0) if copy else known.step_at(at)
        return known.lesson.name, step, slides['began'].get(path)

    def view(self) -> dict:
        """Return all that the page shows: where the slides have gone, or most students are."""
        slides = deck()
        place = self._place_of(slides)
        if place and place != self._deck:
            lesson, step, began_s = self._deck = place
            self.go_to(lesson, step)
            self._began_s[lesson], self._minutes = began_s, {}
            if copy := shown_cell(self._root, slides):
                notes = of_step(*copy)
                minutes = {key: notes[key] for key in ('own', 'planned', 'all')}
                self._minutes = {self.present: minutes}
        elif self.follows_students:
            self.present = self.store.busiest() or self.present
        lesson, step = self.present
        began_s = self._began_s.setdefault(lesson, time.time())
        gone = int(time.time() - began_s) // 60 if began_s else 0
        shown = self.store.view(lesson, step) | self.store.lessons[lesson].notes[step]
        shown |= self._minutes.get(self.present, {})
        return shown | {'gone': gone, 'joins': self.joins, 'over': self.over}


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
        """Give a student with the right code a seat, or the one that the student has."""
        store, address = self.room.store, self.request.remote_ip
        wanted = parse(self.request.body, events.JOIN)
        wrong = self.room.count()
        if wrong[address] >= WRONG_A_MINUTE:
            self.refuse(429, TOO_FAST)
        elif not hmac.compare_digest(_letters(wanted['code']), _letters(store.code)):
            wrong[address] += 1
            self.refuse(401, 'This is not the code of the class. Compare it with the wall.')
        else:
            token = self.token()
            if store.seat(token) is None:
                token = secrets.token_hex(16)
            self.finish({'seat': store.join(token, wanted['name']), 'token': token})

    def events(self) -> None:
        """Take the events of a seat."""
        seat = self.room.store.seat(self.token())
        if seat is None:
            self.refuse(403, 'The class that you joined is over. To tell a new one, join it.')
            return
        told = self.room.count()
        if told[seat] >= EVENTS_A_MINUTE:  # before anything is read
            self.refuse(429, TOO_FAST)
            return
        messages = parse(self.request.body, events.EVENTS)['events']
        told[seat] += 1 + len(messages)
        self.finish({'refused': self.room.store.take(seat, messages)})

    def leave(self) -> None:
        """Forget a seat."""
        if (seat := self.room.store.seat(self.token())) is not None:
            self.room.store.leave(seat)
        self.finish({})


class Instructor(Handler):
    """The door of the instructor, whose address holds the secret."""

    def prepare(self) -> None:
        """Let nobody else in. They cannot tell this from an address that is not there."""
        secret = self.path_args[0] or ''
        if not hmac.compare_digest(secret.encode(), self.room.store.secret.encode()):
            raise web.HTTPError(404)

    async def get(self, _secret: str, name: str) -> None:
        """Answer with the page, one of its files, its changes as they come, or all as CSV."""
        if name in FILES:
            self.set_header('Content-Type', f'{FILES[name]}; charset=UTF-8')
            look = LOOK_CSS if name == 'class.css' else ''
            self.finish(look + (HERE / (name or 'class.html')).read_text('utf-8'))
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
        sent = ''
        with suppress(StreamClosedError, asyncio.CancelledError):  # the page, or the class, is over
            while True:
                if (view := json.dumps(self.room.view())) != sent:
                    self.write(f'data: {view}\n\n')
                    await self.flush()
                    sent = view
                await asyncio.sleep(PAGE_EVERY_S)

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
        self.finish({})


def _letters(code: str) -> bytes:
    """Return a code as it is compared: with blanks for dashes, or in capitals, it is the same."""
    return '-'.join(code.lower().replace('-', ' ').split()).encode()


def application(room: Room) -> web.Application:
    """Return the pages of a class."""
    return web.Application(
        [
            (r'/(join|events|leave)', Student, {'room': room}),
            (r'(?:/(\w+)/)?(.*)', Instructor, {'room': room}),
        ],
        log_function=lambda handler: None,  # addresses of students are kept nowhere
    )


def serve(application: web.Application, sockets: list) -> HTTPServer:
    """Answer on these sockets. A message must be small, and come in a few seconds."""
    server = HTTPServer(
        application,
        max_buffer_size=2 * events.LARGEST_BODY,
        max_body_size=events.LARGEST_BODY,
        max_header_size=16 * 1024,
        body_timeout=10,
        idle_connection_timeout=60,
    )
    server.add_sockets(sockets)
    return server
