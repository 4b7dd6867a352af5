"""Every check judges the answers that students give: wrong ones of many kinds, and right ones.

A file `<lesson>.yaml` beside this one has the answers of a lesson's tasks:

    3 wrong:
    - self.publisher.publish(message): ''  # publishes nothing
    - x = self.speed: x = 0.5  # two edits are one answer
      z = self.turn: z = 1.0
    3 right:
    - message = ... (message): |-
        from geometry_msgs.msg import Vector3
        self.publisher.publish(Twist(linear=Vector3(x=self.speed), angular=Vector3(z=self.turn)))

An answer is the notebook's solution, edited: `old text: new text`. ` ... ` in the old text is
whatever lies between, and a space is any white space. If the old text is not in the solution, the
starter is edited. New lines are indented as the line in which the old text begins. An answer that
has little in common with both is given as a whole, as text.

YAML wants quotes around text that begins with a quote, a bracket or another sign of its own, or
that has a colon or a # with a space in it.
"""

import re
from collections import defaultdict
from pathlib import Path

import nbformat
import pytest
import yaml
from support.kernel import NOTEBOOKS, Kernel

HERE = Path(__file__).parent
LEAST = {'wrong': 5, 'right': 3}  # answers of a task

LESSONS = sorted(path.stem for path in HERE.glob('*.yaml'))


def source_of(answer: str | dict[str, str], *sources: str) -> str:
    """Return the source of an answer: its own text, or the first source that it can edit.

    Raises ValueError if no source has each old text exactly once.
    """
    if isinstance(answer, str):
        return answer
    for source in sources:
        found = [list(re.finditer(pattern(old), source)) for old in answer]
        if all(len(places) == 1 for places in found):
            edits = zip((place.span() for [place] in found), answer.values(), strict=True)
            return edited(source, list(edits))
    raise ValueError(f'Neither the solution nor the starter has this exactly once: {list(answer)}')


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


def judge(kernel: Kernel, answers: dict, key: str, cells: dict[str, list[str]]) -> None:
    """Run each answer, and its check twice: each time it must find of which kind the answer is."""
    kind = key.split()[1]
    some = answers.pop(key, [])
    assert len(some) >= LEAST[kind], (
        f'{HERE.name} has {len(some)} answers under "{key}", and {LEAST[kind]} are wanted.'
    )
    starters = cells['exercise']
    files = starters if len(starters) > 1 else []  # the answer changes what they have written
    for answer in some:
        source = source_of(answer, *cells['solution'], *starters)
        said = ''.join(map(kernel.run, [*files, source]))
        for _ in range(2):
            said += kernel.run(cells['check'][0])
            solved = [verdict['solved'] for verdict in kernel.verdicts]
            # A name that the answer does not define is an error of the cell, not a verdict.
            assert solved == [kind == 'right'] or (kind == 'wrong' and not solved), (
                f'Task {key} answer:\n{source}\nThe check said:\n{said}'
            )


@pytest.mark.parametrize('lesson', LESSONS)
def test_checks_judge_right_and_wrong_answers(lesson):
    [path] = NOTEBOOKS.glob(f'[0-9][0-9]_{lesson}.ipynb')
    answers = yaml.load((HERE / f'{lesson}.yaml').read_text(), yaml.BaseLoader)
    task, cells = 1, defaultdict(list)  # the cells of this task, by their tag
    with Kernel() as kernel:
        for cell in nbformat.read(path, 4).cells:
            tags = cell.metadata.get('tags', [])
            if 'solution' in tags:
                cells['solution'] = [cell.source.split('\n', 1)[1]]
                judge(kernel, answers, f'{task} wrong', cells)
                # What a right answer builds stays, so the solution is tried before.
                said = ''.join(map(kernel.run, [*cells['exercise'], cell.source]))
                assert [(verdict['of'], verdict['solved']) for verdict in kernel.verdicts] == [
                    ('solution', True)
                ], said
                judge(kernel, answers, f'{task} right', cells)
                for source in [*cells['exercise'], *cells['check'], cell.source]:
                    kernel.run(source)
                task, cells = task + 1, defaultdict(list)
            elif cell.cell_type == 'code':
                kernel.run(cell.source)
                assert not any(verdict['solved'] for verdict in kernel.verdicts), (
                    f'The starter of task {task} is right.'
                )
                for tag in {'exercise', 'check'}.intersection(tags):
                    cells[tag].append(cell.source)
    assert not answers, f'There are no such tasks: {", ".join(answers)}.'
