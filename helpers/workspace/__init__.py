"""A colcon workspace for a notebook: write its files, build it, read the error, use it, run it.

What builds is the real `colcon build`, and what runs is a real process. This package adds what a
terminal gives and a running kernel lacks: a clean environment, the effect of
`source install/setup.bash`, and an end for every process.

    workspace     what lessons import: `Workspace`, and `%%write`
    wheels        CMake files of the ROS 2 wheels, made to fit this machine
    processes     a process that prints lines, and ends
    tf2_msgs      the package of the message of /tf, which the wheels lack
    build_output  what a build says, and which of its lines matter
    small_rclcpp  a package in C++: the part of rclcpp that write_a_node_in_cpp needs, over rcl
    colleague.sh  makes the repository of somebody else that bring_in_a_package gets
    sourcing      what `source install/setup.bash` gives, for a kernel that already runs
"""

from helpers.workspace.build_output import BuildResult, lines_that_matter, without_folders
from helpers.workspace.processes import DIED, Process
from helpers.workspace.tf2_msgs import provide_tf2_msgs
from helpers.workspace.wheels import fix_wheels
from helpers.workspace.workspace import BEGIN_EMPTY, COLLEAGUE, SMALL_RCLCPP, Workspace

__all__ = [
    'BEGIN_EMPTY',
    'COLLEAGUE',
    'DIED',
    'SMALL_RCLCPP',
    'BuildResult',
    'Process',
    'Workspace',
    'fix_wheels',
    'lines_that_matter',
    'provide_tf2_msgs',
    'without_folders',
]
