"""Runs at the same time: each in a copy of the kernel, and what it returns comes back."""

import os
import signal
import threading
import time

import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Int32

from helpers.ros import fork, ros_session
from helpers.trials import in_copies


def hear(number):
    """Publish a number until it is received. Return the domain, and all numbers that came."""
    heard = []
    with ros_session() as session:
        node, executor = Node('node'), SingleThreadedExecutor()
        node.create_subscription(Int32, 'number', lambda message: heard.append(message.data), 10)
        publisher = node.create_publisher(Int32, 'number', 10)
        node.create_timer(0.02, lambda: publisher.publish(Int32(data=number)))
        executor.add_node(node)
        session.spin(executor)
        session.wait_until(lambda: len(heard) >= 20)
        return session.environment['ROS_DOMAIN_ID'], set(heard)


def test_each_run_hears_itself_only_and_the_results_are_in_order():
    found = in_copies({number: lambda number=number: hear(number) for number in (3, 1, 2)})
    assert [*found] == [3, 1, 2]
    assert all(heard == {number} for number, (_, heard) in found.items())
    assert len({domain for domain, _ in found.values()}) == 3


def test_they_run_at_the_same_time():
    def meet(own, other):
        os.write(ends[own][1], b'x')
        return os.read(ends[other][0], 1)

    ends = {name: os.pipe() for name in 'ab'}
    runs = {'a': lambda: meet('a', 'b'), 'b': lambda: meet('b', 'a')}
    assert in_copies(runs) == {'a': b'x', 'b': b'x'}


def test_no_more_than_so_many_run_at_a_time(tmp_path):
    def count(number):
        own = tmp_path / str(number)
        own.touch()
        time.sleep(0.1)
        together = len([*tmp_path.iterdir()])
        own.unlink()
        return together

    runs = {number: lambda number=number: count(number) for number in range(5)}
    assert max(in_copies(runs, most=2).values()) <= 2


def test_what_it_changes_stays_in_the_copy_and_what_it_prints_is_not_shown(capfd):
    kept = []

    def run():
        print('printed')
        kept.append(1)
        return len(kept)

    assert in_copies({'run': run}) == {'run': 1}
    assert kept == []
    assert capfd.readouterr().out == ''


def test_what_runs_show_is_shown_in_their_order():
    from IPython.core.interactiveshell import InteractiveShell
    from IPython.utils.capture import capture_output

    def show(text):
        from IPython.display import Markdown, display

        display(Markdown(text))
        return len(text)

    InteractiveShell.instance()
    try:
        with capture_output() as captured:
            found = in_copies({text: lambda text=text: show(text) for text in ('two', 'three')})
    finally:
        InteractiveShell.clear_instance()
    assert found == {'two': 3, 'three': 5}
    assert [output.data['text/markdown'] for output in captured.outputs] == ['two', 'three']


def test_what_a_run_raises_is_raised_and_the_others_end():
    def fail():
        raise ValueError('no such floor')

    begun = time.monotonic()
    with pytest.raises(ValueError, match='no such floor'):
        in_copies({'fails': fail, 'waits': lambda: time.sleep(60)})
    assert time.monotonic() - begun < 30
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)


@pytest.mark.parametrize(
    ('run', 'says'),
    [
        (lambda: os._exit(3), 'The run dies ended without an answer'),
        (lambda: os.kill(os.getpid(), signal.SIGKILL), 'The run dies ended without an answer'),
        (threading.Lock, 'No copy can send what it returns'),
    ],
)
def test_a_run_without_an_answer_is_an_error(run, says):
    with pytest.raises(RuntimeError, match=says):
        in_copies({'dies': run})


def test_an_interrupt_ends_all_copies_in_order(tmp_path):
    def wait(number):
        try:
            time.sleep(60)
        finally:
            (tmp_path / str(number)).touch()

    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        in_copies({number: lambda number=number: wait(number) for number in range(3)})
    assert len([*tmp_path.iterdir()]) == 3
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)


def test_an_interrupt_while_a_copy_begins_ends_it(monkeypatch):
    def fork_and_interrupt():
        pid = fork()
        if pid:
            signal.raise_signal(signal.SIGINT)
        return pid

    monkeypatch.setattr('helpers.trials.copies.fork', fork_and_interrupt)
    with pytest.raises(KeyboardInterrupt):
        in_copies({1: lambda: time.sleep(60)})
    with pytest.raises(ChildProcessError):  # there is none
        os.waitpid(-1, os.WNOHANG)
