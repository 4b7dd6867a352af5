"""Why nothing happens: what is connected to what in this process, what is not, and why.

Each finding is one sentence. Their order is fixed.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator
from itertools import product

from rclpy.action import ActionClient, ActionServer, get_action_names_and_types
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import QoSCompatibility, qos_check_compatible

from helpers.waits import action_name, nearest

NOT_OF_A_LESSON = ('/rosout', '/parameter_events')


def findings(nodes: Iterable[Node], spinning: Container[Executor]) -> list[str]:
    """Return a sentence for everything that keeps messages and answers away.

    `nodes` are all nodes of this process, `spinning` its executors that spin. Callbacks that wait
    are not among them: `helpers.waits` finds those.
    """
    nodes = sorted(nodes, key=lambda node: node.get_fully_qualified_name())
    return [
        *_nodes_that_wait(nodes, spinning),
        *_topics(nodes),
        *_services(nodes),
        *_actions(nodes),
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
    near = nearest(name, others)
    return f' Nearly the same name: {near}.' if near else ''


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
