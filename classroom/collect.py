"""`make collect FROM=/home LESSON=02`: from the homes of a hub into what `make grade` reads.

FROM is a folder with a home for each student: `/home`, an NFS share, the folder of the volumes of
podman or docker. In each home the lesson is looked for in `ros2_notebooks`, or beside it, as a
volume has it, and the files of its workspace in `scratch`. What is found goes into
`submissions_02/STUDENT/`, with the time at which it was saved.

A home is a student's: a link in it may lead to somebody else's file, or be put there while this
runs as root. So each folder and file is opened by its name in the one above, and no link is
followed.
"""

from __future__ import annotations

import argparse
import io
import os
import re
import stat
import sys
import tarfile
from collections.abc import Iterator
from pathlib import Path

from classroom.grade.submissions import LARGEST, LARGEST_FILES, MOST_FILES
from helpers.lesson import FOLDER, Lesson, chosen, outline

COURSE = 'ros2_notebooks'
VOLUME = re.compile(r'^ros2_notebooks_(.+)$')
INSIDE = (COURSE,), (), ('_data', COURSE), ('_data',)  # below a home, or a volume of podman
BUILT = {'__pycache__', '.ipynb_checkpoints', '.git', 'build', 'install', 'log'}


def open_folder(path: Path | str, above: int | None = None) -> int:
    """Open a folder by its name in the one above, if it is none by a link. Raises OSError."""
    return os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=above)


def open_below(above: int, names: tuple[str, ...]) -> int:
    """Open a folder some levels below; the caller closes it. Raises OSError."""
    here = os.dup(above)
    for name in names:
        try:
            inner = open_folder(name, here)
        finally:
            os.close(here)
        here = inner
    return here


def read_file(above: int, name: str, largest: int) -> tuple[bytes, float] | None:
    """Return what a file holds and when it was saved; None for what is no file of this size."""
    try:
        number = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=above)
    except OSError:
        return None
    with os.fdopen(number, 'rb') as file:
        found = os.fstat(number)
        if not stat.S_ISREG(found.st_mode) or found.st_size > largest:
            return None
        data = file.read(largest + 1)
        return (data, found.st_mtime) if len(data) <= largest else None


def files_below(above: int, path: str = '', depth: int = 12) -> Iterator[tuple[str, bytes]]:
    """Yield the files of a folder by their paths, without what a build makes."""
    for name in sorted(os.listdir(above)):
        inside = f'{path}{name}'
        try:
            inner = open_folder(name, above)
        except OSError:
            if found := read_file(above, name, LARGEST_FILES):
                yield inside, found[0]
            continue
        try:
            if name not in BUILT and depth:
                yield from files_below(inner, f'{inside}/', depth - 1)
        finally:
            os.close(inner)


def workspace(course: int, name: str) -> tuple[bytes, str]:
    """Return an archive of the files of a workspace, empty if there are none, and a sentence."""
    data, size, count = io.BytesIO(), 0, 0
    try:
        source = open_below(course, ('scratch', name, 'src'))
    except OSError:
        return b'', ''
    try:
        with tarfile.open(fileobj=data, mode='w:gz') as archive:
            for path, content in files_below(source):
                size, count = size + len(content), count + 1
                if size > LARGEST_FILES or count > MOST_FILES:
                    return b'', f'{name} has more than {MOST_FILES} files or 20 MB: left out'
                info = tarfile.TarInfo(f'{name}/src/{path}')
                info.size = len(content)
                archive.addfile(info, io.BytesIO(content))
    finally:
        os.close(source)
    return (data.getvalue(), '') if count else (b'', '')


def collect(homes: Path, lessons: list[Lesson], to: Path) -> tuple[int, list[str]]:
    """Copy what students have, and return how many have something, and what is to be said."""
    said, count = [], 0
    for home in sorted(homes.iterdir()):
        volume = VOLUME.match(home.name)
        student = volume[1] if volume else home.name
        if home.is_symlink() or not home.is_dir() or student.startswith('.'):
            continue
        with_lesson = False
        for inside in INSIDE:
            try:
                above = open_folder(home)
                try:
                    course = open_below(above, inside)
                finally:
                    os.close(above)
            except OSError:
                continue
            try:
                for lesson in lessons:
                    notebook = read_file(course, lesson.file, LARGEST)
                    if notebook is None:
                        continue
                    with_lesson = True
                    archive, why = b'', ''
                    if lesson.workspace:
                        archive, why = workspace(course, lesson.workspace)
                    said += [f'{student}: {why}'] if why else []
                    put(to / student / lesson.file, *notebook)
                    if archive:
                        put(to / student / f'{lesson.workspace}.tar.gz', archive, notebook[1])
            finally:
                os.close(course)
            if with_lesson:
                break
        count += with_lesson
        if not with_lesson:
            said.append(f'{student}: no lesson')
    return count, said


def put(path: Path, data: bytes, saved_s: float) -> None:
    """Write a file with the time at which the student saved it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    os.utime(path, (saved_s, saved_s))


def main(arguments: list[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = argparse.ArgumentParser(prog='make collect', description=__doc__)
    parser.add_argument('homes', type=Path, metavar='FROM')
    parser.add_argument('--lesson', default='', help='such as "02 03"')
    parser.add_argument('--to', type=Path, help='a folder: submissions_02')
    options = parser.parse_args(arguments)
    try:
        if not options.lesson:
            raise ValueError('Which lesson? LESSON=02, or several: LESSON="02 03".')
        paths = chosen(options.lesson, FOLDER)
        lessons = [outline(path) for path in paths]
        numbers = '_'.join(lesson.number for lesson in lessons)
        to = options.to or Path(f'submissions_{numbers}')
        count, said = collect(options.homes, lessons, to)
    except (ValueError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    print(*said, sep='\n', end='\n' if said else '')
    students = f'{count} student{"s" * (count != 1)}'
    print(f'{to}: {students}. Next: make grade FOLDER={to} LESSON="{options.lesson}"')
    return 0


if __name__ == '__main__':
    sys.exit(main())
