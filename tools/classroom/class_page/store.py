"""What a class was told, kept in SQLite, and what its page says of it.

A seat is a student's computer, known by a random token of which only the hash is kept. An event
counts once: its id and its seat are its key. Of guesses, the last one of a seat counts, in the
order in which the events came: no clock of a student's computer is asked.
"""

import csv
import hashlib
import io
import json
import secrets
import sqlite3
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from tools.classroom.class_page import events
from tools.classroom.class_page.lessons import Guess, Known

WORDS = Path(__file__).with_name('words.txt').read_text().split()
CODE_WORDS = 3  # of 256: 24 bits
SEATS = 500
EVENTS_OF_SEAT = 5000
BARS = 8
TABLES = """
PRAGMA journal_mode = WAL;
CREATE TABLE IF NOT EXISTS class (code TEXT, secret TEXT);
CREATE TABLE IF NOT EXISTS seats (seat INTEGER PRIMARY KEY, token TEXT UNIQUE, name TEXT);
CREATE TABLE IF NOT EXISTS events (
    n INTEGER PRIMARY KEY, seat INTEGER, id TEXT, at_s REAL, lesson TEXT, kind TEXT, what TEXT,
    value TEXT, UNIQUE (seat, id)
);
"""
INSERT = """
INSERT OR IGNORE INTO events (seat, id, at_s, lesson, kind, what, value)
VALUES (?, ?, ?, ?, ?, ?, ?)
"""


BySeat = dict[int, object]


@dataclass
class Latest:
    """What counts of the events: the last ones of each seat, by the number of the seat."""

    places: dict[int, tuple[str, str]] = field(default_factory=dict)  # lesson and cell
    hands: dict[int, str] = field(default_factory=dict)  # the lesson, of hands that are up
    # By lesson and question, or lesson and number of the task:
    guesses: dict[tuple, BySeat] = field(default_factory=lambda: defaultdict(dict))
    outcomes: dict[tuple, BySeat] = field(default_factory=lambda: defaultdict(dict))
    solved: dict[tuple, BySeat] = field(default_factory=lambda: defaultdict(dict))

    def note(self, seat: int, lesson: str, kind: str, what: str, value: object) -> None:
        """Take an event in."""
        match kind:
            case 'cell':
                self.places[seat] = (lesson, value)
            case 'hand' if value:
                self.hands[seat] = lesson
            case 'hand':
                self.hands.pop(seat, None)
            case 'guess':
                self.guesses[lesson, what][seat] = value
            case 'outcome':
                self.outcomes[lesson, what][seat] = value
            case 'task':  # what is solved stays so
                tries = self.solved[lesson, what]
                tries[seat] = value or tries.get(seat, False)

    def forget(self, seat: int) -> None:
        """Forget a seat."""
        for answers in (self.places, self.hands):
            answers.pop(seat, None)
        for several in (self.guesses, self.outcomes, self.solved):
            for answers in several.values():
                answers.pop(seat, None)


class ClassStore:
    """The events of one class. If the file has some already, the class goes on."""

    def __init__(self, file: Path, lessons: list[Known]) -> None:
        self.file = file
        self.lessons = {known.lesson.name: known for known in lessons}
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._db = sqlite3.connect(file)
        self._db.executescript(TABLES)
        if not self._db.execute('SELECT 1 FROM class').fetchone():
            code = '-'.join(secrets.choice(WORDS) for _ in range(CODE_WORDS))
            with self._db:
                self._db.execute('INSERT INTO class VALUES (?, ?)', (code, secrets.token_hex(8)))
        self.code, self.secret = self._db.execute('SELECT code, secret FROM class').fetchone()
        self.went_on = self._db.execute('SELECT 1 FROM events').fetchone() is not None
        self.shown: set[tuple[str, str]] = set()  # lesson and question
        self._latest = Latest()
        for row in self._db.execute(
            'SELECT seat, lesson, kind, what, value FROM events ORDER BY n'
        ):
            seat, lesson, kind, what, value = (*row[:4], json.loads(row[4]))
            if self._is_known(lesson, kind, value):
                self._latest.note(seat, lesson, kind, what, value)

    # Seats

    def join(self, token: str, name: str) -> int:
        """Return the seat of a token, a new one for a new token. Raises ValueError if full."""
        if self.seat(token) is None:
            [[taken]] = self._db.execute('SELECT count(*) FROM seats')
            if taken >= SEATS:
                raise ValueError('The class is full.')
        with self._db:
            self._db.execute(
                'INSERT INTO seats (token, name) VALUES (?, ?) '
                'ON CONFLICT (token) DO UPDATE SET name = excluded.name',
                (_hash(token), name),
            )
        return self.seat(token)

    def seat(self, token: str) -> int | None:
        """Return the number of the seat with this token."""
        row = self._db.execute('SELECT seat FROM seats WHERE token = ?', [_hash(token)]).fetchone()
        return row and row[0]

    def leave(self, seat: int) -> None:
        """Delete a seat, and what it has told."""
        with self._db:
            self._db.execute('DELETE FROM seats WHERE seat = ?', [seat])
            self._db.execute('DELETE FROM events WHERE seat = ?', [seat])
        self._latest.forget(seat)

    # Events

    def take(self, seat: int, messages: list) -> str:
        """Keep the events of a seat. Return why some were refused, in one sentence, or nothing."""
        refused = ''
        rows = []
        for event in messages:
            problem = self._problem(event)
            refused = refused or problem
            if not problem:
                rows.append((seat, event['id'], time.time(), event['lesson'], *_content(event)))
        [[kept]] = self._db.execute('SELECT count(*) FROM events WHERE seat = ?', [seat])
        if kept + len(rows) > EVENTS_OF_SEAT:
            return 'This seat has told enough.'
        with self._db:
            for row in rows:
                new = self._db.execute(INSERT, row)
                if new.rowcount:
                    _, _, _, lesson, kind, what, value = row
                    self._latest.note(seat, lesson, kind, what, json.loads(value))
        return refused

    def lower(self, seat: int) -> None:
        """Take the hand of a seat down. Raises LookupError if it has raised none."""
        hand = {'id': secrets.token_hex(8), 'kind': 'hand', 'lesson': self._latest.hands[seat]}
        self.take(seat, [hand | {'up': False}])

    def _problem(self, event: object) -> str:
        if not events.is_event(event):
            return 'An event has another form.'
        known = self.lessons.get(event['lesson'])
        if known is None:
            return 'There is no such lesson.'
        if event.get('question', None) not in (None, *known.guesses):
            return 'The lesson has no such question.'
        if event.get('task', None) not in (None, *known.tasks):
            return 'The lesson has no such task.'
        if event.get('cell', None) not in (None, *known.step_of):
            return 'The lesson has no such cell.'
        return ''

    def _is_known(self, lesson: str, kind: str, value: object) -> bool:
        """Return whether the lessons, which may have changed since, have what an event names."""
        known = self.lessons.get(lesson)
        return known is not None and (kind != 'cell' or value in known.step_of)

    # What the page says

    def view(self, lesson: str, step: int) -> dict:
        """Return what the page shows of a step of a lesson."""
        known = self.lessons[lesson]
        places = self._latest.places.values()
        at = Counter((name, self.lessons[name].step_of[cell]) for name, cell in places)
        names = dict(self._db.execute('SELECT seat, name FROM seats'))
        here = Counter(name for name, _ in places)
        return {
            'seats': len(names),
            'lessons': [
                {'name': name, 'title': one.title, 'here': here[name], 'now': name == lesson}
                for name, one in self.lessons.items()
            ],
            'steps': [
                {
                    'title': notes['step'],
                    'here': at[lesson, number],
                    'now': number == step,
                }
                for number, notes in enumerate(known.notes)
            ],
            'guesses': [
                self._guesses(lesson, question, guess)
                for question, guess in known.guesses.items()
                if known.step_of[guess.asked] <= step <= known.step_of[guess.compared]
            ],
            'tasks': [self._task(lesson, number, len(names)) for number in known.tasks],
            'hands': [{'seat': seat, 'name': names.get(seat, '')} for seat in self._latest.hands],
        }

    def _guesses(self, lesson: str, question: str, guess: Guess) -> dict:
        answers = self._latest.guesses[lesson, question]
        cells = [guess.asked, guess.compared]
        found = {'question': question, 'cells': cells, 'answered': len(answers)}
        if (lesson, question) not in self.shown:  # what is hidden does not leave the server
            return found | {'shown': False}
        measured = self._latest.outcomes[lesson, question].values()
        return found | {
            'shown': True,
            'bars': bars(list(answers.values())),
            'given': None if guess.given is None else label(guess.given),
            'measured': [label(value) for value, _ in _counted(measured)][:3],
            'by': len(measured),
        }

    def _task(self, lesson: str, number: int, seats: int) -> dict:
        tries = self._latest.solved[lesson, str(number)].values()
        solved = sum(map(bool, tries))
        tried = len(tries) - solved
        return {'number': number, 'solved': solved, 'tried': tried, 'open': seats - len(tries)}

    def busiest(self) -> tuple[str, int] | None:
        """Return the lesson and the step at which most students are, None if nobody is."""
        places = self._latest.places.values()
        if not places:
            return None
        steps = Counter((name, self.lessons[name].step_of[cell]) for name, cell in places)
        return steps.most_common(1)[0][0]

    def as_csv(self) -> str:
        """Return all events as CSV, texts as JSON: so no program takes one for a formula."""
        text = io.StringIO()
        rows = csv.writer(text)
        rows.writerow(['number', 'time_utc', 'seat', 'name', 'lesson', 'kind', 'what', 'value'])
        wanted = 'SELECT n, at_s, seat, name, lesson, kind, what, value FROM events LEFT JOIN seats'
        for n, at_s, seat, name, *rest in self._db.execute(f'{wanted} USING (seat) ORDER BY n'):
            when = time.strftime('%Y-%m-%dT%H:%M:%SZ', time.gmtime(at_s))
            rows.writerow([n, when, seat, json.dumps(name or ''), *rest])
        return text.getvalue()

    # Its end

    def forget(self) -> None:
        """Delete all events and names. The seats stay, so that nobody must join again."""
        with self._db:
            self._db.execute('DELETE FROM events')
            self._db.execute("UPDATE seats SET name = ''")
        self._db.execute('VACUUM')  # what is deleted is in no page of the file,
        self._db.execute('PRAGMA wal_checkpoint(TRUNCATE)')  # nor in its log
        self._latest = Latest()
        self.shown.clear()

    def close(self) -> None:
        """Let go of the file."""
        self._db.close()

    def end(self) -> None:
        """Delete everything: the class is over."""
        self.close()
        for suffix in ('', '-wal', '-shm'):
            Path(f'{self.file}{suffix}').unlink(missing_ok=True)


def bars(answers: list) -> list[dict]:
    """Return what a picture shows of answers: numbers in order, others by how many gave them."""
    numbers = [a for a in answers if isinstance(a, int | float) and not isinstance(a, bool)]
    if answers and len(numbers) == len(answers) and len(set(numbers)) > BARS:
        low, high = min(numbers), max(numbers)
        width = (high - low) / BARS
        counts = Counter(
            min(int((number - low) / (high - low) * BARS), BARS - 1) for number in numbers
        )
        return [
            {'label': f'{low + i * width:.4g} to {low + (i + 1) * width:.4g}', 'count': counts[i]}
            for i in range(BARS)
        ]
    counted = _counted(answers)
    if len(numbers) == len(answers):
        return [{'label': label(value), 'count': count} for value, count in sorted(counted)]
    found = [{'label': label(value), 'count': count} for value, count in counted[:BARS]]
    others = sum(count for _, count in counted[BARS:])
    return found + ([{'label': 'other', 'count': others}] if others else [])


def label(value: object) -> str:
    """Return a value as a reader writes it."""
    if isinstance(value, list):
        return ', '.join(map(label, value)) or 'none'
    return f'{value:.6g}' if isinstance(value, float) else str(value)


def _counted(answers) -> list[tuple]:
    """Return the different answers and how often each came, the most frequent first."""
    first: dict[str, object] = {}
    for answer in answers:
        first.setdefault(label(answer).strip().casefold(), answer)
    counts = Counter(label(answer).strip().casefold() for answer in answers)
    return [(first[text], count) for text, count in counts.most_common()]


def _content(event: dict) -> tuple[str, str, str]:
    """Return kind, what and value, as the table holds them."""
    fields = events.KINDS[event['kind']].schema['properties']
    *what, value = [event[field] for field in fields if field not in events.EVENT]
    return event['kind'], str(what[0]) if what else '', json.dumps(value)


def _hash(token: str) -> str:
    return hashlib.sha256(token.encode()).hexdigest()
