"""A page of JupyterLab, used by keys and clicks as a person does.

What a person sees is waited for, never a time: JupyterLab's own objects say when a kernel is idle,
a cell has run, a slide is shown. `window.jupyterapp` gives them (--LabApp.expose_app_in_browser).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from support.lab_server import Server

if TYPE_CHECKING:  # only what opens a browser needs it
    from playwright.sync_api import ElementHandle, Page

LIMIT_S = 300  # to open a page, and for what a lesson computes; the rest has Playwright's 30 s
PANEL = 'window.jupyterapp.shell.currentWidget'
WIDER = '() => document.documentElement.scrollWidth > innerWidth'  # any page than its window

READY = """name => {
    const panel = window.jupyterapp?.shell.currentWidget;
    return panel?.context?.path === name && panel.context.isReady
        && panel.sessionContext.isReady && panel.sessionContext.session?.kernel?.status === 'idle'
        && document.querySelector('#jp-main-statusbar').textContent.includes('| Idle');
}"""
IDLE = f"{PANEL}.sessionContext.session.kernel.status === 'idle'"
CELL_RAN = f"""index => {{
    const cell = {PANEL}.content.model.cells.get(index);
    return {IDLE} && cell.executionState === 'idle' && cell.executionCount !== null;
}}"""
# Of a note for the instructor nothing is seen: then the focus is anywhere in the notebook.
HAS_FOCUS = f"""() => {{
    const notebook = {PANEL}.content, cell = notebook.activeCell.node;
    return (cell.checkVisibility() ? cell : notebook.node).contains(document.activeElement);
}}"""


class LabPage:
    """One tab of the browser, on a server that `make lab` started."""

    def __init__(self, page: Page, server: Server, artefacts: Path) -> None:
        self.page = page
        self.server = server
        self.artefacts = artefacts

    def goto(self, path: str) -> None:
        """Open an address of the server."""
        self.page.goto(f'{self.server.url}{path}?reset&token={self.server.token}')

    def open(self, name: str) -> None:
        """Open a notebook, and wait for its kernel."""
        self.goto(f'lab/tree/notebooks/{name}')
        self.wait_for_notebook(f'notebooks/{name}')

    def wait_for_notebook(self, path: str) -> None:
        """Wait until a notebook is open and its kernel idle."""
        self.page.wait_for_function(READY, arg=path, timeout=LIMIT_S * 1000)

    def close(self) -> None:
        """End the kernels of this page's server."""
        self.page.evaluate('() => window.jupyterapp?.serviceManager.sessions.shutdownAll()')

    def command(self, name: str) -> None:
        """Execute a command of JupyterLab and wait for its end."""
        script = 'name => window.jupyterapp.commands.execute(name).then(() => null)'
        self.page.evaluate(script, name)

    # Cells

    def cells(self) -> list[dict[str, Any]]:
        """Return the cells as they are now."""
        return self.page.evaluate(f'() => {PANEL}.content.model.toJSON().cells')

    def find(self, source: str = '', tag: str = '') -> int:
        """Return the index of the first cell with this in its source, and this tag."""
        for index, cell in enumerate(self.cells()):
            if source in cell['source'] and tag in ['', *cell['metadata'].get('tags', [])]:
                return index
        raise LookupError(f'There is no cell with {source!r} in it and the tag {tag!r}.')

    def show(self, index: int) -> ElementHandle:
        """Scroll to a cell, and return it with its pictures loaded."""
        script = f'index => {PANEL}.content.scrollToItem(index, "start")'
        self.page.evaluate(script, index)
        cell = self.page.wait_for_function(
            f"""index => {{
                const cell = {PANEL}.content.widgets[index].node;
                return cell.isConnected && cell.querySelector('.jp-Cell-inputWrapper')
                    && [...cell.querySelectorAll('img')].every(img => img.complete) && cell;
            }}""",
            arg=index,
        )
        return cell.as_element()

    def start(self, index: int) -> None:
        """Select a cell with a click, and press Ctrl+Enter. It has no number until it has run."""
        self.page.evaluate(
            f'index => {PANEL}.content.model.cells.get(index).clearExecution()', index
        )
        self.show(index).query_selector('.jp-InputPrompt').click()
        self.page.keyboard.press('Control+Enter')

    def run(self, index: int) -> str:
        """Run a cell, wait for its end, and return what it printed."""
        self.start(index)
        self.wait_until_ran(index)
        return printed(self.cells()[index])

    def run_here(self) -> None:
        """Press Ctrl+Enter in the active cell, and wait for its end."""
        self.page.keyboard.press('Control+Enter')
        self.wait_until_ran(self.active())

    def wait_until_ran(self, index: int) -> None:
        """Wait until a cell has a number, and its kernel nothing to do."""
        self.page.wait_for_function(CELL_RAN, arg=index, timeout=LIMIT_S * 1000)

    def write(self, source: str) -> None:
        """Replace the source of the active cell with keys, and stay in it."""
        self.page.keyboard.press('Enter')
        self.page.keyboard.press('Control+A')
        self.page.keyboard.insert_text(source)

    def active(self) -> int:
        """Return the index of the active cell."""
        return self.page.evaluate(f'() => {PANEL}.content.activeCellIndex')

    def leave_with(self, key: str) -> int:
        """Press a key that leads to another cell, and return its index."""
        self.page.wait_for_function(HAS_FOCUS)
        before = self.active()
        self.page.keyboard.press(key)
        self.page.wait_for_function(
            f'before => {PANEL}.content.activeCellIndex !== before', arg=before
        )
        return self.active()

    def themes(self) -> Iterator[str]:
        """Yield 'dark', then 'light', when the page has this theme."""
        for theme, is_light in (('Dark', 'false'), ('Light', 'true')):
            self.page.evaluate(
                "theme => window.jupyterapp.commands.execute('apputils:change-theme', { theme })",
                f'JupyterLab {theme}',
            )
            self.page.wait_for_function(
                'is_light => document.body.dataset.jpThemeLight === is_light', arg=is_light
            )
            self.page.wait_for_selector('#jupyterlab-splash', state='detached')
            yield theme.lower()

    # What a test keeps

    def screenshot(self, *path: str) -> None:
        """Save what is seen as a PNG below the folder of the artefacts."""
        file = Path(self.artefacts, *path).with_suffix('.png')
        file.parent.mkdir(parents=True, exist_ok=True)
        self.page.screenshot(path=file)


def printed(cell: dict[str, Any]) -> str:
    """Return what a cell printed or showed as text."""
    texts = [
        output.get('text') or output.get('data', {}).get('text/plain', '')
        for output in cell['outputs']
    ]
    return ''.join(map(''.join, texts))


def complaints(cell: dict[str, Any]) -> list[str]:
    """Return the errors of a cell, and what it wrote to stderr."""
    errors = [
        f'{o["ename"]}: {o["evalue"]}' for o in cell['outputs'] if o['output_type'] == 'error'
    ]
    return errors + [''.join(o['text']) for o in cell['outputs'] if o.get('name') == 'stderr']
