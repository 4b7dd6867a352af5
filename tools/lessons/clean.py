"""Clean a notebook, so that a diff shows only what changed, and write it at once."""

import hashlib
import re
import shutil
from copy import deepcopy
from pathlib import Path

import nbformat
from nbformat import NotebookNode

from helpers.lesson import FOLD, compares, guess_of, is_folded
from helpers.notebook import AS_SAVED, MARK

NOTEBOOK_METADATA = {
    'kernelspec': {
        'display_name': 'Python 3 (ipykernel)',
        'language': 'python',
        'name': 'python3',
    },
    'language_info': {'name': 'python'},
    MARK: AS_SAVED,
}
MADE_FROM = 'ros2_notebooks_made_from'  # what made the outputs: see outputs.py
WIDGET = 'application/vnd.jupyter.widget-view+json'
# Begins what explains an answer: lab.css and the site hide it until the answer is there.
EXPLAINS = '<span class="explains"></span>'
# A paragraph, and none that leads to the next cell.
PARAGRAPH = re.compile(r'(?!#)(?!.*:$)', re.MULTILINE)


def clean(notebook: NotebookNode) -> NotebookNode:
    """Return a copy of a notebook without what changes by itself from run to run.

    Kept are sources, tags, hidden sources, cell ids, execution counts, outputs, and what made them.
    Made anew is which cells JupyterLab does not let edit, answers that unfold, and which begin with
    EXPLAINS.
    Neighbouring pieces of one stream become one, because where a stream is cut is chance. The
    model of a widget lives only as long as its kernel: of its view, the text is kept.
    """
    notebook = deepcopy(notebook)
    notebook.nbformat, notebook.nbformat_minor = 4, 5
    kept = {key: notebook.metadata[key] for key in [MADE_FROM] if key in notebook.metadata}
    notebook.metadata = nbformat.from_dict(NOTEBOOK_METADATA | kept)
    ids: set[str] = set()
    for number, cell in enumerate(notebook.cells):
        if cell.get('id') is None or cell.id in ids:
            cell.id = hashlib.sha256(f'{number} {cell.source}'.encode()).hexdigest()[:8]
        ids.add(cell.id)
        cell.metadata = nbformat.from_dict(_kept_metadata(cell))
        if cell.cell_type == 'markdown' and '<details' in cell.source:
            cell.metadata.editable = False  # a double click on an answer must not show the source
        if cell.cell_type == 'code':
            cell.outputs = _clean_outputs(cell)
    _mark_explanations(notebook.cells)
    return notebook


def _mark_explanations(cells: list[NotebookNode]) -> None:
    """Let the paragraph below the answer of a guess begin with EXPLAINS, and no other one."""
    guess, answered = None, False
    for cell in cells:
        if cell.cell_type == 'markdown':
            text = cell.source.removeprefix(EXPLAINS)
            cell.source = EXPLAINS + text if answered and PARAGRAPH.match(text) else text
        guess = guess_of(cell) or guess
        answered = guess is not None and compares(cell, guess)
        if answered:
            guess = None


def _kept_metadata(cell: NotebookNode) -> dict:
    named = {'tags': cell.metadata['tags']} if cell.metadata.get('tags') else {}
    return named | (FOLD if is_folded(cell) else {})


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
    return outputs


def text_of(notebook: NotebookNode) -> str:
    return nbformat.writes(notebook) + '\n'


def write(path: Path, after: str, before: str = '') -> bool:
    """Write a file, at once or not at all; return whether that changed it."""
    if after == before:
        return False
    unfinished = path.with_suffix('.tmp')
    unfinished.write_text(after, encoding='utf-8')
    if path.exists():
        shutil.copymode(path, unfinished)
    unfinished.replace(path)
    return True
