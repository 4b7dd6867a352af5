"""A cell that gives up a wait says why."""

import threading

import pytest
from rclpy.action import ActionClient, ActionServer
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Int64
from support.nodes import Asker, Listener, Talker, spin
from test_msgs.action import Fibonacci

from helpers.recording import Recording
from helpers.ros import ros_session


def said_by(wait, *arguments):
    """Wait for what does not happen, and return the lines of the error."""
    with pytest.raises(TimeoutError) as failure:
        wait(*arguments, timeout_s=0.5)
    first, *lines = str(failure.value).splitlines()
    assert first == 'Gave up after 0.5 s.'
    return lines


def test_a_node_without_an_executor():
    with ros_session() as session:
        talker, listener, _ = Talker(4), Listener(), Node('a_node_with_nothing_to_run')
        recording = Recording(talker.publisher, listener.subscription)
        spin(session, talker)
        session.wait_until(lambda: recording.published == 4)
        assert said_by(recording.wait_until_complete, 4) == [
            'Published 4, received 0.',
            'The node minimal_subscriber is in no executor: executor.add_node(...) is missing.',
        ]


def test_a_name_with_a_capital():
    with ros_session() as session:
        talker, listener = Talker(4, topic='topic'), Listener(topic='Topic')
        recording = Recording(talker.publisher, listener.subscription)
        spin(session, talker, listener)
        session.wait_until(lambda: recording.published == 4)
        assert said_by(recording.wait_until_complete, 4) == [
            'Published 4, received 0.',
            'The topic /Topic has a subscription (minimal_subscriber) and no publisher. '
            'Nearly the same name: /topic.',
            'The topic /topic has a publisher (minimal_publisher) and no subscription. '
            'Nearly the same name: /Topic.',
        ]


def test_qos_that_does_not_fit():
    best_effort = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    with ros_session() as session:
        talker, listener = Node('talker'), Node('listener')
        talker.create_publisher(Int64, 'count', best_effort)
        listener.create_subscription(Int64, 'count', lambda message: None, 10)
        spin(session, listener)
        assert said_by(session.wait_until, lambda: False) == [
            'On the topic /count, the QoS of talker and listener do not fit: '
            'Best effort publisher and reliable subscription.',
        ]


def test_an_idle_executor_and_a_missing_service():
    with ros_session() as session:
        asker, executor = Asker(), SingleThreadedExecutor()
        executor.add_node(asker)
        assert said_by(session.wait_until, lambda: False) == [
            'The executor of the node asker does not spin: session.spin(...) is missing.',
            'asker calls /look, and nobody serves it.',
        ]


def test_a_mistyped_action_whose_server_does_not_spin():
    with ros_session() as session:
        robot, operator = Node('robot'), Node('operator')
        ActionServer(robot, Fibonacci, 'patrol', lambda goal_handle: Fibonacci.Result())
        ActionClient(operator, Fibonacci, 'Patrol')
        spin(session, operator)
        assert said_by(session.wait_until, lambda: False) == [
            'The node robot is in no executor: executor.add_node(...) is missing.',
            'operator sends goals to /Patrol, and nobody serves it. Nearly the same name: /patrol.',
        ]


def wait_for_ever(message):
    threading.Event().wait()


LOCK = threading.Lock()


def take_the_lock(message):
    with LOCK:
        pass


@pytest.mark.parametrize(
    ('callback', 'says'),
    [
        (
            wait_for_ever,
            [
                'listener_callback() waits for an Event to be set.',
                'wait_for_ever(): threading.Event().wait()',
                'Who could end this wait cannot be seen.',
            ],
        ),
        (
            take_the_lock,
            [
                'listener_callback() waits for a lock (LOCK).',
                'take_the_lock(): with LOCK',
                'would leave its `with`: it is at line',
                'Nothing was found that keeps this from coming.',
            ],
        ),
    ],
    ids=['an event', 'a lock that the cell holds'],
)
def test_callbacks_that_wait(callback, says):
    # The interrupt ends what waits for an Event.
    with pytest.raises(KeyboardInterrupt), ros_session() as session:
        listener = Listener(callback)
        with LOCK:  # before a message can come
            spin(session, Talker(1), listener, threads=2)

            def said():
                lines = said_by(session.wait_until, lambda: False)
                return len(lines) == len(says) and all(map(str.__contains__, lines, says))

            session.wait_until(said)
        raise KeyboardInterrupt


def test_nothing_is_wrong():
    with ros_session() as session:
        spin(session, Talker(1), Listener())
        assert said_by(session.wait_until, lambda: False) == [
            'Everything that was made is connected and spins, and no callback waits.'
        ]


def test_findings_are_shown_while_the_cell_waits(monkeypatch):
    said = []
    monkeypatch.setattr(
        'helpers.notebook.progress_bar.ProgressBar.say', lambda bar, text: said.append(text)
    )
    monkeypatch.setattr('helpers.ros.session.SAY_AFTER_S', 0.3)
    with ros_session() as session:
        talker = Talker(1)  # never spun
        session.wait_until(lambda: said)
        assert talker.next_number == 0
    assert said[0].splitlines() == [
        'Waited 0.3 s so far.',
        'The node minimal_publisher is in no executor: executor.add_node(...) is missing.',
        'The topic /topic has a publisher (minimal_publisher) and no subscription.',
    ]
