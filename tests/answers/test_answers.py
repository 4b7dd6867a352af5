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

from helpers.checks.progress import with_tasks

HERE = Path(__file__).parent
RUNS_COMMANDS = re.compile(r'check\(\d+, workspace, [A-Z]')  # a text of commands
LEAST = {'wrong': 5, 'right': 3}  # answers of a task

FILES = sorted(HERE.glob('*.yaml'))


def answers_of(path: Path) -> dict[str, list]:
    """Return the answers in a file, by their task and kind: '3 wrong'."""
    return yaml.load(path.read_text(encoding='utf-8'), yaml.BaseLoader)


def tasks_of(path: Path) -> set[int]:
    """Return the numbers of the tasks that have answers."""
    return {int(key.split()[0]) for key in answers_of(path)}


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


def tag_of(cell: nbformat.NotebookNode) -> str:
    """Return 'exercise', 'check' or 'solution', or nothing for another cell."""
    tags = {'exercise', 'check', 'solution'}.intersection(cell.metadata.get('tags', []))
    return tags.pop() if tags else ''


def run_all(kernel: Kernel, *sources: list[str]) -> str:
    """Run cells, and return what they print."""
    return ''.join(kernel.run(source) for group in sources for source in group)


def judge(kernel: Kernel, answers: list, key: str, cells: dict[str, list[str]]) -> None:
    """Run each answer, and its check twice: each time it must find of which kind the answer is."""
    kind = key.split()[1]
    assert len(answers) >= LEAST[kind], (
        f'There are {len(answers)} answers "{key}", and at least {LEAST[kind]} are wanted.'
    )
    starters = cells['exercise']
    files = starters if len(starters) > 1 else []  # the answer changes what they have written
    for answer in answers:
        source = source_of(answer, *cells['solution'], *starters)
        said = run_all(kernel, files, [source])
        for _ in range(2):
            said += run_all(kernel, cells['check'])
            solved = [verdict['solved'] for verdict in kernel.verdicts]
            # A name that the answer does not define is an error of the cell, not a verdict.
            assert solved == [kind == 'right'] or (kind == 'wrong' and not solved), (
                f'Task {key} answer:\n{source}\nThe check said:\n{said}'
            )


@pytest.mark.parametrize(
    ('lesson', 'task'),
    [(path.stem, task) for path in FILES for task in sorted(tasks_of(path))],
    ids=lambda value: value if isinstance(value, str) else f'task_{value:02d}',
)
def test_check_judges_right_and_wrong_answers(lesson, task):
    [path] = NOTEBOOKS.glob(f'[0-9][0-9]_{lesson}.ipynb')
    answers = answers_of(HERE / f'{lesson}.yaml')
    cells = defaultdict(list)  # the cells of this task, by their tag
    number, check = 1, ''  # of the task that comes next
    with Kernel() as kernel:
        for cell in nbformat.read(path, 4).cells:
            [tag] = {'exercise', 'check', 'solution'}.intersection(
                cell.metadata.get('tags', [])
            ) or {''}
            if cell.cell_type != 'code':
                continue
            if number == task and tag:
                cells[tag].append(
                    cell.source.split('\n', 1)[1] if tag == 'solution' else cell.source
                )
            elif tag == 'check' and RUNS_COMMANDS.match(cell.source):
                check = cell.source
            elif tag == 'solution':
                kernel.run(cell.source.split('\n', 1)[1])
                if check:  # it clones or builds what the next tasks need
                    kernel.run(check)
                check = ''
            elif not tag:
                kernel.run(cell.source)
            if tag == 'solution':
                if number == task:
                    break
                number += 1
        assert cells['solution'], f'The lesson {lesson} has no task {task}.'
        run_all(kernel, cells['exercise'], cells['check'])
        assert [verdict['solved'] for verdict in kernel.verdicts] == [False], (
            'The starter is right.'
        )
        judge(kernel, answers.get(f'{task} wrong', []), f'{task} wrong', cells)
        # What a right answer builds stays, so the solution comes after the wrong ones.
        said = run_all(kernel, cells['exercise'], [f'%%solution {task}\n{cells["solution"][0]}'])
        assert [(verdict['of'], verdict['solved']) for verdict in kernel.verdicts] == [
            ('solution', True)
        ], said
        judge(kernel, answers.get(f'{task} right', []), f'{task} right', cells)


def test_each_task_of_a_lesson_has_answers():
    for tasks in with_tasks():
        path = HERE / f'{tasks.name}.yaml'
        known = tasks_of(path) if path.exists() else set()
        missing = sorted(set(range(1, tasks.tasks + 1)) ^ known)
        assert not missing, (
            f'tests/answers/{tasks.name}.yaml lacks tasks, or has others: {missing}.'
        )
