"""What an executor does: how many callbacks run at once, and what its waiting costs."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable

import psutil
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from std_msgs.msg import Int32

from helpers.ros import ros_session

QUIET = SubscriptionEventCallbacks(use_default_callbacks=False)
PROGRAM = """
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
rclpy.init()
node, executor = rclpy.create_node('resting'), {executor}()
executor.add_node(node)
print('it spins', flush=True)
executor.spin()
"""
# It needs no other process, and would leave its shared memory behind when it is killed.
ALONE = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'OFF', 'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}
SPIN_S = 2.0


def callbacks_at_once(make: Callable[[], tuple]) -> int:
    """Return how many of 12 callbacks run at the same time: all are held at a gate.

    `make` returns an executor and a callback group.
    """
    gate, inside = threading.Event(), []

    def hold(message):
        inside.append(message)
        gate.wait(timeout=30)

    with ros_session() as session:
        executor, group = make()
        node, topic = Node('gated'), (Int32, 'number')
        node.create_subscription(*topic, hold, 20, callback_group=group, event_callbacks=QUIET)
        executor.add_node(node)
        session.spin(executor)
        publisher = node.create_publisher(*topic, 20)
        for number in range(12):
            publisher.publish(Int32(data=number))
        session.wait_until_quiet(executor)
        count = len(inside)
        gate.set()
    return count


def cpu_of_spin(*executors: str) -> dict[str, float]:
    """Return the CPU time (s) of two seconds of `spin()` in which nothing happens.

    Each executor, given by its name, spins in a program of its own. They spin at the same time, and
    are killed.
    """
    programs = {}
    with contextlib.ExitStack() as stack:
        for executor in executors:
            command = [sys.executable, '-c', PROGRAM.format(executor=executor)]
            program = subprocess.Popen(command, env=os.environ | ALONE, stdout=subprocess.PIPE)
            programs[executor] = stack.enter_context(program)
            stack.callback(program.kill)
        for program in programs.values():
            program.stdout.readline()
        before = {executor: _cpu_s(program) for executor, program in programs.items()}
        time.sleep(SPIN_S)
        return {
            executor: _cpu_s(program) - before[executor] for executor, program in programs.items()
        }


def _cpu_s(program: subprocess.Popen) -> float:
    times = psutil.Process(program.pid).cpu_times()
    return times.user + times.system
