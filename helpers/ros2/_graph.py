"""A node for a command: in the domain that is meant, and with the whole graph in its view."""

from __future__ import annotations

import contextlib
import math
import os
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helpers.notebook.interrupts import uninterrupted
from helpers.ros.domain import one_process_at_a_time
from helpers.ros2 import _sessions
from helpers.ros2._commands import CommandError

if TYPE_CHECKING:
    from rclpy.node import Node

POLL_S = 0.01
QUIET_S = 0.08
ANSWERS_S = 0.15, 0.3, 0.6, 4.0  # for all participants: each repeats what it is every 3 s
OTHERS_S = 0.5  # for other machines, as the real command waits
LONGEST_S = 1.0
SERVICE_S = 5.0  # for a service of a node that is there
INTERRUPT_S = 0.1  # after which Ctrl+C is noticed
PARTICIPANTS = 32  # of one domain and machine find each other
UNNAMED = '_NODE_NAME_UNKNOWN_'
MATCHED = 'ros_discovery_info'  # every participant of ROS publishes it


def join_domain() -> dict[str, str]:
    """Choose the domain if ROS_DOMAIN_ID does not, set it, and return the variables that count.

    A cell's commands meet their own kernel, those of a terminal the only kernel with an open
    session. Without any kernel it is domain 0 on this machine.

    Raises CommandError if several are open.
    """
    if not os.environ.get('ROS_DOMAIN_ID'):
        os.environ |= _variables_of_a_kernel()
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    names = 'ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_STATIC_PEERS'
    return {name: os.environ[name] for name in names if os.environ.get(name)}


def _variables_of_a_kernel() -> dict[str, str]:
    kernels = sorted(_sessions.kernels(), key=lambda kernel: not kernel.is_open)
    for pid in _sessions.ancestors():
        for kernel in kernels:
            if kernel.pid == pid:
                return kernel.variables
    candidates = [kernel for kernel in kernels if kernel.is_open] or kernels
    if len({tuple(kernel.variables.items()) for kernel in candidates}) > 1:
        domains = [kernel.variables['ROS_DOMAIN_ID'] for kernel in candidates]
        named = [f'{k.notebook} ({d})' for k, d in zip(candidates, domains, strict=True)]
        raise CommandError(
            f'{len(named)} notebooks have a domain: {", ".join(named)}. '
            f'Choose one, for example with `export ROS_DOMAIN_ID={domains[0]}`.'
        )
    return candidates[0].variables if candidates else {'ROS_DOMAIN_ID': '0'}


class Graph:
    """The node of a command, and what it does with it."""

    def __init__(self, name: str | None) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.parameter import Parameter
        from rclpy.signals import SignalHandlerOptions

        self._context = rclpy.Context()
        rclpy.init(
            # A log file would need a home that can be written.
            args=['--ros-args', '--disable-external-lib-logs'],
            context=self._context,
            # rclpy's own handlers end the context in the middle of what a command does.
            signal_handler_options=SignalHandlerOptions.NO,
        )
        with one_process_at_a_time():
            self.node = rclpy.create_node(
                name or f'_ros2cli_{os.getpid()}',
                context=self._context,
                start_parameter_services=False,
                # It takes 0.1 s.
                parameter_overrides=[Parameter('start_type_description_service', value=False)],
            )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)

    def spin_until(self, done: Callable[[], Any], timeout_s: float = math.inf) -> bool:
        """Spin until something holds that a callback changes, and return whether it does."""
        deadline = time.monotonic() + timeout_s
        while not (answer := done()) and (left_s := deadline - time.monotonic()) > 0:
            self._executor.spin_once(min(left_s, INTERRUPT_S))
        return bool(answer)

    def result(self, future: Any, what: str) -> Any:
        """Spin until a future is done, and return its result. Raises CommandError if it failed."""
        self.spin_until(future.done)
        if future.exception() is not None:
            raise CommandError(f'Exception while {what}: {future.exception()!r}')
        return future.result()

    def call(self, node: str, service: type, **fields: Any) -> Any:
        """Call the service of a node that is named as its type, and return the response.

        Raises CommandError if the service is not there in time, or if it fails.
        """
        name = f'{node}/{re.sub("(?<!^)(?=[A-Z])", "_", service.__name__).lower()}'
        client = self.node.create_client(service, name)
        if not wait_for(client.service_is_ready, SERVICE_S):
            raise CommandError(f"Waited {SERVICE_S:g} s, but the service '{name}' did not appear")
        return self.result(client.call_async(service.Request(**fields)), f"calling '{name}'")

    def close(self) -> None:
        """Give back the node and its participant."""
        self._executor.shutdown(timeout_sec=0)
        with one_process_at_a_time():
            self.node.destroy_node()
            self._context.try_shutdown()

    def knows_all(self, timeout_s: float) -> bool:
        """Wait until it knows each participant of this machine, and the names of its nodes.

        Return whether it does.
        """
        domain = self._context.get_domain_id()

        def known() -> bool:
            named = all(info.node_name != UNNAMED for info in self._named_publishers())
            return named and len(self._matched()) >= _participants(domain)

        return wait_for(known, timeout_s)

    def wait_until_quiet(self) -> None:
        """Wait until nothing new comes and everything has a name, or no longer gets one."""
        deadline = time.monotonic() + ANSWERS_S[-1]
        node, seen, since = self.node, None, 0.0
        while (now := time.monotonic()) < deadline:
            nodes = node.get_node_names_and_namespaces()
            infos = self._named_publishers()
            topics, services = node.get_topic_names_and_types(), node.get_service_names_and_types()
            if (new := (nodes, topics, services, len(infos))) != seen:
                seen, since = new, now
            if now >= since + (QUIET_S if self.is_whole() else LONGEST_S):
                break
            time.sleep(POLL_S)

    def is_whole(self) -> bool:
        """Return whether each participant that it knows has said which nodes it has."""
        infos = self._named_publishers()
        named = {(info.node_name, info.node_namespace) for info in infos}
        nodes = set(self.node.get_node_names_and_namespaces())
        return nodes == named and self._matched() <= set(map(_participant, infos))

    def _named_publishers(self) -> list:
        return [i for t in ('/parameter_events', '/rosout') for i in self._publishers(t)]

    def _matched(self) -> set[bytes]:
        return set(map(_participant, self._publishers(MATCHED, no_mangle=True)))

    def _publishers(self, topic: str, no_mangle: bool = False) -> list:
        return self.node.get_publishers_info_by_topic(topic, no_mangle=no_mangle)


@contextlib.contextmanager
def graph(
    until: Callable[[Node], Any] = lambda node: True, name: str | None = None
) -> Iterator[Graph]:
    """Open a node for a command that has discovered the graph, and close it however that ends.

    On this machine it is known how many participants there are: all of them have been found, and
    nothing new comes. The wait goes on until `until` holds, but not longer than a second.
    """
    join_domain()
    opened = None
    try:
        started = time.monotonic()
        for answer_s in ANSWERS_S:
            with uninterrupted():
                if opened is not None:
                    opened.close()
                opened = Graph(name)
            # Fast DDS loses the answers that come before a new participant listens.
            if opened.knows_all(answer_s):
                break
        if os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] != 'LOCALHOST':
            time.sleep(max(0.0, started + OTHERS_S - time.monotonic()))
        opened.wait_until_quiet()
        wait_for(lambda: until(opened.node), started + LONGEST_S - time.monotonic())
        yield opened
    finally:
        with uninterrupted():  # by a second Ctrl+C
            if opened is not None:
                opened.close()


def full_name(node: Node, name: str) -> str:
    """Return a name as the graph has it, with its namespace. Raises CommandError."""
    try:
        return node.resolve_topic_name(name)
    except RuntimeError as error:  # 'failed to resolve name: REASON, at FILE'
        reason = str(error).partition(': ')[2].partition(', at ')[0]
        raise CommandError(f'Invalid topic name: {reason}') from None


def wait_for(predicate: Callable[[], Any], timeout_s: float) -> bool:
    """Wait until something holds that the middleware changes, and return whether it does."""
    deadline = time.monotonic() + timeout_s
    while not (answer := predicate()) and time.monotonic() < deadline:
        time.sleep(POLL_S)
    return bool(answer)


def _participant(info: Any) -> bytes:
    return bytes(info.endpoint_gid[:12])


def _participants(domain: int) -> int:
    """Return how many participants of a domain this machine has, from the ports that they hold."""
    first = 7400 + 250 * domain + 10  # of the RTPS standard: two ports for each
    lines = Path('/proc/net/udp').read_text().splitlines()[1:]
    ports = {int(line.split()[1].rpartition(':')[2], 16) for line in lines}
    return len(ports & set(range(first, first + 2 * PARTICIPANTS, 2)))
