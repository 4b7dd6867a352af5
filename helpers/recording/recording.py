"""What happened: when each message was published, and when and where each callback ran."""

from __future__ import annotations

import functools
import inspect
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rclpy.service import Service

from helpers.recording.table import RUN_COLUMNS

if TYPE_CHECKING:
    import pandas as pd


def number_of(message) -> int:
    """Return the number at the end of `message.data`: 7 for `Hello World: 7`, or 7 itself.

    Raises ValueError if there is none.
    """
    data = getattr(message, 'data', None)
    if isinstance(data, int):
        return data
    word = data.rpartition(' ')[2] if isinstance(data, str) else ''
    if not word.isdecimal():
        raise ValueError(
            f'A recording needs messages whose data ends with their number, as in '
            f"String(data='Hello World: 7'). This one has none: {message!r}."
        )
    return int(word)


@dataclass(slots=True, eq=False)
class CallbackRun:
    """One run of a callback: when it started (`time.monotonic`, in seconds), and in which thread.

    `finished_s` is None while it runs. `seq` is the number of its message, if that is recorded.
    Threads are their idents.
    """

    started_s: float
    thread: int
    finished_s: float | None = None
    seq: int | None = None

    @property
    def running(self) -> bool:
        return self.finished_s is None


@dataclass(slots=True)
class Call:
    """A request: the names of its client and its service, None if that is not watched.

    `caller` is the run that waits in `Client.call`, None if none that is watched waits.
    """

    client: str
    service: str | None
    caller: CallbackRun | None
    sent_s: float
    future: object = None


class Recording:
    """Records the messages from one publisher to one subscription, from now on.

    Both stay plain rclpy objects. `parameters`, for example
    `period_s=0.05`, are what the run was made with: they are in `table().attrs`.
    """

    number_of = staticmethod(number_of)

    def __init__(self, publisher, subscription, **parameters) -> None:
        self.parameters = parameters
        self._published: list[tuple[int, float]] = []
        self._heard: list[CallbackRun] = []
        self._finished: list[CallbackRun] = []  # the same runs, in the order in which they finished
        self._watch_publisher(publisher)
        self._watch_subscription(subscription)

    def _watch_publisher(self, publisher) -> None:
        publish, clock, append = publisher.publish, time.monotonic, self._published.append

        @functools.wraps(publish)
        def recorded_publish(msg):
            published_s = clock()
            publish(msg)
            # Afterwards, so that it does not delay the message.
            append((self.number_of(msg), published_s))

        publisher.publish = recorded_publish

    def _watch_subscription(self, subscription) -> None:
        clock, append, append_finished = time.monotonic, self._heard.append, self._finished.append
        thread = threading.get_ident

        def start(message, *info) -> CallbackRun:
            seq = self.number_of(message)
            run = CallbackRun(clock(), thread(), seq=seq)
            append(run)
            return run

        def finish(run: CallbackRun) -> None:
            run.finished_s = clock()
            append_finished(run)

        subscription.callback = _surround(subscription.callback, start, finish)

    @property
    def published(self) -> int:
        return len(self._published)

    @property
    def heard(self) -> int:
        """How many callbacks were started."""
        return len(self._heard)

    @property
    def in_flight(self) -> int:
        """How many callbacks have started and not yet finished."""
        return len(self._heard) - len(self._finished)

    @property
    def started_s(self) -> float:
        """When `table` has its second 0, in seconds of `time.monotonic`; NaN before that."""
        return min((at_s for _, at_s in self._all_published()), default=math.nan)

    def published_earlier_s(self, seq: int) -> float:  # noqa: ARG002 - a kind of recording knows it
        """Return when a message of before this recording was published, NaN if that is not known.

        In seconds of `time.monotonic`.
        """
        return math.nan

    def _all_published(self) -> list[tuple[int, float]]:
        """Return the messages of this recording, and those of before it that were heard in it."""
        published = list(self._published)
        first = min((seq for seq, _ in published), default=math.inf)
        earlier = {run.seq for run in list(self._heard) if run.seq < first}
        times = [(seq, self.published_earlier_s(seq)) for seq in sorted(earlier)]
        return [(seq, at_s) for seq, at_s in times if not math.isnan(at_s)] + published

    def runs_here(self) -> int:
        """Return the number of the message whose callback runs in this thread, or -1."""
        here = threading.get_ident()
        runs = (run for run in reversed(self._heard) if run.running)
        return next((run.seq for run in runs if run.thread == here), -1)

    def now(self, depth: int) -> tuple[dict[int, float], list[int]]:
        """Return which messages have a callback now, and which wait in a queue of this depth.

        Both are sequence numbers, oldest first; the former with how old the message is (s).
        """
        heard, published = self._heard[-64:], dict(self._published[-64 - depth :])
        newest, now_s = max((run.seq for run in heard), default=-1), time.monotonic()
        runs = {run.seq: now_s - published.get(run.seq, now_s) for run in heard if run.running}
        return runs, [seq for seq in list(published)[-depth:] if seq > newest]

    def wait_until_complete(self, messages: int, timeout_s: float = 60.0) -> None:
        """Wait until `messages` messages are published and the subscription has worked them off.

        The newest message is never pushed out of a queue: when its callback and all others have
        finished, nothing is waiting any more.

        Raises ValueError for a count below 1, TimeoutError after `timeout_s` seconds, and the
        exception of a callback that failed.
        """
        from helpers.ros import current_session

        __tracebackhide__ = True
        if messages < 1:
            raise ValueError(f'messages must be a whole number from 1 up, not {messages!r}.')

        def complete() -> bool:
            if len(self._published) < messages:
                return False
            newest = self._published[-1][0]
            return self.in_flight == 0 and any(run.seq == newest for run in self._heard)

        def progress() -> float:
            if not (self._finished and self._published):
                return 0.0
            return (self._finished[-1].seq - self._published[0][0] + 1) / messages

        def status() -> str:
            return f'Published {self.published}, received {self.heard}.'

        current_session().wait_until(complete, timeout_s, progress, status)

    def table(self) -> pd.DataFrame:
        """Return one row a message, in the order of their sequence numbers.

        Columns: `seq` (int), `published_s`, `started_s`, `finished_s` (seconds since the first
        publish call; NaN if it did not happen), `thread` ('thread 1', 'thread 2', ... in the
        order of their first callback; None if the message was never heard). `attrs` holds the
        parameters of the recording.

        Raises ValueError if two messages have the same sequence number.
        """
        import pandas as pd  # loaded when a table is made: it takes 0.2 s

        published = pd.DataFrame(self._all_published(), columns=['seq', 'published_s'])
        heard = pd.DataFrame(
            [(run.seq, run.started_s, run.finished_s, run.thread) for run in list(self._heard)],
            columns=['seq', 'started_s', 'finished_s', 'thread'],
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
        table = table[RUN_COLUMNS]
        table.attrs = dict(self.parameters)
        return table


class CallbackRecording:
    """Records every run of some callbacks, from now on.

    `CallbackRecording(tick=node.timer, look=node.service)` watches timers, services, subscriptions
    and clients, each under a name. They stay plain rclpy objects. A
    run of a client is the moment when an executor takes an answer. `watch` is for what has no
    `callback` of its own, such as an action server.
    """

    def __init__(self, **watched) -> None:
        self.runs: dict[str, list[CallbackRun]] = {name: [] for name in watched}
        self.watched = watched
        self.calls: list[Call] = []
        self._answers: dict[object, CallbackRun] = {}  # the client's run that took each future
        for name, thing in watched.items():
            if hasattr(thing, 'call_async'):
                self._watch_client(name, thing)
            else:
                thing.callback = self.watch(name, thing.callback)

    def watch(self, name: str, callback: Callable) -> Callable:
        """Return the callback, which is recorded under this name from now on."""
        runs = self.runs.setdefault(name, [])

        def start(*arguments) -> CallbackRun:
            run = CallbackRun(time.monotonic(), threading.get_ident())
            runs.append(run)
            return run

        def finish(run: CallbackRun) -> None:
            run.finished_s = time.monotonic()

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
            caller = self._running() if getattr(waits, 'here', False) else None
            services = (
                service for service in self.watched if _serves(self.watched[service], client)
            )
            recorded = Call(name, next(services, None), caller, time.monotonic())
            self.calls.append(recorded)
            recorded.future = call_async(request)
            return recorded.future

        @functools.wraps(pending)
        def recorded_pending(sequence_number):
            future = pending(sequence_number)
            now = time.monotonic()
            run = CallbackRun(now, threading.get_ident(), finished_s=now)
            self.runs[name].append(run)
            self._answers[future] = run
            return future

        client.call, client.call_async = recorded_call, recorded_call_async
        client.get_pending_request = recorded_pending

    def _running(self) -> CallbackRun | None:
        """Return the run that this thread is in, of a callback that is watched."""
        here = threading.get_ident()
        runs = [run for runs in self.runs.values() for run in runs if run.running]
        own = (run for run in runs if run.thread == here)
        return max(own, key=lambda run: run.started_s, default=None)

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return for each name a table like that of `Recording`, one row a run, for a timeline.

        `seq` counts from 0, the times are seconds since the first start of all, and a callback has
        `published_s` equal to `started_s`. The threads have the same names in all tables.
        """
        import pandas as pd

        zero, names = self.zero_and_threads()
        return {
            name: pd.DataFrame(
                [
                    (
                        seq,
                        run.started_s - zero,
                        run.started_s - zero,
                        math.nan if run.running else run.finished_s - zero,
                        names[run.thread],
                    )
                    for seq, run in enumerate(list(runs))
                ],
                columns=RUN_COLUMNS,
            )
            for name, runs in self.runs.items()
        }

    def zero_and_threads(self) -> tuple[float, dict[int, str]]:
        """Return when the first run of all started, and the names of the threads by their ids."""
        every = [run for runs in self.runs.values() for run in runs]
        every.sort(key=lambda run: run.started_s)
        idents = dict.fromkeys(run.thread for run in every)
        names = {ident: f'thread {i}' for i, ident in enumerate(idents, 1)}
        return (every[0].started_s if every else 0.0), names

    def answer(self, call: Call) -> CallbackRun | None:
        """Return the run of the client that took the answer, None if none was taken."""
        return self._answers.get(call.future)


def _serves(thing, client) -> bool:
    return isinstance(thing, Service) and thing.srv_name == client.srv_name


def _surround(callback: Callable, start: Callable, finish: Callable) -> Callable:
    """Return the callback with `run = start(*arguments)` before it and `finish(run)` after it."""
    if inspect.iscoroutinefunction(callback):

        @functools.wraps(callback)
        async def recorded_callback(*arguments):
            run = start(*arguments)
            try:
                return await callback(*arguments)
            finally:
                finish(run)

    else:

        @functools.wraps(callback)
        def recorded_callback(*arguments):
            run = start(*arguments)
            try:
                return callback(*arguments)
            finally:
                finish(run)

    return recorded_callback


def most_at_once(table: pd.DataFrame) -> int:
    """Return the largest number of callbacks in a recording that ran at the same time."""
    begun, ended = table['started_s'].dropna(), table['finished_s'].dropna()
    return max(int(((begun <= time_s) & (ended > time_s)).sum()) for time_s in begun)


def at_once_with(table: pd.DataFrame, seq: int) -> set[int]:
    """Return the messages whose callbacks ran at the same time as that of `seq`, with itself.

    Raises ValueError if this one had no callback.
    """
    heard = table.dropna(subset='started_s')
    begun, ended = heard['started_s'], heard['finished_s'].fillna(math.inf)
    [row] = heard.index[heard['seq'] == seq]
    at_once = (begun < ended[row]) & (ended > begun[row])
    return {*heard.loc[at_once, 'seq'].tolist()}
