"""Programs made of the cells that a lesson shows: however they end, their robot stands."""

import os
import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest
from geometry_msgs.msg import Twist
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci as Patrol

from helpers.lesson import ROOT, code_of_solution, path_of, read
from helpers.robot import KIND, Floor, Robot
from helpers.ros import graph_environment, ros_session

WALL, LANE = '#' * 40, '#' + ' ' * 38 + '#'
HALL = Floor.from_text(
    '\n'.join([WALL, LANE, LANE, LANE.replace('# ', '#>'), LANE, LANE, WALL]), name='long hall'
)
CRUEL = KIND.but(command_timeout_s=None)  # without another command, the robot would drive on
PATROLLER = ('lesson-07-04', 'lesson-07-07', 'the-patroller', 'job-07-solution-4')
MAIN = 'a-main-of-its-own'
PLAIN_MAIN = """
def main():
    rclpy.init()
    executor = MultiThreadedExecutor(num_threads=3)
    executor.add_node(ObedientPatroller())
    executor.spin()
"""
BRAKE = (
    'lesson-06-03',
    'lesson-06-05',
    'distance-06',
    'solution-06-3',
    'is-fresh',
    'permitted-remote',
    'solution-06-8',
)
MAIN_OF_BRAKE = """
import rclpy


def main():
    rclpy.init()
    executor = SingleThreadedExecutor()
    for node in (SafeBrake(), Camera()):
        executor.add_node(node)
    executor.spin()
"""
DRIVER = ('imports-15', 'careful-driver', 'careful-driver-node', 'solution-15-1')


def cells(lesson, *ids):
    """Return the code of these cells of a lesson, as a program."""
    path = path_of(lesson)
    found = {cell.id: cell for cell in read(path.read_text(encoding='utf-8'), path.name).cells}
    return '\n\n'.join(code_of_solution(found[id].source) for id in ids)


def names_of(lesson, *ids):
    """Return what these cells of a lesson define."""
    names = {}
    exec(cells(lesson, *ids), names)
    return names


@contextmanager
def started(program, code):
    """Start a program in the domain of the session. At the end it is killed."""
    program.write_text(code + '\n\nmain()\n')
    process = subprocess.Popen(
        [sys.executable, program],
        env=os.environ | graph_environment() | {'PYTHONPATH': str(ROOT)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def spin(session, *nodes):
    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    session.spin(executor)
    return executor


class Operator(Node):
    """Sends a patroller on a long patrol, and hears what it commands."""

    def __init__(self):
        super().__init__('operator')
        self.client = ActionClient(self, Patrol, 'patrol')
        self.speeds = []
        self.create_subscription(Twist, 'cmd_vel', self.command_callback, 100)

    def command_callback(self, message):
        self.speeds.append(message.linear.x)


def end_a_patrol(program, code, end):
    """Start a program, end it on its patrol, and return the commands, and whether it stands."""
    with ros_session() as session:
        robot, operator = Robot(HALL, driver=CRUEL), Operator()
        executor = spin(session, operator)
        with started(program, code) as process:
            session.wait_until(operator.client.server_is_ready, 20)
            executor.create_task(operator.client.send_goal_async, Patrol.Goal(order=100))
            session.wait_until(lambda: len(operator.speeds) > 8, 20)
            process.send_signal(end)
            heard = len(operator.speeds)
            robot.run(3)
            process.wait(20)
    assert heard < 80, 'the patrol was over'
    return operator.speeds, robot.stopped


@pytest.mark.parametrize('end', [signal.SIGINT, signal.SIGTERM])
def test_a_patrol_that_is_ended_leaves_a_robot_that_stands(tmp_path, end):
    code = cells('run_a_long_job', *PATROLLER, MAIN)
    speeds, stands = end_a_patrol(tmp_path / 'patrol.py', code, end)
    assert stands
    assert speeds[-1] == 0.0
    assert speeds.count(0.0) == 1, 'somebody commanded after the stop'


def test_a_finally_alone_cannot_stop_it(tmp_path):
    code = cells('run_a_long_job', *PATROLLER) + PLAIN_MAIN
    speeds, stands = end_a_patrol(tmp_path / 'patrol.py', code, signal.SIGINT)
    assert not stands
    assert speeds[-1] == 0.5


@pytest.mark.parametrize('end', [signal.SIGKILL, signal.SIGSTOP])
def test_a_remote_without_its_brake_stands(tmp_path, end):
    lesson = 'call_a_service_from_a_callback'
    with ros_session() as session:
        robot = Robot(HALL, driver=CRUEL)
        spin(session, names_of(lesson, *BRAKE)['PermittedRemote']())
        with started(tmp_path / 'brake.py', cells(lesson, *BRAKE) + MAIN_OF_BRAKE) as process:
            robot.run(30, until=lambda: robot.pose.x > HALL.start.x + 0.5)
            assert robot.pose.x > HALL.start.x + 0.5, 'it never drove'
            process.send_signal(end)
            assert robot.run(5, until=lambda: robot.stopped)
            place = robot.pose.x
            robot.run(1)
    assert robot.pose.x == place
    assert robot.bumps == 0


@pytest.mark.parametrize('trouble', ['silent', 'blind'])
def test_a_driver_without_a_laser_stands(trouble):
    with ros_session() as session:
        robot = Robot(HALL, driver=CRUEL)
        spin(session, names_of('set_parameters', *DRIVER)['Driver']())
        robot.run(30, until=lambda: robot.pose.x > HALL.start.x + 0.5)
        assert robot.pose.x > HALL.start.x + 0.5, 'it never drove'
        setattr(robot, trouble, True)
        assert robot.run(5, until=lambda: robot.stopped)
        place = robot.pose.x
        robot.run(1)
    assert robot.pose.x == place
    assert robot.bumps == 0
