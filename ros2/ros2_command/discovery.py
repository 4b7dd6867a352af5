"""When a new node has seen all that is in its domain.

DDS never says "that is all": a participant hears of the others one by one, and of each one's
endpoints later. The real command has a daemon that has been listening for long. Here a command
finds out by itself, in three steps:

1. It counts the participants of its domain on this machine: each holds two UDP ports, and Linux
   lists them in /proc/net/udp.
2. It waits until it knows as many, and the names of their nodes (`knows_all`).
3. It waits until nothing new comes any more (`wait_until_quiet`), and no service is half there.

All the times that decide are here.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rclpy.node import Node

# Between two looks. A look costs about 1 ms.
POLL_S = 0.01

# How long the first, second, ... participant of a command waits until it knows all the others; most
# know them after 0.2 s. Fast DDS loses the answers that come before a new participant listens (see
# `new_threads_wait`): a new participant gets them sooner than the old one, to which the others say
# again who they are every 3 s. The last one waits until they have said it three times: once was too
# short on a busy machine. So long it only waits for one that never says it, as a stopped program.
TRIES_S = 0.5, 0.5, 1.0, 10.0

# Each participant has said who it is and which nodes it has, and nothing new has come for so long:
# that is all. The endpoints of a node follow each other within milliseconds.
QUIET_S = 0.08

# The same if a participant has not said which nodes it has, and perhaps never does, as a program
# of DDS without ROS; and how long a command waits for the topic or the node that it was asked for.
LONGEST_S = 1.0

# A graph in which always something is new, or of which a part is missing, is taken as it is after
# so long. Fast DDS sends a lost part again about a second later.
RESTLESS_S = 4.0

# Nothing counts the participants of other machines: that long the real command waits for them, too.
OTHERS_S = 0.5

# Of one domain and machine, so many participants find each other: RTPS gives each two ports, from
# 7400 + 250 x domain + 10 on.
PARTICIPANTS = 32
FIRST_PORT, PORTS_OF_A_DOMAIN, OFFSET = 7400, 250, 10

# Linux gives the list of ports in pieces, and leaves a port out if another one closes between two
# pieces: in 3 looks of 100 if one program opens and closes 3000 ports a second, in 27 if it does
# nothing else. So a count is of all that several looks have seen. A look costs 0.1 ms.
LOOKS = 8

UNNAMED = '_NODE_NAME_UNKNOWN_'
DISCOVERY_TOPIC = 'ros_discovery_info'  # each participant of ROS tells there which nodes it has


def wait_for(predicate: Callable[[], Any], timeout_s: float) -> bool:
    """Wait until something holds that the middleware changes, and return whether it does."""
    deadline = time.monotonic() + timeout_s
    while not (answer := predicate()) and time.monotonic() < deadline:
        time.sleep(POLL_S)
    return bool(answer)


def knows_all(node: Node, timeout_s: float) -> bool:
    """Wait until a node knows each participant of this machine, and the names of its nodes.

    Return whether it does.
    """
    domain = node.context.get_domain_id()

    def is_known() -> bool:
        are_named = all(info.node_name != UNNAMED for info in _publishers_of_nodes(node))
        return are_named and len(_known_participants(node)) >= _count_participants(domain)

    return wait_for(is_known, timeout_s)


def wait_until_quiet(node: Node) -> None:
    """Wait until nothing new comes and everything has a name, or no longer gets one."""
    deadline = time.monotonic() + RESTLESS_S
    last_state, since = None, 0.0
    while (now := time.monotonic()) < deadline:
        state = (
            node.get_node_names_and_namespaces(),
            node.get_topic_names_and_types(),
            node.get_service_names_and_types(),
            len(_publishers_of_nodes(node)),
        )
        if state != last_state:
            last_state, since = state, now
        if (
            now >= since + QUIET_S
            and _knows_both_ends_of_services(node)
            and (now >= since + LONGEST_S or is_whole(node))
        ):
            break
        time.sleep(POLL_S)


def is_whole(node: Node) -> bool:
    """Return whether each participant that a node knows has said which nodes it has."""
    infos = _publishers_of_nodes(node)
    named = {(info.node_name, info.node_namespace) for info in infos}
    nodes = set(node.get_node_names_and_namespaces())
    return nodes == named and _known_participants(node) <= {_participant(info) for info in infos}


def _knows_both_ends_of_services(node: Node) -> bool:
    """Return whether each participant that has one end of a service or client has the other, too.

    A participant tells of its readers and of its writers in two streams of messages. Where packets
    are lost, as on a busy machine, one stream may come a second after the other: then `ros2 topic
    info` would miss a subscription, in 8 of 120 runs at a load of nine on two processors.
    """
    topics = [topic for topic, _ in node.get_topic_names_and_types(no_demangle=True)]

    def ends(prefix: str, suffix: str, infos_of: Callable[..., list]) -> set[tuple[str, bytes]]:
        return {
            (topic.removeprefix(prefix).removesuffix(suffix), _participant(info))
            for topic in topics
            if topic.startswith(prefix)
            for info in infos_of(topic, no_mangle=True)
        }

    requests, replies = ('rq/', 'Request'), ('rr/', 'Reply')
    readers, writers = node.get_subscriptions_info_by_topic, node.get_publishers_info_by_topic
    servers_are_whole = ends(*requests, readers) == ends(*replies, writers)
    return servers_are_whole and ends(*requests, writers) == ends(*replies, readers)


def _publishers_of_nodes(node: Node) -> list:
    """Return the publishers that almost each node has."""
    return [
        info
        for topic in ('/parameter_events', '/rosout')
        for info in node.get_publishers_info_by_topic(topic)
    ]


def _known_participants(node: Node) -> set[bytes]:
    infos = node.get_publishers_info_by_topic(DISCOVERY_TOPIC, no_mangle=True)
    return {_participant(info) for info in infos}


def _participant(info: Any) -> bytes:
    return bytes(info.endpoint_gid[:12])


def _count_participants(domain: int) -> int:
    """Return how many participants of a domain this machine has, from the ports that they hold."""
    held = set().union(*(_held_ports() for _ in range(LOOKS)))
    first = FIRST_PORT + PORTS_OF_A_DOMAIN * domain + OFFSET
    return len(held & set(range(first, first + 2 * PARTICIPANTS, 2)))


def _held_ports() -> set[int]:
    lines = Path('/proc/net/udp').read_text().splitlines()[1:]
    return {int(line.split()[1].rpartition(':')[2], 16) for line in lines}
