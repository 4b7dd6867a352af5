"""What a build needs from this machine: its tools, and an environment without chance settings."""

from __future__ import annotations

import importlib.metadata
import os
import shutil
import sys
import sysconfig
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

# What may be set for other work. It must not reach a build or a node that a lesson starts.
HOSTILE = (
    # Settings of colcon, make, CMake and the compiler: they would change what a lesson shows.
    *('COLCON_*', 'CMAKE_*', 'MAKE*', '*FLAGS', 'DESTDIR', 'VERBOSE', 'NINJA*', 'CCACHE_*'),
    *('CPATH', '*_INCLUDE_PATH', 'LIBRARY_PATH', 'PKG_CONFIG_PATH'),
    # The language of messages. ipykernel asks for colours: then no line starts with "CMake Error".
    *('LC_*', 'LANG*', 'CLICOLOR*', 'FORCE_COLOR'),
    # What pytest, Python and git (in a hook) set for their children.
    *('PYTEST*', 'PYTHON*', 'GIT_*'),
    # A node gets its domain id and its discovery range from the session.
    *('RCUTILS_*', 'ROS_DOMAIN_ID', 'ROS_STATIC_PEERS', 'ROS_LOCALHOST_ONLY'),
    'ROS_AUTOMATIC_DISCOVERY_RANGE',
)
# What another ROS 2 sets that is sourced. Without the wheels, it is the one to build with.
SOURCED = (
    'AMENT_*',
    'CMAKE_PREFIX_PATH',
    'PYTHONPATH',
    'ROS_*',
    'RMW_*',
    'FASTDDS_*',
    'FASTRTPS_*',
)


def from_wheels() -> bool:
    """Return whether ROS 2 comes from the wheels in this Python environment."""
    return bool(_version('ros-rclpy'))


def build_environment() -> dict[str, str]:
    """Return the environment of a build or a node, without what was set for other work."""
    wheels = from_wheels()
    unwanted = (*HOSTILE, *SOURCED) if wheels else HOSTILE
    kept = () if wheels else ('CMAKE_PREFIX_PATH', 'PYTHONPATH')
    environment = {
        name: value
        for name, value in os.environ.items()
        if name in kept or not any(fnmatchcase(name, pattern) for pattern in unwanted)
    }
    # -O keeps the lines of one job together. No -l, which colcon would add: on a
    # busy machine it lets make start one job at a time.
    cores = len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count()
    environment |= {'LC_ALL': 'C.UTF-8', 'MAKEFLAGS': f'-j{cores} -O', 'PYTHONUTF8': '1'}
    here = Path(sys.executable).parent
    environment['PATH'] = f'{here}{os.pathsep}{os.environ.get("PATH", os.defpath)}'
    if ' ' in sys.executable:  # colcon's setup.bash does not quote it
        # private: sys, Python 3.11.7
        environment['COLCON_PYTHON_EXECUTABLE'] = getattr(sys, '_base_executable', sys.executable)
    if sys.prefix != sys.base_prefix:
        environment['VIRTUAL_ENV'] = sys.prefix
    if wheels:
        environment['AMENT_PREFIX_PATH'] = sys.prefix
        # A program that links messages does not use their Python libraries, which lack Python's
        # functions. The compilers of Debian and Ubuntu leave out what is not used, others do not.
        environment['LDFLAGS'] = '-Wl,--as-needed'
        libraries = environment.get('LD_LIBRARY_PATH', '').split(os.pathsep)
        environment['LD_LIBRARY_PATH'] = os.pathsep.join(
            folder for folder in libraries if Path(folder).is_relative_to(sys.prefix)
        )
    else:  # the robot of this course is in this environment, not in that of the other ROS 2
        prefixes = environment.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
        environment['AMENT_PREFIX_PATH'] = os.pathsep.join(filter(None, [*prefixes, sys.prefix]))
    return environment


class Tool(NamedTuple):
    """A tool of a build: what was found, '' if it is missing, and the command that installs it."""

    name: str
    found: str
    install: str


def tools_of_a_build(cmake: bool = True) -> list[Tool]:
    """Look for the tools of a build, in the order in which it needs them.

    `cmake` says whether a package is built with CMake: one of pure Python needs colcon only.
    """
    colcon = Tool(
        'colcon', _version('colcon-core'), 'python -m pip install colcon-common-extensions'
    )
    if not cmake:
        return [colcon]
    environment = build_environment()

    def command(name: str) -> str:
        return shutil.which(name, path=environment['PATH']) or ''

    # CMake tries both, and apt installs both.
    compiler = command(environment.get('CC', 'cc')) and command(environment.get('CXX', 'c++'))
    folders = (sysconfig.get_path('include'), sysconfig.get_path('platinclude'))
    headers = any(Path(folder, 'Python.h').is_file() for folder in folders)
    version = f'{sys.version_info.major}.{sys.version_info.minor}'
    return [
        colcon,
        Tool('C++ compiler', compiler, 'sudo apt install g++'),
        Tool('CMake', command('cmake'), 'sudo apt install cmake'),
        Tool('make', command('make'), 'sudo apt install make'),
        Tool(
            'Python headers',
            f'for Python {version}' if headers else '',
            f'sudo apt install python{version}-dev',
        ),
    ]


def _version(distribution: str) -> str:
    """Return the version of what pip or apt has installed, or ''."""
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return ''
