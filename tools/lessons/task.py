"""Add a task to a lesson. The tasks after it get new numbers.

    python -m tools.lessons.task 01                 after the last task
    python -m tools.lessons.task 01 --after 3       as task 4

The new task is complete and small: four cells, a check, and answers. What it is about is then
yours to change. Headings, checks, solutions and answers of later tasks follow. Where a text calls
a task by its number, that is printed: a person must look at these lines.
"""

import argparse
import ast
import re
import sys
from collections.abc import Collection
from pathlib import Path

import nbformat
from nbformat import NotebookNode

from tools.lessons.clean import clean, text_of, write
from tools.lessons.lesson import ROOT, Lesson, chosen, read, tags
from tools.lessons.new import all_texts, checks_of
from tools.lessons.rules import FOLDED
from tools.lessons.tables import BLOCK, Texts

TEXT = (
    '### ✎ Task {number} ★: Find the largest\n\n'
    'Say exactly what the code must do: `largest(numbers)` returns the largest number of a list, '
    'and 0 for an empty list. A task beyond the core has a star. Without it, add its minutes to '
    'the note of the step and to the time of the opening.'
)
STARTER = """def largest(numbers):
    return 0  # Your code: the largest of the numbers."""
SOLUTION = """%%solution {number}
def largest(numbers):
    return max(numbers, default=0)"""
CHECK = """

@tasks.add({number})
def find_the_largest(largest):
    def returns(right, *numbers):
        found = largest([*numbers])
        return found == right or f'for {{[*numbers]}} it returns {{found}}'

    return [
        ('it finds the largest in the middle', lambda: returns(7, 3, 7, 5), 'Try max(...).'),
        ('it finds the largest at the end', lambda: returns(9, 1, 9), 'Look at all numbers.'),
        ('an empty list gives 0', lambda: returns(0), 'max(..., default=...) has an answer.'),
    ]
"""
ANSWERS = """
{number} wrong:
- 'max(numbers, default=0)': max(numbers)  # fails for an empty list
- 'max(numbers, default=0)': min(numbers, default=0)  # the smallest
- 'max(numbers, default=0)': numbers[-1] if numbers else 0  # the last one
- 'max(numbers, default=0)': sum(numbers)  # all together
- 'return max(numbers, default=0)': print(max(numbers, default=0))  # shows it, and returns None
{number} right:
- 'max(numbers, default=0)': sorted(numbers)[-1] if numbers else 0
- 'max(numbers, default=0)': max([0, *numbers])
- 'return max(numbers, default=0)': |-
    found = 0
    for number in numbers:
        found = max(found, number)
    return found
"""
CELLS = (('markdown', '', TEXT), ('code', 'exercise', STARTER),
         ('code', 'check', 'check({number}, largest)'), ('code', 'solution', SOLUTION))  # fmt: skip
# How a text calls tasks, but for their own headings: `task 3`, `tasks 9 and 10`, `TASKS="9 10"`.
CALLED = re.compile(r'(?<!✎ )\b(?:[Tt]asks? |TASKS?="?)([\d, andto]+)')


def new_cells(number: int) -> list[NotebookNode]:
    cells = []
    for kind, tag, text in CELLS:
        metadata = {'tags': [tag]} if tag else {}
        if tag in FOLDED:
            metadata['jupyter'] = {'source_hidden': True}
        make = getattr(nbformat.v4, f'new_{kind}_cell')
        cells.append(make(text.replace('{number}', f'{number}'), metadata=metadata))
    return cells


def grown(before: str, text: str, number: int, after: str = r'\b') -> str:
    """Add one to each number from `number` on, at the start of a line, between two patterns."""

    def write_number(found: re.Match) -> str:
        old = int(found[2])
        return f'{found[1]}{old + (old >= number)}'

    return re.sub(rf'^({before})(\d+)(?={after})', write_number, text, flags=re.MULTILINE)


def notebook_with(notebook: NotebookNode, number: int) -> NotebookNode:
    """Return the notebook with the new task, whose later tasks have new numbers."""
    place = 0
    for index, cell in enumerate(notebook.cells):
        if 'solution' in tags(cell) and re.match(rf'%%solution {number - 1}\b', cell.source):
            place = index + 1
        if cell.cell_type == 'markdown':
            cell.source = grown('### ✎ Task ', cell.source, number)
        elif 'check' in tags(cell):
            cell.source = grown(r'check\(', cell.source, number)
        elif 'solution' in tags(cell):
            cell.source = grown('%%solution ', cell.source, number)
    notebook.cells[place:place] = new_cells(number)
    return clean(notebook)


def checks_with(source: str, number: int) -> str:
    """Return a module of checks, with one of the new task if it has that of the task before."""
    source = grown(r'@tasks\.add\(', source, number)
    lines = source.splitlines(keepends=True)
    if (end := ends_of_checks(source).get(number - 1)) is not None:
        lines.insert(end, CHECK.format(number=number))
    return ''.join(lines)


def ends_of_checks(source: str) -> dict[int, int]:
    """Return the last line of the function of each task, where `@tasks.add(2)` stands above it."""
    ends = {}
    for node in ast.parse(source).body:
        for decorator in getattr(node, 'decorator_list', []):
            if found := re.match(r'tasks\.add\((\d+)', ast.unparse(decorator)):
                ends[int(found[1])] = node.end_lineno
    return ends


def answers_with(text: str, number: int) -> str:
    """Return the answers with those of the new task after those of the one before it."""
    text = grown('["\']?', text, number, after=' (?:wrong|right)')
    new = ANSWERS.format(number=number).lstrip('\n')
    later = re.search(rf'^["\']?{number + 1} (?:wrong|right)', text, re.MULTILINE)
    if later is None:
        return f'{text.rstrip()}\n{new}'
    return text[: later.start()] + new + text[later.start() :]


def plan(lesson: str, after: str, root: Path) -> tuple[dict[Path, str], int, int]:
    """Return the new texts of the lesson's files, the task's number, and that of the last one.

    The first of them is the notebook. Raises ValueError with one sentence if there is no such
    lesson or task, or if its checks are written in another way.
    """
    path = chosen(lesson, root / 'notebooks')[0]
    found = Lesson(path.name, nbformat.read(path, as_version=4))
    last = len(found.tasks)
    if not last:
        raise ValueError(f'{path.name} has no task yet: CONTRIBUTING.md says how to write one.')
    if after and not (after.isdecimal() and 1 <= int(after) <= last):
        raise ValueError(f'{path.name} has the tasks 1 to {last}: name one of them with AFTER.')
    number = int(after or last) + 1
    checks = {file: file.read_text(encoding='utf-8') for file in checks_of(found.name, root)}
    answers = root / f'tests/answers/{found.name}.yaml'
    if {task for text in checks.values() for task in ends_of_checks(text)} != {*range(1, last + 1)}:
        raise ValueError(
            f'helpers/checks/lessons/{found.name} has no @tasks.add(...) above a function for each '
            f'of the tasks 1 to {last}: write the new task by hand, as CONTRIBUTING.md says.'
        )
    texts = {
        path: text_of(notebook_with(found.notebook, number)),
        **{file: checks_with(text, number) for file, text in checks.items()},
        answers: answers_with(answers.read_text(encoding='utf-8'), number),
    }
    return texts, number, last + 1


def to_look_at(texts: Texts, own: Collection[str], stem: str, number: int) -> list[str]:
    """Return the lines that may call a task of a lesson by its old number.

    `stem` is the lesson's, such as 02_lose_messages, and `own` are the paths of its files. In those
    of others a task counts if the lesson is named near it.
    """
    two_digits, name = stem[:2], stem[3:]
    # `lessons 01 and 02`, `LESSON=02`, `[02 Lose messages](...)`, `| 02, step 3 |`, `02 task 3`.
    lesson = re.compile(
        rf'(?:[Ll]essons? (?:\d\d(?:,| and| or| to)* )*|LESSON="?|[|[] ?){two_digits}\b'
        rf'|\b{two_digits},? task|{name}'
    )
    lines = []
    for path, text in sorted(texts.items()):
        for place, part in parts_of(path, text):
            if path not in own and not lesson.search(part):
                continue
            for line in part.splitlines():
                tasks = re.findall(r'\d+', ' '.join(CALLED.findall(line)))
                if any(int(task) >= number for task in tasks):
                    lines.append(f'{place}: {line.strip()}')
    return lines


def parts_of(path: str, text: str) -> list[tuple[str, str]]:
    """Return where each cell of a notebook, section of a document or other line is, and its text.

    What is written anew is left out: the outputs of notebooks, and the tables of documents.
    """
    if path.endswith('.ipynb'):
        cells = read(text, Path(path).name).notebook.cells
        return [(f'{path}#cell-id={cell.id}', cell.source) for cell in cells]
    if path.endswith('.md'):
        return [(path, part) for part in re.split('^(?=#)', BLOCK.sub('', text), flags=re.M)]
    return [(path, line) for line in text.splitlines()]


def main(arguments: list[str] | None = None, root: Path = ROOT) -> int:
    parser = argparse.ArgumentParser(description='Add a task to a lesson.')
    parser.add_argument('lesson', help='its number or name, such as 01')
    parser.add_argument('--after', default='', metavar='TASK', help='the task before it')
    options = parser.parse_args(arguments)
    try:
        if not options.lesson:
            raise ValueError('Name the lesson: make task LESSON=01 AFTER=3')
        texts, number, last = plan(options.lesson, options.after, root)
        lines = []
        if number < last:
            own = {str(path.relative_to(root)): text for path, text in texts.items()}
            lines = to_look_at(all_texts(root) | own, own, next(iter(texts)).stem, number)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    for path, text in texts.items():
        write(path, text)
        print(f'{path.relative_to(root)}: task {number} is in it')
    if lines:
        print('Look at these lines, which may name a task by its old number:', *lines, sep='\n')
    print(
        'In JupyterLab: File > Reload Notebook from Disk. Change the task in the three files. '
        f'Then: make test-answers LESSON={options.lesson} TASK={number}'
    )
    return 0


if __name__ == '__main__':
    sys.exit(main())
