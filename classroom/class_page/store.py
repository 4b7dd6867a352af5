"""What a class was told, kept in SQLite, and what its page says of it.

A seat is a student's computer, known by a random token of which only the hash is kept. An event
counts once: its id and its seat are its key. Of guesses, the last one of a seat counts, in the
order in which the events came: no clock of a student's computer is asked.
"""

import contextlib
import hashlib
import json
import math
import secrets
import sqlite3
from collections import Counter
from pathlib import Path

from classroom.class_page import events
from classroom.class_page.lessons import Guess, Known
from helpers.lesson import earlier_name, home_of_cell, home_of_guess, home_of_task

WORDS = Path(__file__).with_name('words.txt').read_text().split()
CODE_WORDS = 3  # of 256: 24 bits
SEATS = 500
BARS = 8
MEASURED = 3  # different results of one question, at most
OTHER = 'other'
TABLES = """
PRAGMA journal_mode = WAL;
CREATE TABLE IF NOT EXISTS class (code TEXT, secret TEXT);
CREATE TABLE IF NOT EXISTS seats (seat INTEGER PRIMARY KEY, token TEXT UNIQUE, name TEXT);
CREATE TABLE IF NOT EXISTS events (
    n INTEGER PRIMARY KEY, seat INTEGER, id TEXT, lesson TEXT, kind TEXT, what TEXT, value TEXT,
    UNIQUE (seat, id)
);
CREATE TABLE IF NOT EXISTS away (token TEXT UNIQUE);
CREATE TABLE IF NOT EXISTS removed (
    lesson TEXT, question TEXT, answer TEXT, UNIQUE (lesson, question, answer)
);
CREATE TABLE IF NOT EXISTS closed (is_closed INTEGER);
CREATE INDEX IF NOT EXISTS by_kind ON events (kind, lesson, what);
"""
INSERT = """
INSERT OR IGNORE INTO events (seat, id, lesson, kind, what, value)
VALUES (?, ?, ?, ?, ?, ?)
"""
# The last event of a kind of each seat, in their order: of all lessons, or of one question.
LATEST = """
SELECT seat, lesson, value, max(n) AS n FROM events
WHERE kind = ? AND lesson = coalesce(?, lesson) AND what = coalesce(?, what)
GROUP BY seat ORDER BY n
"""
# What is solved stays so, whatever a student tries later: 'false' comes before 'true'.
SOLVED = """
SELECT max(value) FROM events WHERE kind = 'task' AND lesson = ? AND what = ? GROUP BY seat
"""
# Students who have solved a task that differs for each student, by what theirs was about.
ABOUT = """
SELECT what, value, seat FROM events WHERE kind = 'about' AND lesson = ?
ORDER BY what, seat
"""


# What an event is about, by its kind, and what finds the lesson of that.
FIELDS = {'guess': 'question', 'outcome': 'question', 'task': 'task', 'cell': 'cell'}
HOMES = {'question': home_of_guess, 'task': home_of_task, 'cell': home_of_cell}


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
        self._name_tasks()
        self._move_events()
        self.code, self.secret = self._db.execute('SELECT code, secret FROM class').fetchone()
        self.went_on = self._db.execute('SELECT 1 FROM events').fetchone() is not None
        self.shown: set[tuple[str, str]] = set()  # lesson and question
        self.removed: dict[tuple[str, str], set[str]] = {}  # of a question: answers out of sight
        for lesson, question, answer in self._db.execute('SELECT * FROM removed'):
            self.removed.setdefault((lesson, question), set()).add(answer)

    def _name_tasks(self) -> None:
        """Give the tasks of a class that version 0.3 has broken off their names."""
        tasks = self._db.execute(
            "SELECT n, lesson, what FROM events WHERE kind = 'task'"
        ).fetchall()
        names = [
            (earlier_name(lesson, int(what)), n) for n, lesson, what in tasks if what.isdecimal()
        ]
        with self._db:
            self._db.executemany('UPDATE events SET what = ? WHERE n = ?', names)

    def _move_events(self) -> None:
        """Let a class that was broken off know tasks and guesses in the lessons of today."""
        places = [
            (self._home(lesson, FIELDS.get(kind, ''), what), lesson, kind, what)
            for lesson, kind, what in self._db.execute(
                'SELECT DISTINCT lesson, kind, what FROM events'
            )
        ]
        change = 'UPDATE events SET lesson = ? WHERE lesson = ? AND kind = ? AND what = ?'
        with self._db:
            self._db.executemany(change, [place for place in places if place[0] != place[1]])

    def _home(self, lesson: str, field: str, what: object) -> str:
        """Return the lesson that has a task, a guess or a cell today."""
        if field not in HOMES:
            return lesson
        return HOMES[field](lesson, what, [known.lesson for known in self.lessons.values()])

    # Seats

    def join(self, token: str, name: str) -> int:
        """Return the seat of a token, a new one for a new token.

        Raises ValueError if the class is full or takes nobody new, or if the seat was taken away.
        """
        if self.is_away(token):
            raise ValueError('Your seat was taken out of this class: speak with your teacher.')
        if self.seat(token) is None:
            if self.is_closed:
                raise ValueError('The class takes nobody new now: speak with your teacher.')
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

    def send_away(self, seat: int) -> None:
        """Delete a seat with what it has told, and let its token never come back."""
        with self._db:
            self._db.execute(
                'INSERT OR IGNORE INTO away SELECT token FROM seats WHERE seat = ?', [seat]
            )
        self.leave(seat)

    def is_away(self, token: str) -> bool:
        """Return whether the seat of this token was taken away."""
        found = self._db.execute('SELECT 1 FROM away WHERE token = ?', [_hash(token)])
        return found.fetchone() is not None

    @property
    def is_closed(self) -> bool:
        """Whether nobody new may join. A student who has a seat keeps it."""
        return self._db.execute('SELECT 1 FROM closed').fetchone() is not None

    def close_door(self, closed: bool) -> None:
        """Let nobody new join, or let them join again."""
        with self._db:
            self._db.execute('DELETE FROM closed')
            if closed:
                self._db.execute('INSERT INTO closed VALUES (1)')

    # Events

    def take(self, seat: int, messages: list) -> str:
        """Keep the events of a seat. Return why some were refused, in one sentence, or nothing."""
        refused = ''
        rows = []
        for event in map(self._of_today, messages):
            problem = self._problem(event)
            refused = refused or problem
            if not problem:
                rows.append((seat, event['id'], event['lesson'], *_content(event)))
        with self._db:
            self._db.executemany(INSERT, rows)
        return refused

    def _of_today(self, event: object) -> object:
        """Return an event of a student with older lessons as one with today's would send it."""
        event = _with_name(event)
        if not events.is_event(event) or event['kind'] not in FIELDS:
            return event
        field = FIELDS[event['kind']]
        return event | {'lesson': self._home(event['lesson'], field, event[field])}

    def remove(self, lesson: str, question: str, answer: str) -> None:
        """Take an answer that the page shows out of sight, of all students who gave it."""
        key = _key(_plain(answer))
        self.removed.setdefault((lesson, question), set()).add(key)
        with self._db:  # after a crash it is still out of sight
            self._db.execute(
                'INSERT OR IGNORE INTO removed VALUES (?, ?, ?)', (lesson, question, key)
            )

    def lower(self, seat: int) -> None:
        """Take the hand of a seat down. Raises ValueError if it has raised none."""
        [lesson] = [lesson for one, lesson, _ in self._latest('hand') if one == seat]
        hand = {'id': secrets.token_hex(8), 'kind': 'hand', 'lesson': lesson, 'up': False}
        self.take(seat, [hand])

    def _problem(self, event: object) -> str:
        if not events.is_event(event):
            return 'An event has another form.'
        known = self.lessons.get(event['lesson'])
        if known is None:
            return 'There is no such lesson.'
        has = {'question': known.guesses, 'task': known.tasks, 'cell': known.step_of}
        for field in has.keys() & event:
            if event[field] not in has[field]:
                return f'The lesson has no such {field}.'
        return ''

    def _latest(
        self, kind: str, lesson: str | None = None, what: str | None = None
    ) -> list[tuple[int, str, object]]:
        """Return seat, lesson and value of the last event of a kind of each seat."""
        rows = self._db.execute(LATEST, (kind, lesson, what))
        return [(seat, lesson, json.loads(value)) for seat, lesson, value, _ in rows]

    def _places(self) -> Counter:
        """Return how many students are at each step: by lesson and step.

        The lessons may have changed since a class was broken off.
        """
        steps = {name: known.step_of for name, known in self.lessons.items()}
        return Counter(
            (name, steps[name][cell])
            for _, name, cell in self._latest('cell')
            if cell in steps.get(name, ())
        )

    # What the page says

    def view(self, lesson: str, step: int) -> dict:
        """Return what the page shows of a step of a lesson."""
        known = self.lessons[lesson]
        at = self._places()
        names = dict(self._db.execute('SELECT seat, name FROM seats'))
        here = Counter(name for name, _ in at.elements())
        hands = [seat for seat, _, up in self._latest('hand') if up]
        return {
            'seats': len(names),
            'closed': self.is_closed,
            'people': [{'seat': seat, 'name': name} for seat, name in sorted(names.items())],
            'lessons': [
                {'name': name, 'title': one.title, 'here': here[name], 'now': name == lesson}
                for name, one in self.lessons.items()
            ],
            'steps': [
                {'title': notes['step'], 'here': at[lesson, number], 'now': number == step}
                for number, notes in enumerate(known.notes)
            ],
            'guesses': [
                self._guesses(lesson, question, guess)
                for question, guess in known.guesses.items()
                if known.step_of[guess.asked] <= step <= known.step_of[guess.compared]
            ],
            'tasks': [
                self._task(lesson, task, number, len(names)) for task, number in known.tasks.items()
            ],
            'about': self._about(lesson, names),
            'hands': [{'seat': seat, 'name': names.get(seat, '')} for seat in hands],
        }

    def _guesses(self, lesson: str, question: str, guess: Guess) -> dict:
        removed = self.removed.get((lesson, question), set())
        answers = [
            value
            for *_, value in self._latest('guess', lesson, question)
            if _key(_plain(value)) not in removed
        ]
        cells = [guess.asked, guess.compared]
        found = {'question': question, 'cells': cells, 'answered': len(answers)}
        if (lesson, question) not in self.shown:  # what is hidden does not leave the server
            return found | {'shown': False}
        outcomes = [value for *_, value in self._latest('outcome', lesson, question)]
        measured = [value for value, _ in _counted(outcomes)][:MEASURED]
        return found | {
            'shown': True,
            'bars': bars(answers, measured),
            'values': [*map(_plain, answers)],
            'measured': [label(value) for value in measured],
            'by': len(outcomes),
        }

    def _task(self, lesson: str, task: str, number: int, seats: int) -> dict:
        tries = self._db.execute(SOLVED, (lesson, task)).fetchall()
        solved = tries.count(('true',))
        tried = len(tries) - solved
        return {'number': number, 'solved': solved, 'tried': tried, 'open': seats - len(tries)}

    def _about(self, lesson: str, names: dict[int, str]) -> list[dict]:
        found: dict[str, dict[str, list[str]]] = {}
        numbers = self.lessons[lesson].tasks
        for about, task, seat in self._db.execute(ABOUT, [lesson]):
            who = names.get(seat) or f'seat {seat}'
            found.setdefault(about, {}).setdefault(json.loads(task), []).append(who)
        return [
            {
                'about': about,
                'tasks': [
                    {'number': number, 'who': [*dict.fromkeys(by[task])]}
                    for task, number in numbers.items()
                    if task in by
                ],
            }
            for about, by in found.items()
        ]

    def busiest(self) -> tuple[str, int] | None:
        """Return the lesson and the step at which most students are, None if nobody is."""
        return next((place for place, _ in self._places().most_common(1)), None)

    # Its end

    def forget(self) -> None:
        """Delete all events and names. The seats stay, so that nobody must join again."""
        with self._db:
            self._db.execute('DELETE FROM events')
            self._db.execute('DELETE FROM removed')
            self._db.execute("UPDATE seats SET name = ''")
        self._db.execute('VACUUM')  # what is deleted is in no page of the file,
        self._db.execute('PRAGMA wal_checkpoint(TRUNCATE)')  # nor in its log
        self.shown.clear()
        self.removed.clear()

    def close(self) -> None:
        """Let go of the file."""
        self._db.close()

    def end(self) -> None:
        """Delete everything: the class is over."""
        self.close()
        for suffix in ('', '-wal', '-shm'):
            Path(f'{self.file}{suffix}').unlink(missing_ok=True)


def bars(answers: list, measured: list = ()) -> list[dict]:
    """Return what a picture shows of answers: the most frequent ones, and all others as one bar.

    What was measured always has its bar, with `right`, also if nobody has guessed it. Numbers stand
    in their order; a text that is one, `'41'` or `'11,5'`, counts as one. Where most answers are
    numbers, the texts are among the others, and of equally frequent numbers so are those that are
    farthest from the middle of all.
    """
    answers = [_plain(answer) for answer in answers]
    right = {_key(_plain(value)): _plain(value) for value in measured}
    numbers = sorted(answer for answer in answers if _is_number(answer))
    of_numbers = 2 * len(numbers) > len(answers)
    middle = numbers[len(numbers) // 2] if numbers else 0
    first = {_key(answer): answer for answer in reversed(answers)} | right
    counts = Counter(map(_key, answers))
    keys = [key for key in first if key in right or not of_numbers or _is_number(first[key])]
    keys.sort(
        key=lambda key: (
            key not in right,
            -counts[key],
            abs(first[key] - middle) if _is_number(first[key]) else 0,
        )
    )
    keys = keys[: max(BARS - 1, len(right))]
    if all(_is_number(first[key]) for key in keys):
        keys.sort(key=first.get)
    else:
        keys.sort(key=lambda key: -counts[key])
    found = [
        {'label': label(first[key]), 'count': counts[key], 'right': key in right} for key in keys
    ]
    others = len(answers) - sum(bar['count'] for bar in found)
    return found + ([{'label': OTHER, 'count': others, 'right': False}] if others else [])


def _plain(answer: object) -> object:
    """Return an answer, a number if it is the text of one. A comma is a decimal point, too."""
    if isinstance(answer, str):
        with contextlib.suppress(ValueError):
            number = float(answer.strip().replace(',', '.'))
            if math.isfinite(number):
                return int(number) if number == int(number) else number
    return answer


def _is_number(answer: object) -> bool:
    return isinstance(answer, int | float) and not isinstance(answer, bool)


def _key(answer: object) -> str:
    """Return what equal answers have in common: their text, in whatever case."""
    return label(answer).strip().casefold()


def label(value: object) -> str:
    """Return a value as a reader writes it."""
    if isinstance(value, list):
        return ', '.join(map(label, value)) or 'none'
    return f'{value:.6g}' if isinstance(value, float) else str(value)


def _counted(answers) -> list[tuple]:
    """Return the different answers and how often each came, the most frequent first."""
    first: dict[str, object] = {}
    for answer in answers:
        first.setdefault(_key(answer), answer)
    counts = Counter(map(_key, answers))
    return [(first[text], count) for text, count in counts.most_common()]


def _with_name(event: object) -> object:
    """Return an event of version 0.3, which called a task by its number, with the task's name."""
    if isinstance(event, dict) and type(number := event.get('task')) is int:
        return event | {'task': earlier_name(str(event.get('lesson')), number)}
    return event


def _content(event: dict) -> tuple[str, str, str]:
    """Return kind, what and value, as the table holds them."""
    fields = events.KINDS[event['kind']].schema['properties']
    *what, value = [event[field] for field in fields if field not in events.EVENT]
    return event['kind'], str(what[0]) if what else '', json.dumps(value)


def _hash(token: str) -> str:
    return hashlib.sha256(token.encode()).hexdigest()
