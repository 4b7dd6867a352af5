"""The queue model against slow and obvious references, and against real runs that gates drive."""

import math
import re

import pandas as pd
import pytest
from hypothesis import assume, event, example, given
from hypothesis import strategies as st
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from support.nodes import LIMIT_S, Gate, Listener, Talker, spin
from support.runs import (
    CALLBACK,
    NOT_HEARD,
    changed_happenings,
    happenings,
    heard,
    lose,
    made_table,
    runs,
    tries,
)
from support.waits import wait_for

from helpers.recording import RUN_COLUMNS, Recording, check_table
from helpers.recording.queue_model import explain, predict
from helpers.ros import ros_session

# predict


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


@tries(30)
@given(runs(80))
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
    pd.testing.assert_frame_equal(check_table(table), table)
    assert table['seq'].tolist() == list(range(messages))
    assert heard(table) == list(expected)
    # To the nanosecond, in milliseconds.
    published, started, finished = (
        table[name].dropna().mul(1000).round(6).tolist() for name in RUN_COLUMNS[1:4]
    )
    assert published == [number * period for number in range(messages)]
    assert started == list(expected.values())
    assert finished == [start + callback for start in expected.values()]
    assert [name is None for name in table['thread']] == table['started_s'].isna().tolist()
    assert set(table['thread'].dropna()) <= {f'thread {n}' for n in range(1, threads + 1)}
    assert table.attrs == {'period_s': period / 1000, 'callback_s': callback / 1000, 'depth': depth}
    # No worker does two things at a time.
    for _, work in table.dropna().groupby('thread'):
        assert (work['started_s'].iloc[1:].values >= work['finished_s'].iloc[:-1].values).all()
    explanation = explain(table, depth, threads)
    assert explanation.complete
    assert explanation.lost == explanation.explained == messages - len(expected)


@pytest.mark.parametrize(
    ('changed', 'said'),
    [
        ({'period_s': 0}, 'period_s must be seconds, 1e-09 or more, not 0.'),
        ({'callback_s': -1}, 'callback_s must be seconds, 0 or more, not -1.'),
        ({'callback_s': math.inf}, 'callback_s must be seconds, 0 or more, not inf.'),
        ({'depth': 0}, 'depth must be a whole number from 1 up, not 0.'),
        ({'threads': 1.5}, 'threads must be a whole number from 1 up, not 1.5.'),
    ],
)
def test_bad_numbers(changed, said):
    run = {'period_s': 0.05, 'callback_s': 0.2, 'depth': 10, 'threads': 1, 'messages': 41}
    with pytest.raises(ValueError, match=f'^{re.escape(said)}$'):
        predict(**run | changed)
    for name in {'depth', 'threads'} & changed.keys():
        with pytest.raises(ValueError, match=name):
            explain(predict(**run), **{'depth': 10, 'threads': 1} | changed)


# explain: what can have happened, in whole seconds, so that instants can be equal


def can_have_happened(table, depth, threads):
    """Try every order of arrivals and takes, with a real list as the queue.

    A message arrives after its publish call, and before the next one. A free worker takes the
    oldest message, and starts its callback then or later.
    """
    published = table['published_s'].tolist()
    arrives_until = [*published[1:], math.inf]
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


def contradictions(table, depth, threads):
    """What `explain` finds impossible. That a worker rested is possible: see below."""
    found = explain(table, depth, threads).contradictions
    return [sentence for sentence in found if 'a worker was free' not in sentence]


@tries(25)
@given(happenings())
def test_what_happened_is_explained(happening):
    table, depth, threads = happening
    assert can_have_happened(table, depth, threads)
    assert contradictions(table, depth, threads) == []
    explanation = explain(table, depth, threads)
    assert explanation.lost == explanation.explained == len(table) - len(heard(table))


@tries(60)
@given(changed_happenings())
def test_explain_finds_what_cannot_have_happened(happening):
    table, depth, threads = happening
    possible = can_have_happened(table, depth, threads)
    event(f'possible: {possible}')
    assert (contradictions(table, depth, threads) == []) is possible


# explain: how long a worker may rest

MAY_REST = 0.4  # for this part of a callback


@st.composite
def regular_runs(draw):
    """A run of a timer, whose callbacks need about 20 s and begin late."""
    late = st.integers(0, draw(st.sampled_from([0, int(MAY_REST * 20), 20])))
    lasts = st.integers(20, 20 + draw(st.sampled_from([0, 0, 3])))
    period = draw(st.integers(1, 20))
    return draw(happenings(period, late, lasts, most=(10, 4, 40)))


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


@tries(50)
@given(regular_runs(), st.integers(0, 2), st.data())
def test_no_worker_rests_while_messages_are_pushed_out(run, fewer, data):
    table, depth, threads = run
    table = table.copy()
    for _ in range(fewer):
        lose(data.draw, table)
        assume(heard(table))
    # A worker may never work, or stop for good.
    threads += data.draw(st.sampled_from([0, 0, 1]))
    end = data.draw(st.sampled_from([math.inf, 20, 60]))
    gone = (table['thread'] == 'thread 1') & (table['started_s'] > end)
    table.loc[gone, CALLBACK] = NOT_HEARD
    assume(heard(table))
    found = explain(table, depth, threads).contradictions
    rests = [sentence for sentence in found if 'a worker was free' in sentence]
    event(f'rests: {bool(rests)}')
    # Nothing but the callbacks was late: on a precise record this is 8 s.
    callbacks = (table['finished_s'] - table['started_s']).dropna()
    allowed = MAY_REST * callbacks.median() + callbacks.max() - callbacks.min()
    assert bool(rests) == (longest_rest(table, depth, threads) > allowed)


# explain: examples


def said_of(table, depth):
    """What `explain` finds against a run with one worker."""
    return explain(table, depth, 1).contradictions


def without(table, seq):
    """The message was not heard."""
    broken = table.copy()
    broken.loc[seq, CALLBACK] = NOT_HEARD
    return broken


TABLE = predict(0.05, 0.2, 10, 1, 41)  # message 3 starts at 0.6 s, message 4 is lost


@pytest.mark.parametrize(('rest_s', 'may'), [(0, True), (7, True), (8, True), (9, False)])
def test_a_worker_may_be_late_by_two_fifths_of_a_callback(rest_s, may):
    # A callback of 20 s, a message each second, depth 1: the newest is taken after the rest.
    starts = [0, 20 + rest_s, 40 + 2 * rest_s]
    table = made_table(range(61), {start: (start, start + 20, 'thread 1') for start in starts})
    rests = [said for said in said_of(table, 1) if f'a worker was free for {rest_s} s' in said]
    assert bool(rests) is not may


def test_one_impossible_message_makes_no_later_one_impossible():
    # Depth 5. Message 1 is lost: before 2 is taken, 6 must have come, at 6 s. It was heard at 2 s.
    starts = {seq: seq for seq in range(12) if seq != 1}
    table = made_table(
        range(12), {seq: (start, start + 0.5, 'thread 1') for seq, start in starts.items()}
    )
    impossible = [said for said in said_of(table, 5) if 'cannot have been the oldest' in said]
    assert impossible == [
        'Message 2 cannot have been the oldest in the queue for a free worker when its callback '
        'started.'
    ]


@pytest.mark.parametrize(
    ('table', 'said'),
    [
        (TABLE.assign(thread=TABLE['thread'].replace('thread 1', 'thread 2')), None),
        (TABLE.assign(published_s=TABLE['published_s'].replace(0.25, 9.0)), 'in front of it'),
        (TABLE.assign(started_s=TABLE['started_s'].replace(0.6, 0.01)), 'before it was published'),
        (TABLE.assign(started_s=TABLE['started_s'].replace(0.6, 0.5)), 'thread of message 3'),
        (predict(0.05, 0.2, 9, 1, 41), 'cannot have been the oldest in the queue'),
        (predict(0.05, 0.2, 10, 3, 41), 'More than 1 callback(s) ran when message 1 started.'),
    ],
)
def test_what_is_impossible_is_said(table, said):
    explanation = explain(table, 10, 1)
    assert said is None or any(said in sentence for sentence in explanation.contradictions)
    assert explanation.complete is (said is None)
    assert ('Everything follows' in str(explanation)) is (said is None)


def test_last_messages_that_were_never_heard():
    table = predict(0.05, 0.01, 10, 1, 20)
    explanation = explain(without(without(table, 19), 18), 10, 1)
    assert (explanation.lost, explanation.explained) == (2, 0)
    assert explanation.losses[['pushed_out_by', 'queue_after']].isna().all(axis=None)
    assert explanation.contradictions[-1] == (
        'Message 19 was never received, and fewer than 10 newer ones came to push it out.'
    )


# Real runs: rclpy and Fast DDS


class Gates(dict):
    """A gate for each message, which holds its callback until it is opened."""

    def __init__(self, messages):
        super().__init__((seq, Gate()) for seq in range(messages))

    def __call__(self, message):
        self[int(message.data.rpartition(' ')[2])]()

    def entered(self):
        """Return the messages whose callbacks have begun."""
        return {seq for seq, gate in self.items() if gate.inside}


# Messages that are published at once, and callbacks that end: the first, second, ... that runs.
steps = st.lists(
    st.tuples(st.just('publish'), st.integers(1, 9)) | st.tuples(st.just('end'), st.integers(0, 4)),
    min_size=1,
    max_size=12,
)


@tries(8)
@given(
    depth=st.integers(1, 5),
    threads=st.integers(1, 5),
    exclusive=st.booleans(),
    early=st.integers(0, 9),
    steps=steps,
)
@example(depth=1, threads=1, exclusive=False, early=0, steps=[('publish', 9), ('end', 0)])
@example(depth=3, threads=5, exclusive=False, early=9, steps=[('end', 2), ('publish', 9)])
@example(depth=10, threads=8, exclusive=False, early=0, steps=[('publish', 50)])
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
        wait_for(lambda: len(gates.entered()) >= len(survivors))
        assert gates.entered() == set(survivors)

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
                gates[running.pop(number % len(running))].open()
                take_what_is_free()
        while running:
            gates[running.pop(0)].open()
            take_what_is_free()
        recording.wait_until_complete(messages, LIMIT_S)
    table = recording.table()
    assert heard(table) == survivors
    explanation = explain(table, depth, workers)
    assert explanation.complete, f'{explanation}\n{table.to_string()}'
    assert explanation.lost == messages - len(survivors)
    # The newest messages cannot have been pushed out.
    for seq in set(survivors).intersection(range(messages - depth, messages)):
        assert not explain(without(table, seq), depth, workers).complete
