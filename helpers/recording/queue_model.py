"""What a KEEP_LAST queue must do: predict a run before it happens, explain one that did.

A subscription keeps the last `depth` messages that no callback has taken yet. A message that
arrives at a full queue pushes the oldest one out. Free threads ("workers") take the oldest message
and run the callback. In one process a message has arrived when `publish()` returns.

Source: history policies of the DDS specification (OMG DDS 1.4, 2.2.3.18), and rclpy's executors,
where the thread that runs the callback takes the message itself.
"""

from __future__ import annotations

import heapq
import math
import numbers
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from helpers.notebook import check_count, shown
from helpers.recording.table import check_table

if TYPE_CHECKING:
    import pandas as pd

# A worker may be late, on a busy machine. It may not rest for this part of a callback, and for as
# long as callbacks and timers of the same run were late.
ALLOWED_REST = 0.4


def predict(
    period_s: float, callback_s: float, depth: int, threads: int, messages: int
) -> pd.DataFrame:
    """Return the table of a run that has not happened: `messages` rows, as `Recording.table`.

    A message is published every `period_s` seconds; its callback takes `callback_s` seconds on one
    of `threads` workers; the queue is KEEP_LAST(`depth`). A message that arrives at the very
    moment when a worker becomes free arrives first. Times are exact to the nanosecond.

    Raises ValueError for a count below 1, no period, or a negative time of a callback.
    """
    import pandas as pd  # loaded when a table is made: it takes 0.2 s

    period = _nanoseconds('period_s', period_s, least=1e-9)
    callback = _nanoseconds('callback_s', callback_s, least=0)
    for name, value in (('depth', depth), ('threads', threads), ('messages', messages)):
        check_count(name, value)
    taken, started = [], []
    oldest = 0
    while oldest < messages:
        now = oldest * period
        if len(taken) >= threads:  # all callbacks take the same time: workers take turns
            now = max(now, started[-threads] + callback)
        arrived = min(now // period + 1, messages)
        taken.append(max(oldest, arrived - depth))
        started.append(now)
        oldest = taken[-1] + 1
    start = np.array(started)
    callbacks = pd.DataFrame(
        {
            'started_s': start / 1e9,
            'finished_s': (start + callback) / 1e9,
            'thread': [f'thread {number % threads + 1}' for number in range(len(taken))],
        },
        index=taken,
    )
    seq = np.arange(messages)
    table = pd.DataFrame({'seq': seq, 'published_s': seq * period / 1e9}).join(callbacks)
    table['thread'] = table['thread'].astype(object).where(table['thread'].notna(), None)
    table.attrs = {'period_s': period_s, 'callback_s': callback_s, 'depth': depth}
    return table


@dataclass
class Explanation:
    """Why each lost message was lost. See `explain`.

    `losses` has one row a lost message: `seq`, `pushed_out_by` (the message whose arrival pushed it
    out, or NA) and `queue_after` (the newer messages that then fill the queue).
    `contradictions` are sentences about what such a queue cannot have done.
    """

    messages: int
    losses: pd.DataFrame
    contradictions: list[str] = field(default_factory=list)

    @property
    def lost(self) -> int:
        return len(self.losses)

    @property
    def explained(self) -> int:
        """How many of the lost messages were pushed out by newer ones."""
        return int(self.losses['pushed_out_by'].notna().sum())

    @property
    def complete(self) -> bool:
        """Whether every loss and every delivery is what the queue must do."""
        return not self.contradictions and self.explained == self.lost

    def __str__(self) -> str:
        lines = [
            f'{self.lost} of {self.messages} messages were lost, {self.explained} losses explained.'
        ]
        if self.complete:
            lines.append('Everything follows the rules of a KEEP_LAST queue.')
        return '\n'.join(lines + self.contradictions)


def explain(table: pd.DataFrame, depth: int, threads: int) -> Explanation:
    """Explain a recorded table with a KEEP_LAST(`depth`) queue and `threads` workers.

    `threads` is the number of callbacks that may run at the same time: 1 for a
    SingleThreadedExecutor and for a mutually exclusive group, else the executor's threads.

    The instant at which a worker took a message is not in the table, but it lies between known
    ones. It comes after the publish call of the message, after the previous take, and after the
    previous callback of the worker; and it comes before the start of the callback. How many
    messages had arrived then is given by the gap in front of the message. The table is explained
    when such instants exist for all messages and no worker rested while the queue overflowed.
    Times on a busy machine move, and these rules do not.

    Raises ValueError or TypeError for a table or a number that cannot be used.
    """
    table = check_table(table)
    check_count('depth', depth)
    check_count('threads', threads)
    # A queue for more messages than there are never overflows, and more workers find nothing to do.
    named_depth, depth, threads = depth, min(depth, len(table)), min(threads, len(table))
    heard = _heard(table)
    contradictions = _impossible_rows(table)
    contradictions += [
        f'Message {seq} cannot have been the oldest in the queue for a free worker '
        'when its callback started.'
        for seq, (earliest, latest) in take_bounds(table, depth, threads).items()
        if earliest > latest
    ]
    contradictions += _too_many_at_once(heard, threads)
    contradictions += _rests(table, heard, depth, threads)
    losses = _losses(table, depth)
    for seq in losses.loc[losses['pushed_out_by'].isna(), 'seq']:
        contradictions.append(
            f'Message {seq} was never received, and fewer than {named_depth} newer ones came to '
            'push it out.'
        )
    return Explanation(len(table), losses, contradictions)


def _losses(table: pd.DataFrame, depth: int) -> pd.DataFrame:
    import pandas as pd

    seq = table['seq'].astype('Int64')
    losses = pd.DataFrame({'seq': table['seq'], 'pushed_out_by': seq.shift(-depth)})
    losses['queue_after'] = seq.shift(-1).astype(str) + ' to ' + seq.shift(-depth).astype(str)
    losses['queue_after'] = losses['queue_after'].where(losses['pushed_out_by'].notna(), None)
    return losses[table['started_s'].isna()].reset_index(drop=True)


def _impossible_rows(table: pd.DataFrame) -> list[str]:
    """What no queue at all can do."""
    published = table['published_s']
    return [
        f'Message {seq} was {what}.'
        for what, wrong in (
            ('published before the message in front of it', published.diff() < 0),
            ('heard before it was published', table['started_s'] < published),
        )
        for seq in table.loc[wrong, 'seq']
    ]


def take_bounds(table: pd.DataFrame, depth: int, threads: int) -> dict[int, tuple[float, float]]:
    """Return for each heard message when it was taken: not before, and not after (seconds).

    The takes are in the order of the messages, each as early as possible. If none is possible,
    the first time is later than the second. `table` is as `check_table` returns it.
    """
    published = [*table['published_s'], *[math.inf] * (depth + 1)]
    busy_until = [-math.inf] * threads  # the latest finishes of earlier messages, as a heap
    found = {}
    expected, previous_take = 0, -math.inf
    columns = _heard(table)[['seq', 'started_s', 'finished_s', 'worker_free_s']]
    for index, seq, start, finish, free in columns.itertuples(name=None):
        # `arrived` messages were published when this one was the oldest in the queue. Without a
        # gap the queue may have been anywhere between one message and full; after a gap, full.
        full = index + depth
        arrived = full if index > expected else index + 1
        earliest = max(previous_take, published[arrived - 1], busy_until[0], free)
        latest = min(start, published[full + 1])
        found[seq] = earliest, latest
        if earliest > latest:
            earliest = start  # go on from what was recorded
        heapq.heappushpop(busy_until, finish)
        expected, previous_take = index + 1, earliest
    return found


def _heard(table: pd.DataFrame) -> pd.DataFrame:
    """Return the heard messages, with `worker_free_s`: when their thread was free for them."""
    heard = table[table['started_s'].notna()]
    # A callback that was still running when the record ended has not finished.
    heard = heard.assign(finished_s=heard['finished_s'].fillna(math.inf))
    heard['worker_free_s'] = (
        heard.sort_values(['started_s', 'finished_s'])
        .groupby('thread', sort=False)['finished_s']
        .shift(fill_value=-math.inf)
    )
    return heard


def _too_many_at_once(heard: pd.DataFrame, threads: int) -> list[str]:
    ordered = heard.sort_values(['started_s', 'finished_s'])
    finished = np.searchsorted(np.sort(heard['finished_s']), ordered['started_s'], side='right')
    running = np.arange(1, len(heard) + 1) - finished
    return [
        f'More than {threads} callback(s) ran when message {seq} started.'
        for seq in ordered.loc[running > threads, 'seq']
    ] + [
        f'The thread of message {seq} was busy when it started.'
        for seq in heard.loc[heard['started_s'] < heard['worker_free_s'], 'seq']
    ]


def _rests(table: pd.DataFrame, heard: pd.DataFrame, depth: int, threads: int) -> list[str]:
    """Return when a worker was free for long while messages waited that were then pushed out."""
    import pandas as pd

    published = table['published_s'].to_numpy()
    lost = np.flatnonzero(table['started_s'].isna())
    lost = lost[lost + depth < len(table)]
    callbacks, periods = heard['finished_s'] - heard['started_s'], pd.Series(np.diff(published))
    workers_known = threads == 1 or heard['thread'].notna().all()
    if not (len(lost) and workers_known and _regular(callbacks) and _regular(periods)):
        return []
    # For how long, up to a time, was a message waiting that would be lost?
    pushed_out = published[lost + depth]
    arrived = np.maximum(published[lost], np.concatenate([[-math.inf], pushed_out[:-1]]))
    total = np.cumsum(pushed_out - arrived)
    edges = np.column_stack([arrived, pushed_out]).ravel()
    waited = np.column_stack([total - (pushed_out - arrived), total]).ravel()
    starts, ends = _pauses(heard, threads, until=published[-1])
    rested = np.interp(ends, edges, waited) - np.interp(starts, edges, waited)
    allowed = ALLOWED_REST * callbacks.median() + np.ptp(callbacks) + np.ptp(periods)
    return [
        f'Message {table["seq"].iloc[lost[np.searchsorted(pushed_out, starts[i], "right")]]} was '
        f'pushed out although a worker was free for {ends[i] - starts[i]:.3g} s.'
        for i in np.flatnonzero(rested > allowed)
    ]


def _pauses(heard: pd.DataFrame, threads: int, until: float) -> tuple[np.ndarray, np.ndarray]:
    """From when to when each worker was free. Before the first callback nothing is known."""
    ordered = heard.sort_values(['started_s', 'seq'])
    # A worker is a thread; those of an exclusive group are more, and work one after the other.
    worker = ordered['thread'].to_numpy()
    if threads == 1 or ordered['thread'].nunique() > threads:
        worker = np.arange(len(ordered)) % threads
    finished = ordered['finished_s'].groupby(worker)
    first = ordered['started_s'].iloc[0]
    starts = [*finished.shift(fill_value=first), *finished.last()]
    ends = [*ordered['started_s'], *[until] * len(finished)]
    if len(finished) < threads:  # one that never worked
        starts, ends = [*starts, first], [*ends, until]
    return np.array(starts), np.maximum(starts, ends)


def _regular(durations: pd.Series) -> bool:
    """Whether all durations are alike. If not, a late worker proves nothing."""
    longest = durations.max()  # NaN of none, infinite while a callback is running
    return longest < math.inf and longest <= 2 * durations.median()


def _nanoseconds(name: str, value: float, least: float) -> int:
    if not isinstance(value, numbers.Real) or not least <= value < math.inf:
        raise ValueError(f'{name} must be seconds, {least} or more, not {shown(value)}.')
    return round(float(value) * 1e9)
