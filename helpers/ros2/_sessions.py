"""A record of this user's kernels: which domain each has, and whether a session is open in it.

A kernel writes a small file, and the command reads them to meet the nodes of the notebooks. What a
process that has ended left behind does not count.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# Not TMPDIR or XDG_RUNTIME_DIR, which a kernel and a terminal may have different ones of.
FOLDER = Path(f'/tmp/ros2_notebooks_{os.getuid()}/sessions')


@dataclass(frozen=True)
class Kernel:
    """A kernel that runs: its process id, notebook, and the variables to join its domain."""

    pid: int
    notebook: str
    is_open: bool
    variables: dict[str, str]


@contextlib.contextmanager
def recorded(variables: dict[str, str], is_open: bool) -> Iterator[None]:
    """Keep a record of this process while the block runs, or none if /tmp cannot be written."""
    pid = os.getpid()
    file = FOLDER / f'{pid}.{"session" if is_open else "kernel"}.json'
    notebook = os.environ.get('JPY_SESSION_NAME') or f'process {pid}'
    record = {'start': _start(pid), 'notebook': notebook, 'variables': variables}
    with contextlib.suppress(OSError):
        FOLDER.mkdir(mode=0o700, parents=True, exist_ok=True)
        if FOLDER.stat().st_uid == os.getuid():
            written = file.with_suffix('.new')
            written.write_text(json.dumps(record))
            written.replace(file)
    try:
        yield
    finally:
        if os.getpid() == pid:  # not in a child that was forked
            with contextlib.suppress(OSError):
                file.unlink()


def kernels() -> list[Kernel]:
    """Return the records of this user's kernels. One with an open session may have two."""
    found = []
    for file in sorted(FOLDER.glob('*.json')):
        with contextlib.suppress(OSError, ValueError, KeyError):
            pid, kind, _ = file.name.split('.')
            record = json.loads(file.read_text())
            if file.stat().st_uid != os.getuid():
                continue
            if record['start'] != _start(int(pid)):
                file.unlink()
                continue
            found.append(
                Kernel(int(pid), record['notebook'], kind == 'session', record['variables'])
            )
    return found


def ancestors() -> list[int]:
    """Return the process ids above this one, the nearest first."""
    pids, pid = [], os.getpid()
    with contextlib.suppress(OSError, ValueError, IndexError):
        while pid > 1:
            pid = int(_stat(pid)[1])
            pids.append(pid)
    return pids


def _stat(pid: int) -> list[str]:
    # After the name, which may have spaces and brackets.
    return Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()


def _start(pid: int) -> str | None:
    with contextlib.suppress(OSError, IndexError):
        return _stat(pid)[19]
    return None
