"""Where a task, a guess or a cell is that has moved to another lesson with its answers."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable

from helpers.lesson.lesson import Lesson


def home_of_task(lesson: str, task: str, known: Iterable[Lesson]) -> str:
    """Return the name of the lesson that has a task today, which this lesson had once.

    It is the lesson itself as long as it has a task of this name, and if it is not known. Else it
    is the only other one that has. Where no lesson or several have one, nobody can say, and it is
    the lesson itself.
    """
    return _home(lesson, task, known, lambda one: [task.name for task in one.tasks])


def home_of_guess(lesson: str, question: str, known: Iterable[Lesson]) -> str:
    """Return the name of the lesson that asks a guess today, which this lesson asked once."""
    return _home(lesson, question, known, lambda one: [guess.question for guess in one.guesses])


def home_of_cell(lesson: str, cell: str, known: Iterable[Lesson]) -> str:
    """Return the name of the lesson that has a cell of this id today, which this lesson had."""
    return _home(lesson, cell, known, lambda one: [cell.id for cell in one.cells])


def _home(
    lesson: str, what: str, known: Iterable[Lesson], of: Callable[[Lesson], Collection[str]]
) -> str:
    by_name = {one.name: one for one in known}
    if lesson not in by_name or what in of(by_name[lesson]):
        return lesson
    others = [name for name, one in by_name.items() if what in of(one)]
    return others[0] if len(others) == 1 else lesson
