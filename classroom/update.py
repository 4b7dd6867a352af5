"""Bring newer lessons in, and keep what a student has written, cell by cell.

    python -m classroom.update                     from where this checkout was cloned
    python -m classroom.update new.tar.gz          from a newer archive of `make handout`
    python -m classroom.update FOLDER --to MINE    from a folder, as on a JupyterHub

Three versions are compared: what was handed out, what the student has made of it, what is newer.
JupyterLab keeps the id of a cell, and so do the lessons: a cell is found again by its id, and a
lesson by its name without its number. If a cell has moved to another lesson, what a student has
written goes with it. A cell, or another file, that only one side has changed is taken from that
side. Where both have changed it, both are there. If a newer lesson calls its
workspace by another name, the files that a student has in `scratch` come along.

Why no kept tool: of 200 histories drawn as in classroom/tests/test_update.py, nbdime 4.0.4 left
conflict markers inside cells in 39 (strategy inline), or lost words in 5 (union). nbgitpuller keeps
one side of a conflict only (`git merge -Xours`), and needs git.
"""

import argparse
import errno
import fcntl
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import NamedTuple
from uuid import uuid4

import nbformat
from nbformat import NotebookNode
from nbformat.v4 import new_markdown_cell, new_notebook

from helpers.lesson import outline
from helpers.machine import Renamed, give_new_names, sentence_about, set_apart
from helpers.notebook import MARK

ROOT = Path(__file__).resolve().parents[1]
BASE = '.handed_out'  # beside the lessons: what was handed out
UNPACKED = '.unpacked'  # and what is in an archive, while it is brought
APART = (BASE, '.git', 'wheels', UNPACKED)
LEFT_OUT = {'__pycache__', '.ipynb_checkpoints'}  # wherever they are
# What nbformat and this program raise for a file that is no notebook, or has no ids.
UNREADABLE = (ValueError, LookupError, TypeError, AttributeError, nbformat.ValidationError)
# How the lessons of version 0.3.0 call their workspaces. Its own program brings newer lessons, and
# leaves the workspaces as they are: the next update finds them by these names.
OF_0_3 = {
    'publish_and_subscribe': 'lesson_01',
    'lose_messages': 'lesson_02',
    'set_parameters': 'lesson_08',
    'make_a_package': 'lesson_09',
    'bring_in_a_package': 'lesson_10',
    'use_a_message_in_your_own_interface': 'lesson_11',
    'launch_a_system': 'lesson_12',
    'test_a_node': 'lesson_13',
    'share_code_in_a_cpp_library': 'lesson_14',
    'write_a_node_in_cpp': 'lesson_15',
    'put_the_sensors_on_the_robot': 'lesson_17',
    'record_a_bag': 'lesson_18',
    'find_the_fault': 'lesson_19',
    'build_a_robot_program': 'lesson_20',
}
# The lessons that it had. It leaves what a student has written for cells that have moved to newer
# lessons where they were: the next update finds these cells by their ids.
LESSONS_OF_0_3 = frozenset(OF_0_3) | {
    'start_here',
    'run_callbacks_in_parallel',
    'choose_the_number_of_threads',
    'keep_what_is_fresh',
    'call_a_service_from_a_callback',
    'run_a_long_job',
    'fuse_odometry_imu_and_gps',
}
YOURS = '*Your version of the cell above, from before the update:*'


def merge(base: NotebookNode, mine: NotebookNode, newer: NotebookNode) -> NotebookNode:
    """Return the newer notebook with what was written in `mine` since `base`.

    The order is that of the newer one. A cell that was added in `mine` follows the one that it
    followed there. Outputs are those of `mine` if the source of a cell is the same. Once a student
    has saved the lesson, none are those of the repository.
    """
    old = {cell.id: cell.source for cell in base.cells}
    present = {cell.id for cell in mine.cells}
    merged = nbformat.from_dict(newer)
    if MARK not in mine.metadata:
        _remove_outputs(merged)
    merged.cells = [c for c in merged.cells if c.id in present or old.get(c.id) != c.source]
    at = 0  # where a cell goes that only `mine` has
    for cell in mine.cells:
        theirs = next((one for one in merged.cells if one.id == cell.id), None)
        if theirs:
            here = merged.cells.index(theirs)
            at = here + 1
            if cell.source == theirs.source:
                merged.cells[here] = _changed(cell, metadata=theirs.metadata)
            elif theirs.source == old.get(cell.id):
                merged.cells[here] = cell
            elif cell.source != old.get(cell.id):
                yours = _changed(cell, id=uuid4().hex[:8])
                merged.cells[at:at] = [new_markdown_cell(YOURS), yours]
                at += 2
        elif cell.source != old.get(cell.id):
            merged.cells.insert(at, cell)
            at += 1
    return merged


def _remove_outputs(notebook: NotebookNode) -> None:
    notebook.metadata.pop(MARK, None)
    for cell in notebook.cells:
        if cell.cell_type == 'code':
            cell.outputs, cell.execution_count = [], None


def _changed(cell: NotebookNode, **changes: object) -> NotebookNode:
    return nbformat.from_dict({**cell, **changes})


@dataclass
class Moved:
    """The cells that are in another lesson than before, between three versions of a course.

    `coming` says for each newer file from which files its cells come, and their ids.
    """

    base: Path
    mine: Path
    coming: dict[Path, dict[Path, set[str]]]

    @classmethod
    def between(cls, base: Path, mine: Path, newer: Path) -> 'Moved':
        """Find them. A cell moves if it is gone from a lesson that stays, and new in another."""
        files = [file for file in files_of(newer) if file.suffix == '.ipynb']
        new, old, own = (
            {file: {cell.id for cell in outline(found(folder / file)).cells} for file in files}
            for folder, found in ((newer, Path), (base, _found), (mine, _found))
        )
        coming: dict[Path, dict[Path, set[str]]] = {}
        for file in files:
            came = new[file] - old[file]
            for source in files:
                ids = came & old[source] - new[source]
                if _is_new_since_0_3(file) and not _is_new_since_0_3(source):
                    ids |= new[file] & own[source] - old[source] - new[source]
                if ids := ids - {''}:
                    coming.setdefault(file, {})[source] = ids
        return cls(base, mine, coming)

    def taken(self, file: Path) -> list[NotebookNode]:
        """Return what a student has in other lessons of the cells that come into a file."""
        return [c for source, ids in self._sources(file) for c in self._of(self.mine, source, ids)]

    def handed_out(self, file: Path) -> list[NotebookNode]:
        """Return these cells as they were handed out."""
        return [c for source, ids in self._sources(file) for c in self._of(self.base, source, ids)]

    def left(self, file: Path) -> set[str]:
        """Return the ids of the cells that leave a file, with those that a student put below."""
        ids = set().union(*(of[file] for of in self.coming.values() if file in of))
        return ids | {cell.id for cell in self._of(self.mine, file, ids)}

    def is_written(self, file: Path) -> bool:
        """Return whether a student has written in cells that come into a file, or leave it."""
        try:
            return any(
                self._sources_of(self.taken(target)) != self._sources_of(self.handed_out(target))
                for target, of in self.coming.items()
                if target == file or file in of
            )
        except UNREADABLE:  # it is set aside as a whole
            return False

    def said(self) -> list[str]:
        """Return a sentence for each lesson into which something comes that a student wrote."""
        return [
            f'Some tasks of {source.stem} have moved to {file.stem}, with what you have written.'
            for file, of in self.coming.items()
            for source in of
            if self.is_written(file)
        ]

    def _sources(self, file: Path) -> list[tuple[Path, set[str]]]:
        return sorted(self.coming.get(file, {}).items())

    @staticmethod
    def _sources_of(cells: list[NotebookNode]) -> dict[str, str]:
        return {cell.id: cell.source for cell in cells}

    def _of(self, folder: Path, file: Path, ids: set[str]) -> list[NotebookNode]:
        """Return these cells of a lesson, each with the cells that a student has put below it."""
        path, taken, below = _found(folder / file), [], False
        if not ids or not path.is_file():
            return []
        known = {cell.id for cell in outline(_found(self.base / file)).cells}
        for cell in nbformat.read(path, as_version=4).cells:
            below = cell.id in ids or (below and cell.id not in known)
            if below:
                taken.append(cell)
        return taken


def _is_new_since_0_3(file: Path) -> bool:
    return file.stem[3:] not in LESSONS_OF_0_3


class Move(NamedTuple):
    """A file that takes its place."""

    staged: Path  # beside the place
    target: Path
    own: Path  # the student's, which may be called by another number
    aside: Path | None  # where the student's goes
    said: str  # of that


class Changes(NamedTuple):
    """What a merge changes in a folder, once all files that it writes are there."""

    moves: list[Move]
    gone: list[Path]
    said: list[str]

    def make(self) -> list[str]:
        """Let only names change, which takes no room and no time; return what was set aside."""
        for move in self.moves:
            if move.aside:
                move.own.rename(move.aside)
            move.staged.replace(move.target)
            if move.own != move.target:
                move.own.unlink(missing_ok=True)
        for file in self.gone:
            file.unlink(missing_ok=True)
        return self.said + [move.said for move in self.moves if move.aside]


def merge_folders(base: Path, mine: Path, newer: Path) -> list[str]:
    """Change the files of `mine` as `newer` wants it; return a sentence for each one set aside.

    A file that only `mine` has stays. One that is no longer there in `newer` goes, if it was not
    changed.
    """
    with changes(base, mine, newer) as found:
        return found.make()


@contextmanager
def changes(base: Path, mine: Path, newer: Path) -> Iterator[Changes]:
    """Yield what a merge changes in `mine`, with all files that it needs under other names.

    Before, what ends it, such as a full disk or a folder of another user, has changed nothing.
    """
    moves, moved = [], Moved.between(base, mine, newer)
    try:
        # First those into which something comes: it leaves the others when it is there.
        for file in sorted(files_of(newer), key=lambda file: file not in moved.coming):
            move, data = _change(file, base, mine, newer, moved)
            if move:
                moves.append(move)
                move.target.parent.mkdir(parents=True, exist_ok=True)
                move.staged.write_bytes(data)
                move.staged.chmod((newer / file).stat().st_mode)
        yield Changes(moves, [*_gone(base, mine, newer)], moved.said())
    finally:
        for move in moves:
            move.staged.unlink(missing_ok=True)


def _change(
    file: Path, base: Path, mine: Path, newer: Path, moved: Moved
) -> tuple[Move | None, bytes]:
    """Return how a file changes, and its new text."""
    target, own, old = mine / file, _found(mine / file), _found(base / file)
    staged = target.with_name(f'.{target.name}.newer')
    staged.unlink(missing_ok=True)  # of an update that was killed
    data, was, now = (newer / file).read_bytes(), _bytes(old), _bytes(own)
    moves = moved.is_written(file)
    if data == was and own == target and not moves:
        return None, data
    aside, differs = None, now not in (None, was, data)
    if differs or moves:
        try:
            data = _merged(file, old, own, newer / file, moved)
        except ValueError:
            if differs:
                aside = own.with_name(f'{own.name}.yours')
                if aside.exists():  # what an earlier update has set aside stays
                    aside = own.with_name(f'{own.name}.{uuid4().hex[:8]}.yours')
    said = f'Both have changed {file}: yours is now {aside.name}.' if aside else ''
    return Move(staged, target, own, aside, said), data


def _gone(base: Path, mine: Path, newer: Path) -> Iterator[Path]:
    """Yield the files that are no longer there, and that nobody has changed."""
    for file in files_of(base):
        own = mine / file
        if (newer / file).exists() or not own.is_file() or _bytes(own) != _bytes(base / file):
            continue
        if not os.access(own.parent, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(own))
        yield own


def renamed_workspaces(base: Path, newer: Path) -> list[Renamed]:
    """Return the workspaces that the newer lessons call by another name than those of `base`."""
    found = {}
    for file in files_of(newer):
        if file.suffix != '.ipynb':
            continue
        lesson, old = outline(newer / file), outline(_found(base / file))
        old_name = old.workspace
        if old_name == lesson.workspace:
            old_name = OF_0_3.get(lesson.name, '')
        if old_name and lesson.workspace not in ('', old_name):
            packages = frozenset(old.packages | lesson.packages)
            found.setdefault(old_name, Renamed(old_name, lesson.workspace, packages))
    return [*found.values()]


def files_of(folder: Path) -> list[Path]:
    """Return the paths of the files of a course, relative to its folder."""
    files = (
        path.relative_to(folder)
        for path in folder.rglob('*')
        if path.is_file() and os.access(path, os.R_OK)  # a teacher's own file is no lesson
    )
    return sorted(p for p in files if p.parts[0] not in APART and not LEFT_OUT & {*p.parts})


def _found(path: Path) -> Path:
    """Return the path itself, or that of the lesson of the same name with another number."""
    if path.is_file() or not re.match(r'\d\d_.*\.ipynb', path.name):
        return path
    return next(iter(sorted(path.parent.glob(f'[0-9][0-9]{path.name[2:]}'))), path)


def _bytes(path: Path) -> bytes | None:
    return path.read_bytes() if path.is_file() else None


def _merged(file: Path, base: Path, mine: Path, newer: Path, moved: Moved) -> bytes:
    """Return the text of a merged notebook. Raises ValueError for what is none, or has no ids."""
    if newer.suffix != '.ipynb':
        raise ValueError
    try:
        old, own = (
            nbformat.read(path, as_version=4) if path.is_file() else new_notebook()
            for path in (base, mine)
        )
        left = moved.left(file)
        for notebook in (old, own):
            notebook.cells = [cell for cell in notebook.cells if cell.id not in left]
        known = {cell.id for cell in old.cells}
        old.cells += [cell for cell in moved.handed_out(file) if cell.id not in known]
        own.cells = _with_taken(own.cells, moved.taken(file), old)
        merged = merge(old, own, nbformat.read(newer, as_version=4))
        return (nbformat.writes(merged) + '\n').encode()
    except UNREADABLE as problem:
        raise ValueError from problem


def _with_taken(
    cells: list[NotebookNode], taken: list[NotebookNode], base: NotebookNode
) -> list[NotebookNode]:
    """Return a student's cells with those that come from another lesson.

    If a student has written in both, both are there.
    """
    handed_out = {cell.id: cell.source for cell in base.cells}
    cells = list(cells)
    at = len(cells)
    for cell in taken:
        here = next((i for i, one in enumerate(cells) if one.id == cell.id), None)
        if here is None:
            cells.insert(at, cell)
            at += 1
        elif cells[here].source == handed_out.get(cell.id):
            cells[here], at = cell, here + 1
        elif cells[here].source != cell.source:
            yours = _changed(cell, id=uuid4().hex[:8])
            cells[here + 1 : here + 1] = [new_markdown_cell(YOURS), yours]
            at = here + 3
    return cells


def update_from_folder(newer: Path, mine: Path, course: Path) -> list[str]:
    """Merge a folder into `mine`, and keep it there as what was handed out last.

    `course` is the checkout whose lessons are open: its workspaces follow. After an interruption
    the next update goes on: to merge once more changes nothing.
    """
    said = _about_solutions(mine / BASE, newer)
    base = mine / BASE
    with changes(base, mine, newer) as of_lessons, changes(base, base, newer) as of_base:
        said = set_apart(renamed_workspaces(base, newer), course) + said
        said += of_lessons.make() + of_base.make()
    # Not before: if this were done twice, two workspaces that change names would change them back.
    return said + give_new_names(course)


def _about_solutions(base: Path, newer: Path) -> list[str]:
    """Return sentences about the lessons of both whose solutions came or went."""
    old, new = (
        [outline(folder / file) for file in files_of(folder) if file.suffix == '.ipynb']
        for folder in (base, newer)
    )
    had = {lesson.name: lesson.has_solutions for lesson in old}
    said = []
    for has, what in (
        (True, 'now have their solutions'),
        (False, 'no longer have their solutions, as this archive has none of them'),
    ):
        changed = [x.number for x in new if x.has_solutions == has and had.get(x.name, has) != has]
        if changed:
            said.append(f'Lessons {", ".join(sorted(changed))} {what}.')
    return said


def update_from_archive(archive: Path, mine: Path) -> list[str]:
    """Merge an archive of `make handout` into `mine`. Raises ValueError with one sentence."""
    folder = mine / UNPACKED
    shutil.rmtree(folder, ignore_errors=True)  # of an update that was killed
    folder.mkdir()
    try:
        try:
            _unpack(archive, folder)
        except (tarfile.TarError, OSError, EOFError, zlib.error) as error:
            if getattr(error, 'errno', None):  # of the disk
                raise
            raise ValueError(f'{archive} cannot be read as an archive: get it again.') from None
        newer = next((path.parent for path in folder.glob(f'*/{BASE}')), None)
        if newer is None:
            raise ValueError(f'{archive} is no archive of `make handout`.')
        lock = _bytes(mine / 'tools/locks/requirements.lock')
        said = update_from_folder(newer, mine, course=mine)
        brought = (newer / 'wheels').is_dir()
        if brought or _bytes(mine / 'tools/locks/requirements.lock') != lock:
            shutil.rmtree(mine / 'wheels', ignore_errors=True)  # they are those of the old lock
        if brought:
            (newer / 'wheels').rename(mine / 'wheels')
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return said


def _unpack(archive: Path, folder: Path) -> None:
    """Unpack files and folders of an archive that may come from anywhere, and nothing else.

    Raises ValueError for a file that would be written elsewhere.
    """
    with tarfile.open(archive) as files:
        members = [member for member in files if member.isfile() or member.isdir()]
        for member in members:
            path = PurePosixPath(member.name)
            if path.is_absolute() or '..' in path.parts:
                raise ValueError(f'{archive} is no archive of `make handout`: {path} is in it.')
        # Python 3.11.2 of Debian 12 knows no filter.
        filters = {'filter': 'data'} if hasattr(tarfile, 'data_filter') else {}
        files.extractall(folder, members, **filters)


def update_from_git(mine: Path) -> list[str]:
    """Merge what the branch follows into a clone. Raises ValueError with one sentence."""
    if not (mine / '.git').exists():
        raise ValueError('Name the newer archive: make update FROM=/path/to/ros2_notebooks.tar.gz')
    _git(mine, 'Nothing could be fetched: check the network, and what git says', 'fetch')
    _git(
        mine,
        'This branch has commits of its own, which only you can merge: use git',
        *('merge-base', '--is-ancestor', 'HEAD', '@{upstream}'),
    )
    with tempfile.TemporaryDirectory() as folder:
        base, newer = (
            committed(mine, name, Path(folder, name[-4:])) for name in ('HEAD', '@{upstream}')
        )
        with changes(base, mine, newer) as found:
            said = set_apart(renamed_workspaces(base, newer), mine) + found.make()
        _git(mine, 'The lessons are new, but git could not note it', 'reset', '@{upstream}')
    return said + give_new_names(mine)


def _git(folder: Path, trouble: str, *command: str) -> None:
    _run(folder, trouble, 'git', *command)


def _run(folder: Path, trouble: str, *command: str | Path) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise ValueError(' '.join(f'{trouble}. {done.stderr}'.split()))


def committed(folder: Path, name: str, output: Path) -> Path:
    """Write the files of a commit into a folder, and return it."""
    output.mkdir()
    archive = output.with_suffix('.tar')
    _git(folder, f'{name} cannot be read', 'archive', f'--output={archive}', name)
    _run(output, f'{name} cannot be unpacked', 'tar', '--extract', '--file', archive)
    return output


def bring(source: Path | None, mine: Path) -> list[str]:
    """Merge what is newer in a source into `mine`. Raises ValueError with one sentence."""
    if source is None:
        return update_from_git(mine)
    if source.is_dir():
        return update_from_folder(source, mine, course=ROOT)
    if source.is_file():
        return update_from_archive(source.resolve(), mine)
    raise ValueError(f'There is no file {source}.')


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Wait until no other update changes this folder, where its file system can tell."""
    folder.mkdir(parents=True, exist_ok=True)
    lock = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)


def main(arguments: list[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = argparse.ArgumentParser(description='Bring newer lessons in, keep what was written.')
    parser.add_argument('source', nargs='?', type=Path, help='a newer archive, or a folder')
    parser.add_argument('--to', type=Path, default=ROOT, help='the folder to update')
    options = parser.parse_args(arguments)
    source, mine = options.source, options.to
    try:
        with alone(mine):
            said = bring(source, mine)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    except OSError as error:
        print(sentence_about(error, mine), file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('Interrupted: nothing is lost. Type the same again to go on.', file=sys.stderr)
        return 130
    print(*said, 'The lessons are up to date. What you have written is where it was.', sep='\n')
    return 0


if __name__ == '__main__':
    sys.exit(main())
