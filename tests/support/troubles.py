"""Troubles of a disk, really made: it is full, it cannot be written, it is another user's."""

import os
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

NOBODY = 65534
# Root of a container may not mount either.
MAY_MOUNT = os.getuid() == 0 and subprocess.run(['unshare', '--mount', 'true']).returncode == 0
as_root = pytest.mark.skipif(
    not MAY_MOUNT, reason='LEFT OUT: only root mounts a disk, or becomes another user.'
)


@contextmanager
def small_disk(folder: Path, size: str = '20m') -> Iterator[Path]:
    """Mount an empty disk of this size on a folder."""
    folder.mkdir(exist_ok=True)
    subprocess.run(['mount', '-t', 'tmpfs', '-o', f'size={size}', 'tmpfs', folder], check=True)
    try:
        yield folder
    finally:
        subprocess.run(['umount', '--lazy', folder], check=True)


@contextmanager
def full(disk: Path, but: int = 0) -> Iterator[None]:
    """Fill a small disk, but for some bytes."""
    ballast = disk / 'ballast'
    state = os.statvfs(disk)
    ballast.write_bytes(bytes(state.f_bavail * state.f_frsize - but))
    yield
    ballast.unlink()


@contextmanager
def read_only(folder: Path) -> Iterator[None]:
    """Let nobody write into a folder, not even root."""
    subprocess.run(['mount', '--bind', folder, folder], check=True)
    try:
        subprocess.run(['mount', '-o', 'remount,bind,ro', folder], check=True)
        yield
    finally:
        subprocess.run(['umount', '--lazy', folder], check=True)


@contextmanager
def another_user() -> Iterator[None]:
    """Let this process be another user, who may only what all may."""
    os.setresuid(NOBODY, NOBODY, 0)
    try:
        yield
    finally:
        os.setresuid(0, 0, 0)


def take(path: Path, user: int = NOBODY) -> None:
    """Give a file, or a folder and all that is in it, to a user."""
    for one in (path, *path.rglob('*')):
        os.chown(one, user, user, follow_symlinks=False)


@contextmanager
def folder_of_all() -> Iterator[Path]:
    """Make a folder that each user may enter: TMPDIR may lie in one that only its owner may."""
    with tempfile.TemporaryDirectory(dir='/tmp') as folder:
        Path(folder).chmod(0o755)
        yield Path(folder)
