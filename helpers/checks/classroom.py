"""A class that sees itself: guesses, tasks and steps, told to the class that one has joined.

    join_class('192.0.2.5:8765', 'blue-otter-lamp')   once, from what is on the wall
    raise_hand(), lower_hand(), leave_class()

Without a class nothing is sent, shown or waited for. With one, a thread in the background writes
each event into a file beside the student's progress, then sends it and removes it. So nothing is
lost while the class does not answer, or when the kernel is restarted. An event has an id of its
own, by which the class counts it once, and the file keeps the order: no clock does.

On a JupyterHub the hub names the class, and its token says whose server this is.

A class page is whatever serves three requests below its address, in JSON. The header
`Authorization: token ...` holds the token that `join` has given, empty before.

    POST join    {"code": "blue-otter-lamp", "name": ""}  ->  {"seat": 3, "token": "..."}
    POST events  {"events": [...]}                        ->  {"refused": ""}, or a sentence
    POST leave   {}                                       ->  {}

Another status than 200 comes with {"error": "one sentence"}, which the student reads. After 429,
500 or more the same events are sent again later. An event has an `id` of 16 hexadecimal digits, the
name of its `lesson`, a `kind`, and what belongs to it:

    guess, outcome   "question", "value": what was guessed, and what was measured
    task             "task": "be_the_queue", "solved": true
    about            "about": "plain_twist", "task": "mend_ada": which one it was that is solved
    cell             "cell": the id of the cell that runs
    hand             "up": true
"""

from __future__ import annotations

import atexit
import json
import os
import re
import secrets
import sqlite3
import sys
import threading
import time
from collections import deque
from collections.abc import Set
from contextlib import closing, suppress
from pathlib import Path
from typing import NamedTuple

from helpers.checks import progress
from helpers.notebook import wrap

__all__ = ['join_class', 'leave_class', 'lower_hand', 'raise_hand']

HUB_VARIABLE = 'ROS2_NOTEBOOKS_CLASS'  # on a JupyterHub: the address of its class
JOINED_FOR_S = 12 * 3600  # a class that was not left is forgotten, so that nothing is sent at home
ADDRESS = re.compile(r'(https?://)?[\w.-]+(:\d+)?(/[\w./-]*)?')
ANSWER_LIMIT_S = 5.0
TRY_AGAIN_S = 2.0
TOGETHER_S = 0.05  # events of this time are one message
GIVE_UP_S = 600.0  # of a class that does not answer: its teacher has ended it
BATCH = 50
WAITING = 1000  # events that are kept while the class does not answer; the oldest ones go first
LARGEST = 2**53  # of numbers, which a browser holds exactly
TEXT = 200  # letters of a text, at most
ITEMS = 20  # of a list or a set, at most
UNUSABLE = (
    'Nothing is sent to the class, because {} cannot be used ({}): remove this file, then join '
    'again.'
)
SILENT = (
    'The class does not answer. What you tell is kept for ten minutes. If the class is over, '
    'leave_class() ends this.'
)
OVER = 'The class has not answered for ten minutes, so you have left it. You can join again.'
NOT_JOINED = 'You are in no class: join_class(address, code) joins one.'
NO_LESSON = 'Nothing is sent, because this notebook is no lesson: do it in the lesson itself.'
SENT = (
    'Sent to it: your guesses and what you measured, which tasks you tried and solved, at '
    'which step you are, and a raised hand. Not sent: your code and its outputs.'
)
TABLES = """
CREATE TABLE IF NOT EXISTS class (url TEXT, token TEXT, until_s REAL);
CREATE TABLE IF NOT EXISTS waiting (
    n INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT UNIQUE, kind TEXT, event TEXT
);
"""


class Class(NamedTuple):
    """Where events go, and the token of the sender. Left, on a hub: an empty address."""

    url: str
    token: str


# --- What a notebook calls -----------------------------------------------------------------------


def join_class(address: str = '', code: str = '', name: str = '') -> None:
    """Join a class, and say what is sent: `join_class('192.0.2.5:8765', 'blue-otter-lamp')`.

    The address and the code are on the wall. A name is optional.
    On a JupyterHub `join_class()` joins again after `leave_class()`. What does not work is said in
    one sentence; nothing is raised.
    """
    try:
        text = _join(str(address).strip(), code, name)
    except ValueError as problem:
        text = str(problem)
    except (OSError, sqlite3.Error) as problem:
        text = UNUSABLE.format(_file(), problem)
    print(*wrap(text), sep='\n')


def leave_class() -> None:
    """Leave the class: it is asked to delete what it has, and nothing more is sent.

    What does not work is said in one sentence; nothing is raised.
    """
    try:
        text = _leave()
    except OSError as problem:
        text = UNUSABLE.format(_file(), problem)
    print(*wrap(text), sep='\n')


def raise_hand() -> None:
    """Show the class "I am lost", until `lower_hand()`."""
    _hand(True, 'Your hand is up. lower_hand() takes it down.')


def lower_hand() -> None:
    """Take the hand down again."""
    _hand(False, 'Your hand is down.')


# --- What `checks` sends


def tell_guess(question: str, value: object) -> None:
    """Send what a student guesses."""
    _tell('guess', question=question, value=value)


def tell_outcome(question: str, value: object) -> None:
    """Send what was measured after a guess."""
    _tell('outcome', question=question, value=value)


def tell_task(task: str, solved: bool) -> None:
    """Tell the class that a task was tried."""
    _tell('task', task=task, solved=solved)


def tell_about(task: str, about: str) -> None:
    """Tell the class about what a task was that is solved, if each student has another one."""
    _tell('about', about=about, task=task)


def say_trouble() -> None:
    """Print one line if the class has not answered since the last line."""
    _outbox.say_trouble()


# --- In the background ---------------------------------------------------------------------------


class _Outbox:
    """Keeps events in the student's file and sends them, in a thread that starts with the first."""

    def __init__(self) -> None:
        self._events: deque[dict] = deque()  # until they are in the file
        self._came = threading.Event()
        self._lock, self._keeping = threading.Lock(), threading.Lock()
        self._thread: threading.Thread | None = None
        self._trouble = self._said = ''
        self._silent_since: float | None = None
        atexit.register(self._at_exit)

    def put(self, event: dict) -> None:
        """Take over an event. It does not wait: one that finds no room is lost."""
        with self._lock:
            if len(self._events) < WAITING:
                self._events.append(event)
            self._came.set()
            if self._thread is None or not self._thread.is_alive():
                self._thread = threading.Thread(target=self._run, daemon=True, name='class')
                self._thread.start()

    def drop(self) -> None:
        """Lose the events that are not in the file yet."""
        with self._keeping:
            self._events.clear()

    def say_trouble(self) -> None:
        """Print one line if the class has not answered since the last line."""
        if self._trouble and self._trouble != self._said:
            print(*wrap(self._trouble), sep='\n')
        self._said = self._trouble

    def _run(self) -> None:
        """End if there is no class, or if the file cannot be used; `put` starts again."""
        try:
            with closing(_open(_file())) as db:
                while self._goes_on(db):
                    self._came.clear()
                    self._keep(db)
                    time.sleep(TOGETHER_S)
                    self._keep(db)
                    waiting = self._deliver(db)
                    self._came.wait(TRY_AGAIN_S if waiting else None)
        except (OSError, sqlite3.Error) as problem:
            self._trouble = UNUSABLE.format(_file(), problem)
            with self._lock:
                self._end()

    def _goes_on(self, db: sqlite3.Connection) -> bool:
        """Return whether there is a class; if there is none, let the thread end."""
        if _class(db) is None:
            with self._lock:
                # In between, a student may have joined a class and guessed.
                if _class(db) is None:
                    self._end()
                    return False
        return True

    def _end(self) -> None:
        """Let the next event start another thread. `_lock` is held: no event comes meanwhile."""
        self.drop()
        self._thread = None

    def _at_exit(self) -> None:
        """Keep what came while the thread waited for an answer: a next kernel sends it."""
        with suppress(OSError, sqlite3.Error):
            if self._events:
                with closing(_open(_file())) as db:
                    self._keep(db)

    def _keep(self, db: sqlite3.Connection) -> None:
        """Move events into the file."""
        with self._keeping:  # the thread, and the one that ends the kernel
            events = list(self._events)
            with db:
                for event in events:
                    if event['kind'] == 'cell':  # only the last one matters
                        db.execute("DELETE FROM waiting WHERE kind = 'cell'")
                    row = event['id'], event['kind'], json.dumps(event)
                    db.execute('INSERT INTO waiting (id, kind, event) VALUES (?, ?, ?)', row)
                newest = '(SELECT n FROM waiting ORDER BY n DESC LIMIT ?)'
                db.execute(f'DELETE FROM waiting WHERE n NOT IN {newest}', [WAITING])
            for _ in events:
                self._events.popleft()

    def _deliver(self, db: sqlite3.Connection) -> bool:
        """Send what is in the file. Return whether something is left for later."""
        while (known := _class(db)) and (rows := _first(db)):
            try:
                _ask(known, 'events', {'events': [json.loads(event) for _, event in rows]})
            except ValueError as refused:  # the class knows no such seat, or no such event
                return self._forget(db, known, str(refused))
            except OSError:
                now = time.monotonic()
                self._silent_since = self._silent_since or now
                # The class of a hub comes back with the hub: it cannot be left by waiting.
                if now - self._silent_since > GIVE_UP_S and not os.environ.get(HUB_VARIABLE):
                    return self._forget(db, known, OVER)
                self._trouble = SILENT
                return True
            self._silent_since = None
            with db:
                db.executemany('DELETE FROM waiting WHERE n = ?', [(n,) for n, _ in rows])
            self._trouble = ''
        return False

    def _forget(self, db: sqlite3.Connection, known: Class, why: str) -> bool:
        with db:
            db.execute('DELETE FROM waiting')
            if not os.environ.get(HUB_VARIABLE):
                db.execute('DELETE FROM class WHERE token = ?', [known.token])
        self._trouble, self._silent_since = why, None
        return False


_outbox = _Outbox()


def _tell(kind: str, **what: object) -> None:
    """Hand an event over, if this is a lesson and there is a class. Nothing is raised."""
    lesson = progress.this_lesson()
    if not lesson or not _file_of_class():
        return
    with suppress(Exception):  # a value that no class can show; no lesson may fail because of it
        if 'value' in what:
            what['value'] = to_json(what['value'])
        _outbox.put({'id': secrets.token_hex(8), 'kind': kind, 'lesson': lesson, **what})


def _hand(up: bool, text: str) -> None:
    known = None
    with suppress(OSError, sqlite3.Error):
        known = _known()
    _tell('hand', up=up)
    print((text if progress.this_lesson() else NO_LESSON) if known else NOT_JOINED)
    _outbox.say_trouble()


def _join(address: str, code: str, name: str) -> str:
    path = _file()
    if path is None:
        return f'There is no class here, because {progress.FILE_VARIABLE} is empty.'
    hub = os.environ.get(HUB_VARIABLE)
    if not hub and not (ADDRESS.fullmatch(address) and code):
        raise ValueError(
            "Copy the line from the screen: join_class('192.0.2.5:8765', 'blue-otter-lamp')."
        )
    url = hub or f'{"" if "://" in address else "http://"}{address.rstrip("/")}'
    address = address or 'the hub'
    known = _known()
    # A student who joins again, as after a restart of the kernel, keeps the seat.
    token = known.token if known and known.url == url else _hub_token()
    try:
        answer = _ask(Class(url, token), 'join', {'code': code, 'name': name})
        given, seat = answer['token'], answer['seat']
    except (OSError, KeyError) as problem:  # what answers without a seat is no class
        raise ValueError(
            f'No class answers at {address} ({problem}). Compare the address with the one on '
            'the screen. Is this computer in the same network?'
        ) from None
    with closing(_open(path)) as db, db:
        if given != token:
            db.execute('DELETE FROM waiting')
        db.execute('DELETE FROM class')
        if not hub:
            until_s = time.time() + JOINED_FOR_S
            db.execute('INSERT INTO class VALUES (?, ?, ?)', (url, given, until_s))
    called = f', called {name}. {SENT}' if name else f'. {SENT} Nor your name.'
    return (
        f'You are in the class of {address} on seat {seat}{called} '
        'raise_hand() says that you are lost, leave_class() ends it; in the next lesson import '
        'them again, as here.'
    )


def _leave() -> str:
    path, known = _file_of_class(), None
    if path is None:
        return NOT_JOINED
    hub = os.environ.get(HUB_VARIABLE)
    _outbox.drop()
    try:
        # The file stays, empty: the kernels that have it open find the next class in it.
        with closing(_open(path)) as db, db:
            known = _class(db)
            db.execute('DELETE FROM waiting')
            db.execute('DELETE FROM class')
            if hub:
                db.execute("INSERT INTO class VALUES ('', '', 0)")
    except sqlite3.Error:
        if not hub:
            path.unlink()
    if known is None:
        return NOT_JOINED
    try:
        _ask(known, 'leave', {})
    except (OSError, ValueError):
        return 'You have left the class. It did not answer: what you sent stays there.'
    return 'You have left the class. What you sent is deleted.'


def _ask(known: Class, what: str, body: object) -> dict:
    """Ask the class. Raises OSError if no class answers, ValueError if it refuses."""
    from urllib import error, request  # only students in a class wait for this import

    headers = {'Content-Type': 'application/json', 'Authorization': f'token {known.token}'}
    wanted = request.Request(f'{known.url}/{what}', json.dumps(body).encode(), headers)
    # A class is in the same network: a proxy to the Internet would not find it.
    opener = request.build_opener(request.ProxyHandler({}))
    try:
        with opener.open(wanted, timeout=ANSWER_LIMIT_S) as answer:
            return dict(json.load(answer))
    except error.HTTPError as refused:
        later = what == 'events' and (refused.code == 429 or refused.code >= 500)
        with suppress(KeyError, TypeError, json.JSONDecodeError):
            reason = str(json.load(refused)['error'])
            raise (OSError if later else ValueError)(reason) from None
        raise OSError(f'status {refused.code}') from None
    except error.URLError as problem:
        raise OSError(str(problem.reason)) from None
    except OSError:
        raise
    except Exception as problem:  # of http.client, json, and addresses that are none
        raise OSError(str(problem)) from None


def to_json(value: object, inside: bool = False) -> object:
    """Return a value as JSON holds it. Raises TypeError for one that a page could not show."""
    value = value.tolist() if hasattr(value, 'tolist') else value
    if isinstance(value, Set):
        value = sorted(value, key=lambda item: (len(str(item)), str(item)))
    if (
        isinstance(value, bool)
        or (isinstance(value, int | float) and abs(value) < LARGEST)
        or (isinstance(value, str) and len(value) <= TEXT)
    ):
        return value
    if not inside and isinstance(value, list | tuple | range) and len(value) <= ITEMS:
        return [to_json(item, inside=True) for item in value]
    raise TypeError


# --- What this kernel knows ----------------------------------------------------------------------


def _file() -> Path | None:
    path = progress.file()
    return path and path.with_name('ros2_notebooks_class.sqlite')


def _file_of_class() -> Path | None:
    """Return the file if there may be a class: a student who has joined none has no file."""
    path = _file()
    return path if path and (path.exists() or os.environ.get(HUB_VARIABLE)) else None


def _open(path: Path) -> sqlite3.Connection:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch(mode=0o600)  # the token in it is the student's
    db = sqlite3.connect(path)
    db.executescript(TABLES)
    return db


def _known() -> Class | None:
    """Return the class of this student. No file is made for a student who has joined none."""
    if path := _file_of_class():
        with closing(_open(path)) as db:
            return _class(db)
    return None


def _class(db: sqlite3.Connection) -> Class | None:
    row = db.execute('SELECT url, token, until_s FROM class').fetchone()
    if row and row[2] > time.time():
        return Class(*row[:2])
    hub = os.environ.get(HUB_VARIABLE)
    return Class(hub, _hub_token()) if hub and not row else None


def _hub_token() -> str:
    """Return the token that a JupyterHub's class knows this server by; elsewhere an empty text."""
    return os.environ.get('JUPYTERHUB_API_TOKEN', '') if os.environ.get(HUB_VARIABLE) else ''


def _first(db: sqlite3.Connection) -> list[tuple[int, str]]:
    return db.execute('SELECT n, event FROM waiting ORDER BY n LIMIT ?', [BATCH]).fetchall()


def _follow_cells() -> None:
    """Tell the class which cell runs; it knows the steps. JupyterLab names the cell to IPython."""
    if (
        progress.this_lesson()
        and 'IPython' in sys.modules
        and (shell := sys.modules['IPython'].get_ipython())
    ):
        shell.events.register('pre_run_cell', _cell_runs)


def _cell_runs(info: object) -> None:
    if cell := getattr(info, 'cell_id', None):
        _tell('cell', cell=cell)


_follow_cells()
