"""The folders of workspaces. While a kernel uses one, it is locked: no other kernel takes it."""

from __future__ import annotations

import fcntl
import os
import re
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

_locks: dict[Path, int] = {}  # the workspaces of this process, each with the file that locks it


def claim(name: str) -> Path:
    """Return a folder for a workspace that no other process uses while this one lives."""
    scratch = _scratch()
    for number in range(1, 100):
        path = scratch / (name if number == 1 else f'{name}_{number}')
        if path in _locks:
            return path
        lock = os.open(scratch / f'.{path.name}.lock', os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
            continue
        _locks[path] = lock  # held until this process ends
        return path
    raise RuntimeError(f'99 kernels have a workspace {name!r}: shut down those you do not need.')


def locks() -> tuple[int, ...]:
    return tuple(_locks.values())


def _scratch() -> Path:
    """Return the folder of all workspaces: in the checkout, if that can be written."""
    elsewhere = f'ros2_notebooks_{os.getuid()}'
    for folder in (
        ROOT / 'scratch',
        Path(tempfile.gettempdir()) / elsewhere,
        Path('/tmp') / elsewhere,
    ):
        # rosidl's CMake functions break at an accent, and packages of others at a space.
        if not re.fullmatch(r'[A-Za-z0-9_./-]+', str(folder)):
            continue
        try:
            folder.mkdir(mode=0o755 if folder.parent == ROOT else 0o700, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            if folder.stat().st_uid == os.getuid():
                return folder
        except OSError:  # read-only, or another user's
            continue
    raise RuntimeError(
        'There is no folder for a workspace: neither this checkout nor /tmp can be written. Set '
        'TMPDIR to a folder of yours whose name has no spaces or accents, and restart the kernel.'
    )
