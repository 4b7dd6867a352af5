"""Various topic related sub-commands."""

from __future__ import annotations

import argparse
import math
import time
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from helpers.ros2 import _qos
from helpers.ros2._commands import Parser, number
from helpers.ros2._errors import CommandError
from helpers.ros2._graph import Graph, full_name, graph, wait_for
from helpers.ros2._names import Names

if TYPE_CHECKING:
    from rclpy.node import Node

TOPICS = Names('topic', 'msg', lambda node: node.get_topic_names_and_types())
FILTER = 'Only messages `m` for which this Python expression holds'


def add_arguments(parser: Parser) -> None:
    """Add the commands below `ros2 topic`."""
    parser.flag(*TOPICS.hidden_flag)
    functions = _list, _info, _type, _find, _echo, _hz, _bw, _delay, _pub
    commands = listing, info, type_, find, echo, hz, bw, delay, pub = parser.functions(*functions)
    for command in commands:
        command.graph_options()
    for command in (listing, find):
        TOPICS.add_listing(command)
    for command in (info, type_, echo, hz, bw, delay, pub):
        command.option('topic_name', "Name of the ROS topic (e.g. '/chatter')", TOPICS.complete)
    listing.flag('-t --show-types', 'Additionally show the topic type')
    listing.flag('-v --verbose', 'List full details about each topic')
    info.flag('-v --verbose', 'Print the node, type, GID and QoS of each endpoint')
    find.option('topic_type', 'Name of the ROS topic type to filter for', TOPICS.complete_types)
    for command, window in (hz, 10000), (bw, 100), (delay, 10000):
        help_ = f'Window size, in number of messages (default: {window})'
        command.option('-w --window', help_, type=number(int, 1), default=window)
    hz.option('--filter', FILTER, metavar='EXPR')
    hz.flag('--wall-time', 'Calculate the rate using wall time')
    _add_echo_arguments(echo)
    _add_pub_arguments(pub)


def _add_echo_arguments(echo: Parser) -> None:
    echo.option('message_type', 'Type of the ROS message', TOPICS.complete_types, nargs='?')
    _qos.add_qos_arguments(echo, 'sensor_data')
    echo.flag('--csv', 'Output all recursive fields separated by commas')
    echo.option('--field', "Echo a field of a message, as in 'pose.pose.position'")
    echo.flag('-f --full-length', 'Do not truncate arrays, bytes, and strings')
    help_ = 'The length to truncate arrays, bytes, and strings to (default: 128)'
    echo.option('-l --truncate-length', help_, type=number(int, 0), default=128)
    echo.flag('--no-arr', "Don't print array fields of messages")
    echo.flag('--no-str', "Don't print string fields of messages")
    echo.flag('--flow-style', 'Print collections in the flow style')
    echo.flag('--no-lost-messages', "Don't report when a message is lost")
    echo.flag('--raw', 'Echo the raw binary representation')
    echo.option('--filter', FILTER, metavar='EXPR')
    echo.flag('--once', 'Print the first message received and then exit')
    echo.option('--timeout', 'Seconds to wait', metavar='N', type=number(float, 0, above=True))
    echo.flag('-i --include-message-info', 'Shows the associated message info')


def _add_pub_arguments(pub: Parser) -> None:
    positive = number(float, 0, above=True)
    pub.option('message_type', 'Type of the ROS message', TOPICS.complete_types)
    pub.values('values', "Values of the message in YAML (e.g. 'data: Hello World')")
    pub.option('-r --rate', 'Rate in Hz (default: 1)', metavar='N', type=positive, default=1.0)
    pub.option('-p --print', 'Only print every N-th message', metavar='N', type=int, default=1)
    pub.flag('-1 --once', 'Publish one message and exit')
    pub.option('-t --times', 'Publish this often, then exit', type=number(int, 0), default=0)
    help_ = 'Wait for N subscriptions (default: 1 with --once or --times, otherwise 0)'
    pub.option('-w --wait-matching-subscriptions', help_, metavar='N', type=number(int, 0))
    pub.option('--max-wait-time-secs', 'The longest wait for them', metavar='N', type=positive)
    help_ = 'Seconds to live after the last message (default: 0.1)'
    pub.option('--keep-alive', help_, metavar='N', type=positive, default=0.1)
    pub.option('-n --node-name', 'Name of the created publishing node')
    _qos.add_qos_arguments(pub, 'default')


def _list(args: argparse.Namespace) -> None:
    """Output a list of available topics."""
    if not args.verbose or args.count_topics:
        TOPICS.list(args)
        return
    with graph(args) as opened:
        node = opened.node
        topics = TOPICS.types(node, args.include_hidden_topics)
        for title, word, count in (
            ('Published', 'publisher', node.count_publishers),
            ('Subscribed', 'subscriber', node.count_subscribers),
        ):
            print(f'{title} topics:')
            for name, types in topics.items():
                if (n := count(name)) > 0:
                    print(f' * {name} [{", ".join(types)}] {n} {word}{"s" if n > 1 else ""}')
            print()


def _info(args: argparse.Namespace) -> None:
    """Print information about a topic."""
    name = args.topic_name
    with graph(args, lambda node: name in TOPICS.types(node)) as opened:
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


def _type(args: argparse.Namespace) -> int:
    """Print a topic's type."""
    return TOPICS.type(args, args.topic_name)


def _find(args: argparse.Namespace) -> None:
    """Output a list of available topics of a given type."""
    TOPICS.find(args, args.topic_type)


# --- Listening


def _echo(args: argparse.Namespace) -> None:
    """Output messages from a topic."""
    from helpers.ros2._values import find_type

    fields = [part for part in (args.field or '').split('.') if part]
    if args.field is not None and not fields:
        raise CommandError(f"Invalid field value '{args.field}'")
    keep, shown = _filter(args.filter), []

    def show(message: Any, info: dict) -> None:
        if args.once and shown:
            return
        try:
            for field in fields:
                message = getattr(message, field)
        except AttributeError as error:
            raise CommandError(f"Invalid field '{'.'.join(fields)}': {error}") from None
        if keep(message):
            shown[:] = [True]
            _print_message(message, info, args)

    given = args.message_type
    if given is not None:
        given = find_type(given, 'msg', 'The passed message type is invalid')
    with graph(args, lambda node: given or _count(node, args)) as opened:
        node = opened.node
        topic = full_name(node, args.topic_name)
        qos = _qos.profile(args) if _qos.is_set(args) else _matching(node, topic, args)
        class_ = given or _class_of(opened, args.topic_name)
        _subscribe(node, class_, topic, show, qos, args.raw, say_lost=not args.no_lost_messages)
        opened.spin_until(lambda: args.once and shown, args.timeout or math.inf)


def _print_message(message: Any, info: dict, args: argparse.Namespace) -> None:
    import yaml

    from helpers.ros2._values import to_csv, to_yaml

    limits = {'no_arr': args.no_arr, 'no_str': args.no_str}
    limits['truncate_length'] = None if args.full_length else args.truncate_length
    with_info = args.include_message_info
    if not hasattr(message, '__slots__'):  # a plain value, or raw
        head = f'---Got new message, message info:---\n{info}\n---Message data:---\n'
        print(f'{head if with_info else ""}{message}\n---')
    elif args.csv:
        print(*(info.values() if with_info else []), to_csv(message, **limits), sep=',')
    else:
        head = f'{yaml.dump(info)}---\n' if with_info else ''
        print(f'{head}{to_yaml(message, args.flow_style, **limits)}---')


def _matching(node: Node, topic: str, args: argparse.Namespace) -> Any:
    """Return the profile of the options, as strict as all publishers of the topic allow."""
    from rclpy import qos

    chosen = _qos.profile(args)
    offered = [info.qos_profile for info in node.get_publishers_info_by_topic(topic)]
    for policy, kind, strict, loose in (
        ('reliability', qos.QoSReliabilityPolicy, 'RELIABLE', 'BEST_EFFORT'),
        ('durability', qos.QoSDurabilityPolicy, 'TRANSIENT_LOCAL', 'VOLATILE'),
    ):
        are_strict = [getattr(one, policy) == kind[strict] for one in offered]
        if offered:
            setattr(chosen, policy, kind[strict if all(are_strict) else loose])
        if any(are_strict) and not all(are_strict):
            print(
                f'Some, but not all, publishers are offering {kind.__name__}.{strict}. Falling '
                f'back to {kind.__name__}.{loose} as it will connect to all publishers'
            )
    return chosen


def _class_of(opened: Graph, topic: str, wait: bool = False) -> type:
    """Return the class of a topic's messages. Raises CommandError if it has not exactly one."""
    from helpers.ros2._values import find_type

    full = full_name(opened.node, topic)

    def types() -> list[str]:
        return TOPICS.types(opened.node).get(full, [])

    if not types():
        print(f'WARNING: topic [{topic}] does not appear to be published yet')
    while wait and not opened.spin_until(types, 0.1):
        pass
    found = types()
    if not found:
        raise CommandError('Could not determine the type for the passed topic')
    if len(found) > 1:
        one_only = f"Cannot echo topic '{topic}', as it contains more than one type"
        raise CommandError(f'{one_only}: [{", ".join(found)}]')
    return find_type(found[0], 'msg', f"The message type '{found[0]}' is invalid")


def _count(node: Node, args: argparse.Namespace) -> int:
    return node.count_publishers(full_name(node, args.topic_name))


def _filter(expression: str | None) -> Callable[[Any], Any]:
    """Return a function of the message. Raises CommandError if it is no expression."""
    try:
        code = compile(expression or 'True', '--filter', 'eval')
    except SyntaxError as error:
        raise CommandError(f'The filter is not an expression of Python: {error.msg}') from None
    return lambda m: eval(code, {'m': m})


def _subscribe(
    node: Node,
    class_: type,
    topic: str,
    callback: Callable,
    qos: Any,
    raw: bool,
    say_lost: bool = False,
) -> None:
    from rclpy.event_handler import SubscriptionEventCallbacks

    def lost(status: Any) -> None:
        print(f'A message was lost!!!\n\ttotal count change:{status.total_count_change}')
        print(f'\ttotal count: {status.total_count}---')

    # If no publisher matches, rclpy's own callback says it.
    events = SubscriptionEventCallbacks(message_lost=lost if say_lost else None)
    node.create_subscription(class_, topic, callback, qos, event_callbacks=events, raw=raw)


# --- Measuring


def _measure(
    args: argparse.Namespace,
    value: Callable[[Any, int], Any],
    show: Callable[[list, int], str | None],
    raw: bool = False,
    quiet: str | None = None,
) -> None:
    """Collect a value of each message and the time in ns, and show the last ones each second.

    A value that is None does not count. If nothing new has come, `quiet` is printed.
    """
    from rclpy.qos import qos_profile_sensor_data

    window, fresh = deque(maxlen=args.window), []

    def hear(message: Any) -> None:
        if (new := value(message, clock.now().nanoseconds)) is not None:
            window.append(new)
            fresh[:] = [True]

    def tick() -> None:
        if window and (fresh or raw):
            text = show(list(window), clock.now().nanoseconds)
            print(text) if text else None
        elif window and quiet:
            print(quiet)
        fresh.clear()

    with graph(args, lambda node: _count(node, args)) as opened:
        class_, clock = _class_of(opened, args.topic_name, wait=True), opened.node.get_clock()
        topic = full_name(opened.node, args.topic_name)
        _subscribe(opened.node, class_, topic, hear, qos_profile_sensor_data, raw)
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


def _hz(args: argparse.Namespace) -> None:
    """Print the average publishing rate to screen."""
    keep, last = _filter(args.filter), []

    def since_last(message: Any, now: int) -> int | None:
        now = time.time_ns() if args.wall_time else now
        if not keep(message):
            return None
        before = last[0] if last else now
        last[:] = [now]
        return now - before if now > before else None

    def show(values: list[int], now: int) -> str:
        return _statistics(values, 'average rate', len(values) / sum(values) * 1e9)

    _measure(args, since_last, show)


def _delay(args: argparse.Namespace) -> None:
    """Display delay of topic from timestamp in header."""

    def age(message: Any, now: int) -> int:
        if not hasattr(message, 'header'):
            raise CommandError('msg does not have header')
        return now - message.header.stamp.sec * 10**9 - message.header.stamp.nanosec

    def show(values: list[int], now: int) -> str:
        return _statistics(values, 'average delay', sum(values) / len(values) * 1e-9)

    _measure(args, age, show, quiet='no new messages')


def _bw(args: argparse.Namespace) -> None:
    """Display bandwidth used by topic."""

    def show(values: list[tuple[int, int]], now: int) -> str | None:
        if len(values) < 2:
            return None
        sizes = [size for size, _ in values]
        rate = sum(sizes) / (now - values[0][1]) * 1e9
        power = min(int(max(math.log10(rate), 0)) // 3, 2)
        unit, digits = ('B', 'KB', 'MB')[power], 2 if power else 0
        numbers = rate, sum(sizes) / len(sizes), min(sizes), max(sizes)
        rate, mean, least, most = (f'{n / 1000**power:.{digits}f} {unit}' for n in numbers)
        size = f'\tMessage size mean: {mean} min: {least} max: {most}'
        return f'{rate}/s from {len(sizes)} messages\n{size}'

    _measure(args, lambda message, now: (len(message), now), show, raw=True)


# --- Publishing


def _pub(args: argparse.Namespace) -> None:
    """Publish a message to a topic."""
    from helpers.ros2._values import filled, find_type

    class_ = find_type(args.message_type, 'msg', 'The passed message type is invalid')
    failed = 'Failed to populate field: {}'
    message, stamps = filled(class_(), args.values, failed, stamps=True)
    times = 1 if args.once else args.times
    wanted = args.wait_matching_subscriptions
    wanted = int(times != 0) if wanted is None else wanted
    if wanted == 0 and args.max_wait_time_secs is not None:
        only = '--wait-matching-subscriptions, --once or --times'
        raise CommandError(f'--max-wait-time-secs option is only effective with {only}')
    with graph(args, name=args.node_name) as opened:
        node, count = opened.node, 0
        topic = full_name(node, args.topic_name)
        publisher = node.create_publisher(class_, topic, _qos.profile(args))
        _wait_for_subscriptions(publisher, wanted, args.max_wait_time_secs or math.inf)
        print('publisher: beginning loop')

        def publish() -> None:
            nonlocal count
            for set_stamp in stamps:
                set_stamp(node.get_clock().now().to_msg())
            count += 1
            if args.print and count % args.print == 0:
                print(f'publishing #{count}: {message!r}\n')
            publisher.publish(message)

        publish()
        if times != 1:
            node.create_timer(1.0 / args.rate, publish)
            opened.spin_until(lambda: times and count >= times)
        time.sleep(args.keep_alive)


def _wait_for_subscriptions(publisher: Any, wanted: int, longest_s: float) -> None:
    def matched() -> bool:
        return publisher.get_subscription_count() >= wanted

    end = time.monotonic() + longest_s
    wait_for(matched, min(0.1, longest_s))  # what is there matches at once
    while not matched():
        print(f'Waiting for at least {wanted} matching subscription(s)...')
        if not wait_for(matched, min(1.0, end - time.monotonic())) and time.monotonic() >= end:
            raise CommandError(
                f'Timed out waiting for subscribers: Expected {wanted} subcribers but only got '
                f'{publisher.get_subscription_count()} subscribers'
            )
