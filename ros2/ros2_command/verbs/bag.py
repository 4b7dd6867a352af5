"""Various rosbag related sub-commands."""

from __future__ import annotations

import argparse
import contextlib
import datetime
import os
import re
import signal
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import Reader, ReaderError, StoragePlugin, Writer
from rosbags.rosbag2.metadata import parse_qos
from rosgraph_msgs.msg import Clock

from ros2_command.commands import CommandError, command, flag, option, positive
from ros2_command.discovery import wait_for
from ros2_command.graph import Graph, full_name, graph
from ros2_command.interfaces import interface_file
from ros2_command.names import is_hidden
from ros2_command.values import find_type
from ros2_command.verbs.topic import TOPICS, match

POLL_S = 0.1  # between two looks for new topics, as the real command
FLUSH_S = 1.0  # of a recording that is killed at most so much is lost
WAIT_S = 1.0  # for subscribers, before the first message and after the last
CLOCK_HZ = 40.0
# Fast DDS does not say which depth was offered. Of the last value a late subscriber gets these.
DEPTH, LATCHED_DEPTH = 1000, 10
MAX_NS = 2**63 - 1
UNKNOWN = "the type '{}' is not installed, nor in a sourced workspace"


def _existing(text: str) -> Path:
    if not os.path.exists(text):
        raise argparse.ArgumentTypeError(f"Bag path '{text}' does not exist!")
    return Path(text)


PATH = option('bag_path', 'Folder of the bag, or its file', type=_existing)


@contextlib.contextmanager
def _until_interrupted() -> Iterator[threading.Event]:
    """Yield an event that is set by Ctrl+C and the like: nothing is interrupted half done."""
    event = threading.Event()
    numbers = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:  # by nohup, which then counts
        numbers.remove(signal.SIGHUP)
    before = {number: signal.signal(number, lambda *_: event.set()) for number in numbers}
    try:
        yield event
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


# --- record ---


@command(
    option('topics_positional', 'Topics to record', TOPICS.complete, nargs='*', metavar='topic'),
    option('--topics', 'Topics to record', TOPICS.complete, nargs='+', default=[], metavar='topic'),
    flag('-a --all --all-topics', 'Record all topics, but no hidden ones'),
    option('-o --output', 'Folder to create'),
    option('-s --storage', 'How it is stored', choices=['mcap'], default='mcap'),
)
def _record(args: argparse.Namespace) -> None:
    """Record ROS data to a bag."""
    topics = [*args.topics, *args.topics_positional]
    if not topics and not args.all:
        raise CommandError(
            '[ERROR] [ros2bag]: Need to specify at least one option out of --all, --all-topics, '
            '--topics'
        )
    now = datetime.datetime.now()
    folder = Path(args.output or now.strftime('rosbag2_%Y_%m_%d-%H_%M_%S'))
    if folder.exists():
        raise CommandError(f"[ERROR] [ros2bag]: Output folder '{folder}' already exists.")
    writer = Writer(folder, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP)
    try:
        with graph(name='rosbag2_recorder') as opened, _until_interrupted() as end:
            wanted = {full_name(opened.node, topic) for topic in topics}
            with writer:
                _Recorder(writer, opened, None if args.all else wanted).run(end)
    except OSError as error:
        sentence = f"The recording has ended, as the bag '{folder}' cannot be written"
        if not folder.exists():
            sentence = f"Could not create bag folder '{folder}'"
        raise CommandError(f'[ERROR] [ros2bag]: {sentence}: {error.strerror}.') from None


class _Recorder:
    """Subscribes to topics as soon as somebody publishes them, and writes what comes."""

    def __init__(self, writer: Any, opened: Graph, topics: set[str] | None):
        self.writer, self.graph, self.node, self.topics = writer, opened, opened.node, topics
        self.logger = opened.node.get_logger()
        self.seen: set[str] = set()
        self.count = 0
        self.last_ns = MAX_NS

    def run(self, end: threading.Event) -> None:
        """Record until the end."""
        self.logger.info('Listening for topics...')
        self.subscribe()
        self.logger.info('Recording...')
        flushed = time.monotonic()
        while not self.graph.spin_until(end.is_set, POLL_S):
            self.subscribe()
            if time.monotonic() - flushed >= FLUSH_S:
                self.flush()
                flushed = time.monotonic()
        self.last_ns = time.time_ns()
        count = -1
        while count != self.count:  # what has arrived is taken
            count = self.count
            self.graph.spin_until(lambda: False, POLL_S)
        self.logger.info('Recording stopped')
        for topic in sorted((self.topics or set()) - self.seen):
            self.logger.warning(f"Nobody published '{topic}': nothing of it is in the bag.")

    def subscribe(self) -> None:
        """Look for new topics."""
        for topic, types in self.node.get_topic_names_and_types():
            wanted = topic in self.topics if self.topics else not is_hidden(topic)
            if not wanted or topic in self.seen:
                continue
            if publishers := self.node.get_publishers_info_by_topic(topic):
                self.seen.add(topic)
                try:
                    self.subscribe_to(topic, types, publishers)
                except CommandError as error:
                    self.logger.warning(f"Ignoring a topic '{topic}', reason: {error}.")

    def subscribe_to(self, topic: str, types: list[str], publishers: list) -> None:
        """Subscribe to one topic, with a QoS that hears all its publishers of now."""
        if len(types) != 1:
            raise CommandError(f'it has several types, {", ".join(types)}')
        message_class = find_type(types[0], 'msg', UNKNOWN.format(types[0]))
        connection = self.writer.add_connection(
            topic,
            types[0],
            msgdef=_definition(types[0]),
            rihs01=str(publishers[0].topic_type_hash),
            offered_qos_profiles=[_to_bag(info.qos_profile) for info in publishers],
        )

        def write(data: bytes, info: dict[str, int]) -> None:
            if info['received_timestamp'] <= self.last_ns:
                self.writer.write(connection, info['received_timestamp'], data)
                self.count += 1

        qos = QoSProfile(history=HistoryPolicy.KEEP_ALL)
        match(qos, publishers)
        self.node.create_subscription(message_class, topic, write, qos, raw=True)
        self.logger.info(f"Subscribed to topic '{topic}'")

    def flush(self) -> None:
        """Have what came until now on the disk."""
        storage = self.writer.storage
        if storage.chunk.msgs:
            storage.close_chunk()
        storage.bio.flush()


def _definition(name: str) -> str:
    """Return the .msg file of a message and of all that it is made of, as a bag holds them."""
    texts: dict[str, str] = {}

    def collect(name: str) -> None:
        package, short = name.split('/')[0], name.split('/')[-1]
        name = f'{package}/msg/{short}'
        texts[f'{package}/{short}'] = interface_file(name).read_text(encoding='utf-8')
        for kind in find_type(name, 'msg', name).get_fields_and_field_types().values():
            if (inner := re.search(r'\w+/\w+', kind)) and inner[0] not in texts:
                collect(inner[0])

    try:
        collect(name)
    except (OSError, CommandError):
        return ''  # of an interface without a .msg file: a bag without the text can be played
    first, *others = texts.items()
    return first[1] + ''.join(f'\n{"=" * 80}\nMSG: {name}\n{text}' for name, text in others)


def _to_bag(profile: Any) -> Any:
    """Return a QoS as a bag holds it."""
    values = profile.get_c_qos_profile().to_dict()
    for name in ('deadline', 'lifespan', 'liveliness_lease_duration'):
        sec, nsec = divmod(values[name].nanoseconds, 10**9)
        values[name] = {'sec': sec, 'nsec': nsec}
    return parse_qos([values])[0]


def _from_bag(profiles: list) -> Any:
    """Return a QoS that offers all that was offered when the bag was recorded."""
    if not profiles:
        return QoSProfile(depth=DEPTH)

    def longest(name: str) -> Duration:
        times = [getattr(profile, name) for profile in profiles]
        longest_ns = max(duration.sec * 10**9 + duration.nsec for duration in times)
        return Duration(nanoseconds=min(MAX_NS, longest_ns))

    is_best_effort = all(profile.reliability.name == 'BEST_EFFORT' for profile in profiles)
    is_latched = any(profile.durability.name == 'TRANSIENT_LOCAL' for profile in profiles)
    depth = max(profile.depth for profile in profiles)
    return QoSProfile(
        depth=depth or (LATCHED_DEPTH if is_latched else DEPTH),
        reliability=(
            ReliabilityPolicy.BEST_EFFORT if is_best_effort else ReliabilityPolicy.RELIABLE
        ),
        durability=DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE,
        deadline=longest('deadline'),
        lifespan=longest('lifespan'),
    )


# --- read ---


@dataclass
class _Topic:
    """What a bag says about a topic."""

    type: str
    serialization: str
    offered: list  # the QoS of each publisher, as rosbags has it
    count: int = 0


@dataclass
class _Bag:
    """What a bag holds. Times are in nanoseconds since 1970."""

    files: list[Path]
    messages: Callable[[], Iterator[tuple[str, int, bytes]]]  # each: topic, time, bytes
    topics: dict[str, _Topic] = field(default_factory=dict)
    start: int = 0
    end: int = 0
    distro: str = 'unknown'


@contextlib.contextmanager
def _open(path: Path) -> Iterator[_Bag]:
    """Open a bag, or what is whole of it if its recorder was killed."""
    files = [path] if path.is_file() else sorted([*path.glob('*.mcap'), *path.glob('*.db3')])
    if not files:
        raise CommandError(f"'{path}' is no bag: there is no .mcap and no .db3 file in it.")
    whole = path.is_file() or (path / 'metadata.yaml').exists()
    try:
        reader = Reader(path if whole else files[0])
        reader.open()
    except Exception as error:  # of a damaged file, and there are many kinds
        bag = _salvage(files)
        if not bag.topics:
            raise CommandError(f"the bag '{path}' cannot be read: {error}") from None
        count = sum(topic.count for topic in bag.topics.values())
        message = f"[WARN] [ros2bag]: '{path}' is cut off: {count} messages of it can be read."
        print(message, file=sys.stderr)
        yield bag
        return
    bag = _Bag(files, lambda: ((c.topic, stamp, data) for c, stamp, data in reader.messages()))
    bag.distro = reader.ros_distro or 'unknown'
    if reader.message_count:
        bag.start, bag.end = reader.start_time, reader.end_time - 1
    for connection in reader.connections:
        new = _Topic(connection.msgtype, connection.ext.serialization_format, [])
        topic = bag.topics.setdefault(connection.topic, new)
        topic.offered += connection.ext.offered_qos_profiles
        topic.count += connection.msgcount
    try:
        yield bag
    except ReaderError as error:
        raise CommandError(f"the bag '{path}' cannot be read to its end: {error}") from None
    finally:
        reader.close()


def _salvage(files: list[Path]) -> _Bag:
    """Return what can be read of MCAP files, one record after the other."""
    bag = _Bag(files, lambda: ((c.topic, m.log_time, m.data) for _, c, m in _records(files)))
    stamps = []
    for schema, channel, message in _records(files):
        if channel.topic not in bag.topics:
            offered = parse_qos(channel.metadata.get('offered_qos_profiles', ''))
            new = _Topic(schema.name, channel.message_encoding, offered)
            bag.topics[channel.topic] = new
        bag.topics[channel.topic].count += 1
        stamps.append(message.log_time)
    if stamps:
        bag.start, bag.end = min(stamps), max(stamps)
    return bag


def _records(files: list[Path]) -> Iterator[tuple]:
    """Yield (schema, channel, message) as long as the records of a file are whole."""
    for file in files:
        with file.open('rb') as stream, contextlib.suppress(McapError, struct.error, ValueError):
            yield from NonSeekingReader(stream).iter_messages(log_time_order=False)


# --- info ---


@command(PATH)
def _info(args: argparse.Namespace) -> None:
    """Print information about a bag to the screen."""
    path, below = args.bag_path, '\n' + ' ' * 19
    size = sum(file.stat().st_size for file in (path.iterdir() if path.is_dir() else [path]))
    with _open(path) as bag:
        topics = [
            f'Topic: {name} | Type: {topic.type} | Count: {topic.count} | '
            f'Serialization Format: {topic.serialization}'
            for name, topic in bag.topics.items()
        ]
        rows = {
            'Files:': below.join(file.name for file in bag.files),
            'Bag size:': _size(size),
            'Storage id:': 'sqlite3' if bag.files[0].suffix == '.db3' else 'mcap',
            'ROS Distro:': bag.distro,
            'Duration:': f'{_seconds(bag.end - bag.start)}s',
            'Start:': _moment(bag.start),
            'End:': _moment(bag.end),
            'Messages:': sum(topic.count for topic in bag.topics.values()),
            'Topic information:': below.join(topics),
            'Service:': 0,
        }
    print()
    for name, value in rows.items():
        print(f'{name:19}{value}')
    print('Service information: ')


def _size(size: float) -> str:
    if size < 1024:
        return f'{size} B'
    units = iter(('KiB', 'MiB', 'GiB', 'TiB'))
    while size >= 1024:
        size, unit = size / 1024, next(units)
    return f'{size:.1f} {unit}'


def _seconds(ns: int) -> str:
    return f'{ns // 10**9}.{ns % 10**9:09}'


def _moment(ns: int) -> str:
    date = time.strftime('%b %e %Y %H:%M:%S', time.localtime(ns // 10**9))
    return f'{date}.{ns % 10**9:09} ({_seconds(ns)})'


# --- play ---


@command(
    option('-r --rate', 'How many times as fast', type=positive, default=1.0),
    flag('-l --loop', 'Begin again at the end'),
    option('--topics', 'Topics to play', nargs='+', default=[], metavar='topic'),
    option('--clock', 'Publish /clock, in Hz', type=positive, nargs='?', const=CLOCK_HZ),
    PATH,
)
def _play(args: argparse.Namespace) -> None:
    """Play back ROS data from a bag."""
    with (
        _open(args.bag_path) as bag,
        graph(name='rosbag2_player') as opened,
        _until_interrupted() as end,
    ):
        node, messages = opened.node, bag.messages
        if args.clock:
            bag.topics.pop('/clock', None)
        publishers = _publishers(bag, node, {full_name(node, topic) for topic in args.topics})
        if args.clock:
            publishers['/clock'] = _clock(node)
            step_ns = int(1e9 * args.rate / args.clock)
            messages = partial(_with_clock, bag.messages, step_ns)

        def is_matched() -> bool:
            return end.is_set() or all(
                publisher.get_subscription_count() >= node.count_subscribers(topic)
                for topic, publisher in publishers.items()
            )

        # For those that are there. What cannot match is not waited for longer.
        wait_for(is_matched, WAIT_S)
        while not end.is_set():
            began = time.monotonic()
            for topic, stamp, data in messages():
                due = began + (stamp - bag.start) / 1e9 / args.rate
                if end.wait(max(0.0, due - time.monotonic())):
                    return
                if topic in publishers:
                    publishers[topic].publish(data)
            if not args.loop:
                break
        for publisher in [] if end.is_set() else publishers.values():
            publisher.wait_for_all_acked(Duration(seconds=WAIT_S))


def _publishers(bag: _Bag, node: Any, asked: set[str]) -> dict[str, Any]:
    """Return a publisher for each topic, or for those that are asked for."""
    if missing := asked - bag.topics.keys():
        names = ', '.join(sorted(bag.topics))
        raise CommandError(f"there is no topic '{min(missing)}' in the bag: it has {names}.")
    publishers = {}
    for name in asked or bag.topics:
        topic = bag.topics[name]
        try:
            message_class = find_type(topic.type, 'msg', UNKNOWN.format(topic.type))
        except CommandError as error:
            node.get_logger().warning(f"Ignoring a topic '{name}', reason: {error}.")
            continue
        publishers[name] = node.create_publisher(message_class, name, _from_bag(topic.offered))
    return publishers


def _clock(node: Any) -> Any:
    """Return a publisher of the time."""
    qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    return node.create_publisher(Clock, '/clock', qos)


def _with_clock(messages: Callable[[], Iterator], step_ns: int) -> Iterator:
    """Yield the messages, and between them the time on /clock, instead of what the bag has."""
    tick = None
    for topic, stamp, data in messages():
        tick = stamp if tick is None else tick
        while tick <= stamp:
            time_ = Clock()
            time_.clock.sec, time_.clock.nanosec = divmod(tick, 10**9)
            yield '/clock', tick, serialize_message(time_)
            tick += step_ns
        if topic != '/clock':
            yield topic, stamp, data
