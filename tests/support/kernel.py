"""A kernel in the folder of the lessons that a test types cells into."""

from pathlib import Path

import nbformat
from nbclient import NotebookClient

NOTEBOOKS = Path(__file__).resolve().parents[2] / 'notebooks'


class Kernel(NotebookClient):
    """Use it as `with Kernel() as kernel: said = kernel.run('1 + 1')`."""

    def __init__(self) -> None:
        where = {'metadata': {'path': str(NOTEBOOKS)}}
        super().__init__(
            nbformat.v4.new_notebook(), timeout=200, allow_errors=True, resources=where
        )
        self.widget_registry = {}  # what is printed into a widget is an output of the cell

    def __enter__(self) -> 'Kernel':
        self._open = self.setup_kernel()
        self._open.__enter__()
        return self

    def __exit__(self, *why) -> None:
        self._open.__exit__(*why)

    def run(self, source: str) -> str:
        """Run a cell, and return what it prints and the sentence of its error."""
        cell = nbformat.v4.new_code_cell(source)
        self.nb.cells.append(cell)
        self.execute_cell(cell, len(self.nb.cells) - 1)
        return ''.join(one.get('text') or one.get('evalue', '') for one in cell.outputs)
