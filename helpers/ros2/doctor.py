"""Check ROS setup and other potential issues."""

from __future__ import annotations

import argparse
import os
import sys
from importlib import metadata

from helpers.ros2 import _index, _sessions
from helpers.ros2._commands import CommandError, command
from helpers.ros2._graph import graph, join_domain
from helpers.ros2._names import node_names

PACKAGES = {'rclpy': 'ros-rclpy', 'Fast DDS': 'ros-fastrtps', 'DDS for ROS': 'ros-rmw-fastrtps-cpp'}


@command()
def _doctor(args: argparse.Namespace) -> None:
    """Print what this environment is."""
    rows = [('Python', f'{sys.version.split()[0]} in {sys.prefix}')]
    for what, package in PACKAGES.items():
        try:
            rows.append((what, metadata.version(package)))
        except metadata.PackageNotFoundError:
            rows.append((what, 'not from a wheel'))
    rows.append(('Workspaces', os.environ.get('AMENT_PREFIX_PATH') or 'none is sourced'))
    rows.append(('Packages', f'{len(_index.packages())}, {len(_index.interfaces())} interfaces'))
    for kernel in _sessions.kernels():
        state = 'open session' if kernel.is_open else 'domain reserved'
        rows.append(('Notebook', f'{kernel.notebook}: {state}, {_words(kernel.variables)}'))
    try:
        with graph() as opened:
            names = sorted(node_names(opened.node))
        rows += ('Domain', _words(join_domain())), ('Nodes there', ', '.join(names) or 'none')
    except CommandError as error:
        rows.append(('Domain', str(error)))
    rows.append(('Tab', 'eval "$(register-python-argcomplete ros2)" completes names in bash'))
    for what, value in rows:
        print(f'{what:12} {value}')


def _words(variables: dict[str, str]) -> str:
    return ' '.join(f'{name}={value}' for name, value in variables.items())
