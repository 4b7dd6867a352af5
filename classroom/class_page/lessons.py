"""What a class knows of the lessons: steps, tasks and guesses, read from the notebooks."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from nbformat import NotebookNode

from classroom.class_page.notes import of_step
from helpers.lesson import Lesson, first_heading, has_heading


class Guess(NamedTuple):
    """A question of a lesson: the cells that ask it and that compare it, by their ids."""

    asked: str
    compared: str


@dataclass(frozen=True)
class Known:
    """A notebook of the class. Steps are known by their number, the opening is 0."""

    lesson: Lesson

    @property
    def cells(self) -> list[NotebookNode]:
        """The cells of the notebook."""
        return self.lesson.cells

    @cached_property
    def title(self) -> str:
        """Its number and its title."""
        return first_heading(self.cells[0].source)

    @cached_property
    def starts(self) -> list[int]:
        """The indices of the cells with which its steps begin."""
        return [i for i, cell in enumerate(self.cells) if i == 0 or has_heading(cell, '## ')]

    @cached_property
    def notes(self) -> list[dict]:
        """For each step its title, its notes, and the minutes that they plan."""
        return [of_step(self.cells, start) for start in self.starts]

    def step_at(self, cell: int) -> int:
        """Return the step of the cell with an index."""
        return sum(start <= cell for start in self.starts) - 1

    @cached_property
    def step_of(self) -> dict[str, int]:
        """For each cell's id its step."""
        return {cell.id: self.step_at(index) for index, cell in enumerate(self.cells)}

    @cached_property
    def guesses(self) -> dict[str, Guess]:
        """By question what is guessed."""
        found = {}
        for guess in self.lesson.guesses:
            compared = self.lesson.comparison_of(guess) or guess.cell
            found[guess.question] = Guess(guess.cell.id, compared.id)
        return found

    @cached_property
    def tasks(self) -> dict[str, int]:
        """The numbers of its tasks, by their names."""
        return {task.name: task.number for task in self.lesson.tasks}
