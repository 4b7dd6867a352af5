"""The time from publish to callback, of a publisher and a subscription in two threads.

Once in a plain rclpy script, once in a session with a Recording, and once the same in a notebook's
kernel. Each run is a process of its own, and gives the median of its messages.
"""

import subprocess
import sys
import threading
import time
from contextlib import suppress
from statistics import median

import nbformat.v4

from helpers.lesson import FOLDER
from tools.lessons.run import execute

RATES_HZ = (20, 200, 1000)
RUN_S = 2  # how long each run publishes
LIMIT_S = 60.0
KINDS = {
    'plain rclpy script': 'script',
    'session and recorder': 'session',
    'the same in a kernel': 'session',
}


def latency_s(kind: str, rate_hz: int) -> float:
    """Return the median latency of one run of a kind, in seconds."""
    code = f'from benchmarks.latency import {KINDS[kind]}; {KINDS[kind]}({rate_hz})'
    if 'kernel' in kind:
        notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
        return float(execute(notebook, FOLDER).cells[0].outputs[0].text)
    command = [sys.executable, '-c', code]
    return float(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout)


def _nodes(rate_hz: int) -> tuple:
    """Return a node that publishes, one that listens, and what they note.

    That is: when each message was published, and (number, time) of each that was heard.
    """
    from rclpy.node import Node
    from std_msgs.msg import String

    sent, heard = [], []
    talker, listener = Node('talker'), Node('listener')

    def tick() -> None:
        message = String(data=f'Hello World: {len(sent)}')
        sent.append(time.monotonic())
        talker.publisher.publish(message)
        if len(sent) == RUN_S * rate_hz:
            talker.timer.cancel()

    def listen(message) -> None:
        now = time.monotonic()
        heard.append((int(message.data.rpartition(' ')[2]), now))

    talker.publisher = talker.create_publisher(String, 'topic', 10)
    talker.timer = talker.create_timer(1 / rate_hz, tick)
    listener.subscription = listener.create_subscription(String, 'topic', listen, 10)
    return talker, listener, sent, heard


def script(rate_hz: int) -> None:
    """Print the median latency in a plain rclpy script."""
    import rclpy
    from domain_coordinator import domain_id
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    def spin(executor) -> None:
        with suppress(ExternalShutdownException):
            executor.spin()

    with domain_id() as number:
        rclpy.init(domain_id=number)
        talker, listener, sent, heard = _nodes(rate_hz)
        threads = []
        for node in (listener, talker):
            executor = SingleThreadedExecutor()
            executor.add_node(node)
            threads.append(threading.Thread(target=spin, args=[executor]))
            threads[-1].start()
        deadline = time.monotonic() + LIMIT_S
        # The newest message is never lost.
        while not (heard and heard[-1][0] == RUN_S * rate_hz - 1) and time.monotonic() < deadline:
            time.sleep(0.1)
        rclpy.shutdown()
        for thread in threads:
            thread.join()
    print(median(now - sent[number] for number, now in heard))


def session(rate_hz: int) -> None:
    """Print the same in a session, with a recorder."""
    from rclpy.executors import SingleThreadedExecutor

    from helpers.recording import Recording
    from helpers.ros import ros_session

    with ros_session() as session:
        talker, listener, sent, heard = _nodes(rate_hz)
        recording = Recording(talker.publisher, listener.subscription)
        for node in (listener, talker):
            executor = SingleThreadedExecutor()
            executor.add_node(node)
            session.spin(executor)
        recording.wait_until_complete(RUN_S * rate_hz, LIMIT_S)
    print(median(now - sent[number] for number, now in heard))
