"""`ros2 bag`: what rclpy publishes is in the bag, byte for byte, and comes out of it again."""

import os
import resource
import select
import signal

import pytest
import rclpy
from mcap.reader import make_reader
from nodes import nodes
from processes import ros2
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from sensor_msgs.msg import Imu
from std_msgs.msg import String
from waits import LIMIT_S, START_LIMIT_S, wait_for

from ros2_command.main import main

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
COUNT = 200


def bagging(*arguments, **options):
    """Run the command beside the block."""
    return ros2('bag', *arguments, **options)


def end(process, status=0):
    """Interrupt the command, and return what it says on stderr."""
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=LIMIT_S)
    assert process.returncode == status, err
    return err


class Robot(Node):
    """Publishes three topics, of different QoS."""

    def __init__(self):
        super().__init__('robot')
        self.count = self.create_publisher(String, 'count', 100)
        self.imu = self.create_publisher(Imu, 'imu', BEST_EFFORT)
        self.map = self.create_publisher(String, 'map', LATCHED)
        self.sent = {'/count': [], '/imu': [], '/map': []}

    def send(self, publisher, message):
        data = serialize_message(message)
        publisher.publish(data)
        # Fast DDS fills it up to whole groups of four bytes.
        self.sent[publisher.topic_name].append(data + bytes(-len(data) % 4))


@pytest.fixture(scope='module')
def recorded(domain, tmp_path_factory):
    """A bag of a robot, and the bytes that it has published."""
    folder = tmp_path_factory.mktemp('bags') / 'drive'
    with nodes() as opened:
        robot = opened.add(Robot())
        robot.send(robot.map, String(data='the world'))
        with bagging('record', '--all', '-o', folder) as process:
            publishers = robot.count, robot.imu, robot.map
            wait_for(lambda: all(p.get_subscription_count() for p in publishers))
            for number in range(COUNT):
                robot.send(robot.count, String(data=f'{number} ' + 'x' * number))
                robot.send(robot.imu, Imu(orientation_covariance=[float(number)] * 9))
            robot.count.wait_for_all_acked(Duration(seconds=LIMIT_S))
            late = robot.create_publisher(String, 'late', 10)
            wait_for(late.get_subscription_count)
            late.publish(String(data='also'))
            late.wait_for_all_acked(Duration(seconds=LIMIT_S))
            assert 'Recording stopped' in end(process)
    return folder, robot.sent


def read(bag):
    """The bytes in a bag by topic, as rosbags reads them."""
    data_by_topic = {}
    with Reader(bag) as reader:
        for connection, _, data in reader.messages():
            data_by_topic.setdefault(connection.topic, []).append(bytes(data))
    return data_by_topic


def test_two_libraries_read_the_bytes_that_were_published(recorded):
    folder, sent = recorded
    by_rosbags, by_mcap, definitions = read(folder), {}, {}
    with next(folder.glob('*.mcap')).open('rb') as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            by_mcap.setdefault(channel.topic, []).append(message.data)
            definitions[schema.name] = schema.data.decode()
    assert by_rosbags == by_mcap
    assert {'/late', '/rosout'} <= by_mcap.keys()
    assert (by_mcap['/count'], by_mcap['/map']) == (sent['/count'], sent['/map'])
    # Best effort may lose messages, but changes none.
    assert by_mcap['/imu'] == [data for data in sent['/imu'] if data in by_mcap['/imu']]
    types = get_types_from_msg(definitions['sensor_msgs/msg/Imu'], 'sensor_msgs/msg/Imu')
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    imu = store.deserialize_cdr(by_mcap['/imu'][-1], 'sensor_msgs/msg/Imu')
    assert imu.orientation_covariance[0] == COUNT - 1


def test_a_bag_says_what_was_offered(recorded):
    with Reader(recorded[0]) as reader:
        offered = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}
    words = {t: (q.reliability.name, q.durability.name) for t, q in offered.items()}
    assert words['/count'] == ('RELIABLE', 'VOLATILE')
    assert words['/imu'] == ('BEST_EFFORT', 'VOLATILE')
    assert words['/map'] == ('RELIABLE', 'TRANSIENT_LOCAL')


def test_plays_the_same_bytes(recorded):
    folder, sent = recorded
    heard = {}
    with nodes() as opened:
        node = rclpy.create_node('listener')
        for topic, kind, qos in (
            ('/count', String, 300), ('/map', String, LATCHED), ('/imu', Imu, BEST_EFFORT)
        ):  # fmt: skip
            heard[topic] = []
            node.create_subscription(kind, topic, heard[topic].append, qos, raw=True)
        opened.add(node)
        with bagging('play', folder, '--rate', '10') as process:
            wait_for(lambda: len(heard['/count']) >= COUNT)
            process.communicate(timeout=LIMIT_S)
            assert process.returncode == 0
        assert (heard['/count'], heard['/map']) == (sent['/count'], sent['/map'])
        assert heard['/imu'] == [data for data in sent['/imu'] if data in heard['/imu']]
        # Interrupted in a loop. A subscriber that comes late gets what is latched.
        with bagging('play', folder, '--topics', '/map', '/count', '--loop') as process:
            wait_for(lambda: len(heard['/count']) > 3 * COUNT)
            late = []
            node.create_subscription(String, '/map', late.append, LATCHED, raw=True)
            wait_for(lambda: late)
            end(process)
    assert late[0] == sent['/map'][0]


def test_clock_of_a_bag(recorded):
    folder, _ = recorded
    with Reader(folder) as reader:
        start, stop = reader.start_time, reader.end_time
    seen = []
    with nodes() as opened:
        node = rclpy.create_node('n', parameter_overrides=[Parameter('use_sim_time', value=True)])
        node.create_subscription(
            String, 'count', lambda _: seen.append(node.get_clock().now().nanoseconds), 300
        )
        opened.add(node)
        with bagging('play', folder, '--clock', '1000', '--rate', '0.5') as process:
            process.communicate(timeout=START_LIMIT_S)
        wait_for(lambda: len(seen) == COUNT)
    times = [ns for ns in seen if ns]  # /clock is best effort, and may come after a message
    assert times == sorted(times)
    assert len(set(times)) > 1
    assert all(start <= ns <= stop + 10**9 for ns in times)


@pytest.fixture
def cut_off(recorded, tmp_path):
    """A bag as a recorder leaves it that was killed, and how many messages were in it."""
    with Writer(tmp_path / 'b', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        store = get_typestore(Stores.ROS2_JAZZY)
        connection = writer.add_connection('/count', 'std_msgs/msg/String', typestore=store)
        for number, data in enumerate(recorded[1]['/count']):
            writer.write(connection, number * 10**6, data)
            if number % 10 == 9:
                writer.storage.close_chunk()
    (tmp_path / 'b' / 'metadata.yaml').unlink()
    return tmp_path / 'b'


def test_a_bag_that_is_cut_off(cut_off, recorded, capsys):
    file = cut_off / 'b.mcap'
    os.truncate(file, file.stat().st_size // 2)
    assert main(['bag', 'info', str(cut_off)]) == 0
    out, err = capsys.readouterr()
    count = int(out.partition('Messages:')[2].split()[0])
    assert count in range(10, COUNT + 1, 10)
    assert f"'{cut_off}' is cut off: {count} messages of it can be read." in err
    heard = []
    with nodes() as opened:
        node = rclpy.create_node('listener')
        node.create_subscription(String, 'count', heard.append, 300, raw=True)
        opened.add(node)
        with bagging('play', cut_off) as process:
            process.communicate(timeout=LIMIT_S)
        wait_for(lambda: len(heard) == count)
    assert heard == recorded[1]['/count'][:count]


def test_a_recorder_that_is_killed(domain, tmp_path, capsys):
    with nodes() as opened:
        robot = opened.add(Robot())
        with bagging('record', '/count', '-o', tmp_path / 'b') as process:
            wait_for(robot.count.get_subscription_count)
            robot.send(robot.count, String(data='before'))
            wait_for(lambda: (tmp_path / 'b' / 'b.mcap').stat().st_size > 200)
            process.kill()
            process.wait()
    assert main(['bag', 'info', str(tmp_path / 'b')]) == 0
    assert 'Messages:          1\n' in capsys.readouterr().out


def test_a_full_disk(domain, tmp_path, capsys):
    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (3_000_000, 3_000_000))

    with nodes() as opened:
        robot = opened.add(Robot())
        folder = tmp_path / 'b'
        with bagging('record', '/count', '-o', folder, preexec_fn=limit) as process:
            wait_for(robot.count.get_subscription_count)
            while process.poll() is None:
                robot.send(robot.count, String(data='x' * 100_000))
                select.select([process.stderr], [], [], 0.01)
            err = process.stderr.read().splitlines()[-1]
    assert process.returncode == 1
    assert f"as the bag '{folder}' cannot be written: " in err
    assert main(['bag', 'info', str(folder)]) == 0
    assert 'Topic: /count | Type: std_msgs/msg/String' in capsys.readouterr().out


def test_info_prints_as_the_real_command(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv('TZ', 'UTC')
    with Writer(tmp_path / 'b', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        store = get_typestore(Stores.ROS2_JAZZY)
        for topic in ('/a', '/b'):
            connection = writer.add_connection(topic, 'std_msgs/msg/String', typestore=store)
            stamp = 1_700_000_000_000_000_005 + (10**9 if topic == '/b' else 0)
            writer.write(connection, stamp, b'\0\1\0\0')
    assert main(['bag', 'info', str(tmp_path / 'b')]) == 0
    size = sum(file.stat().st_size for file in (tmp_path / 'b').iterdir())
    assert (
        capsys.readouterr().out
        == f"""
Files:             b.mcap
Bag size:          {size / 1024:.1f} KiB
Storage id:        mcap
ROS Distro:        rosbags
Duration:          1.000000000s
Start:             Nov 14 2023 22:13:20.000000005 (1700000000.000000005)
End:               Nov 14 2023 22:13:21.000000005 (1700000001.000000005)
Messages:          2
Topic information: Topic: /a | Type: std_msgs/msg/String | Count: 1 | Serialization Format: cdr
                   Topic: /b | Type: std_msgs/msg/String | Count: 1 | Serialization Format: cdr
Service:           0
Service information:{' '}
"""
    )


@pytest.mark.parametrize(
    ('arguments', 'sentence', 'status'),
    [
        ('info {0}/nope', "Bag path '{0}/nope' does not exist!", 2),
        ('info {0}', "'{0}' is no bag", 1),
        ('info {0}/a/empty.mcap', "the bag '{0}/a/empty.mcap' cannot be read", 1),
        ('record -a -o {0}', "Output folder '{0}' already exists.", 1),
        ('record -a -o {0}/a/empty.mcap/b', 'Could not create bag folder', 1),
        ('record', 'Need to specify at least one option out of --all', 1),
        ('play {1} --topics /nope', "there is no topic '/nope' in the bag: it has /count", 1),
        ('play {1} --rate 0', '--rate', 2),
    ],
)
def test_a_mistake_is_one_sentence(arguments, sentence, status, recorded, tmp_path, run):
    (tmp_path / 'a').mkdir()
    (tmp_path / 'a' / 'empty.mcap').touch()
    ended_with, out, err = run('bag ' + arguments.format(tmp_path, recorded[0]))
    assert ended_with == status
    assert sentence.format(tmp_path) in err
    assert (out, err.count('\n')) == ('', 1)
