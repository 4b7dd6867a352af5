"""Interfaces as the ros2 command shows them.

An interface has a name of three parts, such as `sensor_msgs/msg/Image`. It is found through the
ament index: first in the prefixes of AMENT_PREFIX_PATH, in their order, then in this environment.
"""

from __future__ import annotations

import difflib
from pathlib import Path

from ros2_command.api import interface_lines, interfaces, packages


def show(name: str) -> None:
    """Print an interface as `ros2 interface show` does. Raises ValueError if there is none."""
    if name not in interfaces():
        near = _nearest(str(name))
        hint = f'The nearest: {near}.' if near else '`ros2 interface list` prints all names.'
        raise ValueError(f'There is no interface {name!r}. {hint}')
    for line in interface_lines(name):
        print(line)


def share_folder(package: str) -> Path | None:
    """Return the share folder of an installed package."""
    prefix = packages().get(package)
    return prefix and prefix / 'share' / package


def _nearest(name: str) -> str:
    """The name most like `name`, rather one that differs only in package, kind or case, or ''."""
    lower = {known.lower(): known for known in interfaces()}
    last = name.lower().rpartition('/')[2]
    same = [known for known in lower if known.rpartition('/')[2] == last]
    near = difflib.get_close_matches(name.lower(), same, cutoff=0)
    near = near or difflib.get_close_matches(name.lower(), lower)
    return lower[near[0]] if near else ''
