"""The rules of replays, in a JavaScript engine, against slow references and real runs."""

import json
import re
from copy import deepcopy
from html import unescape
from urllib.parse import unquote
from xml.etree import ElementTree

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from support.runs import (
    assert_is_the_run,
    changed_happenings,
    happenings,
    made_table,
    runs,
    tries,
)

from helpers.recording import explain, predict
from helpers.replay import FreePlay, level, replay, side_by_side
from helpers.replay.events import events
from tools.lessons.comparison import masked

EXCLUSIVE, REENTRANT = 'mutually exclusive', 'reentrant'


def html(shown):
    return shown._repr_mimebundle_()['text/html']


def record(shown, index=0):
    """What the page gets, from the page."""
    data = re.search("data-record='([^']*)'", html(shown))[1]
    return json.loads(unescape(data))['runs'][index]


# The rules against `predict`


@tries(100)
@given(runs(40), st.booleans())
def test_a_prediction_is_a_walk(script, run, exclusive):
    period, callback, depth, threads, messages = run
    workers = 1 if exclusive else threads
    table = predict(period / 1000, callback / 1000, depth, workers, messages)
    group = EXCLUSIVE if exclusive else REENTRANT
    states = script.call('states', record(replay(table, depth, threads, group)))
    assert_is_the_run(states, table, depth)


# Runs in which all is late by chance

# Three threads ran it, and two were drawn.
THREE_THREADS = made_table(
    [0] * 5,
    {
        0: (0, 1, 'thread 3'),
        1: (0, 1, 'thread 1'),
        2: (0, 1, 'thread 2'),
        3: (1, 2, 'thread 1'),
        4: (1, 2, 'thread 2'),
    },
)


@tries(150)
@given(happenings())
def test_what_happened_is_a_walk(script, happening):
    table, depth, workers = happening
    group = EXCLUSIVE if workers == 1 else REENTRANT
    threads = max(workers, table['thread'].nunique())
    states = script.call('states', record(replay(table, depth, threads, group)))
    assert_is_the_run(states, table, depth)


@tries(100)
@given(changed_happenings())
@example((THREE_THREADS, 4, 2))
def test_what_cannot_have_happened_is_one_sentence(script, happening):
    table, depth, workers = happening
    group = EXCLUSIVE if workers == 1 else REENTRANT
    threads = max(workers, table['thread'].nunique())
    found = [
        sentence
        for sentence in explain(table, depth, 1 if group == EXCLUSIVE else threads).contradictions
        # These may be: a worker rests, and what was never heard still waits.
        if 'a worker was free' not in sentence and 'was never received' not in sentence
    ]
    if found:
        with pytest.raises(ValueError, match='message') as failure:
            replay(table, depth, threads, group)
        assert '\n' not in str(failure.value)
    else:
        states = script.call('states', record(replay(table, depth, threads, group)))
        assert_is_the_run(states, table, depth)


def test_a_take_waits_until_its_thread_is_free():
    # Depth 1. Message 2 is published at 2 s, and 1 is not pushed out: so 2 arrives after 0 has
    # ended, at 2.5 s, and 1 has been taken.
    callbacks = {0: (0, 2.5), 1: (2.5, 3.5), 3: (3.5, 4)}
    table = made_table(range(4), {seq: (*when, 'thread 1') for seq, when in callbacks.items()})
    assert events(table, 1, 1) == [
        (0, 'arrive', 0, None),
        (0, 'take', 0, 'thread 1'),
        (1, 'arrive', 1, None),
        (2.5, 'end', 0, 'thread 1'),
        (2.5, 'take', 1, 'thread 1'),
        (2.5, 'arrive', 2, None),
        (3, 'arrive', 3, None),
        (3.5, 'end', 1, 'thread 1'),
        (3.5, 'take', 3, 'thread 1'),
        (4, 'end', 3, 'thread 1'),
    ]


# What else the rules say: sentences, causes, calls, locks


def says(script, table, *options):
    return [state['says'] for state in script.call('states', record(replay(table, *options)))]


def test_sentences_of_the_tutorial(script):
    said = says(script, predict(0.05, 0.2, 10, 1, 41), 10)
    assert said[:4] == [
        '',
        'Message 0 arrives. A thread is free to take it.',
        'Thread 1 is free and takes the oldest that waits, 0.',
        'Message 1 arrives. It waits: thread 1 is busy.',
    ]
    assert 'Message 14 arrives. Ten wait, so the oldest, 4, is pushed out.' in said
    assert said[-1] == 'The callback of message 40 ends. Thread 1 is free.'


def services(threads, groups, does):
    """A timer asks a service of another node, as in the level of lesson 06."""
    setup = deepcopy(level('deadlock').variants()[threads, groups].setup)
    setup['callbacks'][0]['does'] = [does, {'work': 1}]
    setup['callbacks'][1]['does'] = [{'work': 1}]
    return setup


def test_a_circle_is_said(script):
    one_group = script.call('play', services(2, 'one group', {'call': 1, 'client': 2}))
    assert one_group['circle']['says'] == (
        'Nobody can go on: timer waits for the answer of look, it waits for the group of timer '
        'and client, timer holds the group of timer and client.'
    )
    one_thread = script.call('play', services(1, 'two groups', {'call': 1, 'client': 2}))
    assert one_thread['circle']['says'] == (
        'Nobody can go on: timer waits for the answer of look, its request waits for the thread, '
        'timer holds the thread.'
    )
    said = [move['says'] for move in one_thread['done']]
    assert said[-1] == 'Tick 0 of timer asks look and waits: its thread and its group wait with it.'
    reentrant = script.call('play', services(1, 'Reentrant', {'call': 1, 'client': 2}))
    assert reentrant['done'][-1]['says'].endswith(' waits: its thread waits with it.')


def counting(*does):
    return {
        'threads': ['thread 1', 'thread 2'],
        'groups': [{'name': 'group', 'exclusive': False}],
        'callbacks': [{'name': 'topic', 'group': 0, 'depth': 9, 'does': does}],
    }


ARRIVALS = [{'do': 'arrive', 'callback': 0, 'seq': seq} for seq in range(2)]
TAKES = [{'do': 'take', 'callback': 0, 'thread': thread} for thread in range(2)]
DUE, END = [ARRIVALS[0] | {'at': 0}, TAKES[0]], {'do': 'end', 'thread': 0}


def test_only_a_lock_saves_every_update(script):
    update = [{'read': 'count'}, {'write': 'count'}]
    eager = ['arrive', 'take', 'go', 'end']
    arrivals = [{'at': 0, 'callback': 0, 'seq': seq} for seq in range(2)]
    bare = script.call('play', counting(*update) | {'arrivals': arrivals}, eager)
    assert [m['thread'] for m in bare['done'] if m['do'] == 'go'] == [0, 0, 1, 1]
    assert bare['state']['values'] == {'count': 2}
    go = [{'do': 'go', 'thread': thread} for thread in (0, 1, 0)]
    moves = [*ARRIVALS, *TAKES, *go]
    assert script.call('refusal', counting(*update), moves, {'do': 'go', 'thread': 1}) == ''
    said = script.call('last', counting(*update), [*moves, {'do': 'go', 'thread': 1}])
    assert said == (
        'Message 1 writes count: 0 + 1 = 1. '
        'Another callback had written since it read: that update is lost.'
    )
    locked = counting({'lock': 'lock'}, *update, {'unlock': 'lock'})
    refused = script.call('refusal', locked, [*ARRIVALS, *TAKES, go[0]], {'do': 'go', 'thread': 1})
    assert refused == 'lock is locked: message 0 has it.'
    played = script.call('play', locked | {'arrivals': arrivals}, eager)
    assert played['state']['values'] == {'count': 2}
    assert played['state']['locks'] == {}


@pytest.mark.parametrize(
    ('moves', 'move', 'said'),
    [
        ([], TAKES[0], 'Nothing waits there.'),
        ([], {'do': 'end', 'thread': 0}, 'Thread 1 runs nothing.'),
        ([], {'do': 'take', 'callback': 0, 'thread': 2}, 'There is no such thread.'),
        (
            [*ARRIVALS, TAKES[0]],
            TAKES[0],
            'Thread 1 is busy with message 0: it runs one callback at a time.',
        ),
        (
            [*ARRIVALS, TAKES[0]],
            TAKES[1],
            'Message 0 holds group: a mutually exclusive group runs one callback at a time.',
        ),
        ([*ARRIVALS, TAKES[0]], {'do': 'go', 'thread': 0}, 'The callback has nothing more to do'),
        (
            ARRIVALS,
            TAKES[0] | {'seq': 1},
            'A queue gives its oldest first, and message 0 is older.',
        ),
        ([ARRIVALS[0] | {'at': 2}], ARRIVALS[1] | {'at': 1}, 'Time does not run backwards'),
        (DUE, END | {'at': 2}, 'Not yet: message 1 comes first.'),
        (DUE, END | {'at': 1}, 'Message 0 is not done before 2 s.'),
    ],
)
def test_a_move_is_refused_with_the_rule(script, moves, move, said):
    setup = counting()
    setup['groups'][0]['exclusive'] = True
    del setup['callbacks'][0]['does']
    if moves == DUE:
        setup['callbacks'][0]['does'] = [{'work': 2}]
        setup['arrivals'] = [{'at': at, 'callback': 0, 'seq': at} for at in range(4)]
    assert script.call('refusal', setup, moves, move).startswith(said)


# What a page gets


def test_any_step_in_any_order_is_the_same(script):
    table = predict(0.01, 0.025, 5, 1, 700)
    run = record(replay(table, 5))
    last = len(run['moves'])
    steps = [last, 0, 1, 256, 257, 255, 512, last, 3, 1024, last - 1]
    there = script.call('seek', run, steps)
    assert there == [script.call('seek', run, [step])[0] for step in steps]
    losses = script.call('scan', run)
    lost = table.loc[table['started_s'].isna(), 'seq'].tolist()
    found = [state[1][-1]['seq'] for state in script.call('seek', run, losses)]
    assert found == lost


def test_where_nothing_was_heard(script):
    table = made_table([0, 1, 2, 3], {})
    shown = replay(table, depth=2)
    assert str(shown) == 'Replay: 4 messages, depth 2, no executor. None was received.'
    states = script.call('states', record(shown))
    assert states[1]['says'] == 'Message 0 arrives. No executor takes it.'
    assert (states[-1]['queue'], states[-1]['lost']) == ([2, 3], [[0, 2], [1, 3]])
    assert {state['cause'] for state in states} == {'no executor'}
    assert 'waits, no executor' in svg(shown)


# The picture and the page


def svg(shown, index=0):
    return unquote(re.findall(r'src="data:image/svg\+xml,([^"]*)"', html(shown))[index])


@pytest.mark.parametrize(
    ('threads', 'group', 'cause'),
    [
        (1, EXCLUSIVE, 'waits, thread busy'),
        (3, EXCLUSIVE, 'waits, group busy'),
        (2, REENTRANT, 'waits, thread busy'),
    ],
)
def test_the_picture_shows_why_messages_wait(threads, group, cause):
    workers = 1 if group == EXCLUSIVE else threads
    table = predict(0.05, 0.2, 3, workers, 30)
    shown = replay(table, 3, threads, group)
    drawn = svg(shown)
    assert set(re.findall('waits, [a-z ]+', drawn)) == {cause}
    assert drawn.count('m-3-3') == table['started_s'].isna().sum()
    assert ElementTree.fromstring(drawn).get('width') == '370'


def test_two_runs_side_by_side():
    slow, fast = predict(0.05, 0.2, 10, 1, 41), predict(0.05, 0.2, 10, 8, 41)
    both = side_by_side({'A': replay(slow, 10), 'D': replay(fast, 10, 8, REENTRANT)})
    assert str(both) == (
        'A: 41 messages, depth 10, one thread. Some were lost. '
        'D: 41 messages, depth 10, 8 threads, a reentrant group. None was lost.'
    )
    pictures = [ElementTree.fromstring(svg(both, index)) for index in (0, 1)]
    assert len({(one.get('width'), one.get('height')) for one in pictures}) == 1
    assert [record(both, index)['name'] for index in (0, 1)] == ['A', 'D']
    assert re.findall('<figcaption>(.*?)</figcaption>', html(both)) == ['A', 'D']


def test_a_message_that_still_waits_is_not_lost():
    table = predict(0.05, 0.01, 10, 1, 5)
    table.loc[table.index[-2:], ['started_s', 'finished_s', 'thread']] = None
    assert str(replay(table, 10)).endswith('None was lost.')
    assert str(replay(table, 1)).endswith('Some were lost.')


def test_what_nbval_compares_does_not_move():
    slow, slower = predict(0.05, 0.2, 10, 1, 41), predict(0.05, 0.21, 10, 1, 41)
    pages = [html(replay(table, 10)) for table in (slow, slower)]
    assert pages[0] != pages[1]
    compared = [masked(page) for page in pages]
    assert compared[0] == compared[1]
    assert 'Some were lost' in compared[0]
    assert 'function queueModel' in compared[0]


@pytest.mark.parametrize('shown', [replay(predict(0.05, 0.2, 10, 1, 41), 10), FreePlay()])
def test_size(shown):
    page = html(shown)
    assert len(page) <= 34_500
    assert not re.search(r'https?://(?!www\.w3\.org)', page)


BAD = predict(0.05, 0.2, 10, 1, 41)


@pytest.mark.parametrize(
    ('table', 'options', 'said'),
    [
        (BAD.iloc[:0], {}, 'The table is empty: it needs at least one row.'),
        (BAD, {'depth': 0}, 'depth must be a whole number from 1 up, not 0.'),
        (BAD, {'depth': 3}, 'No queue of depth 3 with one callback at a time can have made'),
        (BAD.assign(thread=None), {}, 'It is not known which thread ran message 0.'),
        (BAD.assign(finished_s=0.0), {}, 'The callback of message 1 ended before it started.'),
        (
            BAD.assign(published_s=BAD['published_s'][::-1].to_numpy()),
            {},
            'Message 1 was published before the one in front of it.',
        ),
        (predict(0.05, 0.2, 10, 3, 41), {}, 'Callbacks ran in 3 threads, more than threads=1.'),
        (
            predict(0.01, 0.005, 10, 1, 10_001),
            {},
            '10,001 messages are too many to step through: at most 10,000.',
        ),
    ],
)
def test_bad_input_is_one_sentence(table, options, said):
    with pytest.raises(ValueError, match=f'^{re.escape(said)}') as failure:
        replay(table, **{'depth': 10} | options)
    assert '\n' not in str(failure.value)
