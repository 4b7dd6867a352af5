"""Why something cannot run: whose thread is held, whose group, what nobody spins, who is missing.

Each `Blocker` is a fact that was read at this moment. If none is found, the list is empty: then
nothing is known that would keep the callback from running.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from difflib import get_close_matches
from itertools import product

from rclpy.action import (
    ActionClient,
    ActionServer,
    get_action_names_and_types,
    get_action_server_names_and_types_by_node,
)
from rclpy.clock import ROSClock
from rclpy.node import Node
from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from . import reading
from .snapshot import (
    Activity,
    Snapshot,
    action_name,
    callback_of,
    code_of,
    is_there,
    pending,
    threads_of,
)

SPIN_CALLS = ('spin', 'spin_once', 'spin_until_future_complete', 'spin_once_until_future_complete')


@dataclass(frozen=True)
class Blocker:
    """`cause` is one word for tests and cures; `text` completes 'It cannot run: '."""

    cause: str
    text: str
    holders: tuple[Activity, ...] = ()  # what must come to an end first, and may
    thing: str = ''  # what they hold: the threads, the group


@dataclass(frozen=True)
class Ender:
    """What would end a wait, why it cannot (nothing known: empty), and what it does now."""

    text: str
    blockers: tuple[Blocker, ...] = ()
    now: str = ''
    activity: Activity | None = None  # what works on it
    name: str = ''  # of the callback that would end it, or of the line
    does: str = ''  # completes the name: 'would answer'
    label: str = 'needs'  # of an arrow from what is waited for


# --- Names


def name_of_callback(entity: object) -> str:
    code = code_of(callback_of(entity))
    if code is None:
        return ''
    return 'a lambda' if code.co_name == '<lambda>' else f'{code.co_name}()'


def name_of(snapshot: Snapshot, entity: object) -> str:
    """Return what an entity is called in a sentence, with its node."""
    node = snapshot.node_of(entity)
    where = f' of the node {node.get_name()}' if node is not None else ''
    callback = name_of_callback(entity)
    match entity:
        case Subscription():
            return f'{callback}, for messages on {entity.topic_name}{where}'
        case Service():
            return f'{callback}, for the service {entity.srv_name}{where}'
        case Timer():
            return f'{callback or "a callback"}, of a timer{where}'
        case ActionServer():
            return f'{callback}, for an action{where}'
        case ActionClient():
            return f'the client of the action {action_name(entity)}{where}'
    name = getattr(entity, 'srv_name', None)
    if name is not None:
        return f'the client of the service {name}{where}'
    return f'{callback or "something"}{where}'


def short_name_of(entity: object) -> str:
    """Return what an entity is called in a picture."""
    return name_of_callback(entity) or (
        'a callback' if isinstance(entity, Subscription | Timer) else 'the client'
    )


def name_of_activity(activity: Activity) -> str:
    """Return what runs, in a word: the callback, the function of a thread, the cell."""
    own = activity.own
    if not own:
        return 'a callback of a library' if activity.task else 'the program'
    code = own[-1].f_code
    if code.co_name in ('<module>', '<lambda>') or code.co_name.startswith('<cell line'):
        is_cell = 'ipykernel' in code.co_filename or code.co_filename.startswith('<ipython')
        top = 'the cell' if is_cell else 'the program'
        return 'a lambda' if code.co_name == '<lambda>' else top
    return f'{code.co_name}()'


def place_of(activity: Activity) -> str:
    """Return the line at which something stands."""
    own = activity.own
    if not own:
        return ''
    frame = own[0]
    inner = '' if len(own) == 1 else f' of {frame.f_code.co_name}()'
    if frame.f_code.co_name in ('<lambda>', '<module>'):
        inner = ''
    return f'line {frame.f_lineno}{inner}: {reading.line_of(frame).rstrip(":")}'


# --- What keeps a callback from running


def blockers(snapshot: Snapshot, entity: object) -> list[Blocker]:
    """Return what keeps the callback of an entity from running, as far as it can be seen."""
    node = snapshot.node_of(entity)
    if node is None:
        return [Blocker('gone', 'it was destroyed, or its node was')]
    return [
        *_of_executor(snapshot, node, entity),
        *_of_group(snapshot, entity),
        *_of_timer(snapshot, node, entity),
    ]


def _of_executor(snapshot: Snapshot, node: Node, entity: object) -> list[Blocker]:
    name = node.get_name()
    executors = snapshot.executors_of(node)
    if not executors:
        text = f'the node {name} is in no executor'
        if node.executor is not None:
            text += ' any more: a function such as rclpy.spin_until_future_complete(node, ...) '
            text += 'has put it into another one, and taken it out'
            return [Blocker('taken out', text)]
        return [Blocker('not spun', f'{text}, so nobody spins it')]
    executor = executors[0]
    if not snapshot.spinners(executor):
        if between_spins(snapshot):
            return []
        text = f'nobody spins the executor of the node {name}'
        return [Blocker('not spun', text + _who_would_spin(snapshot))]
    held = snapshot.held_by(executor)
    # A callback that runs for this very entity is the work, and not in its way.
    if held and all(one.entity is not entity for one in held):
        return [of_threads(threads_of(executor), held)]
    return []


def of_threads(count: int, held: list[Activity]) -> Blocker:
    names = sorted({name_of_activity(one) for one in held})
    only = 'the only thread' if count == 1 else f'each of the {count} threads'
    hold = 'holds' if len(names) == 1 else 'hold'
    text = f'{", ".join(names)} {hold} {only} of its executor'
    return Blocker('thread', text, tuple(held), only if count == 1 else f'the {count} threads')


def _of_group(snapshot: Snapshot, entity: object) -> list[Blocker]:
    group = getattr(entity, 'callback_group', None)
    holder, activity = snapshot.holder_of(group)
    if holder is None or holder is entity:
        return []
    name = name_of_activity(activity) if activity is not None else name_of_callback(holder)
    waits = ' (an `await` does not give it back)' if activity and activity.suspended else ''
    holders = () if activity is None else (activity,)
    text = f'{name} holds its callback group{waits}'
    return [Blocker('group', text, holders, f'the group of {name}')]


def _of_timer(snapshot: Snapshot, node: Node, entity: object) -> list[Blocker]:
    if not isinstance(entity, Timer):
        return []
    if entity.is_canceled():
        return [Blocker('canceled', 'the timer was cancelled')]
    return of_clock(snapshot, node, entity.clock)


def of_clock(snapshot: Snapshot, node: Node, clock: object) -> list[Blocker]:
    """Return why a clock stands still."""
    if not isinstance(clock, ROSClock) or not clock.ros_time_is_active:
        return []
    (subscription,) = [s for s in node.subscriptions if s.topic_name == '/clock'] or [None]
    if node.count_publishers('/clock') == 0:
        text = f'use_sim_time is true in {node.get_name()}, and nobody publishes /clock'
        return [Blocker('clock', text)]
    if subscription is None:
        return []
    return [
        replace(blocker, text=f'its time comes from /clock, and {blocker.text}')
        for blocker in blockers(snapshot, subscription)
    ]


def between_spins(snapshot: Snapshot) -> bool:
    """Return whether a loop of the learner spins now and then, and is only between two spins."""
    return any(
        any(
            isinstance(thing, reading.ast.Call) and reading.last_name(thing.func) in SPIN_CALLS
            for loop in reading.loops_around(frame)
            for thing in reading.ast.walk(loop)
        )
        for activity in snapshot.activities
        if activity.thread is not None and activity.innermost
        for frame in activity.own
    )


def _who_would_spin(snapshot: Snapshot) -> str:
    """Say where the code stands that would spin later."""
    for activity in snapshot.activities:
        for frame in activity.own if activity.innermost else ():
            function = reading.function_of(frame.f_code)
            for thing in reading.inside(function) if function is not None else ():
                if (
                    isinstance(thing, reading.ast.Call)
                    and reading.last_name(thing.func) in SPIN_CALLS
                    and thing.lineno > frame.f_lineno
                ):
                    return (
                        f': line {thing.lineno} would, but {name_of_activity(activity)} '
                        f'is still in line {frame.f_lineno}'
                    )
    return ''


# --- Peers


def nearest(name: str, others: Iterable[str]) -> str | None:
    """Return which of the other names may be meant: nearly the same letters, small or capital."""
    by_lower = {other.lower(): other for other in others if other != name}
    matches = get_close_matches(name.lower(), by_lower, n=1, cutoff=0.8)
    return by_lower[matches[0]] if matches else None


def nearly(name: str, others: Iterable[str]) -> str:
    near = nearest(name, others)
    return f' (nearly the same name: {near})' if near else ''


def of_topic(subscription: Subscription, node: Node) -> list[Blocker]:
    """Return why no message can come on the topic of a subscription."""
    name = subscription.topic_name
    publishers = node.get_publishers_info_by_topic(name)
    if not publishers:
        known = [topic for topic, _ in node.get_topic_names_and_types()]
        known = [topic for topic in known if node.count_publishers(topic)]
        return [Blocker('no peer', f'nobody publishes on {name}{nearly(name, known)}')]
    ours = [
        end
        for end in node.get_subscriptions_info_by_topic(name)
        if end.node_name == node.get_name() and end.node_namespace == node.get_namespace()
    ]
    found = []
    for publisher, end in product(publishers, ours):
        if publisher.topic_type != end.topic_type:
            found.append(
                Blocker(
                    'type',
                    f'on {name}, {publisher.node_name} sends {publisher.topic_type}, '
                    f'and not {end.topic_type}',
                )
            )
            continue
        fit, reason = qos_check_compatible(publisher.qos_profile, end.qos_profile)
        if fit == QoSCompatibility.ERROR:
            reason = reason.replace('ERROR: ', '').strip('; ')
            text = f'on {name}, the QoS of {publisher.node_name} does not match: {reason}'
            found.append(Blocker('qos', text))
        else:
            return []  # one of them can be heard
    return found


def server_enders(snapshot: Snapshot, client: object) -> list[Ender]:
    """Return who answers a client, a list of one or two: the server, and the client itself."""
    node = snapshot.node_of(client)
    if node is None:
        return [Ender('the client would take the answer', (Blocker('gone', 'it is destroyed'),))]
    if isinstance(client, ActionClient):
        name = node.resolve_service_name(action_name(client))
        ready, kind = client.server_is_ready(), 'the action'
        known = [action for action, _ in get_action_names_and_types(node)] if not ready else []
        servers = [
            (other, thing)
            for other, thing in snapshot.entities()
            if isinstance(thing, ActionServer) and _serves(other, name)
        ]
    else:
        name = node.resolve_service_name(client.srv_name)
        ready, kind = client.service_is_ready(), 'the service'
        known = [srv for srv, _ in node.get_service_names_and_types()] if not ready else []
        servers = [
            (other, thing)
            for other, thing in snapshot.entities()
            if isinstance(thing, Service) and other.resolve_service_name(thing.srv_name) == name
        ]
    text = f'a server of {kind} {name} would answer'
    if not ready and not servers:
        return [Ender(text, (Blocker('no peer', f'nobody serves {name}{nearly(name, known)}'),))]
    enders = []
    for _, server in servers:
        running = [one for one in snapshot.activities if one.entity is server]
        text, one = f'{name_of(snapshot, server)}, would answer', next(iter(running), None)
        answers = {'name': short_name_of(server), 'does': 'would answer', 'label': 'comes from'}
        if one is None:
            enders.append(Ender(text, tuple(blockers(snapshot, server)), **answers))
        else:
            place = f', at {place_of(one)}' if place_of(one) else ''
            enders.append(Ender(text, (), f'it works on it{place}', one, **answers))
    if not servers:
        enders.append(Ender(text, (), 'it is in another process, which cannot be seen from here'))
    takes = f'{name_of(snapshot, client)} would take the answer'
    stops = tuple(blockers(snapshot, client))
    enders.append(Ender(takes, stops, name='the client', does='would take it'))
    return enders


def _serves(node: Node, action: str) -> bool:
    """Return whether a node is a server of an action. rclpy does not keep the name of a server."""
    name, namespace = node.get_name(), node.get_namespace()
    served = get_action_server_names_and_types_by_node(node, name, namespace)
    return action in [name for name, _ in served]


def clients_of(snapshot: Snapshot, future: object) -> list:
    """Return the client to which a future belongs."""
    clients = [
        *snapshot.clients,
        *(thing for _, thing in snapshot.entities() if isinstance(thing, ActionClient)),
    ]
    return [client for client in clients if any(one is future for one in pending(client))]


__all__ = ['Blocker', 'Ender', 'blockers', 'is_there', 'server_enders']
