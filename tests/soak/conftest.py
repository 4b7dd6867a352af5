"""A plugin for pytest beside nbval: it runs the cells of notebooks in harder ways, for `make soak`.

The comparison stays nbval's own, with the settings of pyproject.toml. `--soak` says how:

- `idle`: as nbval does
- `busy`: beside busy loops
- `twice`: each cell twice, then all cells again in the same kernel
- `interrupt`: each cell is interrupted at a random time, then run again and compared
- `kill`: the kernel is killed in the middle of a random cell, then all in a fresh one

After the last cell, and after each interrupt, the kernel must have nothing that it had not at its
start; and when it has ended, the machine must be as it was. run.sh gives a run a /dev/shm and a
table of processes of its own, so that whatever is there was left.
"""

from __future__ import annotations

import os
import random
import re
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from contextlib import suppress
from copy import deepcopy
from itertools import groupby
from pathlib import Path
from queue import Empty

import psutil
import pytest
from nbformat.v4 import new_code_cell
from support.leftovers import processes_that_stay

from helpers.checks.verdict import verdict_in
from helpers.lesson import ROOT, is_solution
from tools.lessons.comparison import IPyNbFile, NamedCell, RunningKernel

CONDITIONS = ('idle', 'busy', 'twice', 'interrupt', 'kill')
BUSY_LOOPS = 4
# What would be in the home otherwise.
STATE = ('JUPYTER_CONFIG_DIR', 'JUPYTER_DATA_DIR', 'JUPYTER_RUNTIME_DIR', 'IPYTHONDIR')
STATE += ('ROS_LOG_DIR', 'MPLCONFIGDIR')
OWN_FOLDER = pytest.StashKey[Path]()  # of this run: its home, its temporary files
LOOPS = pytest.StashKey[list[subprocess.Popen]]()
KNOWN = pytest.StashKey[set[str]]()  # what is there, and was looked at
END_TIMEOUT_S = 10.0  # of processes, when their kernel has ended
# Run in a kernel. Its first look makes tests/support known.
LOOK = '__import__("support.leftovers", fromlist=["look"]).look()'
FIRST_LOOK = f'__import__("sys").path.append({str(Path(__file__).parents[1])!r}); {LOOK}'
SHORTEST_S, LONGEST_S = 0.001, 10.0
ANSWER_TIMEOUT_S = 60.0  # of a kernel that is alive, on a busy machine
REPLY_S = 0.2  # after its 'idle', a kernel's reply to the same message is there
# From the second try on, the check of an exercise also prints hints. A fresh run has none.
HINTS = {
    'text/plain': re.compile(r'^ {4}Hint: .*\n(?: {10}.*\n)*', re.MULTILINE),
    'text/html': re.compile(r'<div style="[^"]*"><b>Hint</b> .*?</div>'),
}
KERNEL_LOST = (Empty, RuntimeError, ValueError)  # no answer, a dead kernel, a broken message
# Python's helper of a pool of processes: its child that was not yet noted is a zombie.
IN_TRACKER = re.compile(r'resource_tracker\.py:\d+, in ResourceTracker\.(ensure_running|_launch)')
COLOURS = re.compile(r'\x1b\[[0-9;]*m')  # of IPython's tracebacks


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption('--soak', choices=CONDITIONS, default='idle')


def pytest_configure(config: pytest.Config) -> None:
    """Give this run a home and a temporary folder of its own, and start what makes it busy."""
    tempfile.gettempdir()  # pytest's own files stay where they are
    folder = tempfile.TemporaryDirectory(prefix='soak-', ignore_cleanup_errors=True)
    config.add_cleanup(folder.cleanup)
    config.stash[OWN_FOLDER] = own = Path(folder.name)
    for part in ('home', 'tmp', 'state'):
        (own / part).mkdir()
    os.environ.update({'HOME': f'{own}/home', 'TMPDIR': f'{own}/tmp'})
    os.environ.update(dict.fromkeys(STATE, f'{own}/state'))
    config.stash[LOOPS] = [
        subprocess.Popen([sys.executable, '-ISc', 'while True: pass'])
        for _ in range(BUSY_LOOPS if config.option.soak == 'busy' else 0)
    ]
    for loop in config.stash[LOOPS]:
        config.add_cleanup(loop.kill)
    config.stash[KNOWN] = {*_on_the_machine(config)}


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Give each notebook the cells that the condition asks for."""
    mode, plain, items[:] = config.option.soak, list(items), []
    for file, group in groupby(plain, key=lambda item: item.parent):
        cells = list(group)
        items.append(_like(cells[0], NamedCell, 'the first look', FIRST_LOOK))
        if mode == 'kill':
            cell = random.choice(cells)
            items.append(_like(cell, Killed, f'{cell.name} killed'))
        if mode == 'interrupt':
            for cell in cells:
                items += [
                    _like(cell, Interrupted, f'{cell.name} interrupted'),
                    _look_after(cell, f'what {cell.name} left when interrupted'),
                    _like(cell, Again, cell.name),
                ]
        elif mode == 'twice':
            for cell in cells:
                items += [cell, _like(cell, Again, f'{cell.name} at once again')]
            items += [_like(cell, Again, f'{cell.name} again') for cell in cells]
        else:
            items += cells
        items.append(_look_after(cells[-1], 'what is left in the kernel'))
        items.append(Machine.from_parent(file.session, name=f'what {file.name} has left'))


def _like(cell: NamedCell, kind: type[NamedCell], name: str, source: str = '') -> NamedCell:
    return kind.from_parent(
        cell.parent,
        name=name,
        cell_num=cell.cell_num,
        # A copy: nbval joins the streams of a saved cell when it compares it.
        cell=new_code_cell(source) if source else deepcopy(cell.cell),
        options=defaultdict(bool, check=True) if source else cell.options,
    )


def _look_after(cell: NamedCell, name: str) -> NamedCell:
    return _like(cell, NamedCell, name, LOOK)


class Machine(pytest.Item):
    """What is on the machine after a notebook. pytest has ended its kernel before."""

    def runtest(self) -> None:
        known = self.config.stash[KNOWN]
        now = _on_the_machine(self.config)
        left = [now[key] for key in now if key not in known]
        known.update(now)
        if left:
            pytest.fail('\n'.join(left), pytrace=False)

    def reportinfo(self) -> tuple:
        return ROOT, 0, self.name


def _on_the_machine(config: pytest.Config) -> dict[str, str]:
    """Return a sentence for each process, each file and each piece of shared memory, by a key."""
    mine = {1, os.getpid(), *(loop.pid for loop in config.stash[LOOPS])}
    others = [process for process in psutil.process_iter() if process.pid not in mine]
    sentences = processes_that_stay(others, END_TIMEOUT_S)
    for file in Path('/dev/shm').glob('fastrtps_*'):
        # A port that only writers have opened has no lock, so nobody can see that it is free. The
        # next participant that wants its number takes it.
        if re.search(r'_port\d+$', file.name) and not {*file.parent.glob(f'{file.name}_[es]l')}:
            continue
        sentences[str(file)] = f'Shared memory is left: {file}.'
    own = config.stash[OWN_FOLDER]
    git = ['git', '-C', ROOT, 'status', '--porcelain', '--untracked-files=all']
    changed = subprocess.run(git, stdout=subprocess.PIPE, text=True, check=True).stdout.splitlines()
    files = [file for part in ('home', 'tmp') for file in (own / part).rglob('*')]
    for file in [*changed, *(str(file) for file in files if not file.is_dir())]:
        sentences[file] = f'{file} has changed.'
    return sentences


class Again(NamedCell):
    """A cell that has run before in this kernel."""

    def compare_outputs(self, test, ref, skip_compare=None) -> bool:
        """Compare as nbval does, without the hints that an exercise gives at the second try.

        Of a solution its verdict is compared: commands may say that all is done already.
        """
        if is_solution(self.cell):
            test = [output for output in test if output.output_type != 'stream']
            ref = [output for output in ref if output.output_type != 'stream']
        for output in test:
            if verdict := verdict_in(output):
                for kind, hint in HINTS.items():
                    output.data[kind] = hint.sub('', output.data[kind])
                for point in verdict['points']:
                    point.pop('hint', None)
        return super().compare_outputs(test, ref, skip_compare)


class Interrupted(NamedCell):
    """A cell that is interrupted."""

    def runtest(self) -> None:
        """Run the cell and interrupt it."""
        after_s = random_time_s()
        for _ in range(2):
            try:
                error = self._interrupt(after_s)
                break
            except KERNEL_LOST as lost:
                why = repr(lost)
                fresh_kernel(self, self.cell_num)
        else:  # ipykernel does so by itself, a lesson that is wrong does it twice
            self.raise_cell_error(f'Run for {after_s:.3f} s. The kernel is lost: {why}')
        traceback = COLOURS.sub('', '\n'.join(error.get('traceback', [])))
        if IN_TRACKER.search(traceback):
            fresh_kernel(self, self.cell_num)  # the student sees it in the traceback
        elif error.get('ename', 'KeyboardInterrupt') != 'KeyboardInterrupt':
            self.raise_cell_error(f'Interrupted after {after_s:.3f} s, it fails', traceback)

    def _interrupt(self, after_s: float) -> dict:
        """Interrupt the cell if it still runs, and return its error. Raises one of KERNEL_LOST."""
        kernel = self.parent.kernel
        message = kernel.execute_cell_input(self.cell.source, allow_stdin=False)
        listen(kernel, message, 'execute_input', ANSWER_TIMEOUT_S)
        try:
            return listen(kernel, message, 'idle', after_s)
        except Empty:
            kernel.interrupt()
            # When the signal meets ipykernel beside the cell, it sends no reply, or a broken one.
            error = listen(kernel, message, 'idle', ANSWER_TIMEOUT_S)
            with suppress(Empty):
                kernel.get_message('shell', timeout=REPLY_S)
            return error


class Killed(NamedCell):
    """A cell in whose middle the kernel is killed; a fresh one takes its place."""

    def runtest(self) -> None:
        """Run the cells before this one, kill the kernel in it, and start a fresh kernel."""
        kernel = self.parent.kernel
        run_first(self.parent, self.cell_num)
        message = kernel.execute_cell_input(self.cell.source, allow_stdin=False)
        with suppress(Empty):  # it is in the middle
            listen(kernel, message, 'idle', random_time_s())
        fresh_kernel(self, 0)


def random_time_s() -> float:
    """Return a time from a millisecond to 10 s, of which each magnitude is as likely."""
    return SHORTEST_S * (LONGEST_S / SHORTEST_S) ** random.random()


def listen(kernel: RunningKernel, message: str, until: str, timeout_s: float) -> dict:
    """Read what a kernel says of a message until it says `until`, and return the error in it.

    Raises Empty if this takes longer, RuntimeError if the kernel has ended.
    """
    deadline, error = time.monotonic() + timeout_s, {}
    while kernel.is_alive():
        if time.monotonic() > deadline:
            raise Empty(f'the kernel has not said {until!r} for {timeout_s:g} s')
        with suppress(Empty):
            answer = kernel.get_message('iopub', timeout=min(1, timeout_s))
            kind, content = answer['msg_type'], answer['content']
            if answer['parent_header'].get('msg_id') == message:
                if until in (kind, content.get('execution_state')):
                    return error
                if kind == 'error':
                    error = content
    raise RuntimeError('the kernel has ended')


def fresh_kernel(item: NamedCell, cells_to_run: int) -> None:
    """Kill the kernel of a cell; start one that has run the first cells of its notebook."""
    file = item.parent
    with suppress(psutil.NoSuchProcess):
        psutil.Process(file.kernel.km.provisioner.pid).suspend()  # it holds what is noted
    for path in Path('/dev/shm').glob('fastrtps_*'):
        item.config.stash[KNOWN].add(str(path))  # nobody could remove it
    file.kernel.stop()
    file.setup()
    file.kernel.await_idle(file.kernel.execute_cell_input(FIRST_LOOK), ANSWER_TIMEOUT_S)
    run_first(file, cells_to_run)


def run_first(file: IPyNbFile, count: int) -> None:
    """Run the first code cells of a notebook."""
    for cell in [cell for cell in file.nb.cells if cell.cell_type == 'code'][:count]:
        message = file.kernel.execute_cell_input(cell.source, allow_stdin=False)
        listen(file.kernel, message, 'idle', file.config.option.nbval_cell_timeout)
