"""What a class knows of the lessons: steps, exercises and guesses, read from the notebooks."""

import ast
import re
from dataclasses import dataclass
from functools import cached_property

from IPython.core.inputtransformer2 import TransformerManager
from nbformat import NotebookNode

from tools.lessons.lesson import Lesson, first_heading
from tools.lessons.slides import heading


@dataclass(frozen=True)
class Known:
    """A notebook of the class. Steps, exercises and guesses are known by the index of a cell."""

    lesson: Lesson

    @property
    def cells(self) -> list[NotebookNode]:
        """The cells of the notebook."""
        return self.lesson.notebook.cells

    @cached_property
    def title(self) -> str:
        """Its number and its title."""
        return first_heading(self.cells[0].source)

    @cached_property
    def steps(self) -> list[int]:
        """The cells with which its steps begin, the opening first."""
        return [i for i, cell in enumerate(self.cells) if i == 0 or heading(cell, '## ')]

    @cached_property
    def step_of(self) -> dict[str, int]:
        """For each cell's id the number of its step, counted from 0."""
        step, found = 0, {}
        for index, cell in enumerate(self.cells):
            step += index in self.steps[1:]
            found[cell.id] = step
        return found

    @cached_property
    def guesses(self) -> dict[str, str]:
        """For each question of a call `guess('How many?', 41)` the id of its cell."""
        return {
            question: cell.id
            for cell in self.cells
            if cell.cell_type == 'code'
            for question in _guessed(cell.source)
        }

    @cached_property
    def exercises(self) -> list[int]:
        """The numbers of its exercises."""
        text = '\n'.join(cell.source for cell in self.cells if cell.cell_type == 'markdown')
        return sorted(set(map(int, re.findall(r'^### Exercise (\d+)', text, re.MULTILINE))))


def _guessed(source: str) -> list[str]:
    try:
        tree = ast.parse(TransformerManager().transform_cell(source))
    except SyntaxError:  # of a lesson that is being written
        return []
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and node.args]
    return [
        call.args[0].value
        for call in calls
        if getattr(call.func, 'id', '') == 'guess'
        and isinstance(call.args[0], ast.Constant)
        and isinstance(call.args[0].value, str)
    ]
