"""What the code of a student may use, and what is said of code that used more.

container/run.sh sets the limits of a container, with these numbers: a test compares them. Those of
a kernel are set by judge.py, with a container and without one.
"""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

MEMORY_GB = 2  # that a kernel may take more than it has when it begins
ALL_GB = 3  # of memory for all programs of a container, and what they write
PROGRAMS = 400  # and threads
FILES_GB = 1  # in /tmp of a container, and for one file without a container
SHM_MB = 256  # in /dev/shm
CPUS = 2.0

MUCH_MEMORY = f'used more than {MEMORY_GB} GB of memory'
ALL_MEMORY = f'used more than {ALL_GB} GB of memory, with all its programs and files'
MANY_PROGRAMS = f'started more than {PROGRAMS} programs and threads'
MANY_FILES = f'wrote more than {FILES_GB} GB to /tmp, or more than {SHM_MB} MB to /dev/shm'
LARGE_FILE = f'wrote a file of more than {FILES_GB} GB'

# How the system tells code that there is no more.
ERRORS = {
    MUCH_MEMORY: re.compile(r'^MemoryError|Cannot allocate memory'),
    MANY_PROGRAMS: re.compile(r"can't start new thread|Resource temporarily unavailable"),
    MANY_FILES: re.compile(r'No space left on device'),
    LARGE_FILE: re.compile(r'File too large'),
}
# What is not told to code that goes on: a container counts it, in version 2 and in version 1 of
# control groups.
COUNTED = {
    MANY_PROGRAMS: (('pids.events', 'max'), ('pids/pids.events', 'max')),
    ALL_MEMORY: (('memory.events', 'oom_kill'), ('memory/memory.oom_control', 'oom_kill')),
}
GROUP = Path('/sys/fs/cgroup')
# What judge.py notices while code goes on, or hangs.
NOTICED = (*COUNTED, MUCH_MEMORY)


def counts(group: Path = GROUP) -> dict[str, int]:
    """Return how often each limit of this container was met. Without a container it is 0."""
    found = dict.fromkeys(COUNTED, 0)
    for limit, places in COUNTED.items():
        for file, word in places:
            with suppress(OSError):
                lines = (group / file).read_text().splitlines()
                found[limit] = int(dict(line.split() for line in lines)[word])
    return found


def met_since(before: dict[str, int], group: Path = GROUP) -> str:
    """Return the limit of this container that was met since then, or nothing."""
    now = counts(group)
    return next((limit for limit in COUNTED if now[limit] > before[limit]), '')


def memory_taken(pid: int) -> float:
    """Return which part of its memory a kernel has taken, 0 if it has ended. At 1 there is none."""
    with suppress(OSError, ValueError, IndexError):
        status = Path(f'/proc/{pid}/status').read_text()
        return int(status.partition('VmData:')[2].split()[0]) / (MEMORY_GB << 20)
    return 0.0
