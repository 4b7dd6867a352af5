"""The folders of workspaces. While a kernel uses one, it is locked: no other kernel takes it.

What a person has written stays, whatever happens to a workspace. If newer lessons call their
workspaces by other names, the folders get these names (`set_apart`, `give_new_names`).
"""

from __future__ import annotations

import fcntl
import itertools
import os
import re
import shutil
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Marks the workspace of a person: another run puts it aside, and removes nothing. tools/clean.sh
# removes what was built.
OWNED = '.owned'
BUILT = ('build', 'install', 'log')  # by colcon
WAITING = '.renamed'  # `.make_a_package.renamed` gets the name `make_a_package`

_locks: dict[Path, int] = {}  # the workspaces of this process, each with the file that locks it


def claim_workspace(name: str) -> Path:
    """Return a folder for a workspace that no other process uses while this one lives."""
    scratch = _scratch()
    for number in range(1, 100):
        path = scratch / (name if number == 1 else f'{name}_{number}')
        if path in _locks:
            return path
        lock = os.open(_lock_of(path), os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
            continue
        _locks[path] = lock  # held until this process ends
        return path
    raise RuntimeError(f'99 kernels have a workspace {name!r}: shut down those you do not need.')


def locks_of_workspaces() -> tuple[int, ...]:
    """Return the open files with which this process holds its workspaces."""
    return tuple(_locks.values())


def _lock_of(path: Path) -> Path:
    return path.with_name(f'.{path.name}.lock')


def _is_in_use(path: Path) -> bool:
    try:
        lock = os.open(_lock_of(path), os.O_RDWR)
    except OSError:
        return False
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(lock)
    return False


def _places(root: Path) -> list[Path]:
    """Return where the workspaces of a checkout may be, the best place first."""
    elsewhere = f'ros2_notebooks_{os.getuid()}'
    places = root / 'scratch', Path(tempfile.gettempdir()) / elsewhere, Path('/tmp') / elsewhere
    # rosidl's CMake functions break at an accent, and packages of others at a space.
    return [place for place in places if re.fullmatch(r'[A-Za-z0-9_./-]+', str(place))]


def _scratch() -> Path:
    """Return the folder of all workspaces: in the checkout, if that can be written."""
    for folder in _places(ROOT):
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


# --- What a person has written --------------------------------------------------------------------


def files_of_person(workspace: Path) -> list[Path]:
    """Return the files of a workspace that a person may have written, in cells or in an editor."""
    return [
        file
        for file in workspace.rglob('*')
        if file.is_file() and not any(_is_made(part) for part in file.relative_to(workspace).parts)
    ]


def _is_made(name: str) -> bool:
    return name.startswith('.') or name in (*BUILT, '__pycache__')


def name_beside(workspace: Path) -> Path:
    """Return a free name for a copy of a workspace: `make_a_package.before_1`."""
    names = (f'{workspace.name}.before_{number}' for number in itertools.count(1))
    return next(path for path in map(workspace.with_name, names) if not path.exists())


# --- Other names ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Renamed:
    """A workspace that a newer lesson calls by another name.

    `packages` are those that the lesson names: a folder with packages, and none of these, holds
    files of another lesson.
    """

    old: str
    new: str
    packages: frozenset[str]


def set_apart(renamed: Iterable[Renamed], root: Path = ROOT) -> list[str]:
    """Take the workspaces of a checkout that get other names out of the way of each other.

    Two workspaces may change their names, so none gets its new one before all are out of the way.
    After an interruption, to do it again goes on. What was built goes: it holds the old path.
    Return a sentence for each folder that stays. Raises ValueError with one sentence, before
    anything has changed, if a kernel uses one.
    """
    renamed = list(renamed)
    scratch = _existing(root)
    if scratch is None:
        return []
    said, moves = [], []
    for one in renamed:
        for path, new in _folders_of(one, scratch, {other.old for other in renamed}):
            if _is_of(one, path):
                moves.append((path, new))
            else:
                said.append(f'{_place(path)} has files of another lesson: they stay there.')
    for path, new in moves:
        for used in (path, scratch / new):
            if _is_in_use(used):
                raise ValueError(
                    f'A lesson uses {_place(used)}: shut down its kernel, then try again.'
                )
    for path, new in moves:
        waiting = scratch / f'.{new}{WAITING}'
        if not waiting.exists():
            _remove_built(path)
            path.rename(waiting)
    return said


def give_new_names(root: Path = ROOT) -> list[str]:
    """Give the workspaces that were set apart their new names, and return a sentence about them.

    If a person has already written into a workspace of that name, the other one is put beside it.
    """
    scratch = _existing(root)
    now = []
    for waiting in sorted(scratch.glob(f'.*{WAITING}')) if scratch else ():
        path = scratch / waiting.name.removeprefix('.').removesuffix(WAITING)
        if files_of_person(path):
            path = name_beside(scratch / path.name.partition('.')[0])
        else:
            shutil.rmtree(path, ignore_errors=True)
        waiting.rename(path)
        now.append(_place(path))
    return [f'The files of your workspaces are now in {", ".join(sorted(now))}.'] if now else []


def _existing(root: Path) -> Path | None:
    """Return the folder of all workspaces, None if there was no workspace yet."""
    places = [place for place in _places(root) if place.is_dir()]
    return next((place for place in places if place.stat().st_uid == os.getuid()), None)


def _folders_of(one: Renamed, scratch: Path, old_names: set[str]) -> list[tuple[Path, str]]:
    """Return the folders of a workspace that have files, each with its new name.

    Besides the workspace itself there may be those of a second kernel, and copies.
    """
    form = re.compile(rf'{re.escape(one.old)}((?:_\d+)?(?:\.before_\d+)?)')
    return [
        (path, one.new + match[1])
        for path in sorted(scratch.iterdir())
        if (match := form.fullmatch(path.name))
        and (path.name == one.old or path.name not in old_names)
        and files_of_person(path)
    ]


def _is_of(one: Renamed, workspace: Path) -> bool:
    packages = {path.name for path in workspace.glob('src/*') if path.is_dir()}
    return not packages or bool(packages & one.packages)


def _remove_built(workspace: Path) -> None:
    overlays = [source.parent for source in workspace.glob('*/src')]
    for folder in (workspace, *overlays):
        for built in BUILT:
            shutil.rmtree(folder / built, ignore_errors=True)


def _place(path: Path) -> str:
    return f'{path.parent.name}/{path.name}'
