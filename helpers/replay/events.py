"""The steps of a run, in an order in which a queue can have made them.

A recording does not say when a thread took a message, and when the message arrived: both are
between known times (see `queue_model.take_bounds`). Here each gets one: a take as near to the start
of its callback as the queue allows, an arrival as near to its publish call as the takes allow.
"""

from __future__ import annotations

import heapq
import math
from typing import TYPE_CHECKING, NamedTuple

from helpers.recording import take_bounds

if TYPE_CHECKING:
    import pandas as pd

ARRIVE, TAKE, END = 'arrive', 'take', 'end'


class Event(NamedTuple):
    """One step of a run. Times are seconds since the first publish; an arrival has no thread."""

    at_s: float
    do: str
    seq: int
    thread: str | None


def events(table: pd.DataFrame, depth: int, workers: int) -> list[Event]:
    """Return the steps of a run in their order. `table` is as `check_table` returns it.

    `workers` is how many callbacks may run at the same time. A callback that had not finished when
    the record ended has no end here.

    Raises ValueError, with one sentence, for a table that no such queue can have made.
    """
    depth, workers = min(depth, len(table)), min(workers, len(table))
    heard = table[table['started_s'].notna()]
    _check(table, heard)
    takes = _takes(table, heard, depth, workers)
    arrivals = _arrivals(table, takes, depth)
    seqs = table['seq'].tolist()
    steps: list[Event] = []
    running: list[tuple[float, int, str]] = []  # a heap: the first to end
    arrived = 0

    def go_on(until_s: float, arrivals_wanted: int, at_most: int) -> None:
        """Add what comes before a take: arrivals in their order, and the ends between them."""
        nonlocal arrived
        while arrived < arrivals_wanted or arrived < at_most and arrivals[arrived] <= until_s:
            end(arrivals[arrived])
            steps.append(Event(arrivals[arrived], ARRIVE, seqs[arrived], None))
            arrived += 1
        end(until_s)

    def end(until_s: float) -> None:
        while running and running[0][0] <= until_s:
            finished_s, seq, thread = heapq.heappop(running)
            steps.append(Event(finished_s, END, seq, thread))

    expected = 0
    for index, seq, finished_s, thread in heard[['seq', 'finished_s', 'thread']].itertuples(
        name=None
    ):
        # After a gap, those that pushed out the ones in front of it had arrived.
        full = min(index + depth, len(seqs))
        go_on(takes[index], full if index > expected else index + 1, full)
        steps.append(Event(takes[index], TAKE, seq, thread))
        # One that was still running when the record ended has no end: NaN.
        heapq.heappush(running, (math.inf if math.isnan(finished_s) else finished_s, seq, thread))
        expected = index + 1
    go_on(math.nextafter(math.inf, 0), len(seqs), len(seqs))
    return steps


def _takes(table: pd.DataFrame, heard: pd.DataFrame, depth: int, workers: int) -> dict[int, float]:
    """Return when each heard message was taken, by its row."""
    published = [*table['published_s'], *[math.inf] * depth]
    bounds = take_bounds(table, depth, workers)
    takes, later = {}, math.inf
    for index, seq, started_s in heard[['seq', 'started_s']].iloc[::-1].itertuples(name=None):
        earliest, latest = bounds[seq]
        if earliest > latest:
            at_a_time = f'{workers} callbacks' if workers > 1 else 'one callback'
            raise ValueError(
                f'No queue of depth {depth} with {at_a_time} at a time can have made this table: '
                f'message {seq} cannot have been the oldest in the queue for a free thread when '
                'its callback started. Are depth, threads and group those of the run?'
            )
        later = min(later, started_s, published[index + depth])
        takes[index] = max(later, earliest)
    return takes


def _arrivals(table: pd.DataFrame, takes: dict[int, float], depth: int) -> list[float]:
    """Return when each message arrived. The one that would push out another came after its take."""
    return [
        max(published_s, takes.get(index - depth, -math.inf))
        for index, published_s in enumerate(table['published_s'])
    ]


def _check(table: pd.DataFrame, heard: pd.DataFrame) -> None:
    earlier = table.loc[table['published_s'].diff() < 0, 'seq']
    if len(earlier):
        raise ValueError(f'Message {earlier.iloc[0]} was published before the one in front of it.')
    unknown = heard.loc[heard['thread'].isna(), 'seq']
    if len(unknown):
        raise ValueError(f'It is not known which thread ran message {unknown.iloc[0]}.')
    backwards = heard.loc[heard['finished_s'] < heard['started_s'], 'seq']
    if len(backwards):
        raise ValueError(f'The callback of message {backwards.iloc[0]} ended before it started.')
