"""The robot in a process of its own: `python -m helpers.robot --floor corridor --ros-args ...`."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from rclpy.utilities import remove_ros_args

from helpers.robot import FLOORS, Floor, Robot
from helpers.robot.drivers import DRIVERS
from helpers.ros import run_program


def main() -> None:
    """Drive until Ctrl+C."""
    parser = argparse.ArgumentParser(prog='python -m helpers.robot', description=__doc__)
    parser.add_argument('--floor', default='empty', help=f'{", ".join(FLOORS)}, or a text file')
    parser.add_argument('--seed', type=int, default=0, help='decides the errors of the sensors')
    parser.add_argument('--driver', default='kind', choices=DRIVERS, help='how it speaks')
    parser.add_argument(
        '--habit',
        action='append',
        default=[],
        metavar='NAME=VALUE',
        help='another habit of its drivers, such as command_timeout_s=null (the value is JSON)',
    )
    parser.add_argument(
        '--mounting',
        action='append',
        default=[],
        metavar='FRAME=YAW',
        help='a sensor that is turned on the robot, such as imu_link=0.35 (rad, to the left)',
    )
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    try:
        habits = dict(habit.split('=', 1) for habit in options.habit)
        habits = {name: json.loads(value) for name, value in habits.items()}
        driver = DRIVERS[options.driver].but(**habits)
        mounting = dict(turned.split('=', 1) for turned in options.mounting)
        mounting = {frame: float(yaw) for frame, yaw in mounting.items()}
        floor = FLOORS.get(options.floor) or Floor.from_text(Path(options.floor).read_text())
    except (OSError, ValueError) as error:
        parser.error(str(error))

    def make_robot() -> Robot:
        robot = Robot(floor, seed=options.seed, mounting=mounting, driver=driver, spin=False)
        print(f'The robot drives on the floor {floor.name}.', flush=True)
        return robot

    try:
        run_program(make_robot)
    except ValueError as error:
        parser.error(str(error))


if __name__ == '__main__':
    main()
