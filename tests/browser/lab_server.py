"""A JupyterLab that `make lab` or `make present` started, for one run of the tests.

The notebooks are a copy, and JupyterLab's state is in a folder of the tests: nothing is written
into the checkout but what lessons build in `scratch`.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / 'notebooks').glob('*.ipynb'))
START_LIMIT_S = 60


class Server(NamedTuple):
    """A running JupyterLab."""

    address: str  # as printed
    url: str
    token: str
    folder: Path


@contextmanager
def server(folder: Path, *make: str) -> Iterator[Server]:
    """Run a command of the Makefile that starts JupyterLab, as a process group of its own."""
    shutil.copytree(ROOT / 'notebooks', folder / 'notebooks', dirs_exist_ok=True)
    # Two workers start servers at the same moment, and would both find the first free port. The
    # system gives each a port of its own.
    command = ['make', *make, 'PORT=0', 'BROWSER=no', f'ROOT={folder}']
    state = ('JUPYTER_CONFIG_DIR', 'JUPYTER_DATA_DIR', 'JUPYTER_RUNTIME_DIR')
    command += [f'{name}={folder / name}' for name in state]
    command += ['LAB_ARGS=--LabApp.expose_app_in_browser=True']
    with Path(folder, 'log').open('w') as log:
        process = subprocess.Popen(
            # If this test is killed, the server is told, and ends its kernels.
            ['setpriv', '--pdeathsig', 'TERM', *command],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
        try:
            yield _address(process, folder)
        finally:
            os.killpg(process.pid, signal.SIGTERM)
            process.wait(START_LIMIT_S)


def _address(process: subprocess.Popen, folder: Path) -> Server:
    """Wait until the server has printed its address."""
    end = time.monotonic() + START_LIMIT_S
    while time.monotonic() < end and process.poll() is None:
        printed = Path(folder, 'log').read_text()
        if found := re.search(r'(http://localhost:\d+/)\S+token=(\w+)\n', printed):
            return Server(found[0].strip(), found[1], found[2], folder)
        time.sleep(0.05)
    raise RuntimeError(f'JupyterLab did not start:\n{Path(folder, "log").read_text()}')
