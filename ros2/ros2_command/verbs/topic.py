"""Various topic related sub-commands."""

from __future__ import annotations

import argparse
import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy import qos
from rclpy.duration import Duration
from rclpy.node import Node

from ros2_command.commands import (
    VALUES,
    Argument,
    CommandError,
    command,
    flag,
    natural,
    option,
    positive,
)
from ros2_command.discovery import wait_for
from ros2_command.graph import Graph, full_name, graph
from ros2_command.names import Names
from ros2_command.values import filled, find_type, to_csv, to_yaml

TOPICS = Names('topic', 'msg', lambda node: node.get_topic_names_and_types())
ARGUMENTS = (TOPICS.hidden,)
TYPE = 'message_type', 'Type of the ROS message', TOPICS.complete_types
KEEP_ALIVE_S = 0.1  # after the last message, so that it is sent
# How long a command waits at most until reliable subscriptions have confirmed its last message. One
# confirms it when it has discovered the publisher, on a busy machine later than it was discovered.
CONFIRMED_S = 2.0
POLICIES = {
    'history': qos.HistoryPolicy,
    'reliability': qos.ReliabilityPolicy,
    'durability': qos.DurabilityPolicy,
    'liveliness': qos.LivelinessPolicy,
}


def _qos_options(default: str) -> list[Argument]:
    """Return the options, with the name of the profile that is meant without them."""
    profiles = {'choices': qos.QoSPresetProfiles.short_keys(), 'default': default}
    return [
        option('--qos-profile', f'Preset profile (default: {default})', **profiles),
        option('--qos-depth', 'Queue size', metavar='N', type=natural),
        *(
            option(f'--qos-{name}', f'The {name}', choices=kind.short_keys())
            for name, kind in POLICIES.items()
        ),
    ]


def _profile(args: argparse.Namespace) -> qos.QoSProfile:
    """Return the quality of service that the options give."""
    chosen = qos.QoSPresetProfiles.get_from_short_key(args.qos_profile)
    for name, kind in POLICIES.items():
        if word := getattr(args, f'qos_{name}'):
            setattr(chosen, name, kind.get_from_short_key(word))
    if args.qos_depth:
        chosen.depth = args.qos_depth
    elif chosen.durability == qos.DurabilityPolicy.TRANSIENT_LOCAL and chosen.depth == 0:
        chosen.depth = 1
    return chosen


@command(
    TOPICS.show_types,
    TOPICS.count,
    TOPICS.hidden_below,
    flag('-v --verbose', 'List full details about each topic'),
)
def _list(args: argparse.Namespace) -> None:
    """Output a list of available topics."""
    if not args.verbose or args.count_topics:
        TOPICS.print_names(args)
        return
    with graph() as opened:
        node = opened.node
        topics = TOPICS.types(node, args.include_hidden_topics)
        for title, word, count in (
            ('Published', 'publisher', node.count_publishers),
            ('Subscribed', 'subscriber', node.count_subscribers),
        ):
            print(f'{title} topics:')
            for name, types in topics.items():
                number = count(name)
                if number > 0:
                    plural = 's' if number > 1 else ''
                    print(f' * {name} [{", ".join(types)}] {number} {word}{plural}')
            print()


@command(TOPICS.name, flag('-v --verbose', 'Print the node, type, GID and QoS of each endpoint'))
def _info(args: argparse.Namespace) -> None:
    """Print information about a topic."""
    name = args.topic_name
    with graph(lambda node: name in TOPICS.types(node)) as opened:
        node = opened.node
        types = TOPICS.types(node).get(name)
        if types is None:
            raise CommandError(f"Unknown topic '{name}'")
        end = '\n\n' if args.verbose else '\n'
        print(f'Type: {types[0] if len(types) == 1 else types}', end=end)
        for title, count, infos in (
            ('Publisher', node.count_publishers, node.get_publishers_info_by_topic),
            ('Subscription', node.count_subscribers, node.get_subscriptions_info_by_topic),
        ):
            print(f'{title} count: {count(name)}', end=end)
            for info in infos(name) if args.verbose else []:
                print(info, end=end)


@command(TOPICS.name)
def _type(args: argparse.Namespace) -> int:
    """Print a topic's type."""
    return TOPICS.print_types(args, args.topic_name)


@command(TOPICS.type, TOPICS.count, TOPICS.hidden_below)
def _find(args: argparse.Namespace) -> None:
    """Output a list of available topics of a given type."""
    TOPICS.print_names(args, args.topic_type)


# --- Listening


@command(
    TOPICS.name,
    option(*TYPE, nargs='?'),
    *_qos_options('sensor_data'),
    flag('--once', 'Print the first message received and then exit'),
    option('--field', "Echo a field of a message, as in 'pose.pose.position'"),
    flag('--csv', 'Output all recursive fields separated by commas'),
    flag('--no-arr', "Don't print array fields of messages"),
    flag('--flow-style', 'Print collections in the flow style'),
    flag('-f --full-length', 'Do not truncate arrays, bytes, and strings'),
    option('-l --truncate-length', 'Cut arrays and texts (at 128)', type=natural, default=128),
)
def _echo(args: argparse.Namespace) -> None:
    """Output messages from a topic."""
    fields = [part for part in (args.field or '').split('.') if part]
    if args.field is not None and not fields:
        raise CommandError(f"Invalid field value '{args.field}'")
    given = None
    if args.message_type is not None:
        given = find_type(args.message_type, 'msg', 'The passed message type is invalid')
    has_shown = False

    def show(message: Any) -> None:
        nonlocal has_shown
        if args.once and has_shown:
            return
        try:
            for field in fields:
                message = getattr(message, field)
        except AttributeError as error:
            raise CommandError(f"Invalid field '{'.'.join(fields)}': {error}") from None
        _print_message(message, args)
        has_shown = True

    with graph(lambda node: given or _has_publisher(node, args.topic_name)) as opened:
        topic = full_name(opened.node, args.topic_name)
        profile = _profile(args)
        if all(getattr(args, f'qos_{name}') is None for name in ('depth', *POLICIES)):
            match(profile, opened.node.get_publishers_info_by_topic(topic))
        class_ = given or _class_of(opened, args.topic_name)
        # If no publisher matches, rclpy says it.
        opened.node.create_subscription(class_, topic, show, profile)
        opened.spin_until(lambda: args.once and has_shown)


def _print_message(message: Any, args: argparse.Namespace) -> None:
    limits = {'truncate_length': None if args.full_length else args.truncate_length}
    limits['no_arr'] = args.no_arr
    if not hasattr(message, 'SLOT_TYPES'):  # a plain value
        print(f'{message}\n---')
    elif args.csv:
        print(to_csv(message, **limits))
    else:
        print(f'{to_yaml(message, args.flow_style, **limits)}---')


def match(profile: Any, publishers: list) -> None:
    """Make a profile as strict as all publishers of a topic allow, and say what it is less."""
    for policy, kind, strict, loose in (
        ('reliability', qos.QoSReliabilityPolicy, 'RELIABLE', 'BEST_EFFORT'),
        ('durability', qos.QoSDurabilityPolicy, 'TRANSIENT_LOCAL', 'VOLATILE'),
    ):
        are_strict = [getattr(info.qos_profile, policy) == kind[strict] for info in publishers]
        if publishers:
            setattr(profile, policy, kind[strict if all(are_strict) else loose])
        if any(are_strict) and not all(are_strict):
            print(
                f'Some, but not all, publishers are offering {kind.__name__}.{strict}. Falling '
                f'back to {kind.__name__}.{loose} as it will connect to all publishers'
            )


def _class_of(opened: Graph, topic: str, wait: bool = False) -> type:
    """Return the class of a topic's messages. Raises CommandError if it has not exactly one."""
    full = full_name(opened.node, topic)

    def types() -> list[str]:
        return TOPICS.types(opened.node).get(full, [])

    if not types():
        print(f'WARNING: topic [{topic}] does not appear to be published yet')
    while wait and not opened.spin_until(types, 0.1):
        pass
    names = types()
    if not names:
        raise CommandError('Could not determine the type for the passed topic')
    if len(names) > 1:
        raise CommandError(
            f"Cannot echo topic '{topic}', as it contains more than one type: [{', '.join(names)}]"
        )
    return find_type(names[0], 'msg', f"The message type '{names[0]}' is invalid")


def _has_publisher(node: Node, topic: str) -> bool:
    return node.count_publishers(full_name(node, topic)) > 0


# --- Measuring


def _measure(
    args: argparse.Namespace,
    window: int,
    value: Callable[[Any, int], Any],
    show: Callable[[list, int], str | None],
    raw: bool = False,
) -> None:
    """Measure each message, and show the last values each second if there is a new one.

    `value` gets the message and the time in ns; if it returns None, the message does not count.
    `show` gets up to `window` values and the time; if it returns None, nothing is printed.
    """
    values: deque = deque(maxlen=window)
    has_news = False

    def hear(message: Any) -> None:
        nonlocal has_news
        new = value(message, clock.now().nanoseconds)
        if new is not None:
            values.append(new)
            has_news = True

    def tick() -> None:
        nonlocal has_news
        if has_news:
            text = show(list(values), clock.now().nanoseconds)
            if text is not None:
                print(text)
        has_news = False

    with graph(lambda node: _has_publisher(node, args.topic_name)) as opened:
        class_ = _class_of(opened, args.topic_name, wait=True)
        clock = opened.node.get_clock()
        topic = full_name(opened.node, args.topic_name)
        opened.node.create_subscription(class_, topic, hear, qos.qos_profile_sensor_data, raw=raw)
        if raw:
            print(f'Subscribed to [{args.topic_name}]')
        opened.node.create_timer(1.0, tick)
        opened.spin_until(lambda: False)


def _statistics(values: list[int], title: str, mean: float) -> str:
    """Return the lines about times in nanoseconds."""
    average = sum(values) / len(values)
    deviation = math.sqrt(sum((value - average) ** 2 for value in values) / len(values))
    return (
        f'{title}: {mean:.3f}\n\tmin: {min(values) * 1e-9:.3f}s max: {max(values) * 1e-9:.3f}s '
        f'std dev: {deviation * 1e-9:.5f}s window: {len(values)}'
    )


@command(TOPICS.name)
def _hz(args: argparse.Namespace) -> None:
    """Print the average publishing rate to screen."""
    last: int | None = None

    def since_last(message: Any, now: int) -> int | None:
        nonlocal last
        before, last = last, now
        return now - before if before is not None and now > before else None

    def show(values: list[int], now: int) -> str:
        return _statistics(values, 'average rate', len(values) / sum(values) * 1e9)

    _measure(args, 10000, since_last, show)


@command(TOPICS.name)
def _delay(args: argparse.Namespace) -> None:
    """Display delay of topic from timestamp in header."""

    def age(message: Any, now: int) -> int:
        if not hasattr(message, 'header'):
            raise CommandError('msg does not have header')
        return now - message.header.stamp.sec * 10**9 - message.header.stamp.nanosec

    def show(values: list[int], now: int) -> str:
        return _statistics(values, 'average delay', sum(values) / len(values) * 1e-9)

    _measure(args, 10000, age, show)


@command(TOPICS.name)
def _bw(args: argparse.Namespace) -> None:
    """Display bandwidth used by topic."""

    def show(values: list[tuple[int, int]], now: int) -> str | None:
        if len(values) < 2:
            return None
        sizes = [size for size, _ in values]
        rate = sum(sizes) / (now - values[0][1]) * 1e9  # in bytes per second
        # All numbers have the unit in which the rate has one to three digits before the point.
        power = min(int(max(math.log10(rate), 0)) // 3, 2)
        unit = ('B', 'KB', 'MB')[power]
        digits = 2 if power else 0

        def text(size: float) -> str:
            return f'{size / 1000**power:.{digits}f} {unit}'

        mean = text(sum(sizes) / len(sizes))
        return (
            f'{text(rate)}/s from {len(sizes)} messages\n'
            f'\tMessage size mean: {mean} min: {text(min(sizes))} max: {text(max(sizes))}'
        )

    _measure(args, 100, lambda message, now: (len(message), now), show, raw=True)


# --- Publishing


@command(
    TOPICS.name,
    option(*TYPE),
    VALUES,
    flag('-1 --once', 'Publish one message and exit'),
    option('-t --times', 'Publish this often, then exit', metavar='N', type=natural, default=0),
    option('-r --rate', 'Rate in Hz (default: 1)', metavar='N', type=positive, default=1.0),
    option('-w --wait-matching-subscriptions', 'How many to wait for', type=natural, metavar='N'),
    *_qos_options('default'),
)
def _pub(args: argparse.Namespace) -> None:
    """Publish a message to a topic."""
    class_ = find_type(args.message_type, 'msg', 'The passed message type is invalid')
    message = filled(class_(), args.values, 'Failed to populate field: {}')
    times = 1 if args.once else args.times  # 0 is without end
    subscriptions = args.wait_matching_subscriptions
    if subscriptions is None:
        subscriptions = 0 if times == 0 else 1
    count = 0
    with graph() as opened:
        topic = full_name(opened.node, args.topic_name)
        publisher = opened.node.create_publisher(class_, topic, _profile(args))
        _wait_for_subscriptions(publisher, subscriptions)
        print('publisher: beginning loop')

        def publish() -> None:
            nonlocal count
            count += 1
            print(f'publishing #{count}: {message!r}\n')
            publisher.publish(message)

        publish()
        if times != 1:
            opened.node.create_timer(1.0 / args.rate, publish)
            opened.spin_until(lambda: times != 0 and count >= times)
        publisher.wait_for_all_acked(Duration(seconds=CONFIRMED_S))
        time.sleep(KEEP_ALIVE_S)


def _wait_for_subscriptions(publisher: Any, wanted: int) -> None:
    def matched() -> bool:
        return publisher.get_subscription_count() >= wanted

    wait_for(matched, 0.1)  # what is there matches at once
    while not matched():
        print(f'Waiting for at least {wanted} matching subscription(s)...')
        wait_for(matched, 1.0)
