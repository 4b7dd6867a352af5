"""A colcon workspace for a notebook: write its files, build it, read the error, use it, run it.

What builds is the real `colcon build`, and what runs is a real process. This package adds what a
terminal gives and a running kernel lacks: a clean environment, the effect of
`source install/setup.bash`, and an end for every process.

    workspace     what lessons import: `Workspace`, and `%%write`
    wheels        CMake files of the ROS 2 wheels, made to fit this machine
    processes     a process that prints lines, and ends
    tf2_msgs      the package of the message of /tf, which the wheels lack
    build_output  what a build says, and which of its lines matter
    first_error   the first error of a build, a program, a launch
    small_rclcpp  a package in C++: the part of rclcpp that write_a_node_in_cpp needs, over rcl
    given         files of somebody else: a repository, a package, a program
    rosdep        rosdep, with rules of a lesson
    replaced      other texts in files for a while, and the student's own back
    sourcing      what `source install/setup.bash` gives, for a kernel that already runs
"""

from helpers.workspace.build_output import BuildResult, lines_that_matter, without_folders
from helpers.workspace.first_error import (
    TRACEBACK,
    compile_error,
    error_in,
    error_of_build,
    error_of_launch,
    error_of_pytest,
    first_error,
    started,
    why_it_failed,
)
from helpers.workspace.given import play_colleague, write_fleet, write_try_nearest
from helpers.workspace.processes import DIED, Process, end_together, show_launch, wait_until
from helpers.workspace.rosdep import rosdep, run_rosdep
from helpers.workspace.tf2_msgs import begin_tf2_msgs, provide_tf2_msgs
from helpers.workspace.wheels import fix_wheels
from helpers.workspace.workspace import SMALL_RCLCPP, Workspace, give_files_back

__all__ = [
    'play_colleague',
    'write_fleet',
    'write_try_nearest',
    'rosdep',
    'run_rosdep',
    'show_launch',
    'wait_until',
    'why_it_failed',
    'started',
    'error_of_build',
    'error_of_launch',
    'error_of_pytest',
    'first_error',
    'error_in',
    'compile_error',
    'end_together',
    'DIED',
    'SMALL_RCLCPP',
    'TRACEBACK',
    'BuildResult',
    'Process',
    'Workspace',
    'fix_wheels',
    'give_files_back',
    'lines_that_matter',
    'begin_tf2_msgs',
    'provide_tf2_msgs',
    'without_folders',
]
