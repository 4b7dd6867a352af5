"""The run of an action, recorded with the real rclpy and replayed: for what a cancel waits."""

import functools
import threading
import time

import pytest
from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from std_srvs.srv import Trigger
from support.nodes import LIMIT_S, call_in_executor, spin
from test_msgs.action import Fibonacci

from helpers.replay import ActionRecording, replay_action
from helpers.ros import ros_session

CANCEL = 2  # the place of cancel_goal


class Robot(Node):
    """Serves `job`, and `charge`, which answers when the job has ended."""

    def __init__(self, own_group=False):
        super().__init__('robot')
        self.gate, self.begun, self.ended = (threading.Event() for _ in range(3))
        self.server = ActionServer(
            self,
            Fibonacci,
            'job',
            self.execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=MutuallyExclusiveCallbackGroup() if own_group else None,
        )
        self.charger = self.create_service(Trigger, 'charge', self.charge)

    def execute(self, goal_handle):
        goal_handle.publish_feedback(Fibonacci.Feedback(sequence=[0]))
        self.begun.set()
        assert self.gate.wait(LIMIT_S)
        if goal_handle.is_cancel_requested:
            goal_handle.canceled()
        else:
            goal_handle.succeed()
        self.ended.set()
        return Fibonacci.Result()

    def charge(self, request, response):
        assert self.ended.wait(LIMIT_S)
        return response


def cancel(threads, charges, own_group):
    """Cancel a job, then let it end. Return its replay, whether it was heard, and accepted."""
    with ros_session() as session:
        robot, operator = Robot(own_group), Node('operator')
        recording = ActionRecording(robot.server, robot.execute, charge=robot.charger)
        executor, own = spin(session, robot, threads=threads), spin(session, operator)
        client = ActionClient(operator, Fibonacci, 'job')
        charger = operator.create_client(Trigger, 'charge')

        ask = functools.partial(call_in_executor, session, own)
        session.wait_until(client.server_is_ready, LIMIT_S)
        goal = ask(client.send_goal_async, Fibonacci.Goal())
        session.wait_until(lambda: goal.done() and robot.begun.is_set(), LIMIT_S)
        if charges:
            session.wait_until(charger.service_is_ready, LIMIT_S)
            ask(charger.call_async, Trigger.Request())
            session.wait_until(lambda: recording.runs['charge'], LIMIT_S)
        cancelled_s = time.monotonic()
        answer = ask(goal.result().cancel_goal_async)
        session.wait_until_quiet(executor)
        heard = answer.done()
        robot.gate.set()
        session.wait_until(lambda: robot.ended.is_set() and answer.done(), LIMIT_S)
    accepted = len(answer.result().goals_canceling) == 1
    return replay_action(recording, threads, cancelled_s), heard, accepted


@pytest.mark.parametrize(
    ('threads', 'charges', 'own_group', 'cause'),
    [
        (1, False, False, 'thread busy'),
        (2, False, False, ''),
        (2, True, True, 'thread busy'),
        (3, True, False, 'group busy'),
        (3, True, True, ''),
    ],
)
def test_a_cancel_waits_as_in_rclpy(script, threads, charges, own_group, cause):
    shown, heard, accepted = cancel(threads, charges, own_group)
    steps = script.call('steps', shown.runs[0].record())
    said = [step['says'] for step in steps]
    sent = next(i for i, says in enumerate(said) if 'of cancel_goal arrives' in says)
    assert steps[sent]['causes'][CANCEL] == cause
    assert 'execute_callback' in steps[sent]['running']
    # What rclpy answered while the job was held: it waited if and only if there is a cause.
    assert heard == accepted == (not cause)
    taken = 'is taken while the job runs.' if heard else 'is taken when the job has ended.'
    assert f'Request 0 of cancel_goal {taken}' in said
    assert str(shown) == (
        f'Replay: {f"{threads} threads" if threads > 1 else "One thread"}. The cancel {taken}'
    )
    end = 'canceled' if heard else 'succeed'
    assert [says for says in said if ' calls ' in says] == [
        f'Job 0 of execute_callback calls {call}.' for call in ('publish_feedback', end)
    ]
    # The job holds no group; the request of its goal does.
    held = {name for step in steps for name in step['held']} - {None}
    assert held == {'send_goal', 'cancel_goal', *(['charge'] if charges else [])}
    assert set(steps[-1]['running']) == {None}


def test_no_job_is_one_sentence():
    with ros_session() as session:
        robot = Robot()
        recording = ActionRecording(robot.server, robot.execute)
        spin(session, robot)
        with pytest.raises(ValueError, match=r'^A replay shows one job and its cancel: record'):
            replay_action(recording, 1, 0.0)
