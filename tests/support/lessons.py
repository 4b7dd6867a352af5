"""Small lessons, made for a test."""

from nbformat import NotebookNode
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from helpers.lesson import Lesson


def task(name: str, number: int = 1, title: str = 'Try', star: str = '') -> list[NotebookNode]:
    """Return the cells of a task. Their ids have its name, so they stay wherever it is put."""
    cells = [new_markdown_cell(f'### ✎ Task {number}{star}: {title}\n\nDo it.', id=f'{name}-text')]
    for tag, source in (
        ('exercise', 'x = 1'),
        ('check', f"check('{name}', x)"),
        ('solution', f'%%solution {name}\nx = 2'),
    ):
        cells.append(new_code_cell(source, id=f'{name}-{tag}', metadata={'tags': [tag]}))
    return cells


def lesson(*cells: NotebookNode, file: str = '05_keep_it.ipynb') -> Lesson:
    """Return a lesson with these cells below its title."""
    title = new_markdown_cell(
        f'# {file[:2]} {file[3:-6].replace("_", " ").capitalize()}', id='title'
    )
    return Lesson(file, new_notebook(cells=[title, *cells]))
