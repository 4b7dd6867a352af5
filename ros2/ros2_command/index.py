"""The ament index: which packages are installed where, and what they have.

The prefixes of AMENT_PREFIX_PATH come first, in their order, then this environment, which the
wheels do not name there.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ros2_command.commands import CommandError

INDEX = 'share/ament_index/resource_index'
KINDS = 'msg', 'srv', 'action'


def prefixes(environment: Mapping[str, str] = os.environ) -> list[Path]:
    """Return where packages are installed. The first one that has a package wins."""
    named = [Path(p) for p in environment.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if p]
    return [p for p in dict.fromkeys([*named, Path(sys.prefix)]) if (p / INDEX).is_dir()]


def packages(
    resource: str = 'packages', environment: Mapping[str, str] = os.environ
) -> dict[str, Path]:
    """Return the packages that have a resource in the index, each with its prefix."""
    prefix_by_package: dict[str, Path] = {}
    for prefix in prefixes(environment):
        for file in sorted((prefix / INDEX / resource).glob('[!.]*')):
            prefix_by_package.setdefault(file.name, prefix)
    return prefix_by_package


def prefix_of(
    package: str,
    missing: str = "Package '{}' not found",
    environment: Mapping[str, str] = os.environ,
) -> Path:
    """Return the prefix of a package. Raises CommandError if there is none."""
    try:
        return packages(environment=environment)[package]
    except KeyError:
        raise CommandError(missing.format(package)) from None


def executables(package: str, environment: Mapping[str, str] = os.environ) -> list[Path]:
    """Return the executables of a package. Raises CommandError if there is no such package."""
    paths = []
    prefix = prefix_of(package, environment=environment)
    for folder, folders, files in os.walk(prefix / 'lib' / package):
        folders[:] = sorted(name for name in folders if not name.startswith('.'))
        paths += [Path(folder, name) for name in sorted(files)]
    return [path for path in paths if os.access(path, os.X_OK)]


def command_of(
    package: str, executable: str, environment: Mapping[str, str] = os.environ
) -> list[str]:
    """Return the command of an executable. Raises CommandError as `ros2 run` does."""
    paths = [path for path in executables(package, environment) if path.name == executable]
    if not paths:
        raise CommandError('No executable found')
    if len(paths) > 1:
        raise CommandError('\n- '.join(['Multiple executables found:', *map(str, paths)]))
    [path] = paths
    with path.open('rb') as file:
        first_line = file.readline()
    # The first line of a script cannot name an interpreter whose path has a space.
    is_script = first_line.startswith(b'#!') and os.fsencode(sys.executable) in first_line
    if is_script and ' ' in sys.executable:
        return [sys.executable, str(path)]
    return [str(path)]


def complete_packages(**kwargs: Any) -> list[str]:
    """Return the names of all packages, for Tab."""
    return sorted(packages())


def interfaces(package: str | None = None) -> list[str]:
    """Return the names of all interfaces, or of those of a package, sorted by package and kind."""
    names = set()
    for owner, prefix in packages('rosidl_interfaces').items():
        if package not in (None, owner):
            continue
        file = prefix / INDEX / 'rosidl_interfaces' / owner
        for line in file.read_text(encoding='utf-8').splitlines():
            stem, _, suffix = line.rpartition('.')
            kind = stem.partition('/')[0]
            # A name with an underscore is a part of a service or an action.
            if kind in KINDS and suffix in ('idl', kind) and '_' not in stem:
                names.add(f'{owner}/{stem}')
    return sorted(names)
