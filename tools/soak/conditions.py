"""The conditions in which `make soak` runs the notebooks. A new one is one entry of CONDITIONS."""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
CACHE = ROOT / '.soak'  # git ignores it, `make clean` removes it
VERSIONS = ('3.11', '3.12', '3.13', '3.14')
BUSY_LOOPS = 4
BUSY = 'while True: pass'


class CannotRunError(Exception):
    """Says in one sentence why this machine cannot offer a condition."""


@dataclass(frozen=True)
class Condition:
    """How the notebooks are run.

    `mode` is one of tools/soak/plugin.py. `python()`, `before(folder)` and `environment(chance)`
    return the interpreter, the words that stand before its command, and variables; they raise
    CannotRunError. `beside()` surrounds the runs. Where a notebook cannot run, helpers.doctor must
    say `sentence`.
    """

    name: str
    says: str
    mode: str = 'once'
    at_once: int = 1
    python: Callable[[], str] = lambda: sys.executable
    before: Callable[[Path], list[str]] = lambda folder: []
    environment: Callable[[random.Random], dict[str, str]] = lambda chance: {}
    beside: Callable[[], AbstractContextManager] = field(default=nullcontext)
    sentence: str | None = None


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
    loops = [subprocess.Popen([sys.executable, '-ISc', BUSY]) for _ in range(BUSY_LOOPS)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def one_core(folder: Path) -> list[str]:
    """Give all processes of a run the same core."""
    if not shutil.which('taskset'):
        raise CannotRunError('There is no taskset: run `sudo apt install util-linux`.')
    return ['taskset', '--cpu-list', str(min(os.sched_getaffinity(0)))]


def mounted(commands: str) -> Callable[[Path], list[str]]:
    """Return a `before` that changes what a run sees of the file system, for this run only."""

    def before(folder: Path) -> list[str]:
        if os.getuid():
            raise CannotRunError('Only root may mount: run it as root, for example in a container.')
        start = ['unshare', '--mount', 'sh', '-euc', f'{commands}\nexec "$@"', str(folder)]
        try:
            trial = subprocess.run([*start, 'true'], stderr=subprocess.PIPE, text=True)
        except FileNotFoundError:
            raise CannotRunError(
                'There is no unshare: run `sudo apt install util-linux`.'
            ) from None
        if trial.returncode:
            raise CannotRunError(f'This root may not mount: {trial.stderr.strip()}')
        return start

    return before


# ROS 2 has run before: then LTTng's own page is there.
FULL = """
mount -t tmpfs -o size=64k tmpfs /dev/shm
"$1" -c 'import rclpy'
cat /dev/zero > /dev/shm/full 2> /dev/null || true
"""
FULL_BEFORE_ROS = """
mount -t tmpfs -o size=64k tmpfs /dev/shm
cat /dev/zero > /dev/shm/full 2> /dev/null || true
"""
READ_ONLY = """
mount -t tmpfs -o ro tmpfs /dev/shm
"""
# $0 is the folder of the run, $1 the interpreter.
HOME_READ_ONLY = """
mount -t tmpfs -o ro tmpfs "$0/home"
"""


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
    Condition('idle', 'nothing else'),
    *(
        Condition(f'python{version}', f'Python {version}', python=lambda v=version: python_of(v))
        for version in VERSIONS
    ),
    Condition('busy', f'{BUSY_LOOPS} busy loops beside it', beside=busy_loops),
    Condition('one-core', 'one core for all processes', before=one_core),
    Condition('parallel', '8 notebooks at once', at_once=8),
    Condition('abroad', 'another time zone, language and hash seed', environment=abroad),
    Condition('twice', 'all cells, then all cells again in the same kernel', mode='twice'),
    Condition('interrupt', 'each cell interrupted, then run again', mode='interrupt'),
    Condition('kill', 'a kernel killed in a cell, then all cells in a fresh one', mode='kill'),
    Condition('shm-full', '/dev/shm is full', before=mounted(FULL)),
    Condition(
        'shm-full-before',
        '/dev/shm was full before ROS 2 ran for the first time',
        before=mounted(FULL_BEFORE_ROS),
        sentence='/dev/shm is full',
    ),
    Condition('shm-read-only', '/dev/shm cannot be written', before=mounted(READ_ONLY)),
    Condition('home', 'the home cannot be written', before=mounted(HOME_READ_ONLY)),
]
