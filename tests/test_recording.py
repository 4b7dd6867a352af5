"""A recording says what happened."""

import time
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from rclpy.callback_groups import ReentrantCallbackGroup
from sensor_msgs.msg import Imu
from std_msgs.msg import Int64, String
from support.nodes import LIMIT_S, Answerer, Asker, Gate, Listener, Talker, spin

from helpers.recording import RUN_COLUMNS, CallbackRecording, Recording, check_table
from helpers.ros import ros_session

TIMES = ['published_s', 'started_s', 'finished_s']


def watched(messages, work=None, **options):
    """Return a talker, a listener, and the recording of what is between them."""
    talker, listener = Talker(messages), Listener(work, **options)
    return talker, listener, Recording(talker.publisher, listener.subscription)


async def as_coroutine(message): ...


def with_info(message, info):
    assert info['source_timestamp'] > 0


@pytest.mark.parametrize('callback', [None, with_info, as_coroutine])
def test_table(callback):
    with ros_session() as session:
        talker, listener = Talker(6), Listener()
        if callback:
            listener.subscription.callback = callback
        recording = Recording(talker.publisher, listener.subscription)
        spin(session, listener)
        spin(session, talker)
        recording.wait_until_complete(6, LIMIT_S)
    table = recording.table()
    check_table(table)
    assert list(table.columns) == RUN_COLUMNS
    assert table['seq'].tolist() == list(range(6))
    assert [table[name].dtype for name in ('seq', *TIMES)] == [int, float, float, float]
    assert table['published_s'][0] == 0.0
    assert table['published_s'].is_monotonic_increasing
    assert table['published_s'][5] > 0.01  # seconds: the timer's period is 5 ms
    assert (table['published_s'] <= table['started_s']).all()
    assert (table['started_s'] <= table['finished_s']).all()
    assert set(table['thread']) == {'thread 1'}
    assert (recording.published, recording.heard, recording.in_flight) == (6, 6, 0)


def test_lost_messages():
    gate = Gate()
    with ros_session() as session:
        talker, listener, recording = watched(5, gate, depth=1)
        for _ in range(2):
            talker.publish()
        spin(session, listener)
        session.wait_until(lambda: gate.inside == 1, LIMIT_S)
        assert recording.in_flight == 1
        held = recording.table()
        assert held['started_s'].notna().tolist() == [False, True]
        assert held['finished_s'].isna().all()
        for _ in range(3):
            talker.publish()
        gate.open()
        recording.wait_until_complete(5, LIMIT_S)
    table = recording.table()
    lost = [0, 2, 3]
    assert table.index[table['started_s'].isna()].tolist() == lost
    assert table.index[table['finished_s'].isna()].tolist() == lost
    assert [table['thread'][seq] for seq in lost] == [None] * 3
    assert table['published_s'].notna().all()


def test_a_table_has_the_parameters():
    recording = Recording(publisher := Publisher(), Subscription(), period_s=0.5, depth=10)
    publisher.publish(Int64(data=0))
    assert recording.table().attrs == {'period_s': 0.5, 'depth': 10}


def test_wait_for_callbacks_that_still_run():
    gate = Gate()

    def hold_the_first(message):
        if message.data.endswith(' 0'):
            gate()

    with ros_session() as session:
        talker, listener, recording = watched(
            2, hold_the_first, callback_group=ReentrantCallbackGroup()
        )
        spin(session, listener, threads=2)
        for _ in range(2):
            talker.publish()
        with pytest.raises(TimeoutError):
            recording.wait_until_complete(2, timeout_s=0.3)
        assert (recording.heard, recording.in_flight) == (2, 1)
        gate.open()
        recording.wait_until_complete(2, LIMIT_S)
    assert recording.table()['finished_s'].notna().all()


# Without ROS: a publisher and a subscription that do nothing


class Publisher:
    def publish(self, msg):
        pass


class Subscription(SimpleNamespace):
    def __init__(self, callback=lambda message: None):
        super().__init__(callback=callback)


def test_takes_that_overtake_are_sorted():
    recording = Recording(publisher := Publisher(), subscription := Subscription())
    for number in (3, 1, 2):
        publisher.publish(msg=Int64(data=number))
    for number in (2, 3):
        subscription.callback(Int64(data=number))
    table = recording.table()
    assert table['seq'].tolist() == [1, 2, 3]
    assert table['published_s'].tolist()[2] == 0.0
    assert table['started_s'].notna().tolist() == [False, True, True]


@pytest.mark.parametrize('message', [String(data='Hello World'), Imu()])
def test_message_without_a_number(message):
    recording = Recording(publisher := Publisher(), Subscription())
    with pytest.raises(ValueError, match='A recording needs messages whose data ends with their'):
        publisher.publish(message)
    assert recording.published == 0


@pytest.mark.parametrize('what', ['published', 'heard'])
def test_same_number_twice(what):
    recording = Recording(publisher := Publisher(), subscription := Subscription())
    for _ in range(2):
        (publisher.publish if what == 'published' else subscription.callback)(Int64(data=7))
    with pytest.raises(ValueError, match=f'^The number 7 was {what} twice: give every message'):
        recording.table()


# check_table

GOOD = pd.DataFrame(
    {'seq': [0, 1], 'published_s': [0.0, 1.0], 'started_s': [0.1, np.nan]}
    | {'finished_s': [0.2, np.nan], 'thread': ['thread 1', None]}
)


@pytest.mark.parametrize(
    ('table', 'error', 'said'),
    [
        (None, TypeError, 'The table must be a DataFrame, not NoneType.'),
        (GOOD.drop(columns=['seq']), ValueError, 'The table lacks the column(s) seq.'),
        (GOOD.assign(started_s='soon'), TypeError, 'The column started_s must hold numbers.'),
        (GOOD.assign(seq=[0, np.nan]), ValueError, 'The column seq must hold whole numbers.'),
        (GOOD.assign(seq=[0, 1.5]), ValueError, 'The column seq must hold whole numbers.'),
        (GOOD.iloc[:0], ValueError, 'The table is empty: it needs at least one row.'),
        (
            GOOD.assign(published_s=[0.0, np.nan]),
            ValueError,
            'It is not known when message 1 was published.',
        ),
    ],
)
def test_bad_table(table, error, said):
    with pytest.raises(error) as failure:
        check_table(table)
    assert str(failure.value) == said


# Callbacks of any kind


@pytest.mark.parametrize(('style', 'threads'), [('call', 2), ('call_back', 1), ('wait', 1)])
def test_runs_of_callbacks(style, threads):
    with ros_session() as session:
        asker, answerer = Asker(style, groups=2), Answerer(lambda: time.sleep(0.02))
        recording = CallbackRecording(ask=asker.timer, look=answerer.service)
        spin(session, asker, answerer, threads=threads)
        session.wait_until(lambda: asker.answer, LIMIT_S)
        session.wait_until_quiet(asker.executor)
    tables = recording.tables()
    assert list(tables) == ['ask', 'look']
    for table in tables.values():
        check_table(table)
        assert list(table.columns) == RUN_COLUMNS
        assert table.seq.tolist() == [0]
        assert (table.finished_s > table.started_s).all()
    assert tables['ask'].started_s[0] == 0
    assert tables['look'].started_s[0] > 0
    assert tables['ask'].thread[0] == 'thread 1'
    assert tables['look'].thread[0] == f'thread {threads}'
    # A callback that waits for the answer is still there when the service has answered.
    waits = tables['ask'].finished_s[0] > tables['look'].finished_s[0]
    assert waits == (style != 'call_back')
