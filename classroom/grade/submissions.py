"""Whose file is it? The downloads of Moodle and Canvas say it in the names.

Moodle, `mod/assign/classes/downloader.php`: `Ada Lovelace_123_assignsubmission_file/02.ipynb`, with
an underscore at the end of the folder before 4.1; without folders
`Ada Lovelace_123_assignsubmission_file_02.ipynb`. The number is that of the grading worksheet.
Where students are anonymous, all of them are called Participant, in the language of the teacher.

Canvas, `lib/content_zipper.rb`: `lovelaceada_LATE_123_4567_02.ipynb`. The first number is the
student's ID in the gradebook, the second that of the file. An anonymous student is
`anon_x7Yz1_4567_02.ipynb`.

Other files belong to the folder in which they are, or to their own name.
"""

from __future__ import annotations

import io
import re
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

MOODLE = re.compile(r'(?P<name>[^/]*)_(?P<number>\d+)_assignsubmission_(?P<kind>[a-z]+)_?')
CANVAS = re.compile(r'(?P<name>.+?)(?P<late>_LATE)?_(?P<number>\d+)_\d+_(?=.)')
ANONYMOUS = re.compile(r'(?P<late>LATE_)?(?P<name>anon_[A-Za-z0-9]+)_\d+_(?=.)')
PARTICIPANT = 'Participant'
ARCHIVES = ('.zip', '.tar', '.tar.gz', '.tgz', '.tar.xz', '.tar.bz2')
LARGEST = 50_000_000  # bytes of a file
LARGEST_FILES = 20_000_000  # bytes of all files of a workspace, and
MOST_FILES = 1000
UNREADABLE = (
    *(zipfile.BadZipFile, tarfile.TarError, zlib.error),
    *(OSError, EOFError, RuntimeError, NotImplementedError, ValueError),
)


@dataclass(frozen=True)
class File:
    """A file of a download. `path` is its place there, and `name` what the student called it."""

    path: str
    name: str
    read: Callable[[], bytes]


@dataclass
class Submission:
    """What one student has handed in. `system` is 'moodle', 'canvas' or nothing.

    `anonymous`: the system tells no name. In Moodle there is a number, in Canvas there is none.
    """

    name: str
    number: str = ''
    system: str = ''
    late: bool = False
    anonymous: bool = False
    files: list[File] = field(default_factory=list)

    @property
    def key(self) -> str:
        """Names the student in the files of this tool: no two students have the same one."""
        words = re.sub(r'\W+', '_', self.name)[:60]
        if words != self.name and not self.number:
            words += f'_{zlib.crc32(self.name.encode("utf-8", "replace")):08x}'
        return '-'.join(part for part in (self.system, self.number, words) if part)


def submissions_of(folder: Path) -> tuple[list[Submission], list[File]]:
    """Return what students handed in, by their names, and the CSV files that belong to nobody.

    `folder` is a folder or a zip. Raises ValueError with one sentence if it is neither.
    """
    if folder.is_file():
        try:
            files = list(_of_zip(folder))
        except UNREADABLE:
            raise ValueError(f'{folder} cannot be read as a zip: download it again.') from None
    elif folder.is_dir():
        files = list(_of_folder(folder))
    else:
        raise ValueError(f'There is no {folder}. Write FOLDER= and the folder of the submissions.')
    found: dict[tuple, Submission] = {}
    sheets = []
    for path, read in files:
        owner, name = _owner(path)
        if owner is None:
            sheets.append(File(path, name, read))
            continue
        if owner.system == 'moodle' and name == 'onlinetext.html':
            name = ''  # what was typed into Moodle: no notebook
        same = found.setdefault((owner.system, owner.number or owner.name), owner)
        same.late |= owner.late
        same.files.append(File(path, name, read))
    _number_the_anonymous([one for one in found.values() if one.system == 'moodle'])
    return sorted(found.values(), key=lambda one: (one.name.casefold(), one.number)), sheets


def _number_the_anonymous(students: list[Submission]) -> None:
    """Give students of Moodle who all have one name, such as Participant, their numbers in it."""
    names = {one.name for one in students}
    if len(names) == 1 and (len(students) > 1 or names == {PARTICIPANT}):
        for one in students:
            one.name, one.anonymous = f'{one.name} {one.number}', True


def _owner(path: str) -> tuple[Submission | None, str]:
    """Return whose file a path names, and how the student called the file."""
    parts = path.split('/')
    for number, part in enumerate(parts):
        below = '/'.join(parts[number + 1 :])
        if match := MOODLE.match(part):
            name = f'{part[match.end() :]}/{below}'.strip('/')
            return Submission(match['name'].strip(), match['number'], 'moodle'), name
        if below:
            continue
        if match := ANONYMOUS.match(part):
            owner = Submission(match['name'], '', 'canvas', bool(match['late']), anonymous=True)
            return owner, part[match.end() :]
        if match := CANVAS.match(part):
            owner = Submission(match['name'], match['number'], 'canvas', bool(match['late']))
            return owner, part[match.end() :]
    if len(parts) == 1 and path.lower().endswith('.csv'):
        return None, path
    if len(parts) == 1:
        return Submission(_stem(path)), path
    return Submission(parts[0]), '/'.join(parts[1:])


def _stem(name: str) -> str:
    for ending in ('.ipynb', *sorted(ARCHIVES, key=len, reverse=True)):
        if name.lower().endswith(ending):
            return name[: -len(ending)]
    return name


def _of_folder(folder: Path) -> Iterator[tuple[str, Callable[[], bytes]]]:
    for path in sorted(folder.rglob('*')):
        name = path.relative_to(folder).as_posix()
        if path.is_symlink() or not path.is_file() or _is_hidden(name):
            continue
        if path.parent == folder and path.suffix.lower() == '.zip' and _is_download(path):
            yield from _of_zip(path)
        else:
            yield name, lambda path=path: _limited(path.open('rb'))


def _is_hidden(name: str) -> bool:
    """Whether a file is none of a student: JupyterLab's, macOS's or of git."""
    return any(part.startswith('.') or part == '__MACOSX' for part in name.split('/'))


def _is_download(path: Path) -> bool:
    """Whether a zip is a download of all submissions, and not what a student handed in."""
    if _owner(path.name)[0].system:
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            return any((_owner(name)[0] or Submission('')).system for name in archive.namelist())
    except UNREADABLE:
        return False


def _of_zip(path: Path) -> Iterator[tuple[str, Callable[[], bytes]]]:
    archive = zipfile.ZipFile(path)  # open as long as its files may be read
    for info in archive.infolist():
        name = info.filename.replace('\\', '/')
        if not info.is_dir() and not _is_hidden(name):
            yield name, lambda info=info: _limited(archive.open(info))


def _limited(stream: io.BufferedIOBase, largest: int = LARGEST) -> bytes:
    """Return the bytes of a file. Raises ValueError if there are more than `largest`."""
    with stream:
        data = stream.read(largest + 1)
    if len(data) > largest:
        raise ValueError(f'it has more than {largest // 1_000_000} MB')
    return data


def workspace_files(file: File) -> dict[str, bytes]:
    """Return the files of an archive of a workspace, by their paths below `src`.

    Raises ValueError with the end of a sentence for what cannot be read.
    """
    data = file.read()
    try:
        members = _zip_members if file.name.lower().endswith('.zip') else _tar_members
        workspaces = _workspaces(PurePosixPath(name).parts for name, _ in members(data))
        files, size = {}, 0
        for name, read in members(data):
            path = PurePosixPath(name)
            if path.is_absolute() or '..' in path.parts:
                raise ValueError(f'{name!r} in it leads out of it')
            below = _below_src(path.parts, workspaces)
            if below is None or _is_hidden(name):
                continue
            content = read()
            size += len(content)
            if len(files) == MOST_FILES or size > LARGEST_FILES:
                raise ValueError(f'it has more than {MOST_FILES} files or 20 MB')
            files[below] = content
    except UNREADABLE as error:
        why = str(error) if type(error) is ValueError else 'it cannot be read as an archive'
        raise ValueError(why) from None
    if not files:
        raise ValueError('there are no files of a workspace in it')
    return files


def _workspaces(paths: Iterable[tuple[str, ...]]) -> set[str]:
    """Return the folders at the top of an archive that are workspaces.

    A workspace has folders in its `src`. A package has files there, or a package.xml beside it.
    """
    with_folders, packages = set(), set()
    for top, *below in filter(None, paths):
        if below[:1] == ['src'] and len(below) > 2:
            with_folders.add(top)
        elif below == ['package.xml'] or below[:1] == ['src']:
            packages.add(top)
    return with_folders - packages


def _below_src(parts: tuple[str, ...], workspaces: set[str]) -> str | None:
    """Return the path below the workspace's `src`, or None for a file of a build.

    The archive may begin with `scratch`, the workspace, `src` or the packages.
    """
    rest = list(parts)
    if rest[0] == 'scratch' and len(rest) > 2:
        rest = rest[2:]
    elif rest[0] in workspaces:
        rest = rest[1:]
    if len(rest) > 1 and rest[0] == 'src':
        return '/'.join(rest[1:])
    return None if rest[0] in ('build', 'install', 'log') else '/'.join(rest)


def _zip_members(data: bytes) -> Iterator[tuple[str, Callable[[], bytes]]]:
    archive = zipfile.ZipFile(io.BytesIO(data))
    for info in archive.infolist():
        if not info.is_dir():
            name = info.filename.replace('\\', '/')
            yield name, lambda info=info: _limited(archive.open(info), LARGEST_FILES)


def _tar_members(data: bytes) -> Iterator[tuple[str, Callable[[], bytes]]]:
    with tarfile.open(fileobj=io.BytesIO(data)) as archive:
        for member in archive:
            if member.isfile():  # no link, no device
                name = member.name.removeprefix('./')
                yield name, lambda file=member: _limited(archive.extractfile(file), LARGEST_FILES)
