"""Which code is the learner's own: cells, and files of the workspace."""

from __future__ import annotations

import linecache
import os
import re
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import FrameType

HELPERS = str(Path(__file__).resolve().parents[1]) + os.sep
INSTALLED = tuple(
    os.path.realpath(sysconfig.get_path(name)) + os.sep for name in ('stdlib', 'purelib', 'platlib')
)
CELL = re.compile(r'[/\\]ipykernel_\d+[/\\]|^<(?:ipython-input|cell)')


def is_students(filename: str) -> bool:
    """Return whether a file holds code of the student: a cell, or a file of the workspace."""
    if CELL.search(filename):
        return True
    if filename.startswith('<') or not os.path.isabs(filename):
        return False
    path = os.path.realpath(filename)
    return not path.startswith((HELPERS, *INSTALLED)) and not filename.startswith(sys.prefix)


def own_line(frames: Iterable[tuple[str, int]]) -> str:
    """Return the first of these places that is the student's, as `Line 7: x = 1`, or nothing."""
    for filename, number in frames:
        if is_students(filename):
            line = linecache.getline(filename, number).strip()
            where = '' if CELL.search(filename) else f' of {os.path.basename(filename)}'
            if line:
                return f'Line {number}{where}: {line}'
    return ''


def places(frame: FrameType | None) -> Iterator[tuple[str, int]]:
    """Yield file and line of a frame and of those that called it, the innermost first."""
    while frame is not None:
        yield frame.f_code.co_filename, frame.f_lineno
        frame = frame.f_back
