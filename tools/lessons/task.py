"""Add a task to a lesson. The tasks after it get new numbers, and keep their names.

    python -m tools.lessons.task 01                                 after the last task
    python -m tools.lessons.task 01 --after 3 --name count_them     as task 4, with this name

The new task is complete and small: four cells, a judge, and answers. What it is about is then yours
to change. Its name is for ever: by it progress, classes and grades know the task. Headings of later
tasks follow, and all links to them.
"""

import argparse
import ast
import re
import sys
from pathlib import Path

import nbformat
from nbformat import NotebookNode

from helpers.lesson import FOLD, FOLDED, ROOT, Lesson, chosen, chosen_tasks, read
from tools.lessons import tables
from tools.lessons.clean import clean, text_of, write
from tools.lessons.new import judges_of

NAME = 'find_the_largest'
TEXT = (
    '### ✎ Task 0 ★: Find the largest\n\n'
    'Say exactly what the code must do: `largest(numbers)` returns the largest number of a list, '
    'and 0 for an empty list. A task beyond the core has a star. Without it, add its minutes to '
    'the note of the step and to the time of the opening.'
)
STARTER = """def largest(numbers):
    return 0  # Your code: the largest of the numbers."""
SOLUTION = """%%solution {name}
def largest(numbers):
    return max(numbers, default=0)"""
JUDGE = """

@tasks.add
def {name}(largest):
    def returns(right, *numbers):
        return expect(largest([*numbers]), right, f'of {{[*numbers]}} it returns')

    return [
        ('it finds the largest in the middle', lambda: returns(7, 3, 7, 5), 'Try max(...).'),
        ('it finds the largest at the end', lambda: returns(9, 1, 9), 'Look at all numbers.'),
        ('an empty list gives 0', lambda: returns(0), 'max(..., default=...) has an answer.'),
    ]
"""
ANSWERS = """
{name} wrong:
- 'max(numbers, default=0)': numbers[-1] if numbers else 0  # the last one
- 'max(numbers, default=0)': sum(numbers)  # all together
- 'return max(numbers, default=0)': print(max(numbers, default=0))  # shows it, and returns None
{name} right:
- 'max(numbers, default=0)': sorted(numbers)[-1] if numbers else 0
- 'max(numbers, default=0)': max([0, *numbers])
- 'return max(numbers, default=0)': |-
    found = 0
    for number in numbers:
        found = max(found, number)
    return found
"""
CELLS = (('markdown', '', TEXT), ('code', 'exercise', STARTER),
         ('code', 'check', "check('{name}', largest)"), ('code', 'solution', SOLUTION))  # fmt: skip


def new_cells(name: str) -> list[NotebookNode]:
    cells = []
    for kind, tag, text in CELLS:
        metadata = {'tags': [tag]} if tag else {}
        if tag in FOLDED:
            metadata |= FOLD
        make = getattr(nbformat.v4, f'new_{kind}_cell')
        cells.append(make(text.replace('{name}', name), metadata=metadata))
    return cells


def with_cells(lesson: Lesson, name: str, before: str) -> str:
    """Return the text of the notebook with the new task below that with the name `before`."""
    [task] = [task for task in lesson.tasks if task.name == before]
    place = next(i for i, cell in enumerate(lesson.cells, 1) if cell is task.solutions[-1])
    lesson.cells[place:place] = new_cells(name)
    return text_of(clean(lesson.notebook))


def with_judge(source: str, name: str, before: str) -> str:
    """Return a module of judges with that of the new task below that of the one before it.

    Raises ValueError if the module has no function with the name `before`.
    """
    ends = [
        node.end_lineno
        for node in ast.parse(source).body
        if isinstance(node, ast.FunctionDef) and node.name == before
    ]
    if not ends:
        raise ValueError(
            f'The judge of {before} is no function of its own: write the new task by hand, as '
            'CONTRIBUTING.md says.'
        )
    lines = source.splitlines(keepends=True)
    lines.insert(ends[0], JUDGE.format(name=name))
    return _importing_expect(''.join(lines))


def _importing_expect(source: str) -> str:
    """Return a module of judges with the import that the new judge needs."""
    found = re.search(r'(?<=^from helpers\.checks\.points import )[\w, ]+$', source, re.MULTILINE)
    if not found:
        tasks = 'from helpers.checks.tasks import'
        return source.replace(tasks, f'from helpers.checks.points import expect\n{tasks}', 1)
    names = ', '.join(sorted({'expect', *found[0].split(', ')}))
    return source[: found.start()] + names + source[found.end() :]


def _judges_with(lesson: str, task: str, root: Path) -> Path:
    """Return the file that has the judge of a task: a lesson of many tasks has several."""
    files = judges_of(lesson, root)
    having = [file for file in files if f'def {task}(' in file.read_text(encoding='utf-8')]
    return (having or files)[0]


def plan(lesson: str, after: str, name: str, root: Path) -> tuple[tables.Texts, str, int]:
    """Return the new texts of files, by their paths, the file of the notebook, and the number.

    Raises ValueError with one sentence if there is no such lesson or task, if a task has the name,
    or if the judges are written in another way.
    """
    name = name or NAME
    if not re.fullmatch(r'[a-z]+(_[a-z0-9]+)+', name):
        raise ValueError('Name the task in small letters, with _ between the words: NAME=' + NAME)
    path = chosen(lesson, root / 'notebooks')[0]
    notebook = str(path.relative_to(root))
    texts = tables.texts_of(root)
    found = read(texts[notebook], path.name)
    if not found.tasks:
        raise ValueError(f'{path.name} has no task yet: CONTRIBUTING.md says how to write one.')
    if name in (task.name for task in found.tasks):
        raise ValueError(f'{path.name} has a task {name} already: choose another NAME.')
    before = chosen_tasks(after, found)[0] if after else found.tasks[-1]
    judges = _judges_with(found.name, before.name, root)
    source = judges.read_text(encoding='utf-8')
    answers = f'tests/answers/{found.name}.yaml'
    changed = {
        notebook: with_cells(found, name, before.name),
        str(judges.relative_to(root)): with_judge(source, name, before.name),
        answers: (root / answers).read_text(encoding='utf-8').rstrip() + ANSWERS.format(name=name),
    }
    texts |= {notebook: changed[notebook]}
    return changed | tables.updated(texts), notebook, before.number + 1


def main(arguments: list[str] | None = None, root: Path = ROOT) -> int:
    parser = argparse.ArgumentParser(description='Add a task to a lesson.')
    parser.add_argument('lesson', help='its number or name, such as 01')
    parser.add_argument('--after', default='', metavar='TASK', help='the task before it')
    parser.add_argument('--name', default='', help=f'such as {NAME}: the task keeps it for ever')
    options = parser.parse_args(arguments)
    try:
        if not options.lesson:
            raise ValueError('Name the lesson: make task LESSON=01 AFTER=3 NAME=count_them')
        texts, notebook, number = plan(options.lesson, options.after, options.name, root)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    for path, text in texts.items():
        write(root / path, text)
        print(f'{path}: written')
    print(
        f'Task {number} of {notebook} is new. In JupyterLab: File > Reload Notebook from Disk. '
        'Change the task in its notebook, its judge and its answers. '
        f'Then: make test-answers LESSON={options.lesson} TASK={number}'
    )
    return 0


if __name__ == '__main__':
    sys.exit(main())
