"""An environment of Python that has what a package.xml names, and nothing else.

It stands for a computer on which `rosdep install` has installed what the package names, with all
that these need, as apt does it. Nothing is fetched: the files are those of this environment, linked
into another one.
"""

import os
import shutil
import sys
import sysconfig
import venv
from collections.abc import Iterable
from functools import cache
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from importlib.util import cache_from_source
from pathlib import Path

from catkin_pkg.package import Package, parse_package
from packaging.requirements import Requirement

SITE = Path(sysconfig.get_path('purelib'))
SHARE = Path(sys.prefix, 'share')
# The keys of rosdep that packages of the lessons name, and the packages of Python in their place.
# Of the headers and the compiler it is the machine that has them.
SYSTEM = {
    'pybind11-dev': ['pybind11-global'],
    'pydocstyle': ['pydocstyle'],
    'python3-dev': [],
    'python3-flake8': ['flake8'],
    'python3-flake8-builtins': ['flake8-builtins'],
    'python3-flake8-comprehensions': ['flake8-comprehensions'],
    'python3-flake8-docstrings': ['flake8-docstrings'],
    'python3-flake8-import-order': ['flake8-import-order'],
    'python3-empy': ['empy'],
    'python3-lark-parser': ['lark'],
    'python3-lark': ['lark'],
    'python3-lxml': ['lxml'],
    'python3-numpy': ['numpy'],
    'python3-pytest': ['pytest'],
    'python3-yaml': ['pyyaml'],
    # launch is not on the package index: here the `ros2` command has its own.
    'ros2launch': ['ros2-command'],
}
MORE = {'rmw_implementation': ['rmw_fastrtps_cpp']}  # the default middleware: apt brings it along
# colcon itself wants pytest. A package that has tests must name it all the same.
TOOLS = ['colcon-common-extensions', 'cmake', 'setuptools']
NOT_TOOLS = {'pytest', 'pytest-cov', 'pytest-repeat', 'pytest-rerunfailures', 'coverage'}
# Installed beside ROS, with a Python of their own, as programs of another machine would be.
OUTSIDE = ('simulated_robot', 'robot_localization', 'robot_state_publisher')


class MissingError(Exception):
    """A name of a package.xml for which no wheel is here."""


@cache
def installed(name: str) -> Distribution | None:
    try:
        return distribution(name)
    except PackageNotFoundError:
        return None


@cache
def wheels_of(name: str) -> frozenset[str]:
    """Return the distributions that a name of a package.xml stands for, with all they need."""
    found: set[str] = set()
    waiting, seen = [name], set()
    while waiting:
        key = waiting.pop()
        if key in seen or key in OUTSIDE:
            continue
        seen.add(key)
        direct = SYSTEM.get(key, [f'ros-{key.replace("_", "-")}'])
        waiting += MORE.get(key, [])
        if key == name and any(installed(wheel) is None for wheel in direct):
            raise MissingError(name)
        found |= with_requirements(wheel for wheel in direct if installed(wheel))
        manifest = SHARE / key / 'package.xml'
        if key not in SYSTEM and manifest.is_file():
            waiting += needed_to_use(parse_package(manifest))
    return frozenset(found)


def needed_to_use(package: Package) -> list[str]:
    """Return what has to be there if another package uses this one."""
    depends = package.exec_depends + package.build_export_depends
    return [depend.name for depend in depends + package.buildtool_export_depends]


def with_requirements(names: Iterable[str], without: Iterable[str] = ()) -> set[str]:
    """Return distributions with all that they require."""
    found, waiting = set(), [*names]
    while waiting:
        name = waiting.pop().lower().replace('_', '-')
        dist = installed(name)
        if dist is None or name in found or name in without:
            continue
        found.add(name)
        for line in dist.requires or []:
            requirement = Requirement(line)
            if requirement.marker is None or requirement.marker.evaluate({'extra': ''}):
                waiting.append(requirement.name)
    return found


class Environment:
    """An environment in a folder, which `hold` fills anew. The path of what it holds is the same.

    `prefixes` are where packages are found besides in the environment.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.prefixes: list[Path] = []

    @property
    def python(self) -> Path:
        return self.folder / 'bin' / 'python'

    def hold(self, names: Iterable[str], tools: bool = False) -> None:
        """Hold what these names of a package.xml stand for, perhaps with the tools of a build.

        Raises MissingError if one of them is unknown.
        """
        names = [*names]
        wheels = set().union(*(wheels_of(name) for name in names))
        if tools:
            wheels |= with_requirements(TOOLS, without=NOT_TOOLS)
        shutil.rmtree(self.folder, ignore_errors=True)
        venv.EnvBuilder(with_pip=False, symlinks=True).create(self.folder)
        for wheel in sorted(wheels):
            for file in installed(wheel).files or []:
                self._link(Path(os.path.normpath(SITE / file)))
        self.prefixes = [self._outside(name) for name in OUTSIDE if name in names]

    def _link(self, file: Path) -> None:
        if not file.is_relative_to(sys.prefix) or not file.is_file():
            return
        for source in (file, Path(cache_from_source(str(file)))):
            target = self.folder / source.relative_to(sys.prefix)
            if target.exists() or not source.is_file():
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            if source.parent.name == 'bin' and source.read_bytes()[:2] == b'#!':
                text = source.read_bytes().replace(
                    bytes(sys.executable, 'utf-8'), bytes(self.python)
                )
                target.write_bytes(text)
                shutil.copymode(source, target)
            else:
                os.link(source, target)
            if source.suffix != '.py':
                break

    def _outside(self, name: str) -> Path:
        """Return a prefix with a package whose programs run with the Python of this project."""
        prefix = self.folder / 'outside' / name
        for part in ('share/ament_index/resource_index/packages', f'share/{name}', f'lib/{name}'):
            (prefix / part).mkdir(parents=True)
        (prefix / 'share/ament_index/resource_index/packages' / name).touch()
        shutil.copy(SHARE / name / 'package.xml', prefix / 'share' / name)
        # The wheels set the path of libraries at each start, unless this variable is there. What
        # the workspace has built, such as tf2_msgs, stays.
        lines = ['#!/bin/sh', 'unset _ROS_WHEELS_BOOTSTRAP_COMPLETE']
        for variable in ('LD_LIBRARY_PATH', 'PYTHONPATH'):
            built = f'$(printf %s "${variable}" | tr : "\\n" | grep /install/ | paste -sd:)'
            lines.append(f'export {variable}="{built}"')
        for installed_program in Path(sys.prefix, 'lib', name).iterdir():
            program = prefix / 'lib' / name / installed_program.name
            program.write_text('\n'.join([*lines, f'exec {installed_program} "$@"', '']))
            program.chmod(0o755)
        return prefix

    def variables(self, home: Path) -> dict[str, str]:
        """Return the variables of a terminal of this environment; nothing else is set in it."""
        path = f'{self.folder}/bin{os.pathsep}{os.environ["PATH"]}'
        site = self.folder / SITE.relative_to(sys.prefix)
        libraries = [self.folder / 'lib', *sorted(site.glob('*.libs'))]  # as the wheels set it
        return {
            'PATH': path,
            'HOME': str(home),
            'LC_ALL': 'C.UTF-8',
            'PYTHONUTF8': '1',
            'AMENT_PREFIX_PATH': os.pathsep.join(map(str, [*self.prefixes, self.folder])),
            'LD_LIBRARY_PATH': os.pathsep.join(map(str, libraries)),
            'VIRTUAL_ENV': str(self.folder),
            'MAKEFLAGS': '-j2',
            'LDFLAGS': '-Wl,--as-needed',  # see helpers/machine/build_tools.py
            'PYTHONUNBUFFERED': '1',
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_LOG_DIR': str(home / 'ros_log'),
        }
