"""Programs made of the cells that a lesson shows: however they end, their robot stands."""

import os
import signal
import subprocess
import sys

import pytest
from geometry_msgs.msg import Twist
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci as Patrol

from helpers.lesson import code_of_solution, path_of, read
from helpers.robot import KIND, Floor, Robot
from helpers.ros import graph_environment, ros_session

HALL = Floor.from_text('#' * 40 + '\n#>' + ' ' * 37 + '#\n' + '#' * 40, name='long hall')
PATROLLER = ('lesson-07-04', 'lesson-07-07', 'the-patroller', 'job-07-solution-4')
MAIN = 'a-main-of-its-own'
PLAIN_MAIN = """
def main():
    rclpy.init()
    executor = MultiThreadedExecutor(num_threads=3)
    executor.add_node(ObedientPatroller())
    executor.spin()
"""


def cells(lesson, *ids):
    """Return the code of these cells of a lesson, as a program."""
    path = path_of(lesson)
    found = {cell.id: cell for cell in read(path.read_text(encoding='utf-8'), path.name).cells}
    return '\n\n'.join(code_of_solution(found[id].source) for id in ids)


class Operator(Node):
    """Sends a patroller on a long patrol, and hears what it commands."""

    def __init__(self):
        super().__init__('operator')
        self.client = ActionClient(self, Patrol, 'patrol')
        self.speeds = []
        self.create_subscription(Twist, 'cmd_vel', self.command_callback, 100)

    def command_callback(self, message):
        self.speeds.append(message.linear.x)


def end_a_patrol(program, end):
    """Start a program, end it on its patrol, and return the commands, and whether it stands.

    The base has no time-out: without another command the robot would drive on.
    """
    with ros_session() as session:
        robot, operator = Robot(HALL, driver=KIND.but(command_timeout_s=None)), Operator()
        executor = SingleThreadedExecutor()
        executor.add_node(operator)
        session.spin(executor)
        process = subprocess.Popen(
            [sys.executable, program],
            env=os.environ | graph_environment(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            session.wait_until(operator.client.server_is_ready, 20)
            executor.create_task(operator.client.send_goal_async, Patrol.Goal(order=100))
            session.wait_until(lambda: len(operator.speeds) > 8, 20)
            process.send_signal(end)
            heard = len(operator.speeds)
            robot.run(3)
            process.wait(20)
        finally:
            process.kill()
            process.wait()
    assert heard < 80, 'the patrol was over'
    return operator.speeds, robot.stopped


@pytest.mark.parametrize('end', [signal.SIGINT, signal.SIGTERM])
def test_a_patrol_that_is_ended_leaves_a_robot_that_stands(tmp_path, end):
    program = tmp_path / 'patrol.py'
    program.write_text(cells('run_a_long_job', *PATROLLER, MAIN) + '\n\nmain()\n')
    speeds, stands = end_a_patrol(program, end)
    assert stands
    assert speeds[-1] == 0.0
    assert speeds.count(0.0) == 1, 'somebody commanded after the stop'


def test_a_finally_alone_cannot_stop_it(tmp_path):
    program = tmp_path / 'patrol.py'
    program.write_text(cells('run_a_long_job', *PATROLLER) + PLAIN_MAIN + '\n\nmain()\n')
    speeds, stands = end_a_patrol(program, signal.SIGINT)
    assert not stands
    assert speeds[-1] == 0.5
