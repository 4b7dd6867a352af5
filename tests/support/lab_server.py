"""A JupyterLab that `make lab` or `make present` started, for one run of the tests.

The notebooks are a copy, and JupyterLab's state is in a folder of the tests: nothing is written
into the checkout but what lessons build in `scratch`.
"""

from __future__ import annotations

import contextlib
import os
import random
import re
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / 'notebooks').glob('*.ipynb'))
START_LIMIT_S = 60
STOPS = 'received signal 15, stopping'  # Jupyter's log


class Server(NamedTuple):
    """A running JupyterLab."""

    address: str  # as printed
    url: str
    token: str
    folder: Path


@contextlib.contextmanager
def made(
    folder: Path, printed: str, *make: str, inside: Sequence[str] = ()
) -> Iterator[tuple[subprocess.Popen, re.Match]]:
    """Run a command of the Makefile beside the block, as a process group of its own.

    It yields the process, and what it has printed by which one sees that it has started. `inside`
    is a command that runs others.
    """
    log = folder / f'{make[0]}.log'
    with log.open('w') as file:
        process = subprocess.Popen(
            # If this test is killed, the server is told, and ends its kernels.
            ['setpriv', '--pdeathsig', 'TERM', *inside, *command_of(folder, *make)],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=file,
            start_new_session=True,
        )
    try:
        end = time.monotonic() + START_LIMIT_S
        while not (found := re.search(printed, log.read_text())):
            if process.poll() is not None or time.monotonic() > end:
                raise RuntimeError(f'{make[0]} did not start:\n{log.read_text()}')
            time.sleep(0.05)
        if not inside:
            wait_until_it_listens(found[0], end)
        yield process, found
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGTERM)
        try:
            process.wait(START_LIMIT_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            # Jupyter's loop may stop before it has ended a thread of AnyIO that answers a request,
            # such as the last save of a page. Then the process waits for that thread for ever.
            if STOPS not in log.read_text():
                raise


def wait_until_it_listens(printed: str, end: float) -> None:
    """Wait until the port of a printed address takes connections, until a time of the clock.

    JupyterLab prints its address in `start_app` and listens when its loop runs, a moment later.
    """
    if address := re.search(r'http://localhost:(\d+)', printed):
        while time.monotonic() < end:
            with contextlib.suppress(ConnectionRefusedError):
                socket.create_connection(('localhost', int(address[1]))).close()
                return
            time.sleep(0.05)
        raise RuntimeError(f'It printed {address[0]}, and nothing listens there.')


def command_of(folder: Path, command: str, *options: str) -> list[str]:
    """Return a command of the Makefile that keeps JupyterLab's state in a folder."""
    # Two workers start servers at the same moment, and would both find the first free port. The
    # system's own choice is no way out: JupyterLab lets it go again until it has started, and then
    # any connection may have it. No connection gets a port below 32768.
    port = random.randrange(20_000, 30_000)
    state = ('JUPYTER_CONFIG_DIR', 'JUPYTER_DATA_DIR', 'JUPYTER_RUNTIME_DIR')
    variables = [f'{name}={folder / name}' for name in state]
    return ['make', command, f'PORT={port}', 'BROWSER=no', f'ROOT={folder}', *variables, *options]


@contextlib.contextmanager
def server(folder: Path, *make: str) -> Iterator[Server]:
    """Run a command of the Makefile that starts JupyterLab, on a copy of the notebooks."""
    shutil.copytree(ROOT / 'notebooks', folder / 'notebooks', dirs_exist_ok=True)
    exposed = 'LAB_ARGS=--LabApp.expose_app_in_browser=True'
    with made(folder, r'(http://localhost:\d+/)\S+token=(\w+)\n', *make, exposed) as (_, found):
        yield Server(found[0].strip(), *found.groups(), folder)
