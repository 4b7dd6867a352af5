"""What a student opens holds no outputs until the student has some."""

import asyncio

import nbformat
from ipykernel.ipkernel import IPythonKernel
from nbformat.v4 import new_code_cell, new_notebook, new_output

from helpers.notebook.fresh import AS_SAVED, LANGUAGE, MARK, FreshLessons

ANSWER = new_output('stream', text='The answer is 3.\n')


def test_saved_outputs_are_hidden_and_own_ones_stay(tmp_path):
    lesson = new_notebook(cells=[new_code_cell('1', outputs=[ANSWER], execution_count=1)])
    lesson.metadata[MARK] = AS_SAVED
    nbformat.write(lesson, tmp_path / 'lesson.ipynb')
    manager = FreshLessons(root_dir=str(tmp_path))

    opened = asyncio.run(manager.get('lesson.ipynb'))['content']
    assert opened.cells[0].outputs == []
    assert opened.cells[0].execution_count is None

    opened.cells[0].outputs = [ANSWER]  # the student runs the cell, and saves
    asyncio.run(manager.save({'type': 'notebook', 'content': opened}, 'lesson.ipynb'))
    again = asyncio.run(manager.get('lesson.ipynb'))['content']
    assert again.cells[0].outputs == [ANSWER]


def test_a_lesson_that_nobody_has_touched_is_not_unsaved():
    # JupyterLab would write what the kernel says into it.
    assert IPythonKernel.language_info == LANGUAGE
