"""A robot and a session on two machines: network namespaces, joined by a cable."""

import contextlib
import os
import select
import shutil
import subprocess
import sys
from collections.abc import Iterator

import pytest
from support.waits import START_LIMIT_S, wait_for

# Each worker of pytest has two of its own; their addresses are reserved for documentation.
MACHINES = {
    f'ros2-{name}-{os.getpid()}': f'192.0.2.{number}'
    for number, name in enumerate(('one', 'two'), 1)
}
ONE, TWO = MACHINES
# With shared memory of its own: otherwise Fast DDS would take both for one machine. It is held by a
# process that ends with its input.
HOLD = 'mount -t tmpfs shm /dev/shm && echo held && read line'
HOLDERS = {}  # the ids of these processes
DOMAIN = 42
# What a firewall must let in: discovery, then two ports for each of the first ten participants.
PORTS = {7400 + 250 * DOMAIN, *range(7410 + 250 * DOMAIN, 7430 + 250 * DOMAIN)}
# A robot: no helpers, only the two variables.
ROBOT = {'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}


def ip(*words: str) -> str:
    return subprocess.run(['ip', *words], check=True, capture_output=True, text=True).stdout


@pytest.fixture(scope='module', autouse=True)
def cable() -> Iterator[None]:
    """Make both machines, and wait until their cable is up: Fast DDS looks at it only once."""
    if os.getuid() or not all(map(shutil.which, ('ip', 'nft', 'unshare'))):
        pytest.skip('LEFT OUT: two machines need root, iproute2, nftables and util-linux.')
    with contextlib.ExitStack() as stack:
        for name in MACHINES:
            ip('netns', 'add', name)
            stack.callback(ip, 'netns', 'delete', name)
            holder = subprocess.Popen(
                ['ip', 'netns', 'exec', name, 'unshare', '--mount', 'sh', '-c', HOLD],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            stack.callback(holder.communicate)
            assert holder.stdout.readline() == 'held\n'
            HOLDERS[name] = holder.pid
        ip('link', 'add', 'eth0', 'netns', ONE, 'type', 'veth', 'peer', 'eth0', 'netns', TWO)
        for name, address in MACHINES.items():
            ip('-netns', name, 'address', 'add', f'{address}/24', 'dev', 'eth0')
            for link in ('lo', 'eth0'):
                ip('-netns', name, 'link', 'set', link, 'up')
        for name in MACHINES:
            show = ('-netns', name, '-brief', 'link', 'show', 'eth0')
            wait_for(lambda show=show: ' UP ' in ip(*show), timeout_s=START_LIMIT_S)
        yield


@contextlib.contextmanager
def firewalls(policy: str, rule: str) -> Iterator[None]:
    """Let a rule of nftables decide which packets from outside come into each machine."""
    chain = f'type filter hook input priority 0; policy {policy}; iif lo accept; {rule};'
    for name in MACHINES:
        ip('netns', 'exec', name, 'nft', f'table inet test {{ chain input {{ {chain} }}; }};')
    yield
    for name in MACHINES:
        ip('netns', 'exec', name, 'nft', 'delete table inet test')


@contextlib.contextmanager
def running(machine: str, script: str, *arguments: object, **variables: str) -> Iterator:
    """Run a Python script on a machine beside the block."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(('ROS_', 'RMW_'))}
    process = subprocess.Popen(
        ['nsenter', f'--target={HOLDERS[machine]}', '--net', '--mount']
        + [sys.executable, '-c', script, *map(str, arguments)],
        env=kept | variables,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


# --- Who hears whom ------------------------------------------------------------------------------

# Each of these ends when its standard input does, at the latest when this test is killed.
END = """
import os, sys, threading
def end_with_input():
    sys.stdin.read()
    os._exit(1)
threading.Thread(target=end_with_input, daemon=True).start()
"""

TALKER = f"""{END}
import time, rclpy
from std_msgs.msg import String
rclpy.init()
publisher = rclpy.create_node('talker').create_publisher(String, 'topic', 10)
while True:
    publisher.publish(String(data=sys.argv[1]))
    time.sleep(0.05)
"""

# Prints who it has heard once it has heard `sys.argv[3]`, and its ports.
LISTENER = f"""{END}
from pathlib import Path
from helpers.ros import ros_session
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String
domain, discovery, wanted = int(sys.argv[1]), sys.argv[2], sys.argv[3]
heard = set()
with ros_session(domain, discovery) as session:
    node = Node('listener')
    node.create_subscription(String, 'topic', lambda message: heard.add(message.data), 10)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    session.spin(executor)
    print('open', flush=True)
    session.wait_until(lambda: wanted in heard, {START_LIMIT_S})
    lines = Path('/proc/net/udp').read_text().splitlines()[1:]
    print(*sorted(heard))
    print(*(int(line.split()[1].partition(':')[2], 16) for line in lines), flush=True)
"""


def heard_by(listener: subprocess.Popen) -> list[str]:
    return listener.stdout.readline().split()


def test_range_and_ports_that_two_machines_need():
    first, *_, last = sorted(PORTS)
    with (
        firewalls('drop', f'udp dport {first}-{last} accept'),
        # On machine two, one hears the network and one its machine only: `local`.
        running(TWO, LISTENER, DOMAIN, 'SUBNET', 'robot') as wide,
        running(TWO, LISTENER, DOMAIN, 'LOCALHOST', 'local') as narrow,
    ):
        assert [wide.stdout.readline(), narrow.stdout.readline()] == ['open\n', 'open\n']
        own = ROBOT | {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
        with running(ONE, TALKER, 'robot', **ROBOT), running(ONE, TALKER, 'shy', **own):
            assert heard_by(wide) == ['robot']
            with running(TWO, TALKER, 'local', **ROBOT):
                assert heard_by(narrow) == ['local']
        ports = {int(port) for port in wide.stdout.readline().split()}
    assert {port for port in ports if 7400 <= port < 32768} <= PORTS
    assert 7400 + 250 * DOMAIN in ports


def test_a_network_without_multicast():
    other = ROBOT | {'ROS_DOMAIN_ID': str(DOMAIN + 1)}
    with (
        firewalls('accept', 'ip daddr 224.0.0.0/4 drop'),
        # One listener knows the address of the other machine. One knows nothing.
        running(TWO, LISTENER, DOMAIN, 'SUBNET', 'robot', ROS_STATIC_PEERS=MACHINES[ONE]) as told,
        running(TWO, LISTENER, DOMAIN + 1, 'SUBNET', 'robot') as lost,
        running(ONE, TALKER, 'robot', **ROBOT),
        running(ONE, TALKER, 'robot', **other),
    ):
        assert [told.stdout.readline(), lost.stdout.readline()] == ['open\n', 'open\n']
        assert heard_by(told) == ['robot']
        # Nodes announce themselves every 3 s.
        assert select.select([lost.stdout], [], [], 4) == ([], [], [])


def test_a_static_peer_is_heard_whatever_the_range_and_localhost_only_is_not():
    """What environment.md says of machines that hear each other, or do not."""
    own = {'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    with (
        firewalls('accept', 'ct state invalid accept'),
        running(TWO, LISTENER, DOMAIN, 'SUBNET', 'told') as listener,
        running(ONE, TALKER, 'alone', **ROBOT, ROS_LOCALHOST_ONLY='1'),
    ):
        assert listener.stdout.readline() == 'open\n'
        with running(ONE, TALKER, 'told', **own, ROS_STATIC_PEERS=MACHINES[TWO]):
            assert heard_by(listener) == ['told']
