"""What the tasks of the lesson "Record a bag" are judged by."""

import math
import shutil
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from geometry_msgs.msg import Twist, TwistStamped
from mcap import records
from mcap.stream_reader import StreamReader
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rclpy.time import Time
from rosbags import interfaces
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan, Range
from std_msgs.msg import Bool

from helpers.checks.bench import Bench, scan
from helpers.checks.errors import Failed, sentence
from helpers.checks.points import all_of, expect, rows
from helpers.checks.programs import Program
from helpers.checks.tasks import Tasks

tasks = Tasks()
check = tasks.check

TOPICS = {'/scan': LaserScan, '/wall': Range, '/cmd_vel': Twist, '/bumper': Bool}
STORE = get_typestore(Stores.ROS2_JAZZY)


@tasks.add(limit_s=60)
def write_the_command_that_records(RECORD, workspace):
    def recorded_topics():
        tried = workspace.path / 'tried'
        shutil.rmtree(tried, ignore_errors=True)
        tried.mkdir()
        with Bench() as bench:
            wanted = [bench.publisher(topic, kind) for topic, kind in TOPICS.items()]
            bench.publisher('/battery', Bool)
            with Program(workspace.start(f'cd tried; {RECORD}')) as recorder:
                # It has looked for all topics then: to load a message's class can take seconds.
                bench.wait(lambda: recorder.says('Recording...') or not recorder.running, 30)
                bench.wait(lambda: all(map(is_heard, wanted)) or not recorder.running)
        if not (tried / 'crash').exists():
            said = recorder.error
            raise Failed(f'there is no bag in the folder crash. The command printed: {said}')
        with AnyReader([tried / 'crash']) as bag:
            return sorted(connection.topic for connection in bag.connections)

    def records_all():
        return expect(recorded_topics(), sorted(TOPICS), 'the topics in the bag are')

    hint = 'After --topics come the topics, with spaces between them.'
    return [('it records the four topics into crash', records_all, hint)]


def is_heard(publisher):
    return publisher.get_subscription_count() > 0


@tasks.add
def read_one_topic(read):
    recorded = [
        (5, '/a', Bool(data=True)),
        (6, '/b', stamped(Range, 1, range=2.0)),
        (6, '/a_b', Bool()),
        (7, '/a', Bool()),
        (9, '/a', Bool(data=True)),
    ]

    def reads(topic, kind):
        right = [(time_ns, message) for time_ns, name, message in recorded if name == topic]
        with bag_of(recorded) as path:
            found = read(path, topic, kind)
        messages = [message for _, message in found]
        others = {type(message).__name__ for message in messages} - {kind.__name__}
        times, right_times = ([time_ns for time_ns, _ in each] for each in (found, right))
        return all_of(
            not others or f'of {topic} it returns messages of the class {", ".join(others)}',
            expect(times, right_times, f'of {topic} it returns those that were recorded at'),
            messages == [message for _, message in right] or f'of {topic} it returns other values',
        )

    hint = 'if connection.topic == topic: then deserialize_message(data, kind).'
    return [
        ('three messages of /a', lambda: reads('/a', Bool), hint),
        ('one of /b', lambda: reads('/b', Range), hint),
        ('none of /c', lambda: reads('/c', Bool), hint),
    ]


@tasks.add
def age_of_a_result(age_s):
    def computes(stamp_s, recorded_s, right):
        found = age_s(round(recorded_s * 1e9), stamped(Range, stamp_s).header)
        case = f'of the stamp {stamp_s} s, recorded at {recorded_s} s, it returns'
        return expect(found, right, case, within=1e-3, unit='s')

    hint = 'Time.from_msg(header.stamp).nanoseconds is the stamp in nanoseconds.'
    return [
        ('stamp 10.5 s, recorded at 12 s', lambda: computes(10.5, 12, 1.5), hint),
        ('stamp 1.75 s, recorded at 2 s', lambda: computes(1.75, 2, 0.25), hint),
    ]


@tasks.add
def what_it_believed(at_bump):
    def finds(first_bump):
        rows = [(10 * n, '/scan', ahead(5.0 - n)) for n in range(5)]
        rows += [(10 * n + 4, '/wall', stamped(Range, 1, range=7.0 - n)) for n in range(5)]
        rows += [(10 * n + 7, '/bumper', Bool(data=n >= first_bump)) for n in range(5)]
        with bag_of(sorted(rows, key=lambda row: row[0])) as path:
            found = at_bump(path)
        found = tuple(found) if isinstance(found, list) else found
        right = (7.0 - first_bump, 5.0 - first_bump)
        return expect(found, right, 'of the last /wall and /scan (m) until the bump it returns')

    hint = 'next(ns for ns, bump in ... if bump.data); then a list of what came until then: [-1].'
    return [
        ('a bump in the middle of a bag', lambda: finds(2), hint),
        ('a bump at its end', lambda: finds(4), hint),
        ('a bump at its beginning', lambda: finds(0), hint),
    ]


@tasks.add
def save_what_is_whole(salvage, half):
    def saves_small(missing):
        rows = [(n, f'/{"ab"[n % 2]}', Bool(data=n > 3)) for n in range(6)]
        with bag_of(rows) as path:
            file = next(path.glob('*.mcap'))
            right = whole_messages(file)
            whole = file.read_bytes()
            file.write_bytes(whole[: len(whole) - missing])
            return are_same(salvage(file), right)

    def are_same(found, right):
        if not isinstance(found, list | tuple):
            return f'it returns {found!r}, not a list'
        if not found:  # how many the half file has differs from run to run
            return 'of the whole messages it returns none'
        for number, (saved, message) in enumerate(zip(found, right, strict=False)):
            what = f'message {number} of its list'
            if len(saved) != 3:
                return f'{what} has {len(saved)} parts, not three'
            topic, log_time, data = saved
            same = all_of(
                expect(topic, message[0], f'{what} has the topic'),
                expect(log_time, message[1], f'{what} has the log_time'),
                data == message[2] or f'{what} has other data',
            )
            if same is not True:
                return same
        return expect(len(found), len(right), 'the number of whole messages that it returns is')

    def saves_all_but_the_end():
        saved = saves_small(1)
        if saved is True and not lets_ctrl_c_through(salvage):
            hint = 'except Exception: Ctrl+C is no Exception, and no error of the file.'
            raise Failed('Ctrl+C, while it reads, does not end it', hint=hint)
        return saved

    hint = 'A try around the for loop; except Exception: pass. isinstance(record, records.Message).'
    return [
        ('a file that is whole', lambda: saves_small(0), hint),
        ('a file without its last byte', saves_all_but_the_end, hint),
        ('the half file', lambda: are_same(salvage(half), whole_messages(half)), hint),
    ]


def lets_ctrl_c_through(salvage):
    """Return whether a function that reads a file ends when somebody presses Ctrl+C."""
    with bag_of([(n, '/a', Bool()) for n in range(6)]) as path:
        try:
            salvage(Interrupted(next(path.glob('*.mcap')).read_bytes()))
        except KeyboardInterrupt:
            return True
        except Exception:  # noqa: BLE001 - it opens files in another way: that cannot be tried
            return True
    return False


class Interrupted:
    """A file. Somebody presses Ctrl+C while its fifth piece is read."""

    def __init__(self, content):
        self._content, self._reads = content, 0

    def open(self, mode='rb'):
        """Open it, as a Path does."""
        stream = BytesIO(self._content)
        read = stream.read

        def read_or_end(size=-1):
            self._reads += 1
            if self._reads == 5:
                raise KeyboardInterrupt
            return read(size)

        stream.read = read_or_end
        return stream


def whole_messages(file):
    """Return (topic, log_time, data) of each message that is whole."""
    topics, found = {}, []
    with file.open('rb') as stream, suppress(Exception):  # the rest of the file is not whole
        for record in StreamReader(stream).records:
            if isinstance(record, records.Channel):
                topics[record.id] = record.topic
            elif isinstance(record, records.Message):
                found.append((topics[record.channel_id], record.log_time, record.data))
    return found


@tasks.add
def fix_the_brake(FreshBrake):
    def commands_well(scans, now_s, right):
        """Let a brake in simulated time hear scans (stamp, distance).

        Without a distance, the clock goes on to this stamp.
        """
        with Bench() as bench:
            commands = bench.hear('cmd_vel', Twist)
            bench.spin(FreshBrake(parameter_overrides=[Parameter('use_sim_time', value=True)]))
            bench.say('/clock', Clock(clock=stamp(now_s)))
            for stamp_s, distance in scans:
                if distance is None:
                    bench.say('/clock', Clock(clock=stamp(stamp_s)))
                else:
                    bench.say('scan', ahead(distance, stamp_s))
        found = [twist.linear.x for twist in commands]
        case = f'at {now_s} s, scans (stamp, distance) {scans}: it commands'
        return expect(found, right, case)

    def has_depth_1():
        speeds = []
        with Bench() as bench:
            brake = FreshBrake()
            brake.command = speeds.append
            now_s = bench.tester.get_clock().now().nanoseconds / 1e9
            bench.say('scan', *(ahead(metres, now_s) for metres in (3.0, 2.0, 0.1)), at_once=True)
            bench.spin(brake)
            bench.quiet()
        return expect(speeds, [0.0], 'after scans of 3, 2 and 0.1 m that waited it commands')

    hint = 'Look only if Duration(seconds=-0.1) <= age <= Duration(seconds=0.5).'
    fresh, old = [(99.9, 2), (100, 0.3)], [(59, 2), (59.4, 2), (59.5, 2), (59.8, 2)]
    ahead_of_it = [(80.5, 2), (80.2, 2), (80.1, 2), (80.05, 2), (80, 0.3)]
    later = [(60, 2), (60.6, None), (60, 2)]  # the clock goes on

    def stops_for_old_ones():
        return all_of(
            commands_well(old, 60, [0.0, 0.0, 0.5, 0.5]), commands_well(later, 60, [0.5, 0.0])
        )

    return [
        ('at 100 s, fresh scans', lambda: commands_well(fresh, 100, [0.5, 0.0]), hint),
        ('at 60 s, an old one', stops_for_old_ones, hint),
        (
            'at 80 s, one that is ahead of the clock',
            lambda: commands_well(ahead_of_it, 80, [0.0, 0.0, 0.5, 0.5, 0.0]),
            hint,
        ),
        (
            'of three scans that wait, it receives the newest',
            has_depth_1,
            'super().__init__(depth=1, ...)',
        ),
    ]


@tasks.add(limit_s=60)
def write_the_command_that_plays(PLAY, workspace):
    def plays():
        if not (workspace.path / 'crash').exists():
            return 'there is no bag crash yet: run the cell that records it'
        with Bench() as bench:
            heard = {topic: bench.hear(topic, kind) for topic, kind in TOPICS.items()}
            heard['/clock'] = bench.hear('/clock', Clock)
            said = play(bench, workspace, f'{PLAY} -r 10')
        played = sorted(topic for topic, messages in heard.items() if messages)
        if not played:
            return f'it plays nothing. The command printed: {said}'
        return expect(played, ['/clock', '/scan'], 'it plays')

    hint = '--clock, and --topics /scan'
    return [('it plays /scan and /clock, and nothing else', plays, hint)]


def play(bench, workspace, command):
    """Let a command play a bag to its end. Return what it printed."""
    with Program(workspace.start(command)) as player:
        if not player.has_ended(40):
            raise Failed(f'the player does not end. It printed: {player.error}')
        if player.exit_code() != 0:
            raise Failed(f'the command failed. It printed: {player.error}')
    bench.quiet()
    return player.error


@tasks.add
def write_the_judge(Judge):
    def notes(messages, right):
        """Publish distances ('scan', m) and speeds ('cmd_vel', m/s)."""
        with Bench() as bench:
            judge = bench.spin(Judge())
            timers = len([*judge.timers])
            for topic, value in messages:
                bench.say(topic, ahead(value) if topic == 'scan' else forwards(value))
        if timers:
            return 'it has a timer: keep each distance when its scan comes'
        return expect(judge.commands, right, f'after {messages} it has noted')

    def loses_none():
        """Let ten commands wait for a judge that does not spin yet."""
        speeds = [number / 4 for number in range(10)]
        with Bench() as bench:
            judge = Judge()
            bench.say('cmd_vel', *map(forwards, speeds), qos=20, at_once=True)
            bench.spin(judge)
            bench.quiet()
            depths = {one.topic_name: one.qos_profile.depth for one in judge.subscriptions}
        found = [speed for _, speed in judge.commands]
        return all_of(
            expect(found, speeds, 'of ten commands that waited it has noted'),
            expect(depths.get('/scan'), 10, 'the depth of scan is'),
        )

    early = [('cmd_vel', 0.5), ('scan', 2.0), ('cmd_vel', 0.25), ('cmd_vel', 0.0)]
    newest = [('scan', 3.0), ('scan', 0.5), ('cmd_vel', 0.0)]
    blind, ahead_of_it = [('scan', math.nan), ('cmd_vel', 0.0)], 'distance_ahead(scan)'
    hint = 'Two subscriptions. One callback keeps the distance, the other one appends.'
    return [
        ('a command before any scan', lambda: notes(early[:1], [(None, 0.5)]), hint),
        ('two at 2 m', lambda: notes(early, [(None, 0.5), (2.0, 0.25), (2.0, 0.0)]), hint),
        ('the newest scan counts', lambda: notes(newest, [(0.5, 0.0)]), hint),
        ('a scan that does not say it', lambda: notes(blind, [(None, 0.0)]), ahead_of_it),
        ('ten commands that wait', loses_none, 'The depth is 10.'),
    ]


GOOD = [(None, 0.5), (2.0, 0.5), (1.2, 0.5), (0.4, 0.0), (0.2, 0.0), (0.12, 0.0)]
ANOTHER_GOOD = [(1.5, 0.0), (1.1, 0.3), (0.25, 0.5), (0.1, 0.0)]
A_THIRD_GOOD = [(1.2, 0.5), (0.6, 0.0), (0.2, 0.0)]  # only the first command drives
BAD = {
    'it never drives': [(2.0, 0.0), (1.2, 0.0), (0.2, 0.0)],
    'it says nothing': [],
    'it drives slowly, and only near the wall': [(2.0, 0.0), (1.0, 0.1), (0.2, 0.0)],
    'it drives at once, and knows no scan': [(None, 0.5), (0.2, 0.0)],
    'it stops at 0.2 m only': [(0.24, 0.5), (2.0, 0.5), (0.2, 0.0), (0.1, 0.0)],
    'it stops, then goes on': [*GOOD, (0.11, 0.5)],
    'it goes back at the wall': [*GOOD, (0.11, -0.5)],
    'it falls silent before the wall': [(2.0, 0.5), (0.6, 0.5)],
}


@tasks.add
def write_the_assertions(check_commands):
    def accepts(commands):
        try:
            check_commands(commands)
        except AssertionError as error:
            return f'your test refuses {commands}. {sentence(error)}'
        return True

    def refuses(commands):
        return accepts(commands) is not True or f'your test accepts {commands}'

    hint = 'any(...) for what must happen, and all(...) for what must hold each time.'
    exactly = 'Exactly 0.25 m is not nearer.'
    bad = [(f'it fails: {name}', commands) for name, commands in BAD.items()]
    return [
        ('a good brake passes', lambda: accepts(GOOD), hint),
        (
            'another good brake passes',
            lambda: all_of(accepts(ANOTHER_GOOD), accepts(A_THIRD_GOOD)),
            exactly,
        ),
        *rows(refuses, hint, *bad),
    ]


@tasks.add
def match_by_stamps(Synchroniser):
    def matches(size, slop_s, arrivals, right):
        """Add messages by (name, stamp), and compare the stamps of the pairs."""
        synchroniser = Synchroniser(size, slop_s)
        for name, stamp_s in arrivals:
            synchroniser.add(name, stamped(LaserScan if name == 'scan' else Range, stamp_s))
        for pair in synchroniser.pairs:
            if [type(message) for message in pair] != [LaserScan, Range]:
                names = ', '.join(type(message).__name__ for message in pair)
                return f'a pair is ({names}), not (LaserScan, Range)'
        found = [(seconds_of(seen), seconds_of(wall)) for seen, wall in synchroniser.pairs]
        return expect(found, right, f'size {size}, slop {slop_s} s, {arrivals}: the pairs are')

    def scans_then(size, walls, right):
        arrivals = [('scan', n) for n in range(1, 6)] + [('wall', n) for n in walls]
        return matches(size, 0.3, arrivals, right)

    def uses_each_once():
        wall_in_between = [('scan', 3.0), ('wall', 3.0), ('scan', 3.1)]
        return all_of(
            scans_then(9, [3.0, 3.1, 3.2], [(3, 3.0)]),
            matches(9, 0.3, wall_in_between, [(3.0, 3.0)]),
        )

    hint = 'del own[: -self.size]; min(other, key=lambda m: abs(stamp_s(m) - stamp_s(message))).'
    near = [('wall', 1.0), ('scan', 1.5), ('scan', 1.1), ('wall', 1.4)]
    half = [('scan', 2.0), ('wall', 2.5)]
    two_near = [('scan', 1.8), ('scan', 2.1), ('wall', 2.0)]
    return [
        ('the nearest scan', lambda: scans_then(9, [2.1, 4.9], [(2, 2.1), (5, 4.9)]), hint),
        ('of two that fit, the nearest', lambda: matches(9, 0.3, two_near, [(2.1, 2.0)]), hint),
        ('none that is too far away', lambda: scans_then(9, [2.5, 9.0], []), hint),
        ('exactly slop_s away', lambda: matches(9, 0.5, half, [(2.0, 2.5)]), 'At most is <=.'),
        ('none is used twice', uses_each_once, 'remove(...) both.'),
        ('old messages are removed', lambda: scans_then(2, [1, 3, 4], [(4, 4)]), hint),
        ('whichever comes first', lambda: matches(5, 0.3, near, [(1.1, 1.0), (1.5, 1.4)]), hint),
    ]


@tasks.add(limit_s=60)
def hear_the_laser(LASER_QOS, workspace, scans):
    def hears():
        path = workspace.path / 'laser'
        shutil.rmtree(path, ignore_errors=True)
        write_bag(path, [(ns, '/scan', heard) for ns, heard in scans], [best_effort()])
        heard = []
        with Bench() as bench:
            listener = Node('listener')
            listener.create_subscription(LaserScan, 'scan', heard.append, LASER_QOS)
            bench.spin(listener)
            play(bench, workspace, 'ros2 bag play laser -r 10')
        return bool(heard) or 'it receives no scan'

    def is_deep():
        return expect(LASER_QOS.depth, 100, 'its depth is')

    hint = 'reliability=ReliabilityPolicy.NAME, as that of the laser.'
    return [('it receives scans', hears, hint), ('its depth is 100', is_deep, 'depth=100')]


@tasks.add
def ask_the_bag_for_the_type(speeds):
    def reads(*messages):
        rows = [(number, '/cmd_vel', message) for number, message in enumerate(messages)]
        rows.insert(1, (0, '/other/cmd_vel', forwards(9.0)))
        right = [(getattr(message, 'twist', message)).linear.x for message in messages]
        with bag_of(rows) as path:
            found = speeds(path)
        kind = type(messages[0]).__name__
        return expect([*found], right, f'of {kind} messages it returns the speeds (m/s)')

    def refuses():
        for message in (Bool(data=True), Range(), Odometry()):
            with bag_of([(1, '/cmd_vel', message)]) as path:
                try:
                    found = speeds(path)
                except TypeError:
                    continue
            return f'of a /cmd_vel whose type is {type(message).__name__} it returns {found}'
        return True

    name = "connection.msgtype == 'geometry_msgs/msg/TwistStamped'"
    return [
        ('Twist', lambda: reads(forwards(0.5), forwards(-0.25)), 'Its class is Twist.'),
        ('TwistStamped', lambda: reads(*map(with_stamp, (0.25, 0.5))), name),
        ('TwistStamped of another time', lambda: reads(with_stamp(-0.5, 1e9)), name),
        ('another type', refuses, 'raise TypeError(...)'),
    ]


def with_stamp(speed, stamp_s=1.7e9):
    message = stamped(TwistStamped, stamp_s, twist=forwards(speed))
    message.header.frame_id = 'base_link'
    return message


def best_effort():
    """Return the QoS of a laser, as a bag keeps it."""
    never = interfaces.QosTime(9223372036, 854775807)
    return interfaces.Qos(
        history=interfaces.QosHistory(1),
        depth=10,
        reliability=interfaces.QosReliability(2),
        durability=interfaces.QosDurability(2),
        deadline=never,
        lifespan=never,
        liveliness=interfaces.QosLiveliness(1),
        liveliness_lease_duration=never,
        avoid_ros_namespace_conventions=False,
    )


# --- What the tasks share -------------------------------------------------------------------------


def stamp(seconds):
    return Time(nanoseconds=round(seconds * 1e9)).to_msg()


def stamped(kind, seconds, **fields):
    message = kind(**fields)
    message.header.stamp = stamp(seconds)
    return message


def seconds_of(message):
    return round(Time.from_msg(message.header.stamp).nanoseconds / 1e9, 3)


def ahead(metres, stamp_s=1.0):
    """Return a scan with something at this distance ahead."""
    ranges = [0.2] * 80 + [metres] * 21 + [7.0] * 80
    return scan(ranges, limits=(0.1, 8.0), stamp=stamp(stamp_s))


def forwards(speed):
    twist = Twist()
    twist.linear.x = speed
    return twist


@contextmanager
def bag_of(rows):
    """Give the path of a bag of rows (recorded_ns, topic, message), for a while."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / 'small'
        write_bag(path, rows)
        yield path


def write_bag(path, rows, qos=()):
    writer, connections = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP), {}
    with writer:
        for recorded_ns, topic, message in rows:
            if topic not in connections:
                package = type(message).__module__.partition('.')[0]
                connections[topic] = writer.add_connection(
                    topic,
                    f'{package}/msg/{type(message).__name__}',
                    typestore=STORE,
                    offered_qos_profiles=qos,
                )
            writer.write(connections[topic], recorded_ns, serialize_message(message))
