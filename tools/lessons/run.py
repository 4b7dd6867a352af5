"""Run lessons and save their outputs, and write what follows from the notebooks.

    python -m tools.lessons.run                         all lessons
    python -m tools.lessons.run 02 set_parameters       some of them

Each notebook gets a fresh kernel of the interpreter that runs this tool, started as nbval starts
it. What is saved is what this one run gave, pictures included. A picture kept from an earlier run
would make smaller diffs, but it would also hide a change in `helpers`, and it could contradict
the text beside it. To keep a diff small, run only the lessons that you changed.

Before that, the tables and links of tools/lessons/tables.py are written, and all notebooks cleaned.
Notebook 00, which shows the table of exercises, is run as well if that has changed.
"""

import logging
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path

import nbformat
from ipykernel.kernelspec import RESOURCES, get_kernel_dict
from jupyter_client.kernelspec import KernelSpec, KernelSpecManager
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, CellTimeoutError, DeadKernelError
from nbformat import NotebookNode

from helpers.checks.progress import FILE_VARIABLE
from helpers.lesson import ROOT, START, Lesson, called, chosen
from tools.lessons import tables
from tools.lessons.clean import clean, text_of, write
from tools.lessons.rules import tasks_are_checked

CELL_TIMEOUT_S = 100
# JupyterLab would ask which of the two files to keep, and either choice loses something.
CHANGED = 'changed. Open in JupyterLab? File > Reload Notebook from Disk'


class _ThisInterpreter(KernelSpecManager):
    """Knows one kernel, this interpreter, whatever kernels the user has installed."""

    def get_kernel_spec(self, kernel_name: str) -> KernelSpec:
        return self.kernel_spec_class(resource_dir=RESOURCES, **get_kernel_dict())


def execute(notebook: NotebookNode, folder: Path) -> NotebookNode:
    """Return a copy of a notebook, executed in `folder` by a fresh kernel, and cleaned.

    Raises RuntimeError with one sentence if a cell fails, takes longer than CELL_TIMEOUT_S,
    ends the kernel, or writes to stderr at C level: a reader sees that, and no output holds it.
    """
    notebook = deepcopy(notebook)
    for cell in notebook.cells:
        if cell.cell_type == 'code':
            cell.outputs, cell.execution_count = [], None
    running, size = '', 0

    def begin(cell: NotebookNode, **_: object) -> None:
        nonlocal running
        running = called(cell)

    def end(**_: object) -> None:
        nonlocal size
        size = os.fstat(from_c.fileno()).st_size

    client = _client(notebook, folder, on_cell_execute=begin, on_cell_executed=end)
    environment = os.environ | {
        # Under nbval ipykernel sees this variable, and leaves output written at C level alone.
        'PYTEST_CURRENT_TEST': 'tools/lessons/run.py',
        FILE_VARIABLE: '',  # what is saved is the table of a reader who has solved nothing
        'PYTHONPATH': str(folder.resolve().parent),  # the checks of this checkout
    }
    try:
        with tempfile.TemporaryFile() as from_c:
            client.execute(
                cleanup_kc=True, env=environment, stdout=subprocess.DEVNULL, stderr=from_c
            )
            # Not what ZeroMQ may say when the kernel ends: nobody sees that.
            lines = os.pread(from_c.fileno(), size, 0).decode(errors='replace').splitlines(True)
            shown = ''.join(line for line in lines if not line.startswith('[IPKernelApp]'))
    except CellExecutionError as error:
        lines = f'{error.ename}: {error.evalue}'.splitlines()
        # The second line of a time-out says what was waited for.
        reason = ' '.join(lines[: 2 if error.ename == 'TimeoutError' else 1])
    except CellTimeoutError:
        reason = f'it took longer than {CELL_TIMEOUT_S} s'
    except (DeadKernelError, AssertionError):  # after Ctrl+C nbclient fails its own assertion
        reason = 'the kernel ended'
    else:
        if shown:
            raise RuntimeError(f'JupyterLab would show on red what C wrote: {shown[:200]!r}')
        return clean(notebook)
    raise RuntimeError(f'the cell {running} failed: {reason}')


def _client(notebook: NotebookNode, folder: Path, **hooks: Callable) -> NotebookClient:
    log = logging.getLogger('nbclient')
    log.setLevel(logging.CRITICAL)  # a failure is told once, by the RuntimeError
    client = NotebookClient(
        notebook,
        km=AsyncKernelManager(kernel_spec_manager=_ThisInterpreter()),
        resources={'metadata': {'path': str(folder)}},
        timeout=CELL_TIMEOUT_S,
        force_raise_errors=True,
        skip_cells_with_tag='',
        record_timing=False,
        log=log,
        **hooks,
    )
    # nbval knows no widgets: what is printed into an Output widget is output of the cell.
    client.widget_registry = {}
    return client


def update(path: Path) -> bool:
    """Execute and clean a notebook's file in place; return whether that changed it.

    Raises RuntimeError as `execute` does, and if a check does not judge its starter and its
    solution as it should: the file is as it was before. Raises ValueError if it was saved
    meanwhile, and the file is as it was saved.
    """
    before = path.read_text(encoding='utf-8')
    notebook = execute(nbformat.reads(before, as_version=4), path.parent)
    if problems := [*tasks_are_checked(Lesson(path.name, notebook))]:
        raise RuntimeError(' '.join(problems))
    if path.read_text(encoding='utf-8') != before:
        raise ValueError(f'{path.name} was changed while it ran: save it, then run it again.')
    return write(path, text_of(notebook), before)


def main(arguments: list[str], root: Path = ROOT) -> int:
    try:
        paths = chosen(' '.join(arguments), root / 'notebooks')
        texts = tables.texts_of(root)
        changed = tables.updated(texts)
        for name, text in changed.items():
            write(root / name, text)
            print(f'{name}: written from the notebooks')
        lessons = tables.lessons_of(texts | changed)
        if tables.needs_run(lessons):
            paths = sorted({*paths, *chosen(START, root / 'notebooks')})
        for path in paths:
            start = time.monotonic()
            try:
                changed = update(path)
            except RuntimeError as error:
                raise ValueError(f'{path.name}: {error} (the file is as it was)') from None
            seconds = time.monotonic() - start
            print(f'{path.name}: {seconds:.0f} s, {CHANGED if changed else "unchanged"}')
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
