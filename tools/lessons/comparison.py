"""All that is used of nbval, which runs each notebook and compares its outputs with the saved ones.

pyproject.toml has its options, tests/nbval_sanitize.cfg what is masked before it compares.
"""

import re
from collections import defaultdict
from collections.abc import Callable, Iterator

from jupyter_client.manager import KernelManager
from nbformat import NotebookNode
from nbval import kernel
from nbval.kernel import RunningKernel
from nbval.plugin import (
    IPyNbCell,
    IPyNbFile,
    comment_markers,
    get_sanitize_patterns,
    metadata_tags,
    transform_streams_for_comparison,
)

from helpers.lesson import ROOT, called

__all__ = ['IPyNbFile', 'NamedCell', 'RunningKernel', 'comment_markers', 'metadata_tags']

MASKS = ROOT / 'tests' / 'nbval_sanitize.cfg'
# What nbval 0.11.0 leaves out, without `metadata`, in which a check says what it has found.
NOT_COMPARED = {
    *('traceback', 'prompt_number', 'output_type', 'name', 'execution_count'),
    *('image/png', 'image/jpeg', 'application/vnd.jupyter.widget-view+json'),
}


class NamedCell(IPyNbCell):
    """A cell that a report calls as the rules do, and not by its number."""

    unexpected = ()

    def reportinfo(self) -> tuple:
        return self.path, 0, f'{self.path.name}::{self.name}'

    def repr_failure(self, excinfo: object) -> str:
        """Begin with what the cell says now and did not say: pytest's last lines have this line."""
        said = super().repr_failure(excinfo).replace(f'Cell {self.cell_num}: ', f'{self.name}: ', 1)
        return f'{" | ".join(self.unexpected)}\n{said}' if self.unexpected else said

    def compare_outputs(self, test: list, ref: list, skip_compare: object = None) -> bool:
        """Compare as nbval does. If they differ, say all that the cell has printed, too."""
        same = super().compare_outputs(test, ref, skip_compare)
        if not same:
            printed = [output['text'] for output in test if output.get('output_type') == 'stream']
            self.comparison_traceback.append(f'All that it has printed: {"".join(printed)!r}')
            expected = _lines(ref)
            self.unexpected = [line for line in _lines(test) if line not in expected]
        return same


def masked(text: str) -> str:
    """Return what nbval compares of an output."""
    for pattern, replacement in get_sanitize_patterns(MASKS.read_text(encoding='utf-8')):
        text = re.sub(pattern, replacement, text)
    return text


def _lines(outputs: list[NotebookNode]) -> list[str]:
    texts = [each.get('text') or each.get('data', {}).get('text/plain', '') for each in outputs]
    return masked('\n'.join(texts)).splitlines()


def compared(outputs: list[NotebookNode]) -> dict[str, list]:
    """Return what nbval compares of the outputs of a cell, by its kind, and their metadata."""
    found = defaultdict(list)
    for output in transform_streams_for_comparison(outputs):
        kinds = {**output, **output.get('data', {})}
        kinds.pop('data', None)
        for kind in kinds.keys() - NOT_COMPARED:
            value = kinds[kind]
            found[kind].append(masked(value) if isinstance(value, str) else value)
    return dict(found)


def change_nbval(start_kernel: Callable[..., KernelManager]) -> Callable[[], None]:
    """Let nbval start its kernels by this function, and name cells as the rules do.

    The function that it returns undoes that.
    """
    plain_manager, plain_collect = kernel.KernelManager, IPyNbFile.collect

    def collect(file: IPyNbFile) -> Iterator[NamedCell]:
        for cell in plain_collect(file):
            yield NamedCell.from_parent(
                file,
                name=called(cell.cell).replace('::', ':'),  # pytest splits its names there
                cell_num=cell.cell_num,
                cell=cell.cell,
                options=cell.options,
            )

    def undo() -> None:
        kernel.KernelManager, IPyNbFile.collect = plain_manager, plain_collect

    kernel.KernelManager, IPyNbFile.collect = start_kernel, collect
    return undo
