"""The servers and the browser of these tests: what `make lab` and `make present` start.

The notebooks are a copy, and JupyterLab's state is in a folder of the tests: nothing is written
into the checkout but what lessons build in `scratch`.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest
from lab_page import LabPage
from playwright.sync_api import Browser, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
ARTEFACTS = Path(
    os.environ.get('BROWSER_ARTEFACTS') or Path(tempfile.gettempdir(), 'ros2_notebooks_browser')
)
# No sandbox, because root may run this; and nothing that asks the network.
CHROMIUM_OPTIONS = [
    '--no-sandbox',
    '--disable-gpu',
    '--disable-quic',
    '--no-first-run',
    '--disable-background-networking',
    '--disable-component-update',
    '--disable-sync',
]
START_LIMIT_S = 60
LOCAL = ('http://localhost:', 'http://127.0.0.1:', 'data:', 'blob:')


class Server(NamedTuple):
    """A running JupyterLab."""

    url: str
    token: str
    artefacts: Path = ARTEFACTS


@contextmanager
def server(folder: Path, *make: str) -> Iterator[Server]:
    """Run a command of the Makefile that starts JupyterLab, as a process group of its own."""
    shutil.copytree(ROOT / 'notebooks', folder / 'notebooks')
    state = [f'{name}={folder / name}' for name in ('JUPYTER_CONFIG_DIR', 'JUPYTER_RUNTIME_DIR')]
    options = 'LAB_ARGS=--LabApp.expose_app_in_browser=True'
    with Path(folder, 'log').open('w') as log:
        process = subprocess.Popen(
            ['make', *make, 'BROWSER=no', f'ROOT={folder}', options, *state],
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
    """Wait until the server has written the file with its address."""
    end = time.monotonic() + START_LIMIT_S
    while time.monotonic() < end and process.poll() is None:
        for file in Path(folder, 'JUPYTER_RUNTIME_DIR').glob('jpserver-*.json'):
            found = json.loads(file.read_text() or '{}')
            if found:
                return Server(found['url'], found['token'])
        time.sleep(0.05)
    raise RuntimeError(f'JupyterLab did not start:\n{Path(folder, "log").read_text()}')


@pytest.fixture(scope='session')
def student_server(tmp_path_factory) -> Iterator[Server]:
    """Yield what `make lab` starts."""
    with server(tmp_path_factory.mktemp('lab'), 'lab') as running:
        yield running


@pytest.fixture(scope='session')
def instructor_server(tmp_path_factory) -> Iterator[Server]:
    """Yield what `make present LESSON=02` starts."""
    with server(tmp_path_factory.mktemp('present'), 'present', 'LESSON=02') as running:
        yield running


@pytest.fixture(scope='session')
def chromium() -> Iterator[Browser]:
    """Yield the Chromium that `make test-browser` found."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=os.environ.get('CHROMIUM', '/usr/bin/chromium'), args=CHROMIUM_OPTIONS
        )
        yield browser
        browser.close()


@contextmanager
def page(chromium: Browser, running: Server, name: str) -> Iterator[LabPage]:
    """Open a tab of 1280 x 720. No request may leave this machine."""
    context = chromium.new_context(viewport={'width': 1280, 'height': 720})
    tab = context.new_page()
    outside = []
    tab.on('request', lambda r: r.url.startswith(LOCAL) or outside.append(r.url))
    lab = LabPage(tab, running)
    try:
        yield lab
    finally:
        lab.screenshot(name)
        lab.close()
        context.close()
    assert outside == []


@pytest.fixture
def lab(chromium, student_server, request) -> Iterator[LabPage]:
    """Yield a student's page."""
    with page(chromium, student_server, request.node.name) as opened:
        yield opened


@pytest.fixture
def deck(chromium, instructor_server, request) -> Iterator[LabPage]:
    """Yield an instructor's page."""
    with page(chromium, instructor_server, request.node.name) as opened:
        yield opened


def pytest_terminal_summary(terminalreporter) -> None:
    """Say where the screenshots are."""
    terminalreporter.write_line(f'Screenshots: {ARTEFACTS}')
