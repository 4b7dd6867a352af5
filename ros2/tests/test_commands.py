"""The ros2 command: what the real one prints, and what it does where the real one leaves off."""

import contextlib
import importlib
import json
import os
import random
import re
import signal
import socket
import sys
import time
from pathlib import Path

import pytest
from processes import process, python, ros2
from waits import LIMIT_S, START_LIMIT_S

from ros2_command import index
from ros2_command.discovery import (
    FIRST_PORT,
    OFFSET,
    PARTICIPANTS,
    PORTS_OF_A_DOMAIN,
    _count_participants,
)
from ros2_command.values import _slots, filled, to_yaml

HERE = Path(__file__).parent
OUTPUTS = {real['command']: real for real in json.loads((HERE / 'outputs.json').read_text())}
RACES = re.compile(r'(?m)^(waiting for service|Waiting for at least).*\n')  # in some runs only
MOVING = re.compile(r'(?<=GID: ).*|(?<=ID: )[0-9a-f]{32}|(?<=_ros2cli_)\w+')
TOOLS = re.compile('launch|osrf|ros2|rosidl_runtime_py')  # packages of the real command


@pytest.fixture(scope='module')
def graph(domain):
    """Run the nodes at which the real command was pointed."""
    with process(sys.executable, str(HERE / 'graph.py')) as nodes:
        assert nodes.stdout.readline() == 'ready\n'
        yield nodes


def masked(text):
    text = MOVING.sub('*', RACES.sub('', text))
    return text.replace(sys.prefix, 'ENVIRONMENT')


def test_prints_what_the_real_command_prints(graph, run):
    differ = {}
    for command, real in OUTPUTS.items():
        expected = real['exit'], real['stdout'], real['stderr']
        printed = run(command.removeprefix('ros2 '))
        if command == 'ros2 pkg list':  # the packages of two environments
            packages = [name for name in real['stdout'].split() if not TOOLS.match(name)]
            printed, expected = set(packages) - set(printed[1].split()), set()
        elif command == 'ros2 pkg executables':  # this environment may have more
            lines = [line for line in real['stdout'].splitlines() if not TOOLS.match(line)]
            printed, expected = set(lines) - set(printed[1].splitlines()), set()
        elif command == 'ros2 interface package std_srvs':  # in an order that is never the same
            printed, expected = [(s, sorted(o.split()), e) for s, o, e in (printed, expected)]
        else:
            printed, expected = [(s, masked(o), masked(e)) for s, o, e in (printed, expected)]
        if printed != expected:
            differ[command] = printed, expected
    assert differ == {}
    assert len(OUTPUTS) == 71


# --- Values


def instances():
    """Yield a message of each part of each interface of the wheels."""
    parts = {'msg': [''], 'srv': ['Request', 'Response'], 'action': ['Goal', 'Result', 'Feedback']}
    for name in index.interfaces():
        package, kind, last = name.split('/')
        class_ = getattr(importlib.import_module(f'{package}.{kind}'), last)
        for part in parts[kind]:
            yield (getattr(class_, part) if part else class_)()


def drawn(slot, draw):
    """Return a value for a slot of a message."""
    name = type(slot).__name__
    if 'Sequence' in name or name == 'Array':
        most = min(slot.maximum_size, 3) if name == 'BoundedSequence' else 3
        size = slot.size if name == 'Array' else draw.randint(0, most)
        return [drawn(slot.value_type, draw) for _ in range(size)]
    if hasattr(slot, 'namespaced_name'):
        *modules, last = slot.namespaced_name()
        return drawn_message(getattr(importlib.import_module('.'.join(modules)), last)(), draw)
    if 'String' in name:
        most = min(getattr(slot, 'maximum_size', 8), 8)
        return ''.join(draw.choices('aé1: \n\t#-\'"{}[]~\\\x85\u2028😀🤖', k=draw.randint(0, most)))
    if slot.typename == 'boolean':
        return draw.random() < 0.5
    if slot.typename == 'octet':
        return bytes([draw.randrange(256)])
    if slot.typename in ('float', 'double'):
        return draw.choice([0.0, 0.1, -1e30, 1e-7, float('inf'), draw.uniform(-9, 9)])
    bits = int(re.sub(r'\D', '', slot.typename) or 8)
    return draw.choice([0, 1, 2 ** (bits - slot.typename.startswith('int')) - 1])


def drawn_message(message, draw):
    for name, slot in _slots(message):
        setattr(message, name, drawn(slot, draw))
    return message


@pytest.mark.parametrize('flow_style', [False, True])
def test_yaml_of_every_interface_becomes_the_message(flow_style):
    draw, number = random.Random(2026), 0
    for message in instances():
        for _ in range(3):
            expected = drawn_message(type(message)(), draw)
            text = to_yaml(expected, flow_style)
            assert filled(type(message)(), text, '{}') == expected, text
            number += 1
    assert number > 600


# --- What may happen


PUBLISHERS = """
import sys, rclpy
from rclpy.node import Node
from std_msgs.msg import Int32, String
rclpy.init()
nodes = [Node(f'node_{i}') for i in range(int(sys.argv[1]))]
nodes[-1].create_publisher(Int32 if len(nodes) > 1 else String, '/both', 1)
print('ready', flush=True)
sys.stdin.read()
"""


def test_finds_200_nodes_at_once(own_domain, run):
    with python(PUBLISHERS, '199') as many, python(PUBLISHERS, '1') as single:
        assert many.stdout.readline() == single.stdout.readline() == 'ready\n'
        assert run('node list -c') == (0, '200\n', '')
        assert run('topic list -t')[1].count('/both [std_msgs/msg/Int32, std_msgs/msg/String]') == 1
        status, out, err = run('topic echo /both')
        assert (status, out) == (1, '')
        assert err == (
            "Cannot echo topic '/both', as it contains more than one type: "
            '[std_msgs/msg/Int32, std_msgs/msg/String]\n'
        )


def test_counts_each_participant_while_other_programs_open_and_close_ports(own_domain):
    busy = """
import socket, time
while True:
    beside = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(6)]
    for one in beside:
        one.bind(('127.0.0.1', 0))
    time.sleep(0.002)
    for one in beside:
        one.close()
"""
    first = FIRST_PORT + PORTS_OF_A_DOMAIN * own_domain + OFFSET
    with contextlib.ExitStack() as stack:
        for index_of_participant in range(PARTICIPANTS):
            held = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            stack.enter_context(held).bind(('127.0.0.1', first + 2 * index_of_participant))
        stack.enter_context(python(busy))
        deadline = time.monotonic() + 2
        while time.monotonic() < deadline:
            assert _count_participants(own_domain) == PARTICIPANTS


def test_sees_nodes_of_many_processes_right_after_their_start(own_domain, run):
    with contextlib.ExitStack() as stack:
        started = [stack.enter_context(python(PUBLISHERS, '1')) for _ in range(4)]
        for publisher in started:
            assert publisher.stdout.readline() == 'ready\n'
        for _ in range(5):
            assert run('node list -c')[1] == '4\n'


def test_echo_goes_on_when_a_publisher_ends(domain):
    script = """
import time, rclpy
from std_msgs.msg import String
rclpy.init()
publisher = rclpy.create_node('short').create_publisher(String, '/short', 1)
while not publisher.get_subscription_count():
    time.sleep(0.01)
publisher.publish(String(data='said'))
publisher.wait_for_all_acked()
"""
    with ros2(
        'topic', 'echo', '/short', 'std_msgs/msg/String', '--qos-reliability', 'reliable'
    ) as echo:
        for _ in range(2):
            with python(script) as short:
                assert short.wait(START_LIMIT_S) == 0, short.stderr.read()
            assert [echo.stdout.readline() for _ in range(2)] == ['data: said\n', '---\n']
        assert echo.poll() is None


@pytest.mark.parametrize(
    ('words', 'first'),
    [
        (['topic', 'echo', '/imu/data', '--field', 'header.frame_id'], '\n'),
        (['topic', 'hz', '/nothing'], 'WARNING: topic [/nothing] does not appear'),
        (['topic', 'pub', '/out', 'std_msgs/msg/Empty'], 'publisher: beginning loop'),
        (['service', 'call', '/nothing', 'std_srvs/srv/Empty'], 'waiting for service'),
    ],
)
def test_ctrl_c_ends_a_command_without_a_word(graph, words, first):
    with ros2(*words) as command:
        assert command.stdout.readline().startswith(first)
        command.send_signal(signal.SIGINT)
        _, err = command.communicate(timeout=LIMIT_S)
        assert (command.returncode, err) == (int(signal.SIGINT), '')


def test_a_closed_pipe_is_no_error(graph):
    with ros2('topic', 'echo', '/imu/data') as command:
        command.stdout.readline()
        command.stdout.close()
        assert command.wait(LIMIT_S) == 128 + signal.SIGPIPE
        assert command.stderr.read() == ''


@pytest.mark.parametrize(
    ('command', 'status', 'sentence'),
    [
        ('tpic', 2, "ros2: error: invalid choice: 'tpic' (choose from "),
        ('topic lst', 2, "ros2 topic: error: invalid choice: 'lst' (choose from "),
        ('topic hz', 2, 'ros2 topic hz: error: the following arguments are required: topic_name'),
        ('topic echo /chatter no_msgs/msg/No', 1, 'The passed message type is invalid'),
        ('topic echo /battery --field nope --once', 1, "Invalid field 'nope': 'BatteryState' ob"),
        ('topic echo /a//b', 1, 'Invalid topic name: '),
        ('topic pub /x std_msgs/msg/String "{data: [}"', 1, 'The passed value is not YAML: '),
        ('topic pub /x std_msgs/msg/String text', 1, 'The passed value needs to be a dictionary'),
        ('topic pub /x std_msgs/msg/Int8 "{data: x}"', 1, 'Failed to populate field: inv'),
        ('service call /motors std_srvs/srv/No', 1, 'The passed service type is invalid'),
        ('service call /motors std_srvs/srv/SetBool "{on: 1}"', 1, 'Failed to populate field: '),
        ('action send_goal /count test_msgs/action/No', 1, 'The passed action type is invalid'),
        ('param set /robot frame "{a: 1}"', 1, "'{a: 1}' is no value of a parameter"),
        ('param load /robot nowhere.yaml', 1, 'Cannot load nowhere.yaml: '),
        ('lifecycle get /robot', 1, 'Node not found'),
        ('pkg executables nothing', 1, "Package 'nothing' not found"),
    ],
)
def test_mistakes_get_one_sentence_and_a_status(graph, run, command, status, sentence):
    ended_with, out, err = run(command)
    assert (ended_with, out) == (status, '')
    assert err.startswith(sentence)
    assert err.count('\n') == 1


def test_lifecycle_walks_through_the_states(own_domain, run):
    script = """
import rclpy
from rclpy.lifecycle import LifecycleNode
rclpy.init()
node = LifecycleNode('camera')
print('ready', flush=True)
rclpy.spin(node)
"""
    with python(script) as camera:
        assert camera.stdout.readline() == 'ready\n'
        assert run('lifecycle nodes')[1] == '/camera\n'
        assert run('lifecycle get')[1] == '/camera: unconfigured [1]\n'
        assert run('lifecycle list /camera')[1].startswith('- configure [1]\n\tStart: unconfig')
        assert run('lifecycle set /camera configure') == (0, 'Transitioning successful\n', '')
        assert run('lifecycle get camera')[1] == 'inactive [2]\n'
        assert run('lifecycle set camera fly')[2].startswith('Unknown transition requested, ava')


# --- Beside the graph


def test_leaves_to_a_sourced_ros(tmp_path):
    real = tmp_path / 'ros2'
    real.write_text('#!/bin/sh\necho the real one: "$@"\n')
    real.chmod(0o755)
    path = f'{Path(sys.executable).parent}:{tmp_path}:{os.environ["PATH"]}'
    env = os.environ | {'PATH': path}
    with ros2('topic', 'list', env=env | {'ROS_DISTRO': 'jazzy'}) as command:
        assert command.communicate(timeout=START_LIMIT_S)[0] == 'the real one: topic list\n'
    with ros2('--version', env=env) as command:
        assert 'follows ros2cli 0.32.2' in command.communicate(timeout=START_LIMIT_S)[0]


def test_tab_completes_names(graph, tmp_path):
    def completed(line):
        file = tmp_path / 'completions'
        script = (
            'import os, sys; os.dup2(os.open(sys.argv[1], os.O_RDWR | os.O_CREAT), 8);'
            'from ros2_command.main import main; main()'
        )
        variables = {'COMP_LINE': line, 'COMP_POINT': str(len(line)), '_ARGCOMPLETE': '1'}
        with python(script, file, env=os.environ | variables) as command:
            command.wait(START_LIMIT_S)
        return file.read_text().split('\v')

    assert completed('ros2 top') == ['topic ']
    assert completed('ros2 topic echo /cha') == ['/chatter ']


def test_a_command_whose_end_never_comes_is_ended():
    # A PyDLL holds the interpreter while it waits, as Fast DDS does.
    code = """import ctypes, sys
from ros2_command.guards import at_most
sys.argv[0] = 'ros2'
with at_most(0.2):
    ctypes.PyDLL(None).sleep(60)
"""
    with python(code) as command:
        assert command.wait(LIMIT_S) == 1
