"""Runs of a queue that are drawn by chance, in whole seconds, so that instants can be equal."""

import math

import numpy as np
import pandas as pd
from hypothesis import strategies as st

from helpers.recording import COLUMNS

CALLBACK = ['started_s', 'finished_s', 'thread']
NOT_HEARD = math.nan, math.nan, None
# Two callbacks of a thread at one instant, without a duration, would have no order.
DURATION = st.integers(1, 12)


@st.composite
def happenings(draw):
    """A run in which all is late by chance. Return its table, its depth and its workers."""
    depth, threads = draw(st.integers(1, 4)), draw(st.integers(1, 3))
    # An exclusive group has one worker, who may have another thread each time.
    names = st.integers(1, draw(st.sampled_from([1, 3]))) if threads == 1 else None
    gaps = draw(st.lists(st.integers(0, 6), min_size=1, max_size=9))
    published = np.cumsum(gaps)
    few = st.integers(0, 4)
    queue, free_at, rows = [], [0] * threads, {}
    now = arrived = 0
    take_at = None
    while arrived < len(published) or queue:
        if queue and take_at is None:
            take_at = max(now, min(free_at)) + draw(few)
        if arrived < len(published) and (take_at is None or published[arrived] <= take_at):
            now = max(now, published[arrived])
            queue = [*queue, arrived][-depth:]
            arrived += 1
        else:
            now, take_at = take_at, None
            worker = draw(st.sampled_from([w for w in range(threads) if free_at[w] <= now]))
            start = now + draw(few)
            free_at[worker] = start + draw(DURATION)
            name = draw(names) if names is not None else worker + 1
            rows[queue.pop(0)] = start, free_at[worker], f'thread {name}'
    return made_table(published, rows), depth, threads


def made_table(published, rows):
    return pd.DataFrame(
        [(seq, p, *rows.get(seq, NOT_HEARD)) for seq, p in enumerate(published)], columns=COLUMNS
    ).astype({'published_s': float, 'started_s': float, 'finished_s': float})


def heard(table):
    return table.loc[table['started_s'].notna(), 'seq'].tolist()


def lose(draw, table):
    """A message that was heard counts as lost."""
    seq = draw(st.sampled_from(heard(table)))
    table.loc[seq, CALLBACK] = NOT_HEARD


def hear(draw, table):
    """A message that was lost counts as heard; or a callback ran at another time."""
    seq = draw(st.sampled_from(table['seq'].tolist()))
    start = table['published_s'][seq] + draw(st.integers(0, 20))
    worker = f'thread {draw(st.integers(1, 3))}'
    table.loc[seq, CALLBACK] = start, start + draw(DURATION), worker


def swap(draw, table):
    """Each of two callbacks got the message of the other."""
    one, other = draw(st.sampled_from(heard(table))), draw(st.sampled_from(heard(table)))
    table.loc[[one, other], CALLBACK] = table.loc[[other, one], CALLBACK].to_numpy()
