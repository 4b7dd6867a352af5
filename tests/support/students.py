"""Kernels of students: processes that run the cells of a lesson."""

import contextlib
from pathlib import Path

import pytest

from helpers.checks.classroom import HUB_VARIABLE
from helpers.checks.progress import FILE_VARIABLE
from helpers.lesson import path_of
from support.processes import running

LESSON = path_of('lose_messages').name
BEGIN = 'import sys\nfrom helpers.checks import classroom\nfrom helpers.checks import *\n'
GUESSES = """
import time
from helpers.lesson import path_of
for value in range({}, {}):
    guess({!r}, value)
    time.sleep(0.01)
"""
# Answers that a class can show.
VALUES = [41, 0.2, True, 'the way is free', {'D', 'C'}, [0, 1, 2], ('a', 1)]


def student(folder: Path, lesson: str = LESSON) -> dict[str, str | None]:
    """Return the environment of the kernel of a student, who keeps progress in a folder."""
    folder.mkdir(exist_ok=True)
    return {
        FILE_VARIABLE: str(folder / 'progress.txt'),
        'JPY_SESSION_NAME': str(folder / lesson),
        HUB_VARIABLE: None,
    }


@contextlib.contextmanager
def kernel(folder, script, begin=BEGIN, **environment):
    """Run a script as cells of a lesson; yield what it prints. The kernel lives in the block."""
    end = '\nprint("END", flush=True)\nsys.stdin.read()'
    with running(begin + script + end, **student(folder) | environment) as process:
        lines = []
        for line in process.stdout:
            if line == 'END\n':
                break
            lines.append(line)
        else:
            pytest.fail(process.stderr.read())
        yield ' '.join(''.join(lines).split())
        process.communicate()


def in_kernel(folder, script, **environment):
    """Run a script in a kernel that ends then as at a restart, and return what it printed."""
    with kernel(folder, script, **environment) as said:
        pass
    return said
