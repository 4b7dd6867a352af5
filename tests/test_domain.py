"""Kernels of one machine do not hear each other, unless they agree to."""

import contextlib
import fcntl
import os
import random
import socket
import time
from collections import Counter
from pathlib import Path

import pytest
import rclpy
from domain_coordinator import domain_id as reserved_domain_id
from rclpy.node import Node
from support.nodes import LIMIT_S, Listener, spin
from support.processes import run_python, running

from helpers.ros import domain, graph_environment, remove_dead_segments, ros_session
from helpers.ros.domain import configure_discovery, reserve_domain_id


def domain_of_session():
    return rclpy.get_default_context().get_domain_id()


def test_no_domain_left():
    # The real reservation, in a range of ports that no other process of this machine needs.
    said = run_python("""
        import contextlib, socket
        import domain_coordinator.impl
        domain_coordinator.impl.PORT_BASE = 21000
        sockets = [socket.socket() for _ in range(100)]
        for number, taken in enumerate(sockets, 1):
            with contextlib.suppress(OSError):
                taken.bind(('', 21000 + number))
        from helpers.ros import ros_session
        try:
            with ros_session():
                print('never')
        except RuntimeError as error:
            print(error)
        sockets[41].close()
        with ros_session():
            print('open')
    """)
    assert said.splitlines() == [
        'All 100 ROS domain ids of this machine are in use: '
        'shut down the kernels that you no longer need, then run this cell again.',
        'open',
    ]


def test_a_domain_with_nodes_that_nobody_has_reserved_comes_last():
    said = run_python("""
        import domain_coordinator.impl
        import rclpy
        from helpers.ros.domain import change_domain_id, reserve_domain_id
        domain_coordinator.impl.PORT_BASE = 21200
        rclpy.init(domain_id=reserve_domain_id())
        left_over = rclpy.create_node('left_over')
        domain_coordinator.impl.PORT_BASE = 21400  # nothing is reserved here
        change_domain_id()
        print(reserve_domain_id() != rclpy.get_default_context().get_domain_id())
        rclpy.shutdown()
    """)
    assert said.strip() == 'True'


@pytest.fixture
def shared_id():
    """Return a domain id that no process of this machine has reserved."""
    with reserved_domain_id(lambda: random.randint(30, 100)) as free:
        pass
    return free


def is_free(domain_id):
    with contextlib.suppress(RuntimeError), reserved_domain_id(lambda: domain_id):
        return True
    return False


def test_only_processes_that_agree_hear_each_other(shared_id):
    other = """
        from support.nodes import Talker, spin
        from helpers.ros import ros_session
        with ros_session({}) as session:
            talker = Talker(10**6)
            talker.next_number = {}
            spin(session, talker)
            print(session.environment['ROS_DOMAIN_ID'], flush=True)
            input()
    """
    with ros_session():
        own = domain_of_session()
    with ros_session(domain_id=shared_id) as session:
        listener = Listener()
        spin(session, listener)
        with running(other.format('', 0)) as stranger:
            elsewhere = int(stranger.stdout.readline())
            # The guest is heard, although it began later.
            with running(other.format(shared_id, 10**5)) as guest:
                session.wait_until(lambda: len(listener.heard) >= 25, LIMIT_S)
                # Not killed: Fast DDS may crash when this session closes, see environment.md.
                guest.communicate('\n')
            assert stranger.poll() is None
        assert min(int(data.split()[-1]) for data in listener.heard) >= 10**5
    # Each kernel has a domain of its own, and keeps it.
    assert own == reserve_domain_id() != elsewhere
    assert {1 <= own <= 100, 1 <= elsewhere <= 100} == {True}


def test_no_kernel_reserves_a_domain_that_is_shared(shared_id):
    with ros_session(domain_id=shared_id) as session:
        assert not is_free(shared_id)
    assert is_free(shared_id), session  # also while a notebook keeps it


def test_domain_of_somebody_else(shared_id):
    with (
        reserved_domain_id(lambda: shared_id),
        pytest.raises(ValueError, match=f'Domain {shared_id} is reserved on this machine: agree'),
        ros_session(domain_id=shared_id),
    ):
        pass
    assert not rclpy.ok()
    with ros_session(domain_id=shared_id):
        pass


def test_hostile_variables(monkeypatch, shared_id):
    """A session is on this machine only, whatever the shell says, unless it asks for more."""
    for name, value in {
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET',
        'ROS_DOMAIN_ID': '0',
        'ROS_LOCALHOST_ONLY': '0',
        'ROS_STATIC_PEERS': '192.0.2.1',
    }.items():
        monkeypatch.setenv(name, value)
    wide = {
        'ROS_DOMAIN_ID': str(shared_id),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET',
        'ROS_STATIC_PEERS': '192.0.2.1',
    }
    narrow = {
        'ROS_DOMAIN_ID': str(reserve_domain_id()),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
    }
    for options, expected in (
        ({'domain_id': shared_id, 'discovery': 'SUBNET'}, wide),
        ({'domain_id': 0}, {**narrow, 'ROS_DOMAIN_ID': '0'}),
        ({}, narrow),
    ):
        with ros_session(**options):
            assert graph_environment() == expected
            assert str(domain_of_session()) == expected['ROS_DOMAIN_ID']
            for name in ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_STATIC_PEERS'):
                assert os.environ.get(name) == expected.get(name)
            assert 'ROS_LOCALHOST_ONLY' not in os.environ
        assert graph_environment() == narrow
    configure_discovery('LOCALHOST')  # also if nothing is to be removed


PLAIN = """
import rclpy, sys
rclpy.init()
node = rclpy.create_node('plain')
sys.stdin.read()
"""


def test_a_session_announces_itself_often():
    """In a pause of a plain participant, which is 3 s long, a session says five times who it is.

    Both send to the ports of participants that may be there: here to that of the twentieth.
    """
    announced = Counter()
    with ros_session() as session, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
        port.bind(('127.0.0.1', 7400 + 250 * domain_of_session() + 10 + 2 * 20))
        port.settimeout(LIMIT_S)
        node = Node('session')
        ours = participant_of(session, node, 'session')
        with running(PLAIN, FASTRTPS_DEFAULT_PROFILES_FILE=None, **graph_environment()):
            theirs = participant_of(session, node, 'plain')
            # It begins with five, 0.1 s apart, and answers at once what it discovers: some of its
            # first pauses are short. A session that spoke as seldom would never say so five times.
            most = pauses = 0
            while most < 5 and pauses < 20:
                announced.clear()
                while not announced[theirs]:
                    announced[sender_of(port)] += 1
                most, pauses = max(most, announced[ours]), pauses + 1
    assert most >= 5


def participant_of(session, node, name):
    """Return the prefix of the GUID of the participant in which a node is."""
    found = []

    def is_there():
        found[:] = [
            bytes(one.endpoint_gid[:12])
            for one in node.get_publishers_info_by_topic('/rosout')
            if one.node_name == name
        ]
        return found

    session.wait_until(is_there, LIMIT_S)
    return found[0]


def sender_of(port):
    """Return the prefix of the GUID of the participant that sends the next RTPS message."""
    return port.recv(65536)[8:20]


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        ({'domain_id': '42'}, "a whole number from 0 to 101, not '42'"),
        ({'domain_id': 102}, 'a whole number from 0 to 101, not 102'),
        ({'domain_id': -1}, 'a whole number from 0 to 101, not -1'),
        ({'discovery': 'subnet'}, "'LOCALHOST' or 'SUBNET', not 'subnet'"),
        ({'discovery': 'SUBNET'}, 'needs the domain id that the other machines use'),
    ],
)
def test_bad_domain_or_discovery(arguments, said):
    with pytest.raises(ValueError, match=said):
        ros_session(**arguments)


# The turn to make or to end a participant


@pytest.fixture
def turn(tmp_path, monkeypatch):
    """Return an open folder. Its lock is the turn to make or to end a participant."""
    monkeypatch.setattr(domain, 'SHARED_MEMORY', str(tmp_path))
    folder = os.open(tmp_path, os.O_RDONLY)
    yield folder
    os.close(folder)


def has(turn):
    """Return whether this lock can be taken. It is given back."""
    try:
        fcntl.flock(turn, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    fcntl.flock(turn, fcntl.LOCK_UN)
    return True


def test_participants_are_made_and_ended_in_turn(turn, monkeypatch):
    free = set()

    class Noting(Node):
        def __init__(self, *arguments, **options):
            free.add(('made', has(turn)))
            super().__init__(*arguments, **options)

        def destroy_node(self):
            free.add(('ended', has(turn)))
            super().destroy_node()

    monkeypatch.setattr('helpers.ros.session.Node', Noting)
    with ros_session():
        assert has(turn)
    assert has(turn)
    assert free == {('made', False), ('ended', False)}


def test_what_a_killed_process_left_in_shared_memory_is_removed():
    dead, living, young = (
        Path('/dev/shm', f'fastrtps_{number:016x}') for number in (os.getpid(), 1, 2)
    )
    for name in dead, living, young:
        name.touch()
        Path(f'{name}_el').touch()
    os.utime(f'{dead}_el', (0, 0))
    os.utime(f'{living}_el', (0, 0))
    os.utime(f'{young}_el', (time.time() + 60,) * 2)  # somebody is about to take it
    with open(f'{living}_el') as lock:
        fcntl.flock(lock, fcntl.LOCK_SH)
        remove_dead_segments()
        assert [one.exists() for one in (dead, living, young)] == [False, True, True]
    os.utime(f'{young}_el', (0, 0))
    remove_dead_segments()
    assert [living.exists(), young.exists()] == [False, False]
