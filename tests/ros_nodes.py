"""Nodes and small helpers that several tests use."""

import threading

from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String

LIMIT_S = 20.0  # for every wait; never reached unless something is broken


class Talker(Node):
    """Publishes `messages` numbered messages on a timer, as the first lessons do."""

    def __init__(self, messages: int, period_s: float = 0.005, topic: str = 'topic') -> None:
        super().__init__('minimal_publisher')
        self.messages = messages
        self.next_number = 0
        self.publisher = self.create_publisher(String, topic, 10)
        self.timer = self.create_timer(period_s, self.timer_callback)

    def timer_callback(self) -> None:
        self.publish()
        if self.next_number == self.messages:
            self.timer.cancel()

    def publish(self) -> None:
        self.publisher.publish(String(data=f'Hello World: {self.next_number}'))
        self.next_number += 1


class Listener(Node):
    """Keeps what it hears in `heard`; `work`, if given, is then called with the message."""

    def __init__(self, work=None, depth: int = 10, topic: str = 'topic', **options) -> None:
        super().__init__('minimal_subscriber')
        self.work = work
        self.heard = []
        self.subscription = self.create_subscription(
            String, topic, self.listener_callback, depth, **options
        )

    def listener_callback(self, message: String) -> None:
        self.heard.append(message.data)
        if self.work is not None:
            self.work(message)


class Gate:
    """Holds the callbacks that enter it until it is opened."""

    def __init__(self) -> None:
        self.inside = 0
        self._lock = threading.Lock()
        self._open = threading.Event()

    def __call__(self, message=None) -> None:
        with self._lock:
            self.inside += 1
        assert self._open.wait(LIMIT_S)

    def open(self) -> None:
        self._open.set()


def spin(session, *nodes, threads: int = 1):
    """Spin the nodes with one executor: single-threaded, or with a pool of `threads`."""
    executor = SingleThreadedExecutor() if threads == 1 else MultiThreadedExecutor(threads)
    for node in nodes:
        executor.add_node(node)
    session.spin(executor)
    return executor
