"""The conditions in which `make soak` runs the notebooks. A new one is one entry of CONDITIONS."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
CACHE = ROOT / '.soak'  # git ignores it, `make clean` removes it

# What a run sees of the file system. $0 is the folder of the run, $1 its interpreter.
SHM_OF_ITS_OWN = 'mount -t tmpfs tmpfs /dev/shm'
# ROS 2 has run before: then LTTng's own page is there.
SHM_FULL = """
mount -t tmpfs -o size=64k tmpfs /dev/shm
"$1" -c 'import rclpy'
cat /dev/zero > /dev/shm/full 2> /dev/null || true
"""


@dataclass(frozen=True)
class Condition:
    """How the notebooks are run.

    `mode` is one of tools/soak/plugin.py, `at_once` how many notebooks run, `version` a Python of
    which there may be none, `before` the words before the command, `mounts` shell commands.
    `process_pools` says whether Python can make one: its semaphores are in /dev/shm.
    """

    name: str
    mode: str = 'once'
    at_once: int = 1
    busy_loops: int = 0
    version: str | None = None
    before: tuple[str, ...] = ()
    variables: dict[str, str] = field(default_factory=dict)
    mounts: str = SHM_OF_ITS_OWN
    process_pools: bool = True

    def python(self) -> str:
        """Return the interpreter, of an environment that is made where there is none yet.

        Raises ValueError with one sentence where this machine lacks the version.
        """
        if self.version is None:
            return sys.executable
        environment = CACHE / f'python{self.version}'
        made = subprocess.run(
            ['tools/set_up.sh', '--in', environment.relative_to(ROOT), self.version],
            cwd=ROOT,
            stderr=subprocess.PIPE,
            text=True,
        )
        if made.returncode:
            raise ValueError(made.stderr.strip().rpartition('\n')[2])
        return str(environment / 'bin/python')


CONDITIONS = [
    Condition('idle'),
    *(
        Condition(f'python{version}', version=version)
        for version in ('3.11', '3.12', '3.13', '3.14')
        if version != f'{sys.version_info.major}.{sys.version_info.minor}'
    ),
    Condition('busy', busy_loops=4),
    Condition('one-core', before=('taskset', '-c', str(min(os.sched_getaffinity(0))))),
    Condition('parallel', at_once=8),
    # The language without UTF-8 is the hardest, and every machine has it.
    Condition(
        'abroad', variables={'TZ': 'Pacific/Chatham', 'LC_ALL': 'POSIX', 'LANGUAGE': 'vi:ur:fr'}
    ),
    Condition('twice', mode='twice'),
    Condition('interrupt', mode='interrupt'),
    Condition('kill', mode='kill'),
    Condition('shm-full', mounts=SHM_FULL, process_pools=False),
    Condition('shm-read-only', mounts='mount -t tmpfs -o ro tmpfs /dev/shm', process_pools=False),
    Condition('home', mounts=f'{SHM_OF_ITS_OWN}\nmount -t tmpfs -o ro tmpfs "$0/home"'),
]
