"""The servers, the classes and the browser of these tests."""

import nbformat
import pytest
import support.examples  # noqa: F401
from support.browser import *  # noqa: F403
from support.lab_server import NOTEBOOKS, server
from support.small_checkout import wheels  # noqa: F401
from support.waits import wait_for

from classroom.tests.support.classes import running_class
from classroom.tests.support.deck_page import DeckPage
from classroom.tests.support.handed_in import submit  # noqa: F401


@pytest.fixture
def opened(tmp_path):
    """Yield a class that was told nothing, open at the first step of its lesson."""
    with running_class(tmp_path) as one:
        one.go(1)
        yield one


@pytest.fixture(scope='session')
def instructor_server(tmp_path_factory):
    """Yield what `make present` starts. Its copies look as after all cells have run."""
    folder = tmp_path_factory.mktemp('present')
    with server(folder, 'present', 'LESSON=lose_messages') as running:
        for path in NOTEBOOKS:
            run_as_saved(folder / 'presentation' / path.name, path)
        yield running


def run_as_saved(copy, lesson):
    """Give the cells of a copy the outputs of the lesson, but for what no slide shows."""
    saved = {cell.id: cell for cell in nbformat.read(lesson, as_version=4).cells}
    notebook = nbformat.read(copy, as_version=4)
    for cell in notebook.cells:
        if cell.cell_type == 'code' and 'solution' not in cell.metadata.get('tags', []):
            cell.outputs = saved[cell.id].outputs
            cell.execution_count = saved[cell.id].execution_count
    nbformat.write(notebook, copy)


@pytest.fixture
def deck(lab_page, instructor_server, request):
    """Yield an instructor's page. No change of a copy and no place reaches the next test."""
    folder = instructor_server.folder / 'presentation'
    copies = {path: path.read_bytes() for path in folder.glob('[0-9]*.ipynb')}
    with lab_page(instructor_server, request.node.name, DeckPage) as opened:
        yield opened
    # The server may still save, for the page that has closed: beside the copy, then over it.
    wait_for(lambda: not any(folder.glob('.~*')))
    for path, before in copies.items():
        path.write_bytes(before)
