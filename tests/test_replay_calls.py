"""Calls of services, recorded with the real rclpy and replayed."""

from itertools import pairwise

import pytest
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from std_srvs.srv import Trigger
from support.nodes import LIMIT_S, Answerer, Asker, spin

from helpers.recording import CallbackRecording
from helpers.replay import replay_calls
from helpers.ros import ros_session


def record(threads, groups, style='call'):
    """Let a node ask until nothing can happen any more. Return the replay, and the answer."""
    with ros_session() as session:
        asker, answerer = Asker(style, groups), Answerer()
        recording = watch(asker, answerer)
        executor = spin(session, asker, answerer, threads=threads)
        session.wait_until(asker.timer.is_canceled, LIMIT_S)
        session.wait_until_quiet(executor)
        return replay_calls(recording, threads), asker.answer


def watch(asker, answerer):
    return CallbackRecording(tick=asker.timer, look=answerer.service, client=asker.client)


@pytest.mark.parametrize('groups', [1, 2])
@pytest.mark.parametrize('threads', [1, 2, 4])
def test_a_replay_waits_where_rclpy_waits(script, threads, groups):
    for _ in range(4):
        shown, answer = record(threads, groups)
        steps = script.call('steps', shown.runs[0].record())
        # Nothing else than what was recorded ran, and in no more threads than there are.
        assert all(len(step['running']) == threads for step in steps)
        stuck = answer is None
        assert bool(steps[-1]['circle']) == stuck
        assert any(steps[-1]['held']) == stuck
        assert ('Nobody can go on' in str(shown)) == stuck
        assert ('Nobody waits for ever.' in str(shown)) != stuck


def test_the_circle_closes_when_the_question_is_asked(script):
    shown, _ = record(2, 1)
    assert str(shown) == (
        'Replay: 2 threads. Nobody can go on: tick waits for the answer of look, '
        'it waits for the group of tick and client, tick holds the group of tick and client.'
    )
    steps = script.call('steps', shown.runs[0].record())
    asked = next(i for i, step in enumerate(steps) if 'asks look' in step['says'])
    assert [bool(step['circle']) for step in steps] == [i >= asked for i in range(len(steps))]
    assert steps[asked]['circle'] == steps[-1]['circle']
    # The arrows grow, and turn all at once.
    assert steps[asked - 1]['arrows'] == [
        ['tick holds thread 1', False],
        ['tick holds the group of tick and client', False],
    ]
    assert [says for says, hot in steps[asked]['arrows'] if hot] == [
        'tick holds the group of tick and client',
        'tick waits for the answer of look',
        'it waits for the group of tick and client',
    ]
    assert steps[-1]['queues'] == [0, 0, 1]


def test_the_arrows_come_one_at_a_time_and_the_last_one_closes_the_circle(script):
    shown, _ = record(2, 1)
    steps = script.call('grown', shown.runs[0].record())
    counts = [0, *(len(step['arrows']) for step in steps)]
    assert {after - before for before, after in pairwise(counts)} <= {0, 1}
    closed = [step['closed'] for step in steps]
    first = closed.index(True)
    assert closed == [False] * first + [True] * (len(steps) - first)
    assert steps[first]['says'] == (
        'Nobody can go on: tick waits for the answer of look, '
        'it waits for the group of tick and client, tick holds the group of tick and client.'
    )
    assert set(steps[first]['arrows']) - set(steps[first - 1]['arrows']) == {
        'it waits for the group of tick and client'
    }


def test_a_callback_that_does_not_wait_ends():
    shown, answer = record(1, 1, 'call_back')
    assert (str(shown), answer) == ('Replay: One thread. Nobody waits for ever.', 'clear')


def test_a_chain_of_services_waits_for_a_thread():
    with ros_session() as session:
        pilot, planner, camera = Node('pilot'), Node('planner'), Node('camera')
        groups = [MutuallyExclusiveCallbackGroup() for _ in range(2)]
        plan_client = pilot.create_client(Trigger, 'plan', callback_group=groups[0])
        look_client = planner.create_client(Trigger, 'look', callback_group=groups[1])

        def tick():
            timer.cancel()
            plan_client.call(Trigger.Request())

        def plan(request, response):
            return look_client.call(Trigger.Request())

        timer = pilot.create_timer(0.01, tick)
        services = (
            planner.create_service(Trigger, 'plan', plan),
            camera.create_service(Trigger, 'look', lambda request, response: response),
        )
        recording = CallbackRecording(
            tick=timer, plan=services[0], look=services[1], planned=plan_client, seen=look_client
        )
        executor = spin(session, pilot, planner, camera, threads=2)
        session.wait_until(lambda: recording.runs['plan'], LIMIT_S)
        session.wait_until_quiet(executor)
        shown = replay_calls(recording, 2)
    assert str(shown) == (
        'Replay: 2 threads. Nobody can go on: tick waits for the answer of plan, '
        'the answer of plan comes from plan, plan waits for the answer of look, '
        'its request waits for both threads, tick holds thread 1.'
    )


# Bad input


def test_a_coroutine_is_one_sentence():
    with pytest.raises(ValueError, match=r'^tick is a coroutine: a replay shows callbacks that'):
        record(1, 2, 'wait')


def test_a_call_that_gave_up():
    with ros_session() as session:
        node = Node('node')
        client = node.create_client(Trigger, 'look')
        timer = node.create_timer(0.005, lambda: client.call(Trigger.Request(), timeout_sec=0.01))
        service = Answerer().service
        recording = CallbackRecording(tick=timer, look=service, client=client)
        spin(session, node)
        session.wait_until(lambda: recording.runs['tick'][1:], LIMIT_S)
        with pytest.raises(ValueError, match=r'^tick ended without its answer: a replay shows'):
            replay_calls(recording)


def test_a_call_from_outside_arrives():
    with ros_session() as session:
        answerer = Answerer()
        client = answerer.create_client(Trigger, 'look')
        recording = CallbackRecording(look=answerer.service, client=client)
        spin(session, answerer)
        client.call(Trigger.Request(), LIMIT_S)
        shown = replay_calls(recording)
    assert str(shown) == 'Replay: One thread. Nobody waits for ever.'
