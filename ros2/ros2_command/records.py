"""The records of open sessions: who has a ROS domain on this machine, and which one.

A program whose nodes a terminal should meet writes a small file; this module reads them. The README
describes the format, under "How a terminal finds a session".
"""

from __future__ import annotations

import contextlib
import json
import os
from dataclasses import dataclass
from pathlib import Path

# The variables that a record may set. What else is in it does not reach a command.
VARIABLES = 'ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_STATIC_PEERS'


@dataclass(frozen=True)
class Record:
    """What a process that runs says about itself."""

    pid: int
    start: int  # when it has started, in clock ticks since boot
    name: str  # for a person, such as 01_publish_and_subscribe.ipynb
    prefix: str  # of its Python environment
    is_open: bool  # whether its nodes can be there now, or its domain is only reserved
    variables: dict[str, str]  # with which another process joins its domain

    @property
    def domain(self) -> str:
        """The domain id."""
        return self.variables['ROS_DOMAIN_ID']


def folder() -> Path:
    """Return the folder of the records.

    It is not in TMPDIR or XDG_RUNTIME_DIR, which a kernel and a terminal may have different ones
    of. ROS2_SESSIONS names another one, for tests.
    """
    return Path(os.environ.get('ROS2_SESSIONS') or f'/tmp/ros2_sessions_{os.getuid()}')


def read_records() -> list[Record]:
    """Return the records of this user's processes that run, and remove those of other ones.

    The process that has started first comes first.
    """
    records = []
    for file in folder().glob('*.json'):
        # It may vanish, or be no record at all.
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
            if file.stat().st_uid != os.getuid():
                continue
            fields = json.loads(file.read_text(encoding='utf-8'))
            pid = int(fields['pid'])
            if fields['start'] != _start_of(pid):
                file.unlink()
                continue
            record = Record(
                pid=pid,
                start=int(fields['start']),
                name=str(fields['name']),
                prefix=str(fields['prefix']),
                is_open=fields['state'] == 'open',
                variables={n: str(v) for n, v in fields['variables'].items() if n in VARIABLES},
            )
            int(record.domain)
            records.append(record)
    return sorted(records, key=lambda record: (record.start, record.pid))


def ancestors() -> list[int]:
    """Return the process ids above this one, the nearest first."""
    pids, pid = [], os.getpid()
    with contextlib.suppress(OSError, ValueError, IndexError):
        while pid > 1:
            pid = int(_stat(pid)[1])
            pids.append(pid)
    return pids


def _start_of(pid: int) -> str | None:
    """Return when a process has started, as a record says it, or None if it has ended."""
    with contextlib.suppress(OSError, IndexError):
        return _stat(pid)[19]
    return None


def _stat(pid: int) -> list[str]:
    """Return the fields of /proc/PID/stat from the third one on.

    The second one is the name of the program, which may have spaces and brackets.
    """
    return Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
