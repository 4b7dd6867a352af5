"""A robot and a session on two machines."""

import select
import subprocess
from collections.abc import Iterator

import pytest
from support.machines import ADDRESSES, Machine, ended, two_machines
from support.waits import START_LIMIT_S

DOMAIN = 42
# What a firewall must let in: discovery, then two ports for each of the first ten participants.
PORTS = {7400 + 250 * DOMAIN, *range(7410 + 250 * DOMAIN, 7430 + 250 * DOMAIN)}
# A robot: no helpers, only the two variables.
ROBOT = {'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}


@pytest.fixture(scope='module')
def machines() -> Iterator[list[Machine]]:
    """Two machines on one cable."""
    with two_machines() as both:
        yield both


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
from helpers.session import ros_session
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


def test_range_and_ports_that_two_machines_need(machines):
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
