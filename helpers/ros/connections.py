"""Why nothing happens: what is connected to what in this process, what is not, and why.

Each finding is one sentence. Their order is fixed.
"""

from __future__ import annotations

import linecache
import re
import sysconfig
from collections.abc import Container, Iterable, Iterator
from difflib import get_close_matches
from itertools import product
from pathlib import Path
from types import FrameType

from rclpy.action import ActionClient, ActionServer, get_action_names_and_types
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import QoSCompatibility, qos_check_compatible

from helpers.ros.private import action_name

NOT_OF_A_LESSON = ('/rosout', '/parameter_events')
# Code that is in no callback of a lesson.
FOREIGN = re.compile(
    '|'.join(
        [re.escape(sysconfig.get_path('stdlib')), re.escape(str(Path(__file__).parents[1]))]
        + ['/(site|dist)-packages/', '<frozen']
    )
)
WAITS_AT_A_LOCK = re.compile(r'(async )?with |.*\.acquire\(')


def findings(
    nodes: Iterable[Node], spinning: Container[Executor], frames: Iterable[FrameType]
) -> list[str]:
    """Return a sentence for everything that keeps messages, answers and callbacks away.

    `nodes` are all nodes of this process, `spinning` its executors that spin, and `frames` the
    innermost frames of their threads.
    """
    nodes = sorted(nodes, key=lambda node: node.get_fully_qualified_name())
    return [
        *_nodes_that_wait(nodes, spinning),
        *_topics(nodes),
        *_services(nodes),
        *_actions(nodes),
        *sorted(filter(None, map(_wait_of_callback, frames))),
    ]


def _nodes_that_wait(nodes: list[Node], spinning: Container[Executor]) -> Iterator[str]:
    for node in _own(nodes):
        services = [service for service in node.services if not _is_private(node, service.srv_name)]
        actions = _of_actions(node, ActionClient, ActionServer)
        if not any([*node.subscriptions, *node.timers, *node.clients, *services, *actions]):
            continue  # nothing to run
        name = node.get_name()
        if node.executor is None:
            yield f'The node {name} is in no executor: executor.add_node(...) is missing.'
        elif node.executor not in spinning:
            yield f'The executor of the node {name} does not spin: session.spin(...) is missing.'


def _own(nodes: list[Node]) -> list[Node]:
    """Return the nodes without those that a lesson did not write, and that spin themselves."""
    return [node for node in nodes if not getattr(node, 'stands_alone', False)]


def _is_private(node: Node, service: str) -> bool:
    """Whether it is one of the services that each node has, for its parameters and types."""
    name = node.get_fully_qualified_name()
    return node.resolve_service_name(service).startswith(f'{name}/')


def _topics(nodes: list[Node]) -> Iterator[str]:
    own = {end.topic_name for node in _own(nodes) for end in _ends(node)}
    names = {end.topic_name for node in nodes for end in _ends(node)}
    ends = {
        name: (
            sorted(nodes[0].get_publishers_info_by_topic(name), key=_node_name),
            sorted(nodes[0].get_subscriptions_info_by_topic(name), key=_node_name),
        )
        for name in sorted(names.difference(NOT_OF_A_LESSON))
    }
    for name, (publishers, subscriptions) in ends.items():
        if name not in own:
            continue  # a machine speaks whether somebody listens or not
        if not subscriptions:
            there, missing, others = 'publisher', 'subscription', 1
        elif not publishers:
            there, missing, others = 'subscription', 'publisher', 0
        else:
            yield from _pairs_that_do_not_fit(name, publishers, subscriptions)
            continue
        who = ', '.join(map(_node_name, publishers or subscriptions))
        half = [other for other, both in ends.items() if both[others] and not both[1 - others]]
        yield f'The topic {name} has a {there} ({who}) and no {missing}.{nearly(name, half)}'


def _ends(node: Node) -> list:
    return [*node.publishers, *node.subscriptions]


def _node_name(end) -> str:
    return end.node_name


def nearly(name: str, others: list[str]) -> str:
    """Return a sentence that names which of the other names may be meant, or nothing."""
    by_lower = {other.lower(): other for other in others}
    matches = get_close_matches(name.lower(), by_lower, n=1, cutoff=0.8)
    return f' Nearly the same name: {by_lower[matches[0]]}.' if matches else ''


def _pairs_that_do_not_fit(name: str, publishers: list, subscriptions: list) -> Iterator[str]:
    for publisher, subscription in product(publishers, subscriptions):
        fit, reason = qos_check_compatible(publisher.qos_profile, subscription.qos_profile)
        if fit == QoSCompatibility.ERROR:
            reason = reason.replace('ERROR: ', '').strip('; ')
            ends = f'{publisher.node_name} and {subscription.node_name}'
            yield f'On the topic {name}, the QoS of {ends} do not fit: {reason}.'


def _services(nodes: list[Node]) -> Iterator[str]:
    for node in nodes:
        missing = {
            node.resolve_service_name(client.srv_name)
            for client in node.clients
            if not client.service_is_ready()
        }
        known = {name for name, _ in node.get_service_names_and_types()}
        for name in sorted(missing):
            near = nearly(name, sorted(known - missing))
            yield f'{node.get_name()} calls {name}, and nobody serves it.{near}'


def _of_actions(node: Node, *kinds: type) -> list:
    return [waitable for waitable in node.waitables if isinstance(waitable, kinds)]


def _actions(nodes: list[Node]) -> Iterator[str]:
    for node in nodes:
        missing = {
            node.resolve_service_name(action_name(client))
            for client in _of_actions(node, ActionClient)
            if not client.server_is_ready()
        }
        known = {name for name, _ in get_action_names_and_types(node)} if missing else set()
        for name in sorted(missing):
            near = nearly(name, sorted(known - missing))
            yield f'{node.get_name()} sends goals to {name}, and nobody serves it.{near}'


def _wait_of_callback(frame: FrameType) -> str | None:
    """Return which callback of a lesson a thread is in, and the line at which it waits."""
    in_threading = frame.f_code.co_filename.endswith('/threading.py')
    own = []
    while frame is not None:
        if not FOREIGN.search(frame.f_code.co_filename):
            own.append(frame)
        frame = frame.f_back
    if not own:
        return None
    line = linecache.getline(own[0].f_code.co_filename, own[0].f_lineno).strip()
    if not (in_threading or WAITS_AT_A_LOCK.match(line)):
        return None  # it works
    return f'The callback {own[-1].f_code.co_name} waits at: {line}'
