"""The queue model against slow and obvious references, and against real runs that gates drive."""

import math
import threading

import numpy as np
import pandas as pd
from hypothesis import assume, event, example, given, settings
from hypothesis import strategies as st
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from support.nodes import LIMIT_S, Listener, Talker, spin

from helpers.queue_model import REST, explain, predict
from helpers.recording import COLUMNS, Recording
from helpers.session import ros_session


def tries(number):
    """This many examples in `make test`, and as much more as a profile asks for."""
    return settings(max_examples=number * settings.default.max_examples // 100)


def heard(table):
    return table.loc[table['started_s'].notna(), 'seq'].tolist()


# predict: a run without any chance in it


def slow_prediction(period, callback, depth, threads, messages):
    """Step from event to event with a real list as the queue. Return {message: start}."""
    queue, started, free_at = [], {}, [0] * threads
    published, now = 0, 0
    while published < messages or queue:
        events = []
        if published < messages:
            events.append(published * period)
        if queue:
            events.append(max(now, min(free_at)))
        now = min(events)
        if published < messages and published * period == now:
            queue.append(published)
            published += 1
            if len(queue) > depth:
                queue.pop(0)
        while queue and min(free_at) <= now:
            started[queue.pop(0)] = now
            free_at[free_at.index(min(free_at))] = now + callback
    return started


runs = st.tuples(
    st.integers(1, 12),  # milliseconds
    st.integers(0, 60),  # milliseconds
    st.integers(1, 12),
    st.integers(1, 9),
    st.integers(1, 80),
)


@tries(150)
@given(runs)
@example((50, 200, 10, 1, 41))
@example((50, 200, 10, 3, 60))
@example((50, 200, 10, 4, 60))
@example((1, 1, 1, 1, 1))
@example((3, 0, 1, 4, 20))
@example((1, 60, 1, 9, 80))
def test_predict_is_what_a_queue_does(run):
    period, callback, depth, threads, messages = run
    table = predict(period / 1000, callback / 1000, depth, threads, messages)
    expected = slow_prediction(period, callback, depth, threads, messages)
    assert heard(table) == list(expected)
    # To the nanosecond, in milliseconds.
    started, finished = (
        table[name].dropna().mul(1000).round(6) for name in ('started_s', 'finished_s')
    )
    assert started.tolist() == list(expected.values())
    assert finished.tolist() == [start + callback for start in expected.values()]
    # No worker does two things at a time.
    for _, work in table.dropna().groupby('thread'):
        assert (work['started_s'].iloc[1:].values >= work['finished_s'].iloc[:-1].values).all()
    explanation = explain(table, depth, threads)
    assert explanation.contradictions == []
    assert explanation.complete
    assert explanation.lost == explanation.explained == messages - len(expected)


# explain: what can have happened, in whole seconds, so that instants can be equal


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
            free_at[worker] = start + draw(st.integers(0, 12))
            name = draw(names) if names is not None else worker + 1
            rows[queue.pop(0)] = start, free_at[worker], f'worker {name}'
    return made_table(published, rows), depth, threads


def made_table(published, rows):
    missing = (math.nan, math.nan, None)
    return pd.DataFrame(
        [(seq, p, *rows.get(seq, missing)) for seq, p in enumerate(published)], columns=COLUMNS
    ).astype({'published_s': float, 'started_s': float, 'finished_s': float})


def can_have_happened(table, depth, threads, delay=0):
    """Try every order of arrivals and takes, with a real list as the queue.

    A message arrives after its publish call, and before the next call (plus `delay`). A free
    worker takes the oldest message, and starts its callback then or later.
    """
    published = table['published_s'].tolist()
    arrives_until = [*(p + delay for p in published[1:]), math.inf]
    takes = list(table[table['started_s'].notna()].drop(columns='published_s').itertuples(False))

    def from_here(arrived, queue, taken, now):
        if arrived == len(published) and taken == len(takes):
            return not queue
        if arrived < len(published):
            at = max(now, published[arrived])
            if at <= arrives_until[arrived]:
                full = [*queue, arrived]
                if len(full) > depth:
                    full.pop(0)
                if from_here(arrived + 1, full, taken, at):
                    return True
        if taken < len(takes) and queue and queue[0] == takes[taken].seq:
            take, earlier = takes[taken], takes[:taken]
            for at in sorted({now, *(e.finished_s for e in earlier)}):
                busy = [e.thread for e in earlier if e.finished_s > at]
                if at >= now and len(busy) < threads and take.thread not in busy:
                    return at <= take.started_s and from_here(arrived, queue[1:], taken + 1, at)
        return False

    return from_here(0, [], 0, -math.inf)


def contradictions(table, depth, threads, delay_s=0.0):
    """What `explain` finds impossible. That a worker rested is possible: see below."""
    found = explain(table, depth, threads, delay_s).contradictions
    return [sentence for sentence in found if 'a worker was free' not in sentence]


@tries(100)
@given(happenings())
def test_what_happened_is_explained(happening):
    table, depth, threads = happening
    assert can_have_happened(table, depth, threads)
    assert contradictions(table, depth, threads) == []
    explanation = explain(table, depth, threads)
    assert explanation.lost == explanation.explained == len(table) - len(heard(table))


def lose(draw, table):
    """A message that was heard counts as lost."""
    seq = draw(st.sampled_from(heard(table)))
    table.loc[seq, ['started_s', 'finished_s', 'thread']] = math.nan, math.nan, None


def hear(draw, table):
    """A message that was lost counts as heard; or a callback ran at another time."""
    seq = draw(st.sampled_from(table['seq'].tolist()))
    start = table['published_s'][seq] + draw(st.integers(0, 20))
    worker = f'worker {draw(st.integers(1, 3))}'
    table.loc[seq, ['started_s', 'finished_s', 'thread']] = (
        start, start + draw(st.integers(0, 12)), worker,
    )  # fmt: skip


def swap(draw, table):
    """Each of two callbacks got the message of the other."""
    one, other = draw(st.sampled_from(heard(table))), draw(st.sampled_from(heard(table)))
    columns = ['started_s', 'finished_s', 'thread']
    table.loc[[one, other], columns] = table.loc[[other, one], columns].to_numpy()


@tries(200)
@given(
    happenings(), st.lists(st.sampled_from([lose, hear, swap]), min_size=1, max_size=2), st.data()
)
def test_explain_finds_what_cannot_have_happened(happening, changes, data):
    table, depth, threads = happening
    table = table.copy()
    for change in changes:
        assume(heard(table))
        change(data.draw, table)
    assume((table['started_s'].isna() | (table['started_s'] >= table['published_s'])).all())
    delay = data.draw(st.sampled_from([0, 0, 0, 1, 3, 9]))
    table['published_s'] -= delay
    possible = can_have_happened(table, depth, threads, delay)
    event(f'possible: {possible}')
    assert (contradictions(table, depth, threads, delay) == []) is possible


def test_a_worker_that_is_busy_takes_nothing():
    heard_late = {0: (0, 10, 'worker 1'), 1: (10, 12, 'worker 2'), 3: (12, 14, 'worker 1')}
    table = made_table([0, 1, 2, 3], heard_late)
    assert not can_have_happened(table, 1, 1)
    assert contradictions(table, 1, 1) != []
    # With two workers, message 1 was taken at once, and its callback came late.
    assert can_have_happened(table, 1, 2)
    assert contradictions(table, 1, 2) == []
    # Not by the thread that had another callback then.
    table = made_table([0, 1, 2, 3], heard_late | {1: (10, 12, 'worker 1')})
    assert not can_have_happened(table, 1, 2)
    assert contradictions(table, 1, 2) != []


# explain: how long a worker may rest


@st.composite
def regular_runs(draw, most_late):
    """A run of a timer, whose callbacks need about 20 s and begin late. Return it as above."""
    depth, threads = draw(st.integers(1, 10)), draw(st.integers(1, 4))
    period, messages = draw(st.integers(1, 20)), draw(st.integers(2, 40))
    late, more = st.integers(0, most_late), st.integers(0, draw(st.sampled_from([0, 0, 3])))
    queue, rows, awake_at = [], {}, [0, *(draw(late) for _ in range(threads - 1))]
    now = arrived = 0
    while arrived < messages or queue:
        take_at = max(now, min(awake_at)) if queue else math.inf
        if arrived < messages and arrived * period <= take_at:
            now = arrived * period
            queue = [*queue, arrived][-depth:]
            arrived += 1
        else:
            now, worker = take_at, awake_at.index(min(awake_at))
            finish = now + 20 + draw(more)
            rows[queue.pop(0)] = now, finish, f'worker {worker + 1}'
            awake_at[worker] = finish + draw(late)
    return made_table(np.arange(messages) * period, rows), depth, threads


def longest_rest(table, depth, threads):
    """Second by second: for how long at most did a worker pause, and a message wait in vain?"""
    published = table['published_s'].tolist()
    runs = table[table['started_s'].notna()].sort_values('started_s')
    workers = [
        list(run[['started_s', 'finished_s']].to_numpy()) for _, run in runs.groupby('thread')
    ]
    workers += [[]] * (threads - len(workers))
    first = runs['started_s'].min()
    losses = [
        (published[seq], published[seq + depth])
        for seq in table.loc[table['started_s'].isna(), 'seq']
        if seq + depth < len(table)
    ]
    longest = 0
    for work in workers:
        edges = [first, *(edge for one in work for edge in one), math.inf]
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            seconds = range(int(start), int(min(end, published[-1])))
            in_vain = [s for s in seconds if any(comes <= s < goes for comes, goes in losses)]
            longest = max(longest, len(in_vain))
    return longest


@tries(100)
@given(regular_runs(most_late=int(REST * 20)))
def test_a_worker_may_be_a_little_late(run):
    table, depth, threads = run
    explanation = explain(table, depth, threads)
    assert explanation.complete, f'{explanation}\n{table}'


lateness = st.sampled_from([0, int(REST * 20), 20])


@tries(150)
@given(lateness.flatmap(regular_runs), st.integers(0, 2), st.sampled_from([0, 0, 4]), st.data())
def test_no_worker_rests_while_messages_are_pushed_out(run, fewer, delay, data):
    table, depth, threads = run
    table = table.copy()
    for _ in range(fewer):
        lose(data.draw, table)
        assume(heard(table))
    # A worker may never work, or stop for good.
    threads += data.draw(st.sampled_from([0, 0, 1]))
    end = data.draw(st.sampled_from([math.inf, 20, 60]))
    gone = (table['thread'] == 'worker 1') & (table['started_s'] > end)
    table.loc[gone, ['started_s', 'finished_s', 'thread']] = math.nan, math.nan, None
    assume(heard(table))
    found = explain(table, depth, threads, delay).contradictions
    rests = [sentence for sentence in found if 'a worker was free' in sentence]
    event(f'rests: {bool(rests)}')
    # Nothing but the callbacks was late: on a precise record this is 8 s.
    callbacks = (table['finished_s'] - table['started_s']).dropna()
    allowed = REST * callbacks.median() + callbacks.max() - callbacks.min() + delay
    assert bool(rests) == (longest_rest(table, depth, threads) > allowed)


# Real runs: rclpy and Fast DDS, one step after the other


class Gates:
    """Holds each callback until its own gate is opened."""

    def __init__(self, messages):
        self.entered = set()
        self._changed = threading.Condition()
        self._gates = [threading.Event() for _ in range(messages)]

    def __call__(self, message):
        seq = int(message.data.rpartition(' ')[2])
        with self._changed:
            self.entered.add(seq)
            self._changed.notify()
        assert self._gates[seq].wait(LIMIT_S)

    def open(self, seq):
        self._gates[seq].set()

    def wait_for(self, number):
        """Wait until this many callbacks have begun."""
        with self._changed:
            assert self._changed.wait_for(lambda: len(self.entered) >= number, LIMIT_S)


# Messages that are published at once, and callbacks that end: the first, second, ... that runs.
steps = st.lists(
    st.tuples(st.just('publish'), st.integers(1, 9)) | st.tuples(st.just('end'), st.integers(0, 4)),
    min_size=1,
    max_size=12,
)


@tries(60)
@given(
    depth=st.integers(1, 5),
    threads=st.integers(1, 5),
    exclusive=st.booleans(),
    early=st.integers(0, 9),
    steps=steps,
)
@example(depth=1, threads=1, exclusive=False, early=0, steps=[('publish', 9), ('end', 0)])
@example(depth=3, threads=5, exclusive=False, early=9, steps=[('end', 2), ('publish', 9)])
@example(depth=2, threads=4, exclusive=True, early=1, steps=[('publish', 4), ('end', 0)] * 3)
def test_a_real_queue_keeps_the_law(depth, threads, exclusive, early, steps):
    messages = early + sum(number for step, number in steps if step == 'publish')
    assume(messages)
    workers = 1 if exclusive else threads
    gates = Gates(messages)
    queue, running, survivors = [], [], []  # what the law says

    def arrive():
        talker.publish()
        queue.append(talker.next_number - 1)
        del queue[:-depth]

    def take_what_is_free():
        """Free workers take the oldest messages: then the callbacks of these have begun."""
        while queue and len(running) < workers:
            running.append(queue.pop(0))
            survivors.append(running[-1])
        gates.wait_for(len(survivors))
        assert gates.entered == set(survivors)

    with ros_session() as session:
        talker = Talker(messages)
        listener = Listener(
            gates,
            depth,
            callback_group=(
                MutuallyExclusiveCallbackGroup if exclusive else ReentrantCallbackGroup
            )(),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        recording = Recording(talker.publisher, listener.subscription)
        for _ in range(early):
            arrive()
        spin(session, listener, threads=threads)
        take_what_is_free()
        for step, number in steps:
            for _ in range(number if step == 'publish' else 0):
                arrive()
                take_what_is_free()
            if step == 'end' and running:
                gates.open(running.pop(number % len(running)))
                take_what_is_free()
        while running:
            gates.open(running.pop(0))
            take_what_is_free()
        recording.wait_until_complete(messages, LIMIT_S)
    table = recording.table()
    assert heard(table) == survivors
    explanation = explain(table, depth, workers)
    assert explanation.complete, f'{explanation}\n{table.to_string()}'
    assert explanation.lost == messages - len(survivors)
    # The newest messages cannot have been pushed out.
    for seq in set(survivors).intersection(range(messages - depth, messages)):
        fewer = table.copy()
        fewer.loc[seq, ['started_s', 'finished_s', 'thread']] = math.nan, math.nan, None
        assert not explain(fewer, depth, workers).complete
