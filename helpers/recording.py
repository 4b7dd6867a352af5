"""What happened: when each message was published, and when and where each callback ran."""

from __future__ import annotations

import functools
import inspect
import threading
import time
from array import array
from collections.abc import Callable

import pandas as pd
from rclpy.callback_groups import ReentrantCallbackGroup

from helpers.values import COLUMNS

CALL_COLUMNS = ['client', 'service', 'caller', 'run', 'style', 'sent_s', 'answered_s', 'answer']
CALL_COLUMNS += ['resumed_by']


def number_of(message) -> int:
    """Return the number at the end of `message.data`: 7 for `Hello World: 7`, or 7 itself.

    Of a picture with one pixel it is the pixel. Raises ValueError where there is no number.
    """
    data = getattr(message, 'data', None)
    if isinstance(data, array) and len(data) == 1:
        data = data[0]
    if isinstance(data, int):
        return data
    word = data.rpartition(' ')[2] if isinstance(data, str) else ''
    if not word.isdecimal():
        raise ValueError(
            f'A recording needs messages whose data ends with their number, as in '
            f"String(data='Hello World: 7'). This one has none: {message!r}."
        )
    return int(word)


class Recording:
    """Records the messages from one publisher to one subscription, from now on.

    The two are plain rclpy objects, and stay what they are. `parameters`, for example
    `period_s=0.05`, are what the run was made with: they are in `table().attrs`.

    `Recording.latest` is the one that was made last, also where its cell was interrupted.
    """

    latest: Recording | None = None

    def __init__(self, publisher, subscription, **parameters) -> None:
        self.parameters = parameters
        self._published: list[tuple[int, float]] = []
        # [seq, started, finished, thread id]; finished is NaN while the callback runs
        self._heard: list[list] = []
        self._finished: list[list] = []  # the same rows, in the order in which they finished
        self._watch_publisher(publisher)
        self._watch_subscription(subscription)
        Recording.latest = self

    def _watch_publisher(self, publisher) -> None:
        publish, clock, append = publisher.publish, time.monotonic, self._published.append

        @functools.wraps(publish)
        def recorded_publish(msg):
            published_s = clock()
            publish(msg)
            # Not before, where it would delay the message.
            append((number_of(msg), published_s))

        publisher.publish = recorded_publish

    def _watch_subscription(self, subscription) -> None:
        clock, append, append_finished = time.monotonic, self._heard.append, self._finished.append
        thread_id, nan = threading.get_ident, float('nan')

        def start(message, *info) -> list:
            row = [number_of(message), clock(), nan, thread_id()]
            append(row)
            return row

        def finish(row: list) -> None:
            row[2] = clock()
            append_finished(row)

        subscription.callback = _surround(subscription.callback, start, finish)

    @property
    def published(self) -> int:
        """How many messages were published."""
        return len(self._published)

    @property
    def heard(self) -> int:
        """How many callbacks were started."""
        return len(self._heard)

    @property
    def in_flight(self) -> int:
        """How many callbacks have started and not yet finished."""
        return len(self._heard) - len(self._finished)

    def wait_until_complete(self, messages: int, timeout_s: float = 60.0) -> None:
        """Wait until `messages` messages are published and the subscription has worked them off.

        The newest message is never pushed out of a queue: when its callback and all others have
        finished, nothing is waiting any more.

        Raises ValueError for a count below 1, TimeoutError after `timeout_s` seconds, and the
        exception of a callback that failed.
        """
        from helpers.session import current_session

        __tracebackhide__ = True
        if messages < 1:
            raise ValueError(f'messages must be a whole number from 1 up, not {messages!r}.')

        def complete() -> bool:
            if len(self._published) < messages:
                return False
            newest = self._published[-1][0]
            return self.in_flight == 0 and any(row[0] == newest for row in self._heard)

        def progress() -> float:
            if not (self._finished and self._published):
                return 0.0
            return (self._finished[-1][0] - self._published[0][0] + 1) / messages

        def status() -> str:
            return f'Published {self.published}, heard {self.heard}.'

        current_session().wait_until(complete, timeout_s, progress, status)

    def table(self) -> pd.DataFrame:
        """Return one row a message, in the order of their sequence numbers.

        Columns: `seq` (int), `published_s`, `started_s`, `finished_s` (seconds since the first
        publish call; NaN where it did not happen), `thread` ('thread 1', 'thread 2', ... in the
        order of their first callback; None where the message was never heard). `attrs` holds the
        parameters of the recording.

        Raises ValueError where two messages have the same sequence number.
        """
        published = pd.DataFrame(list(self._published), columns=['seq', 'published_s'])
        heard = pd.DataFrame(
            [list(row) for row in self._heard], columns=['seq', 'started_s', 'finished_s', 'thread']
        )
        for name, part in (('published', published), ('heard', heard)):
            twice = part.loc[part['seq'].duplicated(), 'seq']
            if len(twice):
                raise ValueError(
                    f'The number {twice.iloc[0]} was {name} twice: give every message its own '
                    'sequence number.'
                )
        names = {ident: f'thread {i}' for i, ident in enumerate(heard['thread'].unique(), 1)}
        heard['thread'] = heard['thread'].map(names)
        table = published.merge(heard, on='seq', how='outer')  # sorted by seq
        times = ['published_s', 'started_s', 'finished_s']
        table = table.astype({'seq': int} | dict.fromkeys(times, float))
        table[times] -= table['published_s'].min()
        table['thread'] = table['thread'].astype(object).where(table['thread'].notna(), None)
        table = table[COLUMNS]
        table.attrs = dict(self.parameters)
        return table


class CallbackRecording:
    """Records every run of some callbacks, from now on.

    `CallbackRecording(tick=node.timer, look=node.service)` watches timers, services, subscriptions
    and clients, each under a name. They are plain rclpy objects, and stay what they are. Of a
    client, a run is the moment when an executor takes an answer. `watch` is for what has no
    `callback` of its own, such as an action server.
    """

    def __init__(self, **watched) -> None:
        # For each name its runs: [started, finished, thread id]; finished is NaN while it runs.
        # That of a coroutine that has finished ends with the id of the thread that finished it.
        self.runs: dict[str, list[list]] = {name: [] for name in watched}
        self._watched = watched
        self._coroutines: set[str] = set()  # the names of callbacks that can await
        self._calls: list[dict] = []
        self._answers: list[tuple[object, list]] = []  # the future, and the run of the client
        for name, thing in watched.items():
            if hasattr(thing, 'call_async'):
                self._watch_client(name, thing)
            else:
                thing.callback = self.watch(name, thing.callback)

    def watch(self, name: str, callback: Callable) -> Callable:
        """Return the callback, which is recorded under this name from now on."""
        runs = self.runs.setdefault(name, [])
        if inspect.iscoroutinefunction(callback):
            self._coroutines.add(name)

        def start(*arguments) -> list:
            row = [time.monotonic(), float('nan'), threading.get_ident()]
            runs.append(row)
            return row

        def finish(row: list) -> None:
            if name in self._coroutines:
                row.append(threading.get_ident())
            row[1] = time.monotonic()

        return _surround(callback, start, finish)

    def _watch_client(self, name: str, client) -> None:
        call, call_async, pending = client.call, client.call_async, client.get_pending_request
        waits = threading.local()

        @functools.wraps(call)
        def recorded_call(*arguments, **options):
            waits.here = True
            try:
                return call(*arguments, **options)
            finally:
                waits.here = False

        @functools.wraps(call_async)
        def recorded_call_async(request):
            waiting = getattr(waits, 'here', False)
            made = {'client': name, 'caller': self._running(), 'waits': waiting}
            made |= {'sent': time.monotonic(), 'future': None}
            self._calls.append(made)
            made['future'] = call_async(request)
            return made['future']

        @functools.wraps(pending)
        def recorded_pending(sequence_number):
            future = pending(sequence_number)
            now = time.monotonic()
            row = [now, now, threading.get_ident()]
            self.runs[name].append(row)
            self._answers.append((future, row))
            return future

        client.call, client.call_async = recorded_call, recorded_call_async
        client.get_pending_request = recorded_pending

    def _running(self) -> list | None:
        """Return the run that this thread is in, of a callback that is watched."""
        here = threading.get_ident()
        rows = [row for runs in self.runs.values() for row in runs if row[1] != row[1]]
        return max((row for row in rows if row[2] == here), key=lambda row: row[0], default=None)

    def finished(self, name: str) -> int:
        """Return how many runs have finished."""
        return sum(run[1] == run[1] for run in self.runs[name])  # NaN is not equal to itself

    def inside(self, inner: str, outer: str) -> int:
        """Return how many runs of `inner` started while a run of `outer` was going on."""
        return sum(
            any(
                started <= run[0] and not finished <= run[0]  # NaN: it still goes on
                for started, finished, *_ in self.runs[outer]
            )
            for run in self.runs[inner]
        )

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return for each name a table like that of `Recording`, one row a run, for a timeline.

        `seq` counts from 0, the times are seconds since the first start of all, and a callback has
        `published_s` equal to `started_s`. The threads have the same names in all tables.
        """
        zero, names = self._zero_and_threads()
        return {
            name: pd.DataFrame(
                [
                    [seq, run[0] - zero, run[0] - zero, run[1] - zero, names[run[2]]]
                    for seq, run in enumerate(list(runs))
                ],
                columns=COLUMNS,
            )
            for name, runs in self.runs.items()
        }

    def _zero_and_threads(self) -> tuple[float, dict[int, str]]:
        """Return when the first run of all started, and the names of the threads by their ids."""
        every = sorted((row for runs in self.runs.values() for row in runs), key=lambda row: row[0])
        idents = dict.fromkeys(ident for row in every for ident in row[2:])
        names = {ident: f'thread {i}' for i, ident in enumerate(idents, 1)}
        return (every[0][0] if every else 0.0), names

    def calls(self) -> pd.DataFrame:
        """Return one row for each request that a client which is watched has sent.

        Columns: `client` and `service` (names; the service is None where it is not watched),
        `caller` and `run` (the callback that sent it, and which of its runs; None where none is
        watched), `style` ('call', 'await' where a coroutine sent it, or 'send'), `sent_s` and
        `answered_s` (seconds, as in `tables`; NaN where no answer was taken), `answer` (which of
        the client's runs took it), `resumed_by` (the thread that finished the coroutine, or None).
        """
        zero, names = self._zero_and_threads()
        services = {
            thing.srv_name: name
            for name, thing in self._watched.items()
            if type(thing).__name__ == 'Service'
        }
        place = {
            id(row): (name, seq) for name, runs in self.runs.items() for seq, row in enumerate(runs)
        }
        answers = {id(future): row for future, row in list(self._answers)}
        rows = []
        for made in list(self._calls):
            answer, run = answers.get(id(made['future'])), made['caller']
            caller, seq = place.get(id(run), (None, None))
            awaits = caller in self._coroutines
            rows.append(
                {
                    'client': made['client'],
                    'service': services.get(self._watched[made['client']].srv_name),
                    'caller': caller,
                    'run': seq,
                    'style': 'call' if made['waits'] else 'await' if awaits else 'send',
                    'sent_s': made['sent'] - zero,
                    'answered_s': answer[0] - zero if answer else float('nan'),
                    'answer': place[id(answer)][1] if answer else None,
                    'resumed_by': names[run[3]] if run and len(run) > 3 else None,
                }
            )
        return pd.DataFrame(rows, columns=CALL_COLUMNS)

    def groups(self) -> pd.DataFrame:
        """Return for each name, in its row, what it is and its callback group.

        Columns: `kind` ('Timer', 'Service', 'Client', 'Subscription'), `group` (the first name that
        is in the same group), `exclusive` (bool).
        """
        first: dict[int, str] = {}
        rows = {}
        for name, thing in self._watched.items():
            group = thing.callback_group
            first.setdefault(id(group), name)
            exclusive = not isinstance(group, ReentrantCallbackGroup)
            rows[name] = type(thing).__name__, first[id(group)], exclusive
        return pd.DataFrame.from_dict(rows, 'index', columns=['kind', 'group', 'exclusive'])


def _surround(callback: Callable, start: Callable, finish: Callable) -> Callable:
    """Return the callback with `row = start(*arguments)` before it and `finish(row)` after it."""
    if inspect.iscoroutinefunction(callback):

        @functools.wraps(callback)
        async def recorded_callback(*arguments):
            row = start(*arguments)
            try:
                return await callback(*arguments)
            finally:
                finish(row)

    else:

        @functools.wraps(callback)
        def recorded_callback(*arguments):
            row = start(*arguments)
            try:
                return callback(*arguments)
            finally:
                finish(row)

    return recorded_callback
