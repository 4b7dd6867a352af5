"""The robot as another process, beside a session."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

from helpers.ros.session import graph_environment
from helpers.workspace.processes import Process

START_TIMEOUT_S = 60.0  # a machine that a class shares may need it


def start_robot(floor: str = 'empty', *arguments: str) -> Process:
    """Start `python -m helpers.robot` in the graph of the open session, and return the process.

    `floor` is 'empty', 'corridor', 'rooms' or the path of a text; `arguments` are further ones,
    such as '--seed', '1' or '--ros-args', '-r', '__ns:=/two'. It ends with its `with` block, with
    `stop()`, when the cell that starts it is interrupted, and with the kernel.

    Raises RuntimeError, with its last line, where it does not start.
    """
    command = [sys.executable, '-m', 'helpers.robot', '--floor', str(floor), *arguments]
    if '--ros-args' not in arguments:
        command.append('--ros-args')
    command.append('--disable-external-lib-logs')  # no file: the home may be read-only
    folder = Path(tempfile.gettempdir())
    process = Process('robot', command, {**os.environ, **graph_environment()}, folder)
    try:
        process.wait_for('drives', START_TIMEOUT_S)
    except BaseException:
        process.stop()
        raise
    return process
