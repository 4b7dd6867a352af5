"""The conditions in which `make soak` runs the notebooks. A new one is one entry of CONDITIONS."""

from __future__ import annotations

import contextlib
import os
import random
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
CACHE = ROOT / '.soak'  # git ignores it, `make clean` removes it
BUSY_LOOPS = 4

# What a run sees of the file system. $0 is the folder of the run, $1 its interpreter.
SHM_OF_ITS_OWN = 'mount -t tmpfs tmpfs /dev/shm'
SHM_FULL_BEFORE_ROS = """
mount -t tmpfs -o size=64k tmpfs /dev/shm
cat /dev/zero > /dev/shm/full 2> /dev/null || true
"""
# ROS 2 has run before: then LTTng's own page is there.
SHM_FULL = """
mount -t tmpfs -o size=64k tmpfs /dev/shm
"$1" -c 'import rclpy'
cat /dev/zero > /dev/shm/full 2> /dev/null || true
"""
SHM_READ_ONLY = 'mount -t tmpfs -o ro tmpfs /dev/shm'
HOME_READ_ONLY = f'{SHM_OF_ITS_OWN}\nmount -t tmpfs -o ro tmpfs "$0/home"'


class CannotRunError(Exception):
    """Says in one sentence why this machine cannot offer a condition."""


@dataclass(frozen=True)
class Condition:
    """How the notebooks are run.

    `mode` is one of tools/soak/plugin.py, `mounts` the shell commands before a run. `python()` and
    `variables(chance)` return the interpreter and environment variables; `beside()` surrounds the
    run. Where a notebook cannot run, helpers.doctor must say `sentence`.
    """

    name: str
    mode: str = 'once'
    at_once: int = 1
    cores: int | None = None
    mounts: str = SHM_OF_ITS_OWN
    python: Callable[[], str] = lambda: sys.executable
    variables: Callable[[random.Random], dict[str, str]] = lambda chance: {}
    beside: Callable[[], AbstractContextManager] = nullcontext
    sentence: str | None = None


def sandbox(mounts: str, folder: Path) -> list[str]:
    """Return the words before a command that let it see these mounts. Others do not see them.

    Raises CannotRunError where this user may not mount.
    """
    user = ['--user', '--map-root-user'] if os.getuid() else []
    words = ['unshare', *user, '--mount', 'sh', '-euc', f'{mounts}\nexec "$@"', str(folder)]
    trial = subprocess.run(
        [*words[:-2], f'{SHM_OF_ITS_OWN}\nexec "$@"', folder, 'true'],
        stderr=subprocess.PIPE,
        text=True,
    )
    if trial.returncode:
        raise CannotRunError(f'This user may not mount, root may: {trial.stderr.strip()}')
    return words


def python_of(version: str) -> str:
    """Return the interpreter of an environment with this Python, made where there is none yet."""
    if version == f'{sys.version_info.major}.{sys.version_info.minor}':
        raise CannotRunError('All other conditions use this Python.')
    environment = CACHE / f'python{version}'
    # What pyenv has installed is not on the PATH as long as nobody chooses it.
    pyenv = Path(os.environ.get('PYENV_ROOT', Path.home() / '.pyenv'), 'versions')
    path = os.pathsep.join([os.environ['PATH'], *map(str, sorted(pyenv.glob(f'{version}*/bin')))])
    made = subprocess.run(
        ['tools/set_up.sh', '--in', environment.relative_to(ROOT), version],
        cwd=ROOT,
        env=os.environ | {'PATH': path},
        stderr=subprocess.PIPE,
        text=True,
    )
    if made.returncode:
        raise CannotRunError(made.stderr.strip().rpartition('\n')[2])
    return str(environment / 'bin/python')


@contextlib.contextmanager
def busy_loops() -> Iterator[None]:
    """Keep all cores busy."""
    command = [sys.executable, '-ISc', 'while True: pass']
    loops = [subprocess.Popen(command) for _ in range(BUSY_LOOPS)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def abroad(chance: random.Random) -> dict[str, str]:
    """Return another time zone, another language, and another order of sets."""
    known = subprocess.run(['locale', '-a'], capture_output=True, text=True).stdout.split()
    # The one without UTF-8 is the hardest, and every machine has it.
    others = [name for name in known if not name.startswith(('C.', 'en_'))] or ['C']
    return {
        'TZ': chance.choice(['Asia/Kathmandu', 'Pacific/Chatham', 'America/St_Johns']),
        'LC_ALL': chance.choice(others),
        'LANGUAGE': 'vi:ur:fr',
        'PYTHONHASHSEED': str(chance.randrange(2**32)),
    }


CONDITIONS = [
    Condition('idle'),
    *(
        Condition(f'python{version}', python=lambda v=version: python_of(v))
        for version in ('3.11', '3.12', '3.13', '3.14')
    ),
    Condition('busy', beside=busy_loops),
    Condition('one-core', cores=1),
    Condition('parallel', at_once=8),
    Condition('abroad', variables=abroad),
    Condition('twice', mode='twice'),
    Condition('interrupt', mode='interrupt'),
    Condition('kill', mode='kill'),
    Condition('shm-full', mounts=SHM_FULL),
    Condition('shm-full-before', mounts=SHM_FULL_BEFORE_ROS, sentence='/dev/shm is full'),
    Condition('shm-read-only', mounts=SHM_READ_ONLY),
    Condition('home', mounts=HOME_READ_ONLY),
]
