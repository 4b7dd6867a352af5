"""Various rosbag related sub-commands."""

from __future__ import annotations

import argparse
import contextlib
import datetime
import itertools
import os
import re
import signal
import struct
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from helpers.ros2 import _index
from helpers.ros2._commands import Parser, number
from helpers.ros2._errors import CommandError
from helpers.ros2._graph import Graph, full_name, graph, wait_for
from helpers.ros2._names import is_hidden
from helpers.ros2._values import find_type
from helpers.ros2.topic import TOPICS

POLL_S = 0.1  # between two looks for new topics, as the real command
FLUSH_S = 1.0  # of a recording that is killed at most so much is lost
WAIT_S = 1.0  # for subscribers, before the first message and after the last
CLOCK_HZ = 40.0
# Fast DDS does not say which depth was offered. Of the last value a late subscriber gets these.
DEPTH, LATCHED_DEPTH = 1000, 10
MAX_NS = 2**63 - 1
UNKNOWN = "the type '{}' is not installed, nor in a sourced workspace"


def add_arguments(parser: Parser) -> None:
    """Add the commands below `ros2 bag`."""
    record, play, info = parser.functions(_record, _play, _info)
    topics = {'complete': TOPICS.complete, 'default': [], 'metavar': 'topic'}
    record.option('topics_positional', 'Topics to record', nargs='*', **topics)
    record.option('--topics', 'Topics to record', nargs='+', **topics)
    record.flag('-a --all --all-topics', 'Record all topics, but no hidden ones')
    record.option('-o --output', 'Folder to create')
    record.option('-s --storage', 'How it is stored', choices=['mcap'], default='mcap')
    positive = number(float, 0.0, above=True)
    play.option('-r --rate', 'How many times as fast', type=positive, default=1.0)
    play.flag('-l --loop', 'Begin again at the end')
    play.option('-d --delay', 'Seconds to wait before', type=number(float, 0.0), default=0.0)
    play.option('--topics', 'Topics to play', nargs='+', default=[], metavar='topic')
    remap = {'nargs': '+', 'type': _renamed, 'default': [], 'metavar': 'old:=new'}
    play.option('-m --remap', 'Topics to publish under another name', **remap)
    play.option(
        '--clock', 'Publish /clock, so often a second', type=positive, nargs='?', const=CLOCK_HZ
    )
    info.flag('-t --topic-name', 'Print only the topics')
    for command in (play, info):
        command.option('bag_path', 'Folder of the bag, or its file', type=_existing)


def _existing(text: str) -> Path:
    if not os.path.exists(text):
        raise argparse.ArgumentTypeError(f"Bag path '{text}' does not exist!")
    return Path(text)


def _renamed(text: str) -> list[str]:
    old, _, new = text.partition(':=')
    if not old or not new:
        raise argparse.ArgumentTypeError(f"'{text}' is not of the form old_topic:=new_topic")
    return [old, new]


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


def _record(args: argparse.Namespace) -> None:
    """Record ROS data to a bag."""
    from rosbags.rosbag2 import StoragePlugin, Writer

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
        with graph(args, name='rosbag2_recorder') as opened, _until_interrupted() as end:
            wanted = {full_name(opened.node, topic) for topic in topics}
            with writer:
                _Recorder(writer, opened, None if args.all else wanted).run(end)
    except OSError as error:
        what = f"The recording has ended, as the bag '{folder}' cannot be written"
        if not folder.exists():
            what = f"Could not create bag folder '{folder}'"
        raise CommandError(f'[ERROR] [ros2bag]: {what}: {error.strerror}.') from None


class _Recorder:
    """Subscribes to topics as soon as somebody publishes them, and writes what comes."""

    def __init__(self, writer: Any, opened: Graph, topics: set[str] | None):
        self.writer, self.graph, self.node, self.topics = writer, opened, opened.node, topics
        self.seen: set[str] = set()
        self.count = 0
        self.last_ns = MAX_NS

    def run(self, end: threading.Event) -> None:
        """Record until the end."""
        logger = self.node.get_logger()
        logger.info('Listening for topics...')
        self.subscribe()
        logger.info('Recording...')
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
        logger.info('Recording stopped')
        for topic in sorted((self.topics or set()) - self.seen):
            logger.warning(f"Nobody published '{topic}': nothing of it is in the bag.")

    def subscribe(self) -> None:
        """Look for new topics."""
        for topic, types in self.node.get_topic_names_and_types():
            wanted = topic in self.topics if self.topics else not is_hidden(topic)
            if wanted and topic not in self.seen:
                publishers = self.node.get_publishers_info_by_topic(topic)
                if publishers:
                    self.seen.add(topic)
                    self.subscribe_to(topic, types, publishers)

    def subscribe_to(self, topic: str, types: list[str], publishers: list) -> None:
        """Subscribe to one topic, with a QoS that hears all its publishers of now."""
        from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

        logger = self.node.get_logger()
        try:
            if len(types) != 1:
                raise ValueError(f'it has several types, {", ".join(types)}')
            message_class = find_type(types[0], 'msg', UNKNOWN.format(types[0]))
        except (ValueError, CommandError) as error:
            logger.warning(f"Ignoring a topic '{topic}', reason: {error}.")
            return
        profiles = [publisher.qos_profile for publisher in publishers]
        reliable = all(p.reliability == ReliabilityPolicy.RELIABLE for p in profiles)
        latched = all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in profiles)
        connection = self.writer.add_connection(
            topic,
            types[0],
            msgdef=_definition(types[0], message_class),
            rihs01=str(publishers[0].topic_type_hash),
            offered_qos_profiles=[_to_bag(profile) for profile in profiles],
        )

        def write(data: bytes, info: dict[str, int]) -> None:
            if info['received_timestamp'] <= self.last_ns:
                self.writer.write(connection, info['received_timestamp'], data)
                self.count += 1

        qos = QoSProfile(
            history=HistoryPolicy.KEEP_ALL,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )
        self.node.create_subscription(message_class, topic, write, qos, raw=True)
        logger.info(f"Subscribed to topic '{topic}'")

    def flush(self) -> None:
        """Have what came until now on the disk."""
        storage = self.writer.storage
        if storage.chunk.msgs:
            storage.close_chunk()
        storage.bio.flush()


def _definition(name: str, message_class: type) -> str:
    """The .msg file of a message and of all that it is made of, as a bag holds them."""
    texts: dict[str, str] = {}

    def collect(name: str, message_class: type) -> None:
        package, short = name.split('/')[0], name.split('/')[-1]
        file = _index.prefix_of(package) / 'share' / package / 'msg' / f'{short}.msg'
        texts[f'{package}/{short}'] = file.read_text(encoding='utf-8')
        for kind in message_class.get_fields_and_field_types().values():
            if (inner := re.search(r'\w+/\w+', kind)) and inner[0] not in texts:
                collect(inner[0], find_type(inner[0], 'msg', inner[0]))

    try:
        collect(name, message_class)
    except (OSError, CommandError):
        return ''  # of an interface without a .msg file: a bag without the text can be played
    first, *others = texts.items()
    return first[1] + ''.join(f'\n{"=" * 80}\nMSG: {name}\n{text}' for name, text in others)


def _to_bag(profile: Any) -> Any:
    """A QoS as a bag holds it."""
    from rosbags import interfaces as bags

    def split(duration: Any) -> Any:
        return bags.QosTime(*divmod(duration.nanoseconds, 10**9))

    return bags.Qos(
        history=bags.QosHistory(int(profile.history)),
        depth=profile.depth,
        reliability=bags.QosReliability(int(profile.reliability)),
        durability=bags.QosDurability(int(profile.durability)),
        deadline=split(profile.deadline),
        lifespan=split(profile.lifespan),
        liveliness=bags.QosLiveliness(int(profile.liveliness)),
        liveliness_lease_duration=split(profile.liveliness_lease_duration),
        avoid_ros_namespace_conventions=profile.avoid_ros_namespace_conventions,
    )


def _from_bag(profiles: list) -> Any:
    """A QoS that offers all that was offered when the bag was recorded."""
    from rclpy.duration import Duration
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    if not profiles:
        return QoSProfile(depth=DEPTH)

    def longest(name: str) -> Duration:
        times = [getattr(profile, name) for profile in profiles]
        return Duration(nanoseconds=min(MAX_NS, max(t.sec * 10**9 + t.nsec for t in times)))

    effort = all(profile.reliability.name == 'BEST_EFFORT' for profile in profiles)
    latched = any(profile.durability.name == 'TRANSIENT_LOCAL' for profile in profiles)
    return QoSProfile(
        depth=max(profile.depth for profile in profiles) or (LATCHED_DEPTH if latched else DEPTH),
        reliability=ReliabilityPolicy.BEST_EFFORT if effort else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        deadline=longest('deadline'),
        lifespan=longest('lifespan'),
    )


# --- read ---


class _Bag(NamedTuple):
    """What a bag holds. Times are in nanoseconds since 1970."""

    files: list[Path]
    connections: list  # of rosbags
    start: int
    end: int
    distro: str
    messages: Any  # a function that returns an iterator over (topic, time, bytes)


@contextlib.contextmanager
def _open(path: Path) -> Iterator[_Bag]:
    """Open a bag, or what is whole of it if its recorder was killed."""
    from rosbags.rosbag2 import Reader, ReaderError

    files = [path] if path.is_file() else sorted([*path.glob('*.mcap'), *path.glob('*.db3')])
    if not files:
        raise CommandError(f"'{path}' is no bag: there is no .mcap and no .db3 file in it.")
    whole = path.is_file() or (path / 'metadata.yaml').exists()
    try:
        reader = Reader(path if whole else files[0])
        reader.open()
    except Exception as error:  # of a damaged file, and there are many kinds
        bag = _salvage(files)
        if not bag.connections:
            raise CommandError(f"the bag '{path}' cannot be read: {error}") from None
        count = sum(connection.msgcount for connection in bag.connections)
        message = f"[WARN] [ros2bag]: '{path}' is cut off: {count} messages of it can be read."
        print(message, file=sys.stderr)
        yield bag
        return
    try:
        start, end = reader.start_time, reader.end_time - 1
        start, end = (start, end) if reader.message_count else (0, 0)
        yield _Bag(
            files,
            reader.connections,
            start,
            end,
            reader.ros_distro or 'unknown',
            lambda: ((c.topic, stamp, data) for c, stamp, data in reader.messages()),
        )
    except ReaderError as error:
        raise CommandError(f"the bag '{path}' cannot be read to its end: {error}") from None
    finally:
        reader.close()


def _salvage(files: list[Path]) -> _Bag:
    """What can be read of MCAP files, one record after the other."""
    found: dict[str, list] = {}  # by topic: its connection and the times of its messages
    for connection, stamp, _ in itertools.chain.from_iterable(map(_records, files)):
        found.setdefault(connection.topic, [connection]).append(stamp)
    stamps = [stamp for _, *stamps in found.values() for stamp in stamps] or [0]
    return _Bag(
        files,
        [connection._replace(msgcount=len(stamps)) for connection, *stamps in found.values()],
        min(stamps),
        max(stamps),
        'unknown',
        lambda: ((c.topic, s, data) for file in files for c, s, data in _records(file)),
    )


def _records(file: Path) -> Iterator[tuple]:
    """Yield (connection, time, bytes) as long as the records of an MCAP file are whole."""
    from mcap import records
    from mcap.exceptions import McapError
    from mcap.stream_reader import StreamReader
    from rosbags.interfaces import Connection, ConnectionExtRosbag2
    from rosbags.rosbag2.metadata import parse_qos

    kinds, connections = {}, {}
    with file.open('rb') as stream, contextlib.suppress(McapError, struct.error, ValueError):
        for record in StreamReader(stream).records:
            if isinstance(record, records.Schema):
                kinds[record.id] = record.name
            elif isinstance(record, records.Channel):
                qos = parse_qos(record.metadata.get('offered_qos_profiles', ''))
                more = ConnectionExtRosbag2(record.message_encoding, qos)
                kind = kinds[record.schema_id]
                connections[record.id] = Connection(
                    record.id, record.topic, kind, None, '', 0, more, None
                )
            elif isinstance(record, records.Message):
                yield connections[record.channel_id], record.log_time, record.data


# --- info ---


def _info(args: argparse.Namespace) -> None:
    """Print information about a bag to the screen."""
    with _open(args.bag_path) as bag:
        if args.topic_name:
            print(*(connection.topic for connection in bag.connections), sep='\n')
            return
        path = args.bag_path
        size = sum(file.stat().st_size for file in (path.iterdir() if path.is_dir() else [path]))
        topics = [
            f'Topic: {c.topic} | Type: {c.msgtype} | Count: {c.msgcount} | '
            f'Serialization Format: {c.ext.serialization_format}'
            for c in bag.connections
        ]
        below = '\n' + ' ' * 19
        rows = {
            'Files:': below.join(file.name for file in bag.files),
            'Bag size:': _size(size),
            'Storage id:': 'sqlite3' if bag.files[0].suffix == '.db3' else 'mcap',
            'ROS Distro:': bag.distro,
            'Duration:': f'{_seconds(bag.end - bag.start)}s',
            'Start:': _moment(bag.start),
            'End:': _moment(bag.end),
            'Messages:': sum(c.msgcount for c in bag.connections),
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


def _play(args: argparse.Namespace) -> None:
    """Play back ROS data from a bag."""
    with (
        _open(args.bag_path) as bag,
        graph(args, name='rosbag2_player') as opened,
        _until_interrupted() as end,
    ):
        player = _Player(bag, args, opened.node, end)
        player.wait_for_subscriptions()
        while not end.wait(args.delay):
            player.play()
            if not args.loop:
                break
        player.wait_for_acknowledgements()


class _Player:
    """Publishes what a bag holds, at the times at which it came."""

    def __init__(self, bag: _Bag, args: argparse.Namespace, node: Any, end: threading.Event):
        self.bag, self.node, self.end, self.rate = bag, node, end, args.rate
        self.publishers: dict[str, Any] = {}  # by the topic's name in the bag
        self.clock, self.period = None, float('inf')
        offered: dict[str, list] = {}
        types = {connection.topic: connection.msgtype for connection in bag.connections}
        for connection in bag.connections:
            offered.setdefault(connection.topic, []).extend(connection.ext.offered_qos_profiles)
        asked = {full_name(node, topic) for topic in args.topics}
        if missing := asked - types.keys():
            names = ', '.join(sorted(types))
            raise CommandError(f"there is no topic '{min(missing)}' in the bag: it has {names}.")
        renamed = dict([full_name(node, name) for name in pair] for pair in args.remap)
        if args.clock:
            self._make_clock(args.clock)
        for topic in (asked or types.keys()) - ({'/clock'} if args.clock else set()):
            try:
                message_class = find_type(types[topic], 'msg', UNKNOWN.format(types[topic]))
            except CommandError as error:
                node.get_logger().warning(f"Ignoring a topic '{topic}', reason: {error}.")
                continue
            qos = _from_bag(offered[topic])
            name = renamed.get(topic, topic)
            self.publishers[topic] = node.create_publisher(message_class, name, qos)

    def _make_clock(self, frequency_hz: float) -> None:
        from rclpy.qos import QoSProfile, ReliabilityPolicy
        from rosgraph_msgs.msg import Clock

        qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.clock, self.period = self.node.create_publisher(Clock, '/clock', qos), 1 / frequency_hz

    def wait_for_subscriptions(self) -> None:
        """Wait for those that are there. What cannot match is not waited for longer."""
        publishers = [*self.publishers.values(), *([self.clock] if self.clock else [])]

        def is_matched() -> bool:
            return self.end.is_set() or all(
                publisher.get_subscription_count() >= self.node.count_subscribers(topic)
                for publisher, topic in topics
            )

        topics = [(publisher, publisher.topic_name) for publisher in publishers]
        wait_for(is_matched, WAIT_S)

    def wait_for_acknowledgements(self) -> None:
        """Wait until what was published is heard."""
        from rclpy.duration import Duration

        for publisher in [] if self.end.is_set() else self.publishers.values():
            publisher.wait_for_all_acked(Duration(seconds=WAIT_S))

    def play(self) -> None:
        """Publish all messages once."""
        began = time.monotonic()
        tick = began if self.clock else float('inf')
        for topic, stamp, data in self.bag.messages():
            due = began + (stamp - self.bag.start) / 1e9 / self.rate
            while (now := time.monotonic()) < due or now >= tick:
                if now >= tick:
                    self._tell_time(self.bag.start + int((now - began) * 1e9 * self.rate))
                    tick += self.period
                if self.end.wait(max(0.0, min(due, tick) - time.monotonic())):
                    return
            if topic in self.publishers:
                self.publishers[topic].publish(data)

    def _tell_time(self, ns: int) -> None:
        from rosgraph_msgs.msg import Clock

        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(ns, 10**9)
        self.clock.publish(message)
