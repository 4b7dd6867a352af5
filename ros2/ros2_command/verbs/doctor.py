"""Check ROS setup and other potential issues."""

from __future__ import annotations

import argparse
import os
import sys
from importlib import metadata

from ros2_command import index
from ros2_command.commands import CommandError, command, what_is_missing
from ros2_command.domain import join_domain
from ros2_command.graph import graph
from ros2_command.names import node_names
from ros2_command.records import read_records

PACKAGES = {'rclpy': 'ros-rclpy', 'Fast DDS': 'ros-fastrtps', 'DDS for ROS': 'ros-rmw-fastrtps-cpp'}


@command()
def _doctor(args: argparse.Namespace) -> None:
    """Print what this environment is."""
    rows = [('Python', f'{sys.version.split()[0]} in {sys.prefix}')]
    for title, package in PACKAGES.items():
        try:
            rows.append((title, metadata.version(package)))
        except metadata.PackageNotFoundError:
            rows.append((title, 'not from a wheel'))
    rows.append(('Workspaces', os.environ.get('AMENT_PREFIX_PATH') or 'none is sourced'))
    rows.append(('Packages', f'{len(index.packages())}, {len(index.interfaces())} interfaces'))
    for record in read_records():
        state = 'open session' if record.is_open else 'domain reserved'
        rows.append(('Notebook', f'{record.name}: {state}, {_words(record.variables)}'))
    try:
        with graph() as opened:
            names = sorted(node_names(opened.node))
        rows += ('Domain', _words(join_domain())), ('Nodes there', ', '.join(names) or 'none')
    except CommandError as error:
        rows.append(('Domain', str(error)))
    except ModuleNotFoundError as error:
        rows.append(('Missing', what_is_missing(error)))
    rows.append(('Tab', 'eval "$(register-python-argcomplete ros2)" completes names in bash'))
    for title, value in rows:
        print(f'{title:12} {value}')


def _words(variables: dict[str, str]) -> str:
    return ' '.join(f'{name}={value}' for name, value in variables.items())
