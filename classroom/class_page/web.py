"""The two doors of a class: students tell, and hear no more than that; the instructor sees.

    POST join, events, leave   of students: helpers/checks/classroom.py documents them
    GET  SECRET/               the instructor's page, its files, and `live`, its changes
    POST SECRET/slide          of the deck, when it goes on: events.SLIDE is what it tells
    POST SECRET/show, hide, remove, go, lower,
         send_away, close_door, open_door, end
                               the buttons of the page

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

from classroom.class_page import events
from classroom.class_page.events import parse
from classroom.class_page.store import ClassStore
from helpers.notebook import LOOK_CSS

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
# Codes from an address. A whole class may have one address, behind a router, and mistype a few.
WRONG_A_MINUTE = 120
NEW_A_MINUTE = 120  # seats of an address: nobody fills the class, and a lecture has joined in three
EVENTS_A_MINUTE = 1200  # of a seat


class Room:
    """What all handlers share: the class, where it is in the lesson, and how fast one may ask."""

    def __init__(self, store: ClassStore, stop=lambda: None) -> None:
        self.store, self.stop = store, stop
        self.over = False  # the pages say it
        self.joins: list[str] = []  # what students type, for the wall
        self.deck_asks = False  # for the address of the page: it cannot find it by itself
        self.present = next(iter(store.lessons)), 0
        self.follows_students = True  # until the deck or the instructor says where the class is
        self._minutes: dict[tuple[str, int], dict] = {}  # of the step that the deck shows
        self._began_s: dict[str, float | None] = {}  # by lesson, as the deck says, or when shown
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

    def show_slide(self, slide: dict) -> None:
        """Show the step of the deck's slide. Raises LookupError for an unknown lesson.

        The minutes are those of the deck: the slides of a timetable have fewer steps.
        """
        lesson = slide['lesson']
        self.go_to(lesson, self.store.lessons[lesson].step_of.get(slide['cell'], 0))
        self._began_s[lesson] = slide['began_s']
        self._minutes = {self.present: {key: slide[key] for key in ('own', 'planned', 'all')}}

    def view(self) -> dict:
        """Return all that the page shows."""
        if self.follows_students:
            self.present = self.store.busiest() or self.present
        lesson, step = self.present
        began_s = self._began_s.setdefault(lesson, time.time())
        gone = int(time.time() - began_s) // 60 if began_s else 0
        shown = self.store.view(lesson, step) | self.store.lessons[lesson].notes[step]
        shown |= self._minutes.get(self.present, {})
        secret = self.store.secret if self.deck_asks else ''
        return shown | {'gone': gone, 'joins': self.joins, 'secret': secret, 'over': self.over}


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
            token, name = self.token(), events.plain_name(wanted['name'])
            if store.seat(token) is None and not store.is_away(token):
                token = secrets.token_hex(16)
                if wrong[f'new {address}'] >= NEW_A_MINUTE:
                    self.refuse(429, TOO_FAST)
                    return
                wrong[f'new {address}'] += 1
            self.finish({'seat': store.join(token, name), 'token': token})

    def events(self) -> None:
        """Take the events of a seat."""
        seat = self.room.store.seat(self.token())
        if self.room.store.is_away(self.token()):
            self.refuse(403, 'Your seat was taken out of this class: speak with your teacher.')
            return
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
        """Answer with the page, one of its files, or its changes as they come."""
        if name in FILES:
            self.set_header('Content-Type', f'{FILES[name]}; charset=UTF-8')
            look = LOOK_CSS if name == 'class.css' else ''
            self.finish(look + (HERE / (name or 'class.html')).read_text('utf-8'))
        elif name == 'live':
            await self._send_changes()
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
        """Do what a button of the page says, or follow the deck."""
        store = self.room.store
        try:
            wanted = json.loads(self.request.body)
            match name:
                case 'show' | 'hide':
                    change = store.shown.add if name == 'show' else store.shown.discard
                    change((self.room.present[0], str(wanted['question'])))
                case 'remove':
                    lesson, question = self.room.present[0], str(wanted['question'])
                    store.remove(lesson, question, str(wanted['answer']))
                case 'go':
                    self.room.go_to(wanted['lesson'], int(wanted['step']))
                case 'slide':
                    self.room.show_slide(parse(self.request.body, events.SLIDE))
                case 'lower':
                    store.lower(int(wanted['seat']))
                case 'send_away':
                    store.send_away(int(wanted['seat']))
                case 'close_door' | 'open_door':
                    store.close_door(name == 'close_door')
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


def serve(application: web.Application, sockets: list, *, behind_proxy: bool = False) -> HTTPServer:
    """Answer on these sockets. A message must be small, and come in a few seconds.

    Behind a proxy on this machine, a student's address is the one that the proxy tells.
    """
    server = HTTPServer(
        application,
        xheaders=behind_proxy,
        max_buffer_size=2 * events.LARGEST_BODY,
        max_body_size=events.LARGEST_BODY,
        max_header_size=16 * 1024,
        body_timeout=10,
        idle_connection_timeout=60,
    )
    server.add_sockets(sockets)
    return server
