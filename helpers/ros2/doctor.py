"""Check ROS setup and other potential issues."""

from __future__ import annotations

import argparse
import os
import sys
from importlib import metadata

from helpers.ros2 import _index, _sessions
from helpers.ros2._commands import Parser
from helpers.ros2._errors import CommandError
from helpers.ros2._graph import graph, join_domain
from helpers.ros2._names import node_names

PACKAGES = {'rclpy': 'ros-rclpy', 'Fast DDS': 'ros-fastrtps', 'DDS for ROS': 'ros-rmw-fastrtps-cpp'}
MISSING = {
    'rclcpp': 'nodes in C++',
    'tf2_ros': 'tf2',
    'launch': 'launch files in Python (those in XML and YAML run)',
    'rviz2': 'RViz',
    'rosbag2': "the real bags' plug-ins (`ros2 bag` reads and writes MCAP)",
}


def add_arguments(parser: Parser) -> None:
    """Add what `ros2 doctor` does, which has no options."""
    parser.set_defaults(run=_doctor)


def _doctor(args: argparse.Namespace) -> None:
    """Print what this environment is."""
    _print('Python', f'{sys.version.split()[0]} in {sys.prefix}')
    for what, package in PACKAGES.items():
        try:
            _print(what, metadata.version(package))
        except metadata.PackageNotFoundError:
            _print(what, 'not from a wheel')
    _print('Workspaces', os.environ.get('AMENT_PREFIX_PATH') or 'none is sourced')
    _print('Packages', f'{len(_index.packages())}, {len(_index.interfaces())} interfaces')
    for kernel in _sessions.kernels():
        state = 'open session' if kernel.is_open else 'domain reserved'
        _print('Notebook', f'{kernel.notebook}: {state}, {_words(kernel.variables)}')
    said = 'ROS_DOMAIN_ID' in os.environ
    try:
        _print('Domain', f'{_words(join_domain())} {"(as you set it)" if said else ""}'.rstrip())
        with graph(args) as opened:
            _print('Nodes there', ', '.join(sorted(node_names(opened.node))) or 'none')
    except CommandError as error:
        _print('Domain', str(error))
    known = _index.packages()
    for package, what in MISSING.items():
        if package not in known:
            _print('Missing', f'{package}: {what}')
    _print('Tab', 'eval "$(register-python-argcomplete ros2)" completes names in bash')


def _print(what: str, value: str) -> None:
    print(f'{what:12} {value}')


def _words(variables: dict[str, str]) -> str:
    return ' '.join(f'{name}={value}' for name, value in variables.items())
