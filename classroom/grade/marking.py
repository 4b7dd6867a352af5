"""What a task is worth: one point, or its weight; all of it, or the part that is met."""

from __future__ import annotations

from dataclasses import dataclass, field

from classroom.grade.answers import Handed
from classroom.grade.results import Result
from helpers.lesson import chosen_tasks


@dataclass
class Marking:
    """`partial`: a task that is not solved gives the part of its points that its check has met.

    `weights` are those of tasks, by their numbers or names; others count one point.
    """

    partial: bool = False
    weights: dict[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, weights: str, partial: bool, lessons: list[Handed]) -> Marking:
        """Read `WEIGHTS="a_driver=2 4=0.5"`. Raises ValueError with one sentence."""
        found: dict[str, float] = {}
        for word in weights.split():
            name, _, number = word.partition('=')
            try:
                weight = float(number)
            except ValueError:
                weight = -1
            if not 0 <= weight <= 1000:
                raise ValueError(f'WEIGHTS= has {word!r}, and wants such as a_driver=2.')
            for lesson in lessons:
                for task in chosen_tasks(name, lesson.lesson):
                    found[f'{lesson.lesson.name} {task.name}'] = weight
        return cls(partial, found)

    def weight(self, lesson: Handed, task: str) -> float:
        """Return what a task is worth: nothing if it does not count."""
        return self.weights.get(f'{lesson.lesson.name} {task}', 1.0) * (task in lesson.counted)

    def most(self, lesson: Handed) -> float:
        return sum(self.weight(lesson, task) for task in lesson.counted)

    def share(self, result: Result, task: str) -> float:
        """Return how much of a task is solved, from 0 to 1. What was forged is nothing."""
        outcome = result.tasks[task]
        if outcome.solved or not self.partial or outcome.forged or not outcome.of:
            return float(outcome.solved)
        return outcome.met / outcome.of

    def points(self, lesson: Handed, result: Result) -> float:
        """Return the points of a lesson, rounded to hundredths as the tables have them."""
        tasks = lesson.counted
        return round(sum(self.weight(lesson, t) * self.share(result, t) for t in tasks), 2)

    def said(self, lesson: Handed, result: Result) -> str:
        """Return `3.5 of 7`."""
        return f'{self.points(lesson, result):.10g} of {self.most(lesson):.10g}'
