"""A record of this process, with which a terminal finds its session.

The `ros2` command reads it. The format is version 1 of "How a terminal finds a session" in
ros2/README.md: a JSON file with `pid`, `start`, `name`, `prefix`, `state` and `variables`.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def recorded(variables: dict[str, str], state: str) -> Iterator[None]:
    """Keep a record of this process while the block runs, or none if it cannot be written.

    `variables` are those with which another process joins its domain. `state` is 'open' while a
    session is open, and 'reserved' while the process only keeps its domain.
    """
    pid = os.getpid()
    file = _folder() / f'{pid}.{state}.json'
    record = {
        'pid': pid,
        'start': _start(),
        'name': os.environ.get('JPY_SESSION_NAME') or f'process {pid}',  # that of the notebook
        'prefix': sys.prefix,
        'state': state,
        'variables': variables,
    }
    with contextlib.suppress(OSError):
        _write(file, json.dumps(record))
    try:
        yield
    finally:
        if os.getpid() == pid:  # not in a child that was forked
            with contextlib.suppress(OSError):
                file.unlink()


def _folder() -> Path:
    # Not TMPDIR or XDG_RUNTIME_DIR, which a kernel and a terminal may have different ones of.
    return Path(os.environ.get('ROS2_SESSIONS') or f'/tmp/ros2_sessions_{os.getuid()}')


def _write(file: Path, text: str) -> None:
    """Write a file that nobody reads half of. Raises OSError."""
    file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    if file.parent.stat().st_uid != os.getuid():
        raise PermissionError(f'{file.parent} belongs to another user')
    new = file.with_suffix('.new')
    new.write_text(text, encoding='utf-8')
    new.replace(file)


def _start() -> str:
    """Return when this process has started, in clock ticks since boot: field 22 of its stat."""
    # After the name of the program, which may have spaces and brackets, comes field 3.
    after_name = Path('/proc/self/stat').read_text().rpartition(')')[2]
    return after_name.split()[22 - 3]
