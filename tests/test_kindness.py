"""The project's solution drives robots that are less kind than the one it was written with.

It hits nothing, it arrives, and it stands if the laser is blind: whatever the drivers do. A person
who takes the program of the last lessons to another robot relies on that.
"""

import math
import re
import runpy

import pytest
from std_msgs.msg import Header

from helpers.lesson import code_of_solution, outline, path_of
from helpers.patrol import LAST
from helpers.robot import KIND, TURTLEBOT3, Robot
from helpers.robot.messages import laser_scan
from helpers.ros import ros_session

DRIVERS = {
    'kind': KIND,
    'the last command counts': KIND.but(command_timeout_s=None),
    'commands in steps': KIND.but(command_step=0.01),
    'all around, with gaps': KIND.but(laser='ld08'),
    'slow, and turns quickly': KIND.but(max_speed=0.21, max_turn=2.63, radius_m=0.105),
    'a TurtleBot 3': TURTLEBOT3,
}
PART = re.compile(r'%%write src/patrol_pkg/patrol_pkg/logic\.py part \d+\n')


@pytest.fixture(scope='module')
def logic(tmp_path_factory):
    """Return the functions of logic.py, as the lesson's solutions write them."""
    tasks = outline(path_of('build_a_robot_program')).tasks
    solutions = [code_of_solution(cell.source) for task in tasks for cell in task.solutions]
    parts = [PART.sub('', solution) for solution in solutions if PART.match(solution)]
    assert len(parts) == 3
    file = tmp_path_factory.mktemp('project') / 'logic.py'
    file.write_text('\n\n'.join(parts))
    return runpy.run_path(str(file))


def steer(robot, logic, place):
    """Command what the solution decides for the robot's last scan, and drive for 0.1 s."""
    x, y, yaw = robot.pose
    scan = laser_scan(Header(), robot.record.scans[-1], robot.driver)
    wanted, distance_m = logic['direction'](x, y, yaw, place), math.dist((x, y), place)
    robot.command(*logic['steer'](*logic['beams'](scan), wanted, distance_m, 0.5))
    robot.run(0.1)


@pytest.mark.parametrize('name', DRIVERS)
def test_the_project_arrives_and_hits_nothing(name, logic):
    place = LAST.places['A']
    with ros_session():
        robot = Robot(LAST, driver=DRIVERS[name], sim_time=True)
        while math.dist(robot.pose[:2], place) > 0.2 and robot.t_s < 40 and not robot.bumps:
            steer(robot, logic, place)
    assert not robot.bumps
    assert math.dist(robot.pose[:2], place) <= 0.2


@pytest.mark.parametrize('name', DRIVERS)
def test_the_project_stands_if_the_laser_is_blind(name, logic):
    with ros_session():
        robot = Robot(LAST, driver=DRIVERS[name], sim_time=True)
        for _ in range(15):
            steer(robot, logic, LAST.places['A'])
        assert not robot.stopped
        robot.blind = True
        before = robot.pose
        for _ in range(10):
            steer(robot, logic, LAST.places['A'])
    assert robot.stopped
    assert math.dist(before[:2], robot.pose[:2]) < 0.15
