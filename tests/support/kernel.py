"""A kernel in the folder of the lessons that a test types cells into."""

from pathlib import Path

import nbformat
from nbclient import NotebookClient

from helpers.checks.verdict import verdict_in

OWN_ERROR = 'ended with an error. Mend it'  # in the note of an answer that was not judged
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
        """Run a cell, and return what it prints and shows as text, and the sentence of its error.

        The verdicts of its checks, as data, are then in `verdicts`.
        """
        cell = nbformat.v4.new_code_cell(source)
        self.nb.cells.append(cell)
        self.execute_cell(cell, len(self.nb.cells) - 1)
        self.verdicts = list(filter(None, map(verdict_in, cell.outputs)))
        self._has_error = any(output['output_type'] == 'error' for output in cell.outputs)
        return ''.join(map(_text, cell.outputs))

    @property
    def judged(self) -> str:
        """How the check in the last cell has judged an answer: 'right', 'wrong', or 'not judged'.

        An answer whose own cell ends with an error is wrong. One that needs another task, or has
        changed what judges it, is not judged: then nothing is known of the check.
        """
        if not self.verdicts:
            return 'wrong' if self._has_error else 'not judged'
        verdict = self.verdicts[-1]
        if verdict['solved']:
            return 'right'
        return 'not judged' if 'note' in verdict and OWN_ERROR not in verdict['note'] else 'wrong'


def _text(output: dict) -> str:
    if 'data' in output:
        return output['data'].get('text/plain', '') + '\n'
    return output.get('text') or output.get('evalue', '')
