"""Answers of students: read from their file, and made from a lesson's cells.

The top of tests/answers/test_answers.py says how they are written.
"""

import re
from pathlib import Path

import yaml

LEAST = {'wrong': 5, 'right': 3}  # answers of a task: wrong ones with those that rules make
EQUAL = 'equal'  # mutants of a task that no check need notice: they may be there


def answers_of(path: Path) -> dict[str, list]:
    """Return the answers in a file, by their task and kind: '3 wrong'.

    Raises ValueError with the file and the line if it cannot be read.
    """
    try:
        return yaml.load(path.read_text(encoding='utf-8'), yaml.BaseLoader)
    except yaml.MarkedYAMLError as error:
        where = error.problem_mark or error.context_mark
        raise ValueError(
            f'{path.name}, line {where.line + 1}: {error.problem}. YAML wants quotes around some '
            'texts: the top of tests/answers/test_answers.py says which.'
        ) from None


def equal_of(answers: dict[str, list], task: str) -> list[tuple[str | dict[str, str], str]]:
    """Return the mutants of a task that are equal to its solution: each with its reason.

    Raises ValueError with one sentence if one has no reason.
    """
    found = []
    for entry in answers.get(f'{task} {EQUAL}', []):
        edits = dict(entry) if isinstance(entry, dict) else {}
        reason = edits.pop('because', '')
        if not edits or not reason.strip():
            raise ValueError(f'A mutant below `{task} {EQUAL}:` needs a line `because:`: {entry}')
        found.append((edits, reason))
    return found


def source_of(answer: str | dict[str, str], *sources: str) -> str:
    """Return the source of an answer: its own text, or the first source that it can edit.

    Raises ValueError with one sentence if no source has each old text exactly once.
    """
    if isinstance(answer, str):
        return answer
    for source in sources:
        found = [list(re.finditer(pattern(old), source)) for old in answer]
        if all(len(places) == 1 for places in found):
            edits = zip((place.span() for [place] in found), answer.values(), strict=True)
            return edited(source, list(edits))
    counts = {old: [len(re.findall(pattern(old), source)) for source in sources] for old in answer}
    found = [
        f'`{old}` is {in_solution} times in the solution and {" or ".join(map(str, in_starter))} '
        'times in the starter'
        for old, (in_solution, *in_starter) in counts.items()
    ]
    raise ValueError(f'An old text must be there exactly once, but {"; ".join(found)}.')


def pattern(old: str) -> str:
    """Return the regular expression that finds the old text of an edit."""
    parts = [r'\s+'.join(map(re.escape, part.split())) for part in old.split(' ... ')]
    return '(?s)' + '.*?'.join(parts)


def edited(source: str, edits: list[tuple[tuple[int, int], str]]) -> str:
    """Return the source with new text from one place to another, as often as there are edits."""
    result = source
    for (start, end), new in sorted(edits, reverse=True):
        indent = re.match(' *', source[source.rfind('\n', 0, start) + 1 :]).group()
        result = result[:start] + new.replace('\n', '\n' + indent) + result[end:]
    return result
