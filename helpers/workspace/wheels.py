"""The CMake files of the ROS 2 wheels, made to fit this machine."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import sys
import sysconfig
from pathlib import Path


def fix_wheels(prefix: str | Path = sys.prefix) -> int:
    """Make the CMake files of the ROS 2 wheels fit this machine. Return how many were changed.

    The wheels were built in a container, and 20 of their CMake files name its folders, such as
    /opt/python/cp311-cp311/include/python3.11. CMake stops at a folder that does not exist. Here
    these are replaced by the folders of this Python and this NumPy. A second call finds nothing.

    Raises RuntimeError where a file needs it and cannot be written.
    """
    import numpy

    folders = {
        rb'/opt/python/[^/";]+/include/python[^/";]+': sysconfig.get_path('include'),
        rb'/opt/python/[^";]+/numpy/(?:_core|core)/include': numpy.get_include(),
    }
    changed = 0
    for file in Path(prefix).glob('share/*/cmake/*Export.cmake'):
        old = new = file.read_bytes()
        for pattern, folder in folders.items():
            new = re.sub(pattern, lambda _, folder=folder: os.fsencode(folder), new)
        if new != old:
            _replace(file, new)
            changed += 1
    return changed


def _replace(file: Path, content: bytes) -> None:
    """Replace a file by a new one, because uv may have linked the old one to its cache."""
    # The name is the process's own, because two kernels may do this at once.
    written = file.with_name(f'{file.name}.{os.getpid()}')
    try:
        written.write_bytes(content)
        shutil.copymode(file, written)
        written.replace(file)
    except OSError as error:
        with contextlib.suppress(OSError):
            written.unlink()
        raise RuntimeError(
            'The CMake files of the ROS 2 wheels name folders of another machine, and '
            f'{file.parent.parent.parent} cannot be written: use an environment of your own, '
            'made with `make lab`.'
        ) from error
