"""Runs of a queue: drawn by chance, in whole seconds, so that instants are equal; real ones."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import assume, settings
from hypothesis import strategies as st

from helpers.recording import RUN_COLUMNS

CALLBACK = ['started_s', 'finished_s', 'thread']
NOT_HEARD = math.nan, math.nan, None
# Two callbacks of a thread at one instant, without a duration, would have no order.
DURATION = st.integers(1, 12)
FEW = st.integers(0, 4)


def tries(number):
    """This many examples in `make test`, and as much more as a profile asks for."""
    return settings(max_examples=number * settings.default.max_examples // 100)


def runs(most_messages):
    """What a run is predicted from: the milliseconds of a period and of a callback, and so on."""
    return st.tuples(
        st.integers(1, 12),  # period
        st.integers(0, 60),  # callback
        st.integers(1, 12),  # depth
        st.integers(1, 9),  # threads
        st.integers(1, most_messages),
    )


@st.composite
def happenings(draw, period=None, late=FEW, lasts=DURATION, most=(4, 3, 9)):
    """A run in which all is late by chance. Return its table, its depth and its workers.

    With a period, the messages are those of a timer, and a worker has one thread. At most are the
    depth, the threads and the messages.
    """
    depth, threads, messages = (draw(st.integers(1, number)) for number in most)
    gaps = [draw(st.integers(0, 6)) if period is None else period for _ in range(messages)]
    published = np.cumsum(gaps)
    # An exclusive group has one worker, which may have another thread each time.
    exclusive = threads == 1 and period is None
    names = st.integers(1, draw(st.sampled_from([1, 3]))) if exclusive else None
    queue, free_at, rows = [], [0] * threads, {}
    now = arrived = 0
    take_at = None
    while arrived < len(published) or queue:
        if queue and take_at is None:
            take_at = max(now, min(free_at)) + draw(late)
        if arrived < len(published) and (take_at is None or published[arrived] <= take_at):
            now = max(now, published[arrived])
            queue = [*queue, arrived][-depth:]
            arrived += 1
        else:
            now, take_at = take_at, None
            worker = draw(st.sampled_from([w for w in range(threads) if free_at[w] <= now]))
            start = now + draw(late)
            free_at[worker] = start + draw(lasts)
            name = draw(names) if names is not None else worker + 1
            rows[queue.pop(0)] = start, free_at[worker], f'thread {name}'
    return made_table(published, rows), depth, threads


def made_table(published, rows):
    return pd.DataFrame(
        [(seq, p, *rows.get(seq, NOT_HEARD)) for seq, p in enumerate(published)],
        columns=RUN_COLUMNS,
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


@st.composite
def changed_happenings(draw):
    """A happening with one or two changes, after which it may be one that cannot happen."""
    table, depth, threads = draw(happenings())
    for change in draw(st.lists(st.sampled_from([lose, hear, swap]), min_size=1, max_size=2)):
        assume(heard(table))
        change(draw, table)
    assume((table['started_s'].isna() | (table['started_s'] >= table['published_s'])).all())
    return table, depth, threads


def assert_is_the_run(states, table, depth, accuracy_s=1e-6):
    """Each state is what the counts of arrivals and takes so far make of the table."""
    published, taken_in_order = table['seq'].tolist(), heard(table)
    published_s, started_s, finished_s = (table.set_index('seq')[name] for name in RUN_COLUMNS[1:4])
    arrived, taken, lost = 0, [], []
    for before, state in zip(states, states[1:], strict=False):
        assert before['now'] <= state['now']
        if 'arrives' in state['says']:
            seq = published[arrived]
            arrived += 1
            assert state['says'].startswith(f'Message {seq} arrives.')
            assert state['now'] >= published_s[seq] - accuracy_s
            if arrived < len(published):
                assert state['now'] <= published_s[published[arrived]] + accuracy_s
            out = published[arrived - 1 - depth] if arrived > depth else None
            if out is not None and math.isnan(started_s[out]):
                lost.append([out, seq])
                assert f', {out}, ' in state['says']
        elif 'takes' in state['says']:
            seq = taken_in_order[len(taken)]
            assert f', {seq}.' in state['says']
            assert seq not in before['threads']
            assert seq in state['threads']
            assert state['now'] <= started_s[seq] + accuracy_s
            taken.append(seq)
        else:
            (ended,) = set(before['threads']) - set(state['threads']) - {None}
            assert state['now'] == pytest.approx(finished_s[ended], abs=accuracy_s)
            assert f'message {ended} ends' in state['says']
        gone = {*taken, *(seq for seq, _ in lost)}
        assert state['queue'] == [seq for seq in published[:arrived] if seq not in gone]
        assert len(state['queue']) <= depth
        assert [seq for seq, _ in state['lost']] == [seq for seq, _ in lost]
        running = [seq for seq in state['threads'] if seq is not None]
        assert set(running) <= set(taken)
        assert len(set(running)) == len(running)
    assert arrived == len(published)
    assert taken == taken_in_order
    unheard = [seq for seq in published if seq not in taken_in_order]
    assert [seq for seq, _ in lost] + states[-1]['queue'] == unheard
