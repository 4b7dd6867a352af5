"""Which students have the same answer? That is no proof: a person has to ask them."""

from __future__ import annotations

import io
import tokenize
from collections import defaultdict
from collections.abc import Iterable

from classroom.grade.answers import Answers, Handed
from helpers.lesson import Task, code_of_solution

LEAST = 80  # letters of one's own code: shorter answers are equal by themselves


def normalised(source: str) -> list[str]:
    """Return the lines of a source without comments, white space and the kind of quotes."""
    try:
        tokens = list(tokenize.generate_tokens(io.StringIO(source).readline))
    except (tokenize.TokenError, SyntaxError, ValueError):  # a shell, XML, C++, a broken line
        lines = (line.partition('#')[0] for line in source.splitlines())
        return [text for line in lines if (text := ''.join(line.split()))]
    lines, words = [], []
    for token in tokens:
        if token.type == tokenize.STRING:
            words.append(token.string.replace('"', "'"))
        elif token.type in (tokenize.NEWLINE, tokenize.NL):
            lines.append(' '.join(words))
            words = []
        elif token.type not in (tokenize.COMMENT, tokenize.INDENT, tokenize.DEDENT):
            words.append(token.string)
    return [line for line in [*lines, ' '.join(words)] if line.strip()]


def own(task: Task, answers: Answers) -> str:
    """Return what a student has written for a task, normalised, or nothing if that says little.

    Lines of the starter and of the solution are not the student's own.
    """
    given = {line for cell in (*task.exercises, *task.solutions) for line in _of_lesson(cell)}
    written = [
        line
        for cell in task.exercises
        for line in normalised(answers.sources.get(cell.id, ''))
        if line not in given
    ]
    text = '\n'.join(written)
    return text if len(text) >= LEAST else ''


def _of_lesson(cell: object) -> list[str]:
    return normalised(code_of_solution(cell.source))


def groups(handed: Handed, students: Iterable[tuple[str, Answers]]) -> list[tuple[str, list[str]]]:
    """Return the tasks and the names of students whose answers are the same."""
    found: dict[tuple[str, str], list[str]] = defaultdict(list)
    for name, answers in students:
        for known, task in handed.tasks.items():
            if text := own(task, answers):
                found[known, text].append(name)
    return sorted((task, names) for (task, _), names in found.items() if len(names) > 1)
