"""The CMake files of the ROS 2 wheels, made to fit this machine."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import sys
import sysconfig
from pathlib import Path


def fix_wheels(prefix: str | Path = sys.prefix) -> None:
    """Make the CMake files of the ROS 2 wheels fit this machine.

    The wheels were built in a container, and 21 of their CMake files name its folders, such as
    /opt/python/cp311-cp311/include/python3.11. CMake stops at a folder that does not exist. Here
    these are replaced by the folders of this Python and this NumPy. Fast DDS also asks for the
    development files of two libraries which it brings along, and which no other package needs. A
    second call finds nothing.

    Raises RuntimeError if a file needs it and cannot be written.
    """
    import numpy

    replacements = {
        rb'/opt/python/[^/";]+/include/python[^/";]+': sysconfig.get_path('include'),
        rb'/opt/python/[^";]+/numpy/(?:_core|core)/include': numpy.get_include(),
        rb'find_package\(OpenSSL REQUIRED\)\n': '',
        rb'BOOL:1>:OpenSSL': 'BOOL:0>:OpenSSL',
        rb'/usr/lib64/libtinyxml2\.so;': '',
    }
    share = Path(prefix, 'share')
    for file in [*share.glob('*/cmake/*Export.cmake'), *share.glob('fastrtps/cmake/*.cmake')]:
        old = new = file.read_bytes()
        for pattern, replacement in replacements.items():
            new = re.sub(pattern, lambda _, text=replacement: os.fsencode(text), new)
        if new != old:
            _replace(file, new)


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
