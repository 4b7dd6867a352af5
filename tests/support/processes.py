"""Python processes that tests start, and what this process has running."""

import contextlib
import os
import re
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import psutil

from support.leftovers import threads_of_process
from support.waits import START_LIMIT_S

HERE = Path(__file__).parents[1]  # for `import support` in a process
SEGMENT = re.compile(r'/dev/shm/fastrtps_[0-9a-f]{16}')


@contextlib.contextmanager
def running(script: str, **environment: str | None) -> Iterator[subprocess.Popen]:
    """Run a Python script beside the block. A variable that is None is not in its environment."""
    variables = {**os.environ, 'PYTHONPATH': str(HERE), **environment}
    process = subprocess.Popen(
        [sys.executable, '-c', textwrap.dedent(script)],
        env={name: value for name, value in variables.items() if value is not None},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        kill(process)
        process.communicate()


def run_python(script: str, **environment: str | None) -> str:
    """Run a script that must succeed without a word on stderr, and return its stdout."""
    with running(script, **environment) as process:
        out, err = process.communicate(timeout=START_LIMIT_S)
    assert (process.returncode, err) == (0, '')
    return out


def kill(process: subprocess.Popen | psutil.Process) -> None:
    """Kill a process, and remove the shared memory that it can no longer remove.

    Its ports stay: the next participant that wants their numbers takes them.
    """
    with contextlib.suppress(OSError):
        held = segments(process.pid)
        process.kill()
        process.wait()
        for segment in held:
            for file in (segment, f'{segment}_el'):  # and the lock that says it is in use
                Path(file).unlink(missing_ok=True)


def segments(pid: int | str = 'self') -> set[str]:
    """Return the segments of Fast DDS's shared memory that a process uses, without its ports."""
    return set(SEGMENT.findall(Path(f'/proc/{pid}/maps').read_text()))


def traces() -> set[str]:
    """Return what is in this process and can be left behind: threads and shared memory."""
    return threads_of_process().keys() | segments()


def put(folder: Path, name: str, script: str) -> Path:
    """Put a command into a folder, which does what a script in sh says."""
    program = folder / name
    program.unlink(missing_ok=True)  # a link leads to a command of this machine
    program.write_text(f'#!/bin/sh\n{script}\n')
    program.chmod(0o755)
    return program
