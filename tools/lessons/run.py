"""Run lessons and save their outputs, and write what follows from the notebooks.

    python -m tools.lessons.run                         all lessons whose code has changed
    python -m tools.lessons.run 02 set_parameters       some of them
    python -m tools.lessons.run 02 --run yes            though only its text has changed
    python -m tools.lessons.run 02 --run new            and save all outputs of this run
    python -m tools.lessons.run --keep-outputs          run nothing: you vouch for the outputs

Each notebook gets a fresh kernel of the interpreter that runs this tool, started as nbval starts
it. A cell keeps its saved outputs if nothing has changed that makes them: outputs.py says what that
is, and how it is known. Of all others the new outputs are saved, and it is printed why. A lesson of
which only text has changed is not run at all.

`--keep-outputs` is for a change of code that changes no output, such as another name in all
notebooks: the outputs stay as they are in the files, and count as made by the code of today. Nobody
checks that here: `make test` does, but for replays and pictures.

Before that, the tables and links of tools/lessons/tables.py are written, and all notebooks cleaned.
Notebook 00, which shows the table of exercises, is run as well if that has changed.
"""

import argparse
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
from tools.lessons import outputs, tables
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


def update(path: Path, run: str = '') -> tuple[bool, list[str]]:
    """Execute and clean a notebook's file in place if its code has changed.

    With `run` as `yes` it is executed in any case, and as `new` all its outputs are new. Returns
    whether that changed the file, and sentences: what was not done, or which outputs are new.

    Raises RuntimeError as `execute` does, and if a check does not judge its starter and its
    solution as it should: the file is as it was before. Raises ValueError if it was saved
    meanwhile, and the file is as it was saved.
    """
    before = path.read_text(encoding='utf-8')
    notebook = nbformat.reads(before, as_version=4)
    now = outputs.made_from(notebook, path.parent.parent)
    old = outputs.saved(path, notebook, now)
    if old and not run and outputs.is_made_from(old, now):
        outputs.take_outputs(notebook, old)
        notebook = clean(notebook)
        sentences = ['only its text may have changed, so its outputs stay (RUN=yes runs it)']
    else:
        notebook = execute(notebook, path.parent)
        if run == 'new':
            sentences = ['all outputs are new, as you asked']
        elif old:
            sentences = [*outputs.keep(notebook, old, now)]
        else:
            sentences = ['all outputs are new: no earlier ones were saved by this tool']
    outputs.stamp(notebook, now)
    if problems := [*tasks_are_checked(Lesson(path.name, notebook))]:
        raise RuntimeError(' '.join(problems))
    if path.read_text(encoding='utf-8') != before:
        raise ValueError(f'{path.name} was changed while it ran: save it, then run it again.')
    return write(path, text_of(notebook), before), sentences


def vouch(path: Path) -> bool:
    """Let the outputs in a file count as made by the code of today; return whether it changed."""
    before = path.read_text(encoding='utf-8')
    notebook = clean(nbformat.reads(before, as_version=4))
    outputs.stamp(notebook, outputs.made_from(notebook, path.parent.parent))
    return write(path, text_of(notebook), before)


def options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='python -m tools.lessons.run')
    parser.add_argument('lessons', nargs='*', help='numbers or names; all, if none is given')
    parser.add_argument('--run', choices=('yes', 'new'), default='')
    parser.add_argument('--keep-outputs', action='store_true')
    return parser.parse_args(arguments)


def main(arguments: list[str], root: Path = ROOT) -> int:
    asked = options(arguments)
    try:
        paths = chosen(' '.join(asked.lessons), root / 'notebooks')
        if asked.keep_outputs:
            for path in paths:
                print(f'{path.name}: {CHANGED if vouch(path) else "unchanged"}')
            return 0
        texts = tables.texts_of(root)
        changed = tables.updated(texts)
        for name, text in changed.items():
            write(root / name, text)
            print(f'{name}: written from the notebooks')
        lessons = tables.lessons_of(texts | changed)
        must_run = chosen(START, root / 'notebooks') if tables.needs_run(lessons) else []
        for path in sorted({*paths, *must_run}):
            run = asked.run or ('yes' if path in must_run else '')
            start = time.monotonic()
            try:
                changed, sentences = update(path, run)
            except RuntimeError as error:
                raise ValueError(f'{path.name}: {error} (the file is as it was)') from None
            seconds = time.monotonic() - start
            print(f'{path.name}: {seconds:.0f} s, {CHANGED if changed else "unchanged"}')
            for sentence in sentences:
                print(f'  {sentence}')
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
