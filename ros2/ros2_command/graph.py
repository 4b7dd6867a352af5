"""A node for a command: in the domain that is meant, and with the whole graph in its view."""

from __future__ import annotations

import contextlib
import math
import os
import re
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from ros2_command.commands import CommandError
from ros2_command.discovery import (
    LONGEST_S,
    OTHERS_S,
    TRIES_S,
    knows_all,
    wait_for,
    wait_until_quiet,
)
from ros2_command.domain import join_domain, why_nobody_is_there
from ros2_command.guards import at_most, new_threads_wait, one_process_at_a_time, uninterrupted

if TYPE_CHECKING:
    from rclpy.node import Node

SERVICE_S = 5.0  # for a service of a node that is there
INTERRUPT_S = 0.1  # after which Ctrl+C is noticed
CLOSE_S = 10.0  # a close takes 0.1 s, and some seconds on a busy machine
COMMAND = '_ros2cli_'  # how the node of a command begins


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
        with one_process_at_a_time(), new_threads_wait():
            self.node = rclpy.create_node(
                name or f'{COMMAND}{os.getpid()}',
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

    def result(self, future: Any, action: str) -> Any:
        """Spin until a future is done, and return its result.

        Raises CommandError if it failed. `action` says at what, such as 'calling service'.
        """
        self.spin_until(future.done)
        if future.exception() is not None:
            raise CommandError(f'Exception while {action}: {future.exception()!r}')
        return future.result()

    def call(self, node: str, service: type, **fields: Any) -> Any:
        """Call the service of a node that is named as its type, and return the response.

        Raises CommandError if the service is not there in time, or if it fails.
        """
        snake_case = re.sub('(?<!^)(?=[A-Z])', '_', service.__name__).lower()
        name = f'{node}/{snake_case}'
        client = self.node.create_client(service, name)
        if not wait_for(client.service_is_ready, SERVICE_S):
            raise CommandError(f"Waited {SERVICE_S:g} s, but the service '{name}' did not appear")
        return self.result(client.call_async(service.Request(**fields)), f"calling '{name}'")

    def is_alone(self) -> bool:
        """Return whether there is no other node, except those of other commands."""
        others = [name for name in self.node.get_node_names() if not name.startswith(COMMAND)]
        return others in ([], [self.node.get_name()])

    def close(self) -> None:
        """Give back the node and its participant.

        While other programs come and go, Fast DDS 2.14 may wait for itself here for ever: one in
        400 ends beside three of them. All has been printed then, so the process ends.
        """
        self._executor.shutdown(timeout_sec=0)
        with one_process_at_a_time(), at_most(CLOSE_S):
            self.node.destroy_node()
            self._context.try_shutdown()


@contextlib.contextmanager
def graph(
    until: Callable[[Node], Any] = lambda node: True, name: str | None = None
) -> Iterator[Graph]:
    """Open a node for a command that has discovered the graph, and close it however that ends.

    It has discovered all that is there. If then `until` does not hold, it waits a little longer.
    """
    join_domain()
    opened = None
    try:
        started = time.monotonic()
        for try_s in TRIES_S:
            with uninterrupted():
                if opened is not None:
                    opened.close()
                opened = Graph(name)
            if knows_all(opened.node, try_s):
                break
        if os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] != 'LOCALHOST':
            time.sleep(max(0.0, started + OTHERS_S - time.monotonic()))
        wait_until_quiet(opened.node)
        wait_for(lambda: until(opened.node), started + LONGEST_S - time.monotonic())
        if opened.is_alone() and (reason := why_nobody_is_there()):
            print(reason, file=sys.stderr)
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
