"""A robot and a session on two machines.

The machines are network namespaces joined by a veth pair, each with its own shared memory. They are
gone when the processes in them are.
"""

import contextlib
import os
import select
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

DOMAIN = 42
LIMIT_S = 60
ADDRESSES = ('192.0.2.1', '192.0.2.2')  # reserved for documentation: nobody's
# What a firewall must let in: discovery, then two ports for each of the first ten participants.
PORTS = {7400 + 250 * DOMAIN, *range(7410 + 250 * DOMAIN, 7430 + 250 * DOMAIN)}
# A robot: no helpers, only the two variables.
ROBOT = {'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}


class Machine:
    """A machine that is a few namespaces, held by a process that ends with this one."""

    def __init__(self, stack: contextlib.ExitStack, inside: str = '') -> None:
        own = ['--net', '--mount', '--ipc', '--fork']
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
        self._enter = f'{self.user or target} --net --mount --ipc'.split()

    def _end(self) -> None:
        self._process.communicate()  # ends its input, as the kernel does when this one is killed

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
        two = Machine(stack, inside=one.user)
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


def test_discovery_range_and_open_ports_that_two_machines_need(machines):
    one, two = machines
    first, *_, last = sorted(PORTS)
    rule = f'udp dport {first}-{last} accept'
    with one.firewall('drop', rule), two.firewall('drop', rule):
        # On machine two, one hears the network and one its machine only: `local`.
        wide = two.start(LISTENER, DOMAIN, 'SUBNET', 'robot')
        narrow = two.start(LISTENER, DOMAIN, 'LOCALHOST', 'local')
        with ended(wide, narrow):
            assert [wide.stdout.readline(), narrow.stdout.readline()] == ['open\n', 'open\n']
            robot = one.start(TALKER, 'robot', **ROBOT)
            shy = one.start(TALKER, 'shy', **ROBOT | {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'})
            with ended(robot, shy):
                assert heard_by(wide) == ['robot']
                local = two.start(TALKER, 'local', **ROBOT)
                with ended(local):
                    assert heard_by(narrow) == ['local']
            ports = {int(port) for port in wide.stdout.readline().split()}
    assert {port for port in ports if 7400 <= port < 32768} <= PORTS
    assert 7400 + 250 * DOMAIN in ports


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
