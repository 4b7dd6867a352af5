"""Does a session with a recorder delay the messages that it records?

A publisher and a subscription in two threads, as in lesson 02: once in a plain rclpy script, once
in a session with a Recording, and once the same in a notebook's kernel. Each run is a process of
its own and gives the median of its messages. The three take turns, so that what happens on the
machine happens to all.
"""

import subprocess
import sys
import threading
import time
from contextlib import suppress
from functools import partial
from statistics import median

from benchmarks.table import Row

MESSAGES = {20: 40, 200: 400, 1000: 2000}  # at each rate, in Hz
ROUNDS = 16  # one run can be a fifth slower than the next
LIMIT_S = 60.0
RUN = 'from benchmarks.latency import run_{kind}; run_{kind}({rate}, {messages})'


def make_nodes(rate_hz: float, messages: int) -> tuple:
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
        if len(sent) == messages:
            talker.timer.cancel()

    def listen(message) -> None:
        now = time.monotonic()
        heard.append((int(message.data.rpartition(' ')[2]), now))

    talker.publisher = talker.create_publisher(String, 'topic', 10)
    talker.timer = talker.create_timer(1 / rate_hz, tick)
    listener.subscription = listener.create_subscription(String, 'topic', listen, 10)
    return talker, listener, sent, heard


def print_median(sent: list, heard: list) -> None:
    """Print the median latency in seconds."""
    print(median(now - sent[number] for number, now in heard))


def run_bare(rate_hz: float, messages: int) -> None:
    """Be a plain rclpy script."""
    import rclpy
    from domain_coordinator import domain_id
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    def spin(executor) -> None:
        with suppress(ExternalShutdownException):
            executor.spin()

    with domain_id() as number:
        rclpy.init(domain_id=number)
        talker, listener, sent, heard = make_nodes(rate_hz, messages)
        threads = []
        for node in (listener, talker):
            executor = SingleThreadedExecutor()
            executor.add_node(node)
            threads.append(threading.Thread(target=spin, args=[executor]))
            threads[-1].start()
        deadline = time.monotonic() + LIMIT_S
        # The newest message is never lost.
        while not (heard and heard[-1][0] == messages - 1) and time.monotonic() < deadline:
            time.sleep(0.1)
        rclpy.shutdown()
        for thread in threads:
            thread.join()
    print_median(sent, heard)


def run_session(rate_hz: float, messages: int) -> None:
    """Do the same in a session, with a recorder."""
    from rclpy.executors import SingleThreadedExecutor

    from helpers.recording import Recording
    from helpers.session import ros_session

    with ros_session() as session:
        talker, listener, sent, heard = make_nodes(rate_hz, messages)
        recording = Recording(talker.publisher, listener.subscription)
        for node in (listener, talker):
            executor = SingleThreadedExecutor()
            executor.add_node(node)
            session.spin(executor)
        recording.wait_until_complete(messages, LIMIT_S)
    print_median(sent, heard)


def in_process(kind: str, rate_hz: int) -> float:
    """Return the median latency of one run in a Python of its own."""
    code = RUN.format(kind=kind, rate=rate_hz, messages=MESSAGES[rate_hz])
    answer = subprocess.run(
        [sys.executable, '-c', code], stdout=subprocess.PIPE, text=True, check=True
    )
    return float(answer.stdout)


def in_kernel(rate_hz: int) -> float:
    """Return the median latency of one run in a notebook's kernel."""
    import nbformat.v4

    from tools.notebooks import FOLDER, execute

    code = RUN.format(kind='session', rate=rate_hz, messages=MESSAGES[rate_hz])
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    return float(execute(notebook, FOLDER).cells[0].outputs[0].text)


def measure() -> list[Row]:
    """Return for each rate the session, and the session in a kernel, against the script."""
    rows = []
    for rate in MESSAGES:
        runs = {
            'plain rclpy script': partial(in_process, 'bare', rate),
            'session and recorder': partial(in_process, 'session', rate),
            'the same in a kernel': partial(in_kernel, rate),
        }
        latency = {name: [] for name in runs}
        for turn in range(ROUNDS):
            for name in list(runs)[:: 1 if turn % 2 else -1]:
                latency[name].append(runs[name]())
        bare, *others = latency
        rows += [Row(f'{name}, {rate} Hz', latency[name], bare, latency[bare]) for name in others]
    return rows
