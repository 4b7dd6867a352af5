"""Nodes that several tests use, and how to hold their callbacks and spin them."""

import contextlib
import threading

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger

from support.waits import LIMIT_S


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


class Answerer(Node):
    """Serves `look`; `work`, if given, is called before the answer."""

    def __init__(self, work=None) -> None:
        super().__init__('answerer')
        self.work = work
        self.service = self.create_service(Trigger, 'look', self.look)

    def look(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.work is not None:
            self.work()
        response.message = 'clear'
        return response


class Asker(Node):
    """Calls `look` once, in the callback of a timer, and keeps the answer.

    With `groups=1` the timer and the client share a mutually exclusive group, with 2 they do not.
    """

    def __init__(self, style: str = 'call', groups: int = 1) -> None:
        super().__init__('asker')
        self.asked = 0
        self.answer = None
        group = None if groups == 1 else MutuallyExclusiveCallbackGroup()
        self.client = self.create_client(Trigger, 'look', callback_group=group)
        self.timer = self.create_timer(0.005, getattr(self, style))

    def ask(self):
        self.timer.cancel()
        self.asked += 1
        return Trigger.Request()

    def call(self) -> None:
        self.answer = self.client.call(self.ask()).message

    def call_twice(self) -> None:
        for _ in range(2):
            with contextlib.suppress(Exception):
                self.call()

    async def wait(self) -> None:
        self.answer = (await self.client.call_async(self.ask())).message

    def call_back(self) -> None:
        self.client.call_async(self.ask()).add_done_callback(self.keep)

    def keep(self, future) -> None:
        self.answer = future.result().message


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


def call_in_executor(session, executor, call, *arguments):
    """Let a thread of the executor make a call. Return what the call returns."""
    task = executor.create_task(call, *arguments)
    session.wait_until(task.done, LIMIT_S)
    return task.result()
