"""Execute the lessons in place, and clean them so that a diff shows only what changed.

    python tools/notebooks.py                      all lessons
    python tools/notebooks.py --lesson 02 03       some of them
    python tools/notebooks.py --clean-only         all lessons, without executing them

Each notebook gets a fresh kernel of the interpreter that runs this tool, started as nbval starts
it. What is saved is what this one run gave, pictures included. A picture kept from an earlier run
would make smaller diffs, but it would also hide a change in `helpers`, and it could contradict
the text beside it. To keep a diff small, run only the lessons that you changed. Every cell gets
its slide type from the rule of tools/slides.py.
"""

import argparse
import hashlib
import logging
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path

import nbformat
from ipykernel.kernelspec import RESOURCES, get_kernel_dict
from jupyter_client.kernelspec import KernelSpec, KernelSpecManager
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, CellTimeoutError, DeadKernelError
from nbformat import NotebookNode
from traitlets import default

from tools.slides import png_of, slide_types

FOLDER = Path(__file__).resolve().parent.parent / 'notebooks'
CELL_TIMEOUT_S = 100
# The README and lesson 00 show these: the id of a cell, and the file for its picture.
PICTURES = {'lost-before-none-after': 'images/lost_before_none_after.png'}
NOTEBOOK_METADATA = {
    'kernelspec': {
        'display_name': 'Python 3 (ipykernel)',
        'language': 'python',
        'name': 'python3',
    },
    'language_info': {'name': 'python'},
}
WIDGET = 'application/vnd.jupyter.widget-view+json'
OVERWRITTEN = re.compile(r'^.*\r(?=[^\n])', re.MULTILINE)


def clean(notebook: NotebookNode) -> NotebookNode:
    """Return a copy of a notebook without what changes by itself from run to run.

    Kept are sources, tags, hidden sources, cell ids, execution counts and outputs. The slide types
    are made anew.
    Neighbouring pieces of one stream become one, because where a stream is cut is chance. The
    model of a widget lives only as long as its kernel: of its view, the text is kept.
    """
    notebook = deepcopy(notebook)
    notebook.nbformat, notebook.nbformat_minor = 4, 5
    notebook.metadata = nbformat.from_dict(NOTEBOOK_METADATA)
    ids: set[str] = set()
    for number, cell in enumerate(notebook.cells):
        if cell.get('id') is None or cell.id in ids:
            cell.id = hashlib.sha256(f'{number} {cell.source}'.encode()).hexdigest()[:8]
        ids.add(cell.id)
        cell.metadata = nbformat.from_dict(dict(_kept_metadata(cell.metadata)))
        if cell.cell_type == 'code':
            cell.outputs = _clean_outputs(cell)
    for cell, slide_type in zip(notebook.cells, slide_types(notebook), strict=True):
        cell.metadata.slideshow = nbformat.from_dict({'slide_type': slide_type})
    return notebook


def _kept_metadata(metadata: NotebookNode) -> Iterator[tuple[str, object]]:
    if metadata.get('tags'):
        yield 'tags', metadata['tags']
    if metadata.get('jupyter', {}).get('source_hidden'):
        yield 'jupyter', {'source_hidden': True}


def _clean_outputs(cell: NotebookNode) -> list[NotebookNode]:
    outputs: list[NotebookNode] = []
    for output in cell.outputs:
        last = outputs[-1] if outputs else {}
        if output.output_type == 'stream' and output.name == last.get('name'):
            last['text'] += output.text
            continue
        if output.output_type == 'execute_result':
            output.execution_count = cell.execution_count
        output.get('data', {}).pop(WIDGET, None)
        outputs.append(output)
    for output in outputs:
        if output.output_type == 'stream':
            output.text = OVERWRITTEN.sub('', output.text)
    return outputs


def text_of(notebook: NotebookNode) -> str:
    """Return the text of a notebook's file, as Jupyter writes it."""
    return nbformat.writes(notebook) + '\n'


class _ThisInterpreter(KernelSpecManager):
    """Knows one kernel, this interpreter, whatever kernels the user has installed."""

    def get_kernel_spec(self, kernel_name: str) -> KernelSpec:
        return self.kernel_spec_class(resource_dir=RESOURCES, **get_kernel_dict())


class _KernelManager(AsyncKernelManager):
    @default('kernel_spec_manager')
    def _this_interpreter(self) -> KernelSpecManager:
        return _ThisInterpreter()


def execute(notebook: NotebookNode, folder: Path) -> NotebookNode:
    """Return a copy of a notebook, executed in `folder` by a fresh kernel, and cleaned.

    Raises RuntimeError with one sentence where a cell fails, takes longer than CELL_TIMEOUT_S,
    or ends the kernel.
    """
    notebook = deepcopy(notebook)
    for cell in notebook.cells:
        if cell.cell_type == 'code':
            cell.outputs, cell.execution_count = [], None
    running = 0

    def count(**_: object) -> None:
        nonlocal running
        running += 1

    log = logging.getLogger('nbclient')
    log.setLevel(logging.CRITICAL)  # a failure is told once, by the RuntimeError
    client = NotebookClient(
        notebook,
        kernel_name='python3',
        kernel_manager_class=_KernelManager,
        resources={'metadata': {'path': str(folder)}},
        timeout=CELL_TIMEOUT_S,
        force_raise_errors=True,
        skip_cells_with_tag='',
        record_timing=False,
        on_cell_execute=count,
        log=log,
    )
    # nbval knows no widgets: what is printed into an Output widget is output of the cell.
    client.widget_registry = {}
    # Under nbval ipykernel sees this variable, and leaves output written at C level alone.
    environment = os.environ | {'PYTEST_CURRENT_TEST': 'tools/notebooks.py'}
    try:
        client.execute(env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    except CellExecutionError as error:
        what = f'{error.ename}: {error.evalue}'.splitlines()[0]
    except CellTimeoutError:
        what = f'it took longer than {CELL_TIMEOUT_S} s'
    except (DeadKernelError, AssertionError):  # after Ctrl+C nbclient fails its own assertion
        what = 'the kernel ended'
    else:
        return clean(notebook)
    raise RuntimeError(f'code cell {running} failed: {what}')


def pictures(notebook: NotebookNode) -> dict[str, bytes]:
    """Return the PNG files of `PICTURES` that come from this notebook, by their name."""
    return {
        PICTURES[cell.id]: png
        for cell in notebook.cells
        if cell.get('id') in PICTURES
        for output in cell.outputs
        if (png := png_of(output))
    }


def update(path: Path, clean_only: bool = False) -> bool:
    """Execute and clean a notebook's file in place; return True where that changed the file.

    Raises RuntimeError as `execute` does; the file is then as it was before.
    """
    before = path.read_text(encoding='utf-8')
    notebook = nbformat.reads(before, as_version=4)
    notebook = clean(notebook) if clean_only else execute(notebook, path.parent)
    after = text_of(notebook)
    for name, picture in pictures(notebook).items():
        (path.parent / name).parent.mkdir(exist_ok=True)
        (path.parent / name).write_bytes(picture)
    if after == before:
        return False
    unfinished = path.with_suffix('.tmp')
    unfinished.write_text(after, encoding='utf-8')
    unfinished.replace(path)
    return True


def lessons(numbers: list[str], folder: Path) -> list[Path]:
    """Return the notebooks with these numbers (all, where none is given), in teaching order.

    Raises ValueError where a number is not that of exactly one notebook.
    """
    paths = sorted(folder.glob('*.ipynb'))
    if not paths:
        raise ValueError(f'There is no notebook in {folder}.')
    chosen = []
    for number in numbers:
        found = [path for path in paths if path.name.startswith(f'{number}_')]
        if len(found) != 1:
            known = ', '.join(path.name.partition('_')[0] for path in paths)
            raise ValueError(f'There is no single lesson {number!r}. Give one of {known}.')
        chosen += found
    return sorted(set(chosen)) or paths


def main(arguments: list[str] | None = None, folder: Path = FOLDER) -> int:
    """Run the tool; return its exit status."""
    parser = argparse.ArgumentParser(description='Execute lessons in place and clean them.')
    parser.add_argument('--lesson', nargs='+', default=[], metavar='NN', help='for example 02')
    parser.add_argument('--clean-only', action='store_true', help='keep the outputs as they are')
    options = parser.parse_args(arguments)
    numbers = ' '.join(options.lesson).split()
    try:
        for path in lessons(numbers, folder):
            start = time.monotonic()
            try:
                changed = update(path, options.clean_only)
            except (RuntimeError, ValueError) as error:
                raise ValueError(f'{path.name}: {error} (the file is as it was)') from None
            seconds = time.monotonic() - start
            print(f'{path.name}: {seconds:.0f} s, {"changed" if changed else "unchanged"}')
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
