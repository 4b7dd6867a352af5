"""A publisher and a slow subscriber on two machines.

The machines are network namespaces joined by a veth pair, each with its own shared memory. The
second one also has a clock of its own, 1000 s ahead. They are gone when the processes in them are.
"""

import contextlib
import json
import os
import select
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest

from helpers.queue_model import explain
from helpers.recording import COLUMNS

DOMAIN = 42
DEPTH = 10
MESSAGES = 41
LIMIT_S = 60
AHEAD_S = 1000
ADDRESSES = ('192.0.2.1', '192.0.2.2')  # reserved for documentation: nobody's
# What a firewall must let in: discovery, then two ports for each of the first ten participants.
PORTS = {7400 + 250 * DOMAIN, *range(7410 + 250 * DOMAIN, 7430 + 250 * DOMAIN)}
# A robot: no helpers, only the two variables.
ROBOT = {'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}


class Machine:
    """A machine that is a few namespaces, held by a process that ends with this one."""

    def __init__(self, stack: contextlib.ExitStack, *, ahead_s: int = 0, inside: str = '') -> None:
        own = ['--net', '--mount', '--ipc', '--time', '--monotonic', str(ahead_s), '--fork']
        user = ['--user', '--map-root-user'] if os.getuid() and not inside else []
        # `read` ends when this process does.
        hold = 'mount -t tmpfs shm /dev/shm && ip link set lo up && echo $$ && read line'
        self._process = subprocess.Popen(
            [*inside.split(), 'unshare', *user, *own, 'sh', '-c', hold],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        stack.callback(self._end)
        self.pid = self._process.stdout.readline().strip()
        if not self.pid:
            pytest.skip(f'no namespaces here: {self._process.stderr.read().strip()}')
        target = f'nsenter --target {self.pid}'
        self.user = f'{target} --user --preserve-credentials' if os.getuid() else ''
        self._enter = f'{self.user or target} --net --mount --ipc --time'.split()

    def _end(self) -> None:
        self._process.communicate('\n')

    def run(self, command: str) -> str:
        answer = subprocess.run(
            [*self._enter, *shlex.split(command)], capture_output=True, text=True
        )
        if answer.returncode:
            pytest.skip(f'no network between namespaces here: {answer.stderr.strip()}')
        return answer.stdout

    def wait_for_cable(self) -> None:
        """Fast DDS knows the interfaces that are up when a participant starts, no later ones."""
        limit = time.monotonic() + LIMIT_S
        while ' UP ' not in self.run('ip -brief link show eth0'):
            assert time.monotonic() < limit
            time.sleep(0.05)

    @contextlib.contextmanager
    def firewall(self, policy: str, rule: str) -> Iterator[None]:
        """Let a rule of nftables decide which packets from outside come in."""
        if not shutil.which('nft'):
            pytest.skip('nft not found: install nftables')
        chain = f'type filter hook input priority 0 ; policy {policy} ;'
        self.run('nft add table inet test')
        self.run(f"nft 'add chain inet test input {{ {chain} }}'")
        self.run('nft add rule inet test input iif lo accept')
        self.run(f'nft add rule inet test input {rule}')
        try:
            yield
        finally:
            self.run('nft delete table inet test')

    def start(self, script: str, *arguments: object, **environment: str) -> subprocess.Popen:
        """Start a Python script, whose end of input says that this process has ended."""
        kept = {k: v for k, v in os.environ.items() if not k.startswith(('ROS_', 'RMW_'))}
        return subprocess.Popen(
            [*self._enter, sys.executable, '-c', script, *map(str, arguments)],
            env=kept | environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )


@pytest.fixture(scope='module')
def machines() -> Iterator[list[Machine]]:
    """Two machines on one cable."""
    missing = [name for name in ('unshare', 'nsenter', 'ip') if not shutil.which(name)]
    if missing:
        pytest.skip(f'{" and ".join(missing)} not found: install util-linux and iproute2')
    with contextlib.ExitStack() as stack:
        one = Machine(stack)
        two = Machine(stack, ahead_s=AHEAD_S, inside=one.user)
        one.run(f'ip link add eth0 type veth peer name eth0 netns {two.pid}')
        for machine, address in zip((one, two), ADDRESSES, strict=True):
            machine.run(f'ip address add {address}/24 dev eth0')
            machine.run('ip link set eth0 up')
        one.wait_for_cable()
        two.wait_for_cable()
        yield [one, two]


@contextlib.contextmanager
def ended(*processes: subprocess.Popen) -> Iterator[None]:
    """End the processes at the end of the block, whatever happened in it."""
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.communicate()


# --- Who hears whom ------------------------------------------------------------------------------

# Each of these ends when its standard input does, at the latest when this test is killed.
END = """
import os, sys, threading
def end_with_input():
    sys.stdin.read()
    os._exit(1)
"""

TALKER = f"""{END}
import time, rclpy
from std_msgs.msg import String
threading.Thread(target=end_with_input, daemon=True).start()
rclpy.init()
publisher = rclpy.create_node('talker').create_publisher(String, 'topic', 10)
while True:
    publisher.publish(String(data=sys.argv[1]))
    time.sleep(0.05)
"""

# Prints who it has heard once it has heard `sys.argv[3]`, and its ports.
LISTENER = f"""{END}
from pathlib import Path
from helpers.session import ros_session
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String
threading.Thread(target=end_with_input, daemon=True).start()
domain, discovery, wanted = int(sys.argv[1]), sys.argv[2], sys.argv[3]
heard = set()
with ros_session(domain, discovery) as session:
    node = Node('listener')
    node.create_subscription(String, 'topic', lambda message: heard.add(message.data), 10)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    session.spin(executor)
    print('open', flush=True)
    session.wait_until(lambda: wanted in heard, {LIMIT_S})
    lines = Path('/proc/net/udp').read_text().splitlines()[1:]
    print(*sorted(heard))
    print(*(int(line.split()[1].partition(':')[2], 16) for line in lines), flush=True)
"""


def heard_by(listener: subprocess.Popen) -> list[str]:
    return listener.stdout.readline().split()


def test_discovery_range_that_two_machines_need(machines):
    one, two = machines
    # On machine two, one hears the network and one its machine only. `local` is its own talker.
    wide = two.start(LISTENER, DOMAIN, 'SUBNET', 'robot')
    narrow = two.start(LISTENER, DOMAIN, 'LOCALHOST', 'local')
    with ended(wide, narrow):
        assert [wide.stdout.readline(), narrow.stdout.readline()] == ['open\n', 'open\n']
        robot = one.start(TALKER, 'robot', **ROBOT)
        shy = one.start(TALKER, 'shy', **ROBOT | {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'})
        stranger = one.start(TALKER, 'stranger', **ROBOT | {'ROS_DOMAIN_ID': '43'})
        with ended(robot, shy, stranger):
            assert heard_by(wide) == ['robot']
            local = two.start(TALKER, 'local', **ROBOT)
            with ended(local):
                assert heard_by(narrow) == ['local']
        ports = {int(port) for port in wide.stdout.readline().split()}
    assert {port for port in ports if 7400 <= port < 32768} <= PORTS
    assert 7400 + 250 * DOMAIN in ports


def test_ports_that_a_firewall_must_open(machines):
    one, two = machines
    first, *_, last = sorted(PORTS)
    with (
        one.firewall('drop', f'udp dport {first}-{last} accept'),
        two.firewall('drop', f'udp dport {first}-{last} accept'),
    ):
        listener = two.start(LISTENER, DOMAIN, 'SUBNET', 'robot')
        robot = one.start(TALKER, 'robot', **ROBOT)
        with ended(listener, robot):
            assert listener.stdout.readline() == 'open\n'
            assert heard_by(listener) == ['robot']


def test_a_network_without_multicast(machines):
    one, two = machines
    rule = 'ip daddr 224.0.0.0/4 drop'
    with one.firewall('accept', rule), two.firewall('accept', rule):
        # One listener knows the address of the other machine. One knows nothing.
        told = two.start(LISTENER, DOMAIN, 'SUBNET', 'robot', ROS_STATIC_PEERS=ADDRESSES[0])
        lost = two.start(LISTENER, DOMAIN + 1, 'SUBNET', 'robot')
        robots = [
            one.start(TALKER, 'robot', **ROBOT | {'ROS_DOMAIN_ID': str(domain)})
            for domain in (DOMAIN + 1, DOMAIN)
        ]
        with ended(told, lost, *robots):
            assert [told.stdout.readline(), lost.stdout.readline()] == ['open\n', 'open\n']
            assert heard_by(told) == ['robot']
            # Nodes announce themselves every 3 s.
            assert select.select([lost.stdout], [], [], 4) == ([], [], [])


# --- The slow subscriber on another machine ------------------------------------------------------

# Publishes as lesson 02 does, and asks for the other machine's time after each message.
PUBLISHER = f"""{END}
import json, time
import rclpy
from std_msgs.msg import Float64, String

rclpy.init()
node = rclpy.create_node('minimal_publisher')
publisher = node.create_publisher(String, 'topic', {DEPTH})
question = node.create_publisher(Float64, 'question', 10)
answers = []
node.create_subscription(Float64, 'answer', lambda message: answers.append(message.data), 10)

def ask():
    asked = time.monotonic()
    question.publish(Float64())
    while not answers:
        rclpy.spin_once(node, timeout_sec=0.1)
    return asked, answers.pop(), time.monotonic()

while not (publisher.get_subscription_count() and question.get_subscription_count()):
    rclpy.spin_once(node, timeout_sec=0.02)
print('ready', flush=True)
sys.stdin.readline()
threading.Thread(target=end_with_input, daemon=True).start()
clocks = [ask() for _ in range(20)]
published = []
start = time.monotonic()
for number in range({MESSAGES}):
    time.sleep(max(0, start + 0.05 * number - time.monotonic()))
    before = time.monotonic()
    publisher.publish(String(data=f'Hello World: {{number}}'))
    published.append((number, before, ask()[1]))
print(json.dumps([clocks, published]))
"""

SUBSCRIBER = f"""{END}
import json, time
from helpers.session import ros_session
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float64, String

class SlowSubscriber(Node):
    def __init__(self):
        super().__init__('slow_subscriber')
        self.heard = []
        self.create_subscription(String, 'topic', self.listener_callback, {DEPTH})

    def listener_callback(self, message):
        started = time.monotonic()
        time.sleep(0.2)
        number = int(message.data.split()[-1])
        self.heard.append((number, started, time.monotonic()))

class Clock(Node):
    def __init__(self):
        super().__init__('clock')
        self.publisher = self.create_publisher(Float64, 'answer', 10)
        self.create_subscription(Float64, 'question', self.answer, 10)

    def answer(self, message):
        self.publisher.publish(Float64(data=time.monotonic()))

with ros_session(domain_id={DOMAIN}, discovery='SUBNET') as session:
    subscriber, clock = SlowSubscriber(), Clock()
    for node in (subscriber, clock):
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        session.spin(executor)
    session.wait_until(lambda: subscriber.count_publishers('topic'), {LIMIT_S})
    session.wait_until(lambda: clock.publisher.get_subscription_count(), {LIMIT_S})
    print('ready', flush=True)
    sys.stdin.readline()
    threading.Thread(target=end_with_input, daemon=True).start()
    session.wait_until(
        lambda: subscriber.heard and subscriber.heard[-1][0] == {MESSAGES} - 1, {LIMIT_S}
    )
print(json.dumps(subscriber.heard))
"""


def record(clocks: list, published: list, heard: list) -> tuple[pd.DataFrame, float]:
    """Return the table of both machines on the subscriber's clock, and the longest delay in s.

    A question and its answer tell between which limits the other clock is ahead: the answer was
    written after the question was asked, and before the answer came. The earliest time at which a
    message can have been published is in the table. The error of the clocks is in the delay, since
    each message had arrived when the question that was sent behind it was answered.
    """
    behind = max(answer - came for _, answer, came in clocks)
    at_most = min(answer - asked for asked, answer, _ in clocks)
    assert behind <= AHEAD_S <= at_most
    sent = pd.DataFrame(published, columns=['seq', 'published_s', 'arrived_s'])
    sent['published_s'] += behind
    table = sent.merge(pd.DataFrame(heard, columns=COLUMNS[:1] + COLUMNS[2:4]), 'left', on='seq')
    table['thread'] = table['started_s'].notna().map({True: 'worker 1', False: None})
    return table[COLUMNS], (sent['arrived_s'] - sent['published_s']).max()


def test_a_slow_subscriber_on_another_machine_is_explained(machines):
    one, two = machines
    subscriber = two.start(SUBSCRIBER)
    publisher = one.start(PUBLISHER, **ROBOT)
    with ended(publisher, subscriber):
        assert [p.stdout.readline() for p in (publisher, subscriber)] == ['ready\n'] * 2
        for process in (subscriber, publisher):
            process.stdin.write('go\n')
            process.stdin.flush()
        clocks, published = json.loads(publisher.stdout.readline())
        heard = json.loads(subscriber.stdout.readline())
    table, delay_s = record(clocks, published, heard)
    assert table['seq'].tolist() == list(range(MESSAGES))
    explanation = explain(table, DEPTH, threads=1, delay_s=delay_s)
    print(f'\n{explanation}\nLongest delay, with the error of the clocks: {1e3 * delay_s:.1f} ms')
    assert explanation.lost > 0
    assert explanation.complete, f'{explanation}\n{table.to_string()}'


def test_nothing_is_left():
    """The namespaces of a process that is killed are gone, and all that ran in them."""
    with contextlib.ExitStack() as stack:
        machine = Machine(stack)
        namespaces = {os.readlink(f'/proc/{machine.pid}/ns/{kind}') for kind in ('net', 'mnt')}
        machine._process.stdin.close()  # as the kernel does when this process is killed
        machine._process.wait(LIMIT_S)
        for links in Path('/proc').glob('[0-9]*/ns'):
            with contextlib.suppress(OSError):
                assert not namespaces & {os.readlink(link) for link in links.iterdir()}
        machine._process.stdin = None
    assert not Path('/proc', machine.pid).exists()
