"""The servers and the browser of these tests."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from support.lab_page import LIMIT_S, LabPage
from support.lab_server import Server, server

if TYPE_CHECKING:  # only what opens a browser needs it
    from playwright.sync_api import Browser, BrowserContext, Page

ARTEFACTS = Path(
    os.environ.get('BROWSER_ARTEFACTS') or Path(tempfile.gettempdir(), 'ros2_notebooks_browser')
)
# What Playwright does not turn off itself.
CHROMIUM_OPTIONS = ['--disable-gpu', '--disable-quic']
# The div stands for a cell, which takes the focus when Escape is pressed.
PHONE = '<!doctype html><meta name="viewport" content="width=device-width"><div tabindex="0">'
AXE = Path(__file__).with_name('axe')
LOCAL = ('http://localhost:', 'http://127.0.0.1:', 'data:', 'blob:')


@pytest.fixture(scope='session')
def student_server(tmp_path_factory) -> Iterator[Server]:
    """Yield what `make lab` starts."""
    with server(tmp_path_factory.mktemp('lab'), 'lab') as running:
        yield running


@pytest.fixture(scope='session')
def artefacts() -> Path:
    """Return the folder of the screenshots."""
    ARTEFACTS.mkdir(parents=True, exist_ok=True)
    return ARTEFACTS


@pytest.fixture(scope='session')
def chromium() -> Iterator[Browser]:
    """Yield Chromium. Without one, the tests that need it are left out."""
    found = filter(None, map(shutil.which, ('chromium', 'chromium-browser', 'google-chrome')))
    if not (program := os.environ.get('CHROMIUM') or next(found, None)):
        pytest.skip('LEFT OUT, no Chromium: `sudo apt install chromium`, or set CHROMIUM=...')
    sync_api = pytest.importorskip('playwright.sync_api', reason='LEFT OUT: no Playwright')
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=CHROMIUM_OPTIONS)
        yield browser
        browser.close()


@pytest.fixture(scope='session')
def axe(tmp_path_factory) -> Path:
    """Return the script that knows the rules of accessibility. npm fetches it."""
    folder = shutil.copytree(AXE, tmp_path_factory.mktemp('axe'), dirs_exist_ok=True)
    command = ['npm', 'ci', '--ignore-scripts', '--no-audit', '--no-fund', '--silent']
    try:
        subprocess.run([*command, '--prefer-offline'], cwd=folder, check=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip('LEFT OUT: npm cannot fetch axe-core.')
    return folder / 'node_modules/axe-core/axe.min.js'


@pytest.fixture(scope='session')
def tabs(chromium) -> Iterator[BrowserContext]:
    """Yield what opens tabs of 1280 x 720, which share what they have loaded of JupyterLab."""
    with chromium.new_context(viewport={'width': 1280, 'height': 720}) as context:
        context.set_default_navigation_timeout(LIMIT_S * 1000)
        yield context


@pytest.fixture
def lab_page(tabs) -> Callable:
    """Return a context manager that opens a tab of a server. No request may leave this machine."""

    @contextmanager
    def opened(running: Server, name: str, kind: type = LabPage) -> Iterator[LabPage]:
        tab = tabs.new_page()
        outside = []
        tab.on('request', lambda r: r.url.startswith(LOCAL) or outside.append(r.url))
        lab = kind(tab, running, ARTEFACTS)
        try:
            yield lab
        finally:
            lab.screenshot(re.sub(r'\W+', '_', name).strip('_'))
            lab.close()
            tab.close()
        assert outside == []

    return opened


@pytest.fixture
def lab(lab_page, student_server, request) -> Iterator[LabPage]:
    """Yield a student's page."""
    with lab_page(student_server, request.node.name) as opened:
        yield opened


@pytest.fixture
def file_page(chromium) -> Callable:
    """Return a context manager that opens a tab for a page from a file, without a network.

    At its end no script of the page has failed, but for what `expected` names.
    """

    @contextmanager
    def opened(width: int, height: int, expected: tuple[str, ...] = (), **options):
        size = {'width': width, 'height': height}
        context = chromium.new_context(viewport=size, offline=True, **options)
        tab = context.new_page()
        errors = []
        tab.on('pageerror', lambda error: errors.append(str(error)))
        yield tab
        context.close()
        assert [e for e in errors if not any(word in e for word in expected)] == []

    return opened


@pytest.fixture
def phone(file_page, tmp_path) -> Iterator[Callable]:
    """Yield a function that opens what cells show on a page from a file, as wide as a phone."""
    with file_page(360, 720) as tab:

        def opened(*shown) -> Page:
            html = ''.join(one._repr_mimebundle_()['text/html'] for one in shown)
            file = tmp_path / 'page.html'
            file.write_text(PHONE + html, encoding='utf-8')
            tab.goto(file.as_uri())
            return tab

        yield opened


def pytest_terminal_summary(terminalreporter) -> None:
    """Say where the screenshots are."""
    terminalreporter.write_line(f'Screenshots: {ARTEFACTS}')
