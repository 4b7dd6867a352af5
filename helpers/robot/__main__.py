"""The robot in a process of its own: `python -m helpers.robot --floor corridor --ros-args ...`."""

from __future__ import annotations

import argparse
import sys

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.utilities import remove_ros_args

from helpers.robot.floor import FLOORS
from helpers.robot.robot import Robot


def main() -> None:
    """Drive until Ctrl+C."""
    parser = argparse.ArgumentParser(prog='python -m helpers.robot', description=__doc__)
    parser.add_argument('--floor', default='empty', choices=FLOORS)
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    rclpy.init(args=sys.argv)
    try:
        robot = Robot(FLOORS[options.floor], spin=False)
        print(f'The robot drives on the floor {options.floor}.', flush=True)
        rclpy.spin(robot)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # the end that was asked for
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
