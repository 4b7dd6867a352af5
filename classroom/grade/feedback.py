"""The lesson of a student, with the verdicts: what goes back."""

from __future__ import annotations

from copy import deepcopy

import nbformat
from nbformat import NotebookNode
from nbformat.v4 import new_markdown_cell

from classroom.grade.answers import Answers, Handed
from classroom.grade.marking import Marking
from classroom.grade.results import Result
from helpers.lesson import tags
from tools.lessons.clean import text_of

LEFT_OUT = {'notes', 'solution'}


def feedback(handed: Handed, answers: Answers, result: Result, marking: Marking) -> str:
    """Return the text of a notebook: the lesson with the answers, and what its checks say."""
    notebook = deepcopy(handed.lesson.notebook)
    notebook.cells = [cell for cell in notebook.cells if not LEFT_OUT & tags(cell)]
    for cell in notebook.cells:
        if cell.cell_type == 'code':
            cell.source = answers.sources.get(cell.id, cell.source)
            cell.execution_count = None
            cell.outputs = [*_valid(result.outputs.get(cell.id, []))]
    notebook.cells.insert(0, new_markdown_cell(_summary(handed, result, marking), id='feedback'))
    return text_of(notebook)


def _summary(handed: Handed, result: Result, marking: Marking) -> str:
    """Return the first cell. Its counts are those of the tables: only of tasks that count."""
    counted = handed.counted
    solved = sum(result.tasks[name].solved for name in counted)
    lines = [f'# {solved} of {len(counted)} tasks are solved', '']
    if marking.partial or marking.weights:
        lines += [f'{marking.said(handed, result)} points.', '']
    lines += ['| task | | points of its check | |', '|---|---|---|---|']
    for name, task in result.tasks.items():
        met = f'{task.met} of {task.of}' if task.of else ''
        why = (
            task.why if name in counted else '. '.join(filter(None, ['no points for it', task.why]))
        )
        why = ''.join(' ' if letter in '|\n<>`' else letter for letter in why)
        number = handed.tasks[name].number
        lines.append(f'| {number} | {"✔" if task.solved else "○"} | {met} | {why} |')
    lines += ['', 'Only the cells of the tasks were judged, in the lesson as it was handed out.']
    return '\n'.join(lines)


def _valid(outputs: list[dict]) -> list[NotebookNode]:
    """Return the outputs that a notebook may hold."""
    found = []
    for output in outputs:
        node = nbformat.from_dict(output)
        try:
            nbformat.validate(node, ref='output', version=4, version_minor=5)
        except nbformat.ValidationError:
            continue
        found.append(node)
    return found
