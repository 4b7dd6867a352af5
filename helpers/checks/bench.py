"""The bench on which a check tries the student's nodes: it spins them, speaks to them, and listens.

    with Bench() as bench:
        speeds = bench.hear('cmd_vel', Twist)
        bench.spin(Driver(0.5, 0.0))
        bench.wait(lambda: len(speeds) >= 3)
    return expect([twist.linear.x for twist in speeds[:3]], [0.5] * 3, 'it published')

A bench is a `ros_session` with a tester in it. It belongs into the test of a point (see points.py),
which runs in a sandbox. What the student's callbacks raise is raised by `wait`, `quiet`, `call` and
at the end of the `with` block. Waiting itself raises nothing: `wait` says whether it came.

The words of a judge for nodes:

    bench.spin(node), spin_each            the student's nodes: together, or each in an executor
    bench.say, hear                        publish messages; a list of those that come
    bench.call, ask, send_goal             services and actions, as a client
    bench.wait, quiet, advance             until something holds, until all is handled, of the clock
    bench.log(), line_of_callback()        what was logged; where a callback is now
    gate = bench.gate()                    holds callbacks until `gate.open()`, see `Gate`
    scan(0.5), scan(ranges, age_s=3)       a scan of the laser
    must_have(node, 'timer')               an attribute is not there yet
    must_define(Driver, '__init__')        a method is not there yet
    must_be_called(node, 'driver')         a node has another name
    override(Driver, PERIOD_S=0.1)         another value for a constant of the notebook
    with one_cpu() as counted:             an executor that is made here counts one CPU

Those for what a test returns are in points.py: expect, needs, cached, rows.
"""

from __future__ import annotations

import math
import os
import re
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from unittest import mock

import numpy as np
import rclpy
from builtin_interfaces.msg import Time as TimeMessage
from rclpy.action import ActionClient
from rclpy.clock import Clock as SystemClock
from rclpy.clock import ClockType
from rclpy.duration import Duration
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan

from helpers.checks.errors import Failed, NeverEnds
from helpers.notebook import frames, own_line, places
from helpers.ros import STATUS, ros_session

WAIT_S = 2.0  # for what a right answer does at once
QUIET_S = 6.0
CALLBACK_S = 3.0  # for a callback to end
HOLD_S = 30.0  # at a gate that nobody opens
POLL_S = 0.005
WAITS_FOR_LOCK = re.compile(r'\.acquire\(|: with .*lock', re.IGNORECASE)
ALL = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)  # hears every publisher
# As the base of a robot subscribes: a program that ends can wait until its last message is here.
RELIABLE = QoSProfile(depth=1000)


class Bench:
    """A session with the student's nodes and a tester. Use it as `with Bench() as bench:`."""

    def __init__(self) -> None:
        self._exit = ExitStack()
        self._executors: list[Executor] = []  # of the student's nodes
        self._own_executor: SingleThreadedExecutor | None = None
        self._publishers: dict[tuple[str, type, object], object] = {}
        self._clients: dict[tuple[str, type], object] = {}
        self._clock_s = 0.0
        self._gates: list[Gate] = []

    def __enter__(self) -> Bench:
        self.session = self._exit.enter_context(ros_session())
        self._exit.enter_context(_refused_spins())
        self.tester = Node('tester')
        self._own_executor = SingleThreadedExecutor()
        self._own_executor.add_node(self.tester)
        self.session.spin(self._own_executor)
        return self

    def __exit__(self, kind, error, traceback) -> bool | None:
        for gate in self._gates:
            gate.open()
        if isinstance(error, NeverEnds):
            return None  # to close would wait for that callback; the worker of the check ends it
        if error is None:
            self._check_that_callbacks_end()
            if not rclpy.ok():
                self._exit.close()
                raise Failed('your code has shut rclpy down: nothing can run after that')
        return self._exit.__exit__(kind, error, traceback)

    # --- The student's nodes

    def spin(self, *nodes: Node, executor: Executor | None = None, threads: int = 1) -> Node:
        """Spin nodes together, by default in an executor with one thread. Return the first one.

        With `threads` of 2 and more it is a MultiThreadedExecutor.
        """
        for node in nodes:
            if not isinstance(node, Node):
                raise Failed(f'a node is wanted here, and this is {_kind_of(node)}')
        if executor is None:
            executor = MultiThreadedExecutor(threads) if threads > 1 else SingleThreadedExecutor()
        for node in nodes:
            executor.add_node(node)
        self._executors.append(executor)
        self.session.spin(executor)
        return nodes[0]

    def spin_each(self, *nodes: Node) -> None:
        """Spin each node in an executor of its own."""
        for node in nodes:
            self.spin(node)

    # --- The tester

    def say(self, topic: str, *messages, qos: QoSProfile | int = 10, at_once: bool = False) -> None:
        """Publish messages of one type. Each but the first waits until the one before was handled.

        With `at_once` they are published without a pause, so that queues fill. The QoS offers
        RELIABLE, which serves every subscription.
        """
        publisher = self.publisher(topic, type(messages[0]), qos)
        for message in messages:
            publisher.publish(message)
            if not at_once:
                self.quiet()

    def publisher(self, topic: str, kind: type, qos: QoSProfile | int = 10):
        """Return the tester's publisher on a topic; the same one for the same QoS."""
        key = topic, kind, qos if isinstance(qos, int) else id(qos)
        if key not in self._publishers:
            self._publishers[key] = self.tester.create_publisher(kind, topic, qos)
        return self._publishers[key]

    def hear(self, topic: str, kind: type, qos: QoSProfile | int = ALL) -> list:
        """Return a list to which each message of a topic is appended, from now on."""
        heard: list = []
        self.tester.create_subscription(kind, topic, heard.append, qos)
        return heard

    def call(self, service: str, kind: type, request=None, limit_s: float = WAIT_S):
        """Call a service. Return its response, or None if no answer came within the limit."""
        try:
            future = self.ask(service, kind, request, limit_s)
        except Failed:
            return None
        return future.result() if self.wait(future.done, limit_s) else None

    def ask(self, service: str, kind: type, request=None, limit_s: float = WAIT_S):
        """Call a service, and return the future of its response at once.

        Raises Failed if nobody serves it.
        """
        client = self._client(service, kind)
        if not self.wait(client.service_is_ready, limit_s):
            raise Failed(f'nobody serves {service}')
        return self.as_tester(client.call_async, kind.Request() if request is None else request)

    def as_tester(self, function: Callable, *arguments: object):
        """Let the tester's executor call a function, and return what it returns.

        An answer to a goal that another thread sends may get lost:
        https://github.com/ros2/rclpy/issues/1123
        """
        task = self._own_executor.create_task(function, *arguments)
        self.wait(task.done)
        return task.result()

    def _client(self, service: str, kind: type):
        if (service, kind) not in self._clients:
            self._clients[service, kind] = self.tester.create_client(kind, service)
        return self._clients[service, kind]

    def send_goal(self, action: str, kind: type, goal, limit_s: float = WAIT_S) -> Goal:
        """Send a goal, and wait for the answer: was it accepted? See `Goal`."""
        if (action, kind) not in self._clients:
            self._clients[action, kind] = ActionClient(self.tester, kind, action)
        client = self._clients[action, kind]
        if not self.wait(client.server_is_ready, limit_s):
            raise Failed(f'nobody serves the action {action}')
        return Goal(self, client, goal, limit_s)

    # --- Time

    def gate(self) -> Gate:
        """Return a gate that holds callbacks until it is opened, or until the bench ends."""
        self._gates.append(Gate(self.wait))
        return self._gates[-1]

    def advance(self, seconds: float, step_s: float = 0.1) -> None:
        """Let simulated time go on, for nodes with `use_sim_time`, and wait after each step."""
        for _ in range(max(1, round(seconds / step_s))):
            self._clock_s += step_s
            clock = Time(seconds=self._clock_s, clock_type=ClockType.ROS_TIME).to_msg()
            self.publisher('/clock', Clock).publish(Clock(clock=clock))
            self.quiet()

    def wait(self, condition: Callable[[], object], limit_s: float = WAIT_S) -> bool:
        """Wait until a condition holds, at most `limit_s` seconds. Return whether it holds.

        Raises what a callback of the student has raised.
        """
        try:
            self.session.wait_until(lambda: bool(condition()), limit_s)
        except TimeoutError:
            return False
        return True

    def quiet(self, limit_s: float = QUIET_S, executor: Executor | None = None) -> bool:
        """Wait until all that was sent is handled, in the student's nodes and in the tester.

        Return whether a thread of each executor is free: False if callbacks hold all of them. With
        an `executor`, wait for this one only.
        """
        free = True
        executors = [*self._executors, self._own_executor] if executor is None else [executor]
        for _ in executors:  # what one sends may be for one that was quiet before
            states = [self._wait_until_quiet(each, limit_s) for each in executors]
            free = all(states)
        return free

    def _wait_until_quiet(self, executor: Executor, limit_s: float) -> bool:
        end = time.monotonic() + limit_s
        while (left_s := end - time.monotonic()) > 0:
            try:
                return self.session.wait_until_quiet(executor, min(CALLBACK_S, left_s))
            except TimeoutError:
                self._check_that_callbacks_end()
        raise Failed('it is never quiet: callbacks come without end')

    def line_of_callback(self) -> str:
        """Return the line at which a callback of the student is now, `Line 7: ...`, or nothing.

        When it is quiet, a callback that has not ended waits for something.
        """
        return _place_of_callback(self.session.threads())

    # --- What was logged

    def log(self, node: str | None = None) -> list[str]:
        """Return the lines of the log so far, `[INFO] [talker]: Hello`, of one node or of all."""
        return [
            f'[{record.level}] [{record.node}]: {record.text}'
            for record in self.session.records()
            if node in (None, record.node)
        ]

    # --- At the end

    def _check_that_callbacks_end(self) -> None:
        """Raise NeverEnds if a callback of the student runs on, with the line that it is at."""
        end = time.monotonic() + CALLBACK_S
        while place := self.line_of_callback():
            if time.monotonic() > end:
                if WAITS_FOR_LOCK.search(place):
                    raise NeverEnds(f'a callback waits for a lock that nobody releases. {place}')
                raise NeverEnds(f'a callback does not end. {place}')
            time.sleep(POLL_S)


class Goal:
    """A goal that was sent: `accepted`, its `feedback` so far, and later its `status`."""

    def __init__(self, bench: Bench, client: ActionClient, goal, limit_s: float) -> None:
        self._bench, self._limit_s = bench, limit_s
        self.feedback: list = []
        sent = bench.as_tester(
            client.send_goal_async, goal, lambda message: self.feedback.append(message.feedback)
        )
        if not bench.wait(sent.done, limit_s):
            raise Failed('the goal gets no answer')
        self._handle = sent.result()
        self.accepted: bool = self._handle.accepted
        self._result = bench.as_tester(self._handle.get_result_async) if self.accepted else None

    @property
    def done(self) -> bool:
        """Whether the goal has ended, or was not accepted."""
        return self._result is None or self._result.done()

    def cancel(self, limit_s: float | None = None) -> bool:
        """Ask for cancellation. Return whether the server agreed in time."""
        answer = self._bench.as_tester(self._handle.cancel_goal_async)
        return self._bench.wait(answer.done, limit_s or self._limit_s) and bool(
            answer.result().goals_canceling
        )

    def ended(self, limit_s: float | None = None) -> tuple[str, object]:
        """Wait for the end. Return 'SUCCEEDED', 'CANCELED', 'ABORTED' or 'RUNNING', and the result.

        Of a goal that was not accepted it is ('REJECTED', None).
        """
        if self._result is None:
            return 'REJECTED', None
        if not self._bench.wait(self._result.done, limit_s or self._limit_s):
            return 'RUNNING', None
        answer = self._result.result()
        return STATUS.get(answer.status, str(answer.status)), answer.result


class Gate:
    """Holds callbacks, so that a check can look at what goes on meanwhile.

        gate = bench.gate()
        node.create_subscription(Int32, 'number', gate.hold, 10)
        bench.say('number', Int32(data=1), at_once=True)
        gate.wait_until_entered()
        ...
        gate.open()

    `entered` has what each callback was called with, in their order: a message, or None.
    """

    def __init__(self, wait: Callable[[Callable[[], object], float], bool]) -> None:
        self.entered: list = []
        self._wait = wait  # until a condition holds, so many seconds: whether it does
        self._opened = threading.Event()

    def hold(self, came: object = None) -> bool:
        """Wait until the gate is open. Return whether it is: after `HOLD_S` seconds it is not.

        It is a callback, or what a callback calls.
        """
        self.entered.append(came)
        return self._opened.wait(HOLD_S)

    def wait_until_entered(self, count: int = 1, limit_s: float = WAIT_S) -> bool:
        """Wait until so many callbacks have come to the gate. Return whether they have."""
        return self._wait(lambda: len(self.entered) >= count, limit_s)

    def open(self) -> None:
        """Let all callbacks pass, those that come later, too."""
        self._opened.set()


def scan(
    ranges: float | Sequence[float],
    *,
    first: float = -math.pi / 2,
    step: float = math.pi / 180,
    limits: tuple[float, float] = (0.12, 8.0),
    age_s: float = 0.0,
    stamp: TimeMessage | None = None,
) -> LaserScan:
    """Return a scan of the laser, by default as that of the simulated robot: 181 beams, 1 degree.

    `ranges` (m) begin at the angle `first` (rad, to the left) and are `step` apart. One number is
    what all 181 beams see; NaN is a beam that sees nothing. `limits` are range_min and range_max.
    Its stamp is that of now, `age_s` seconds ago, or another `stamp`.
    """
    seen = [float(metres) for metres in (ranges if np.ndim(ranges) else [ranges] * 181)]
    message = LaserScan(angle_min=first, angle_increment=step, ranges=seen)
    message.angle_max = first + step * max(0, len(seen) - 1)
    message.range_min, message.range_max = limits
    now = SystemClock(clock_type=ClockType.ROS_TIME).now()
    message.header.stamp = stamp or (now - Duration(nanoseconds=round(age_s * 1e9))).to_msg()
    return message


def must_have(thing: object, *names: str) -> None:
    """Raise Failed if an object of the student lacks one of these attributes."""
    for name in names:
        if not hasattr(thing, name):
            raise Failed(f'there is no self.{name} yet')


def must_define(a_class: type, *methods: str) -> None:
    """Raise Failed if the student's class does not define one of these methods itself."""
    for method in methods:
        if method not in vars(a_class):
            raise Failed(f'the class has no {method} yet')


def must_be_called(node: Node, name: str) -> None:
    """Raise Failed if a node of the student has another name than the task says."""
    if node.get_name() != name:
        found = f'the name of the node is {node.get_name()}, not {name}'
        raise Failed(found, hint=f"super().__init__('{name}') in its __init__.")


def periods_of(node: Node) -> list[float]:
    """Return the periods of the timers of a node (s)."""
    return [timer.timer_period_ns / 1e9 for timer in node.timers]


def override(written: type | Callable, **constants: object) -> None:
    """Give constants that the student's code reads another value.

    `override(Driver, PERIOD_S=0.1)`. They are those of the notebook in which the class or function
    was written. The process ends with the check, and with it what was changed.
    """
    vars(sys.modules[written.__module__]).update(constants)


@contextmanager
def one_cpu() -> Iterator[list]:
    """Let what is made here see a computer with one CPU. Yield a list: was the number asked for?

    A MultiThreadedExecutor without a number of threads then gets one, as on a small robot.
    """
    counted: list = []

    def allowed(pid: int) -> set[int]:
        counted.append(pid)
        return {0}

    def count() -> int:
        return len(allowed(0))

    with (
        mock.patch.object(os, 'sched_getaffinity', allowed),
        mock.patch.object(os, 'cpu_count', count),
        warnings.catch_warnings(action='ignore'),  # rclpy warns about a single thread
    ):
        yield counted


def _kind_of(value: object) -> str:
    return f'the class {value.__name__}' if isinstance(value, type) else repr(value)


def _place_of_callback(threads: list[threading.Thread]) -> str:
    for _, frame in frames(threads):
        if place := own_line(places(frame)):
            return place
    return ''


class _refused_spins:  # noqa: N801 - a context manager, named as a function
    """Let a spin inside a callback say what is wrong, in place of waiting for ever.

    `rclpy.spin...(node)` takes the node out of the executor that runs the callback. This process
    ends with the check, so it may replace functions of rclpy.
    """

    NAMES = 'spin', 'spin_once', 'spin_until_future_complete'

    def __enter__(self) -> None:
        self._before = {name: getattr(rclpy, name) for name in self.NAMES}
        for name, function in self._before.items():
            setattr(rclpy, name, _refuse_in_callback(name, function))

    def __exit__(self, *exception) -> None:
        for name, function in self._before.items():
            setattr(rclpy, name, function)


def _refuse_in_callback(name: str, function: Callable) -> Callable:
    def spin(*arguments, **options):
        if threading.current_thread() is not threading.main_thread():
            raise Failed(
                f'rclpy.{name} inside a callback takes the node out of its executor: the callback '
                'must return, or wait in another way'
            )
        return function(*arguments, **options)

    return spin
