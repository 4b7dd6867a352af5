"""A plugin for pytest beside nbval: it runs the cells of a notebook in harder ways.

The comparison stays nbval's own, with the settings of pyproject.toml. `--soak-mode` says how:

- `once`       as nbval does
- `twice`      all cells, then all cells again in the same kernel
- `interrupt`  each cell is interrupted at a random time, then run again and compared
- `kill`       the kernel is killed in the middle of a random cell, then all cells in a fresh one

After the last cell, in every mode, the kernel must have nothing that it had not at its start; after
the last notebook, nothing may be left of the run. A line of JSON for each cell goes to the file
`--soak-report`.
"""

from __future__ import annotations

import json
import random
import re
import time
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from queue import Empty

import psutil
import pytest
from nbval.kernel import RunningKernel
from nbval.plugin import IPyNbCell, IPyNbFile

from tools.soak.leftovers import adopt_orphans, left_by_processes, left_in_process, shared_memory

LOOK = """
import json
from tools.soak.leftovers import state_of_process
print(json.dumps(state_of_process()))
"""
SHORTEST_S, LONGEST_S = 0.001, 10.0
INTERRUPTED_TIMEOUT_S = 60.0
OUTPUT_TIMEOUT_S = 60.0  # of a kernel that is alive, on a busy machine
REPLY_TIMEOUT_S = 2.0  # it was sent before the kernel became idle
# From the second try on, the check of an exercise also prints hints. A fresh run has none.
HINTS = re.compile(r'^ {4}Hint: .*\n(?: {10}.*\n)*', re.MULTILINE)
# No answer, a dead kernel, a broken message.
KERNEL_LOST = (Empty, TimeoutError, RuntimeError, ValueError)
# In IPython's traceback: the top level of a module.
IN_IMPORT = re.compile(r'^File (<frozen importlib|.+\.py:\d+$)', re.MULTILINE)
COLOURS = re.compile(r'\x1b\[[0-9;]*m')  # of IPython's tracebacks


# --- pytest's hooks ------------------------------------------------------------------------------


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of this plugin."""
    group = parser.getgroup('soak')
    group.addoption('--soak-mode', choices=('once', 'twice', 'interrupt', 'kill'), default='once')
    group.addoption('--soak-seed', default='0')
    group.addoption('--soak-report', type=Path)


def pytest_configure(config: pytest.Config) -> None:
    """Report what the cells do; at the end, when all kernels have ended, what is left."""
    if not hasattr(config, 'workerinput'):  # pytest-xdist's workers report to this process
        adopt_orphans()
        report = _Report(config.option.soak_report)
        config.pluginmanager.register(report)
        config.add_cleanup(report.end)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Give each notebook the cells that the mode asks for."""
    mode, plain, items[:] = config.option.soak_mode, list(items), []
    for file, cells in groupby(plain, key=lambda item: item.parent):
        cells = list(cells)
        if mode == 'kill':
            items.append(Killed.from_parent(file, name='the kernel that is killed', cells=cells))
        if mode == 'interrupt':
            cells = [_like(cell, Interrupted, cell.name) for cell in cells]
        items += cells
        if mode == 'twice':
            items += [_like(cell, Again, f'{cell.name} again') for cell in cells]
        items.append(NothingLeft.from_parent(file, name='what is left in the kernel'))


def _like(cell: IPyNbCell, kind: type[IPyNbCell], name: str) -> IPyNbCell:
    return kind.from_parent(
        cell.parent, name=name, cell_num=cell.cell_num, cell=cell.cell, options=cell.options
    )


@pytest.hookimpl(trylast=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Look at a kernel before its first cell."""
    look_at(item.parent.kernel)


class _Report:
    """Writes one line of JSON for what was done, and for what failed before and after it."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.killed_held: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == 'call' or report.failed:
            notebook, item = Path(report.location[0]).stem, report.nodeid.rpartition('::')[2]
            properties = dict(report.user_properties)
            self.killed_held |= set(properties.pop('killed_held', ()))
            failed = COLOURS.sub('', report.longreprtext) if report.failed else None
            self.write(notebook, item, failed, {'seconds': report.duration} | properties)

    def end(self) -> None:
        if left := left_by_processes(self.killed_held):
            self.write(None, 'after the run', ' '.join(left), {})

    def write(self, notebook: str | None, item: str, failed: str | None, more: dict) -> None:
        # nbval's `Cell 0` is called as the tests call it: `code cell 1`.
        item = re.sub(r'^Cell (\d+)', lambda found: f'code cell {int(found[1]) + 1}', item)
        row = {'notebook': notebook, 'item': item, 'failed': failed} | more
        with self.file.open('a', encoding='utf-8') as file:
            print(json.dumps(row), file=file)


# --- What is done to a kernel --------------------------------------------------------------------


def state_of(kernel: RunningKernel) -> dict:
    """Return `state_of_process` of a kernel."""
    printed = []

    def keep(message: dict) -> None:
        printed.append(message['content'].get('text', ''))

    kernel.kc.execute_interactive(
        LOOK,
        store_history=False,
        allow_stdin=False,
        timeout=OUTPUT_TIMEOUT_S,
        output_hook=keep,
    )
    return json.loads(''.join(printed))


def look_at(kernel: RunningKernel) -> None:
    """Note what a new kernel has."""
    if not hasattr(kernel, 'soak_before'):
        kernel.soak_before = state_of(kernel)


def left_in(kernel: RunningKernel) -> str:
    """Return sentences for what a kernel has now and had not at its start."""
    return ' '.join(left_in_process(kernel.soak_before, state_of(kernel)))


def fresh_kernel(file: IPyNbFile, cells_to_run: int = 0) -> None:
    """Give a notebook a fresh kernel that has run its first code cells."""
    file.kernel.stop()
    file.setup()
    look_at(file.kernel)
    run_first(file, cells_to_run)


def run_first(file: IPyNbFile, count: int) -> None:
    """Run the first code cells of a notebook."""
    for cell in [cell for cell in file.nb.cells if cell.cell_type == 'code'][:count]:
        message = file.kernel.execute_cell_input(cell.source, allow_stdin=False)
        await_reply(file.kernel, message, file.config.option.nbval_cell_timeout)


def begin(kernel: RunningKernel, source: str) -> str:
    """Let a kernel run a cell; return the id of the message once it has begun."""
    message = kernel.execute_cell_input(source, allow_stdin=False)
    while True:
        answer = kernel.get_message('iopub', timeout=OUTPUT_TIMEOUT_S)
        begun = answer['msg_type'] == 'execute_input'
        if begun and answer['parent_header'].get('msg_id') == message:
            return message


def await_reply(kernel: RunningKernel, message: str, timeout_s: float) -> dict:
    """Wait for a kernel's reply to a message and return its content. Raises queue.Empty."""
    deadline = time.monotonic() + timeout_s
    while True:
        answer = kernel.get_message('shell', timeout=max(0.0, deadline - time.monotonic()))
        if answer['parent_header'].get('msg_id') == message:
            return answer['content']


def await_idle(kernel: RunningKernel, message: str) -> None:
    """Wait for the end of an interrupted message. Raises one of KERNEL_LOST."""
    deadline = time.monotonic() + INTERRUPTED_TIMEOUT_S
    while kernel.is_alive():
        with suppress(Empty):
            kernel.await_idle(message, 1)
            return
        if time.monotonic() > deadline:
            raise Empty(f'the cell had not ended {INTERRUPTED_TIMEOUT_S:g} s later')
    raise RuntimeError('the kernel has ended')


def random_time_s(chance: random.Random) -> float:
    """Return a time from a millisecond to 10 s, of which each magnitude is as likely."""
    return SHORTEST_S * (LONGEST_S / SHORTEST_S) ** chance.random()


def chance_of(item: pytest.Item) -> random.Random:
    """Return the random numbers of an item: the same for the same seed."""
    return random.Random(f'{item.config.option.soak_seed} {item.name}')


class Again(IPyNbCell):
    """A cell that has run before in this kernel."""

    def compare_outputs(self, test, ref, skip_compare=None) -> bool:
        """Compare as nbval does, without the hints that an exercise gives at the second try."""
        for output in test:
            if output.output_type == 'stream':
                output.text = HINTS.sub('', output.text)
        return super().compare_outputs(test, ref, skip_compare)


class Interrupted(Again):
    """A cell that is interrupted, and then run again."""

    def runtest(self) -> None:
        """Run the cell, interrupt it, look what it left, then run it as nbval does."""
        after_s = random_time_s(chance_of(self))
        try:
            self._interrupt(after_s)
        except KERNEL_LOST:
            # ipykernel does so by itself (environment.md). What a lesson does wrong, it does twice.
            self.user_properties.append(('kernel_lost', True))
            self.user_properties.append(('killed_held', sorted(shared_memory())))
            fresh_kernel(self.parent, self.cell_num)
            try:
                self._interrupt(after_s)
            except KERNEL_LOST as error:
                fresh_kernel(self.parent, self.cell_num)  # for the cells that follow
                self.raise_cell_error(f'Run for {after_s:.3f} s. The kernel is lost: {error!r}')
        started = time.monotonic()
        super().runtest()
        self.user_properties.append(('seconds', time.monotonic() - started))

    def _interrupt(self, after_s: float) -> None:
        """Run the cell, interrupt it, and look what it left. Raises one of KERNEL_LOST."""
        kernel = self.parent.kernel
        message = begin(kernel, self.cell.source)
        traceback = None
        try:
            await_reply(kernel, message, after_s)
        except Empty:
            self.user_properties.append(('interrupted_after_s', after_s))
            kernel.interrupt()
            traceback = self._end(message, after_s)
        if left := left_in(self.parent.kernel):
            self.raise_cell_error(f'Run for {after_s:.3f} s. {left}', traceback)

    def _end(self, message: str, after_s: float) -> str | None:
        """Wait for the end of the interrupted cell and return its traceback."""
        kernel = self.parent.kernel
        await_idle(kernel, message)
        try:
            reply = await_reply(kernel, message, REPLY_TIMEOUT_S)
        except Empty:
            # The signal met ipykernel beside the code of the cell: it then sends no reply, and
            # JupyterLab shows the cell as running until another one runs.
            self.user_properties.append(('no_reply', True))
            return None
        if reply['status'] != 'error':
            return None
        traceback = COLOURS.sub('', '\n'.join(reply['traceback']))
        if IN_IMPORT.search(traceback):
            # Python cannot repeat a half-done import of NumPy: environment.md says to restart.
            self.user_properties.append(('import_interrupted', True))
            fresh_kernel(self.parent, self.cell_num)
        elif reply['ename'] != 'KeyboardInterrupt':
            self.raise_cell_error(
                f'Interrupted after {after_s:.3f} s, it raised {reply["ename"]}: {reply["evalue"]}',
                traceback,
            )
        return traceback


class _OfNotebook(pytest.Item):
    """Something done to the kernel of a notebook that is none of its cells."""

    parent: IPyNbFile

    def reportinfo(self) -> tuple[Path, int, str]:
        """Name this item in pytest's report."""
        return self.path, 0, self.name

    def repr_failure(self, excinfo) -> str:
        """Say in one sentence what is wrong."""
        return f'{excinfo.value}' or repr(excinfo.value)


class Killed(_OfNotebook):
    """A kernel that is killed in the middle of a cell; a fresh one takes its place."""

    def __init__(self, *, cells: list[IPyNbCell], **arguments) -> None:
        super().__init__(**arguments)
        self.cells = cells

    def runtest(self) -> None:
        """Run the cells up to a random one, kill the kernel in it, and start a fresh kernel."""
        chance, kernel = chance_of(self), self.parent.kernel
        last, after_s = chance.randrange(len(self.cells)), random_time_s(chance)
        run_first(self.parent, last)
        message = begin(kernel, self.cells[last].cell.source)
        with suppress(Empty):  # it is in the middle
            await_reply(kernel, message, after_s)
        process = psutil.Process(kernel.km.provisioner.pid)
        process.suspend()  # so that it holds what is noted
        self.user_properties += [
            ('killed_in_cell', last + 1),
            ('killed_after_s', after_s),
            ('killed_held', sorted(shared_memory())),
        ]
        process.kill()
        fresh_kernel(self.parent)


class NothingLeft(_OfNotebook):
    """The look at a kernel after its last cell."""

    def runtest(self) -> None:
        """Fail with a sentence for each thing that is left."""
        if left := left_in(self.parent.kernel):
            raise AssertionError(left)
