"""The filter nodes as programs: `python -m helpers.fusion ekf_node --ros-args ...`.

The packages in `helpers/robot/prefix` start them, in place of those of robot_localization.
"""

from __future__ import annotations

import argparse
import sys

from rclpy.utilities import remove_ros_args

from helpers.fusion.nodes import EkfNode, NavSatNode
from helpers.ros import run_program

# The name of a node whose launch file gives it none, as in robot_localization.
PROGRAMS = {
    'ekf_node': lambda: EkfNode('ekf_filter_node'),
    'navsat_transform_node': lambda: NavSatNode('navsat_transform'),
}


def main() -> None:
    """Run a node until Ctrl+C."""
    parser = argparse.ArgumentParser(prog='python -m helpers.fusion', description=__doc__)
    parser.add_argument('program', choices=PROGRAMS)
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    try:
        run_program(PROGRAMS[options.program])
    except (KeyError, ValueError) as error:  # a parameter that is missing, or wrong
        sys.exit(f'{options.program}: {error}')


if __name__ == '__main__':
    main()
