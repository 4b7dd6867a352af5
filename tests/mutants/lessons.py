"""The mutants of a lesson: of each task what its check must notice, and what is equal."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from support.answers import answers_of, equal_of, source_of
from support.judged import Cells, read_tasks

from mutants.made import Mutant, drawn, mutants_of, same_program

ANSWERS = Path(__file__).resolve().parents[1] / 'answers'
BY_ID = 'mutant'  # an entry that names a mutant by its id, where no edit can
EACH = 'each that survives'  # in place of an id: of tests, which are judged by what they find


@dataclass(frozen=True)
class OfTask:
    """The mutants of a task.

    `equal` are those that stand below `NAME equal:` with their reasons, `stale` the entries that no
    rule makes any more, and `known` the wrong answers written by hand that a rule makes as well.
    With `each_equal` a mutant that the check takes is as good as the solution.
    """

    mutants: list[Mutant]
    equal: list[tuple[Mutant, str]]
    stale: list[str]
    known: list[str]
    each_equal: bool = False


@cache
def of_lesson(name: str) -> dict[str, OfTask]:
    """Return the mutants of a lesson's tasks. Raises ValueError if an entry cannot be read."""
    file = ANSWERS / f'{name}.yaml'
    answers = answers_of(file) if file.exists() else {}
    return {task: _of_task(answers, task, cells) for task, (_, cells) in read_tasks(name).items()}


def drawn_of_lesson(
    name: str, count: int | None, seed: int, tasks: set[str] | None = None
) -> dict[str, list[Mutant]]:
    """Return so many mutants of a lesson or of some of its tasks, or all, by their task."""
    every = [
        (task, one)
        for task, of in of_lesson(name).items()
        if tasks is None or task in tasks
        for one in of.mutants
    ]
    chosen: dict[str, list[Mutant]] = {}
    for task, mutant in drawn(every, count, seed):
        chosen.setdefault(task, []).append(mutant)
    return chosen


def _of_task(answers: dict[str, list], task: str, cells: Cells) -> OfTask:
    [solution], starters = cells['solution'], cells['exercise']

    def sources(kind: str) -> list[str]:
        given = answers.get(f'{task} {kind}', [])
        return [source_of(answer, solution, *starters) for answer in given]

    # A right answer that a rule makes is equal, and its check judges it anyway.
    mutants = mutants_of(solution, starters, (*sources('right'), *starters))
    equal, stale, left, each_equal = [], [], [*mutants], False
    for edits, reason in equal_of(answers, task):
        if edits.get(BY_ID) == EACH:
            each_equal = True
            continue
        if BY_ID in edits:
            found = next((one for one in left if one.id == edits[BY_ID]), None)
        else:
            source = source_of(edits, solution)
            found = next((one for one in left if same_program(one.source, source)), None)
        if found is None:
            stale.append(next(iter(edits.items()))[0])
        else:
            left.remove(found)
            equal.append((found, reason))
    known = [
        source
        for source in sources('wrong')
        if any(same_program(source, mutant.source) for mutant in mutants)
    ]
    return OfTask(left, equal, stale, known, each_equal)
