"""A lesson, its tasks and its guesses, as they stand in the cells of a notebook."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from helpers.lesson.cells import Node, tags

START, GLOSSARY = '00', '99'  # the notebooks that are no lessons
PARTS = ('nodes', 'packages', 'robot')
NOTE = 'For the instructor'
TASK = ('exercise', 'check', 'solution')  # the tags of the cells of a task, in their order
MAGIC = '%%solution '
CHECK_BEGINS = 'check('
FOLDED = {'solution': MAGIC, 'notes': NOTE}  # what folded cells begin with, by their tag
WRITTEN = {'exercise', 'predict'}  # the tags of the cells in which a student writes
TAGS = {'predict', 'nbval-ignore-output', 'deck-break', *TASK, *FOLDED}
HEADING = re.compile(r'^### ✎ Task (?P<number>\d+)(?P<star> ★)?(?P<rest>: (?P<title>.+))?$', re.M)
ANY_HEADING = re.compile(r'^(?P<signs>##+) (?P<title>.*)', re.MULTILINE)
STEP = re.compile(r'## (\d+)\. |## (\w+)')
TIME = re.compile(r'^(\*\*Time\*\*.*)(?:\n\n(Steps and tasks with ★.*)\.)?$', re.MULTILINE)
MEMORY = '## From memory\n'
PACKAGE = re.compile(r'\bsrc/(\w+)')
WORKSPACE = re.compile(r"^\w+ = Workspace\('([^']+)'\)", re.MULTILINE)


@dataclass
class Task:
    """A task: its name, its place, what its heading says, and its cells, in their order.

    `name` is that of its judge, and stays. It is empty where no cell of the task says it.
    """

    number: int
    title: str = ''
    star: bool = False
    heading: Node | None = None
    exercises: list[Node] = field(default_factory=list)
    checks: list[Node] = field(default_factory=list)
    solutions: list[Node] = field(default_factory=list)
    code: list[Node] = field(default_factory=list)  # all code cells up to the next heading

    @property
    def name(self) -> str:
        # An editor may have taken the tags away.
        for cell in (*self.checks, *self.solutions, *self.code):
            call = check_call(cell.source)
            if name := call[0] if call else name_of_solution(cell.source):
                return name
        return ''

    @property
    def cells(self) -> list[Node]:
        """The cells with the tags of a task."""
        return [*self.exercises, *self.checks, *self.solutions]

    @property
    def anchor(self) -> str:
        """How a link leads to the heading, as JupyterLab makes it: `#✎-Task-3-★:-A-mirror`."""
        return f'#{heading_of(self)[4:].replace(" ", "-")}'


def heading_of(task: Task) -> str:
    """Return the line that is the heading of a task."""
    title = f': {task.title}' if task.title else ''
    return f'### ✎ Task {task.number}{" ★" * task.star}{title}'


def check_call(source: str) -> tuple[str, list[str]] | None:
    """Return the task and the arguments in the code of `check('a_name', Listener)`.

    None if a cell calls no check with a name, also if it is no Python.
    """
    if CHECK_BEGINS not in source:
        return None
    try:
        tree = ast.parse(source)
    except SyntaxError:
        return None
    for node in ast.walk(tree):
        match node:
            case ast.Call(ast.Name('check'), [ast.Constant(str(name)), *rest]):
                return name, [ast.unparse(one) for one in rest]
    return None


def is_check(cell: Node) -> bool:
    """Return whether a cell is a check, also in a notebook without tags, or of version 0.3."""
    return cell.cell_type == 'code' and cell.source.startswith(CHECK_BEGINS)


def is_solution(cell: Node) -> bool:
    """Return whether a cell is a solution, also in a notebook without tags."""
    return cell.cell_type == 'code' and cell.source.startswith(MAGIC.strip())


def name_of_solution(source: str) -> str:
    """Return the name in the first line of a solution, empty if there is none."""
    first, _, _ = source.partition('\n')
    return first.removeprefix(MAGIC).strip() if first.startswith(MAGIC) else ''


def code_of_solution(source: str) -> str:
    """Return a solution without its first line, which runs it."""
    return source.partition('\n')[2] if source.startswith(MAGIC) else source


@dataclass(frozen=True)
class Guess:
    """A guess: its variable, its question, its value, the cell, and whether it shows the answers.

    It shows them by `on=`, which says what may be answered.
    """

    variable: str
    question: str
    value: object
    cell: Node
    shows_answers: bool


def guess_of(cell: Node) -> Guess | None:
    """Return the guess of a cell with the tag predict, None for other cells.

    It ends in `my_guess = guess('How many are received?', 41, on=range(42))`.
    """
    if 'predict' not in tags(cell):
        return None
    try:
        match ast.parse(_without_magics(cell.source)).body:
            case [
                *_,
                ast.Assign(
                    [ast.Name(variable)],
                    ast.Call(ast.Name('guess'), [ast.Constant(str(question)), value], words),
                ),
            ]:
                shows = any(word.arg == 'on' for word in words)
                return Guess(variable, question, ast.literal_eval(value), cell, shows)
    except (SyntaxError, ValueError):  # of a lesson that is being written
        pass
    return None


def compares(cell: Node, guess: Guess) -> bool:
    """Return whether a cell compares this guess with what was measured."""
    if cell.cell_type != 'code' or 'compare_prediction' not in cell.source:
        return False
    try:
        tree = ast.parse(_without_magics(cell.source))
    except SyntaxError:
        return False
    for node in ast.walk(tree):
        match node:
            case ast.Call(
                ast.Name('compare_prediction'), [ast.Constant(str(asked)), ast.Name(name), *_]
            ):
                if (asked, name) == (guess.question, guess.variable):
                    return True
    return False


def _without_magics(source: str) -> str:
    """Return the source of a cell as Python, where a magic is a call."""
    if not re.search(r'^\s*[%!]', source, re.MULTILINE):
        return source
    from IPython.core.inputtransformer2 import TransformerManager  # only tools come here

    return TransformerManager().transform_cell(source)


def names_of_memory(source: str) -> list[str] | None:
    """Return the questions that a cell asks from memory, None if it does not end in such a call."""
    try:
        body = ast.parse(source).body
    except SyntaxError:
        return None
    match body:
        case [*_, ast.Expr(ast.Call(ast.Name('remember'), [], words))]:
            dots = all(isinstance(word.value, ast.Constant) for word in words)
            if dots and all(word.value.value is ... for word in words):
                return [word.arg for word in words if word.arg]
    return None


def starts_memory(cell: Node) -> bool:
    """Return whether the questions from memory stand below this cell."""
    return cell.cell_type == 'markdown' and cell.source.startswith(MEMORY)


def step_number(cell: Node) -> int:
    """Return the number of the step that a cell begins, 0 if it begins none."""
    found = STEP.match(cell.source) if cell.cell_type == 'markdown' else None
    return int(found[1]) if found and found[1] else 0


def minutes_of_note(source: str) -> int:
    """Return the minutes that a note for the instructor names; 0 for what is none."""
    minutes = re.match(rf'{NOTE}: (\d+) minutes', source)
    return int(minutes[1]) if minutes else 0


def beside_time(opening: str, words: str) -> str:
    """Return an opening with its time, what may be left out, and these words on one line.

    An empty text if the opening says no time.
    """
    if not TIME.search(opening):
        return ''
    return TIME.sub(lambda found: ' · '.join(filter(None, found.groups())) + words, opening)


@dataclass(frozen=True)
class Lesson:
    """A notebook and its file name. What cannot be read raises ValueError with one sentence."""

    file: str
    notebook: Node

    @property
    def number(self) -> str:
        """The two digits of the file name: its place today."""
        return self.file[:2]

    @property
    def name(self) -> str:
        """What the file is called after its number, for ever."""
        return Path(self.file).stem[3:]

    @property
    def is_lesson(self) -> bool:
        """Whether this is neither the start nor the glossary."""
        return self.number not in (START, GLOSSARY)

    @property
    def cells(self) -> list[Node]:
        return self.notebook.cells

    @property
    def title(self) -> str:
        """The title without its number."""
        return self._find(r'# \d\d (.+)', self._opening, 'title such as `# 02 Lose messages`')[1]

    @property
    def title_or_name(self) -> str:
        """The title, or the name in words if a student has changed the title."""
        try:
            return self.title
        except ValueError:
            return self.name.replace('_', ' ').capitalize()

    @property
    def minutes(self) -> int:
        """The minutes that the opening promises."""
        wanted = r'^\*\*Time\*\*:? (\d+) minutes?\.?$'
        return int(self._find(wanted, self._opening, 'line `**Time** 40 minutes`')[1])

    @property
    def can(self) -> str:
        """What the reader can do at the end, as README.md and the map say it."""
        wanted = r'^\*\*At the end you can\*\*:? (.+?)\.?$'
        return self._find(wanted, self._opening, 'line `**At the end you can** ...`')[1]

    @property
    def part(self) -> str:
        """The part of the map in which the lesson stands, one of PARTS."""
        line = f'line `Part: ...` in its first note, with one of {", ".join(PARTS)}'
        return self._find(rf'^Part: ({"|".join(PARTS)})$', self._class_note, line)[1]

    @property
    def leave_out(self) -> str:
        """What a class leaves out first when time runs out; empty where nothing is named."""
        line = re.search(r'^When time runs out, leave out: (.+)$', self._class_note, re.MULTILINE)
        return line[1] if line else ''

    @property
    def next_link(self) -> str:
        """The link to this notebook, with number and title."""
        return f'[{self.number} {self.title}]({self.file})'

    @property
    def workspace(self) -> str:
        """The name of its workspace, empty if it has none."""
        found = [WORKSPACE.search(cell.source) for cell in self.cells if cell.cell_type == 'code']
        return next((match[1] for match in found if match), '')

    @property
    def has_solutions(self) -> bool:
        """Whether this edition of the lesson has a solution."""
        return any('solution' in tags(cell) for cell in self.code_cells())

    @property
    def packages(self) -> set[str]:
        """The packages of its workspace that its cells name: those of `src/fleet_pkg`."""
        return {name for cell in self.code_cells() for name in PACKAGE.findall(cell.source)}

    @cached_property
    def tasks(self) -> list[Task]:
        """The tasks, in their order, with their code cells up to the solution."""
        tasks: list[Task] = []
        inside = False
        for cell in self.cells:
            if cell.cell_type == 'markdown':
                if heading := HEADING.search(cell.source):
                    number, star = int(heading['number']), bool(heading['star'])
                    tasks.append(Task(number, heading['title'] or '', star, cell))
                    inside = True
                elif cell.source.startswith('#'):
                    inside = False
                continue
            if not inside or cell.cell_type != 'code':
                continue
            task, kind = tasks[-1], next((tag for tag in TASK if tag in tags(cell)), '')
            task.code.append(cell)
            if kind != 'solution' and task.solutions:
                inside = False
            elif kind:
                cells_of_kind = {
                    'exercise': task.exercises,
                    'check': task.checks,
                    'solution': task.solutions,
                }
                cells_of_kind[kind].append(cell)
        return tasks

    @cached_property
    def guesses(self) -> list[Guess]:
        """The guesses, in their order."""
        return [guess for cell in self.cells if (guess := guess_of(cell))]

    def comparison_of(self, guess: Guess) -> Node | None:
        """Return the cell that compares a guess with what was measured, the first one below it."""
        below = False
        for cell in self.cells:
            if below and compares(cell, guess):
                return cell
            below = below or cell is guess.cell
        return None

    @cached_property
    def steps(self) -> list[str]:
        """The step of each cell, such as `1`; empty before the first one."""
        steps, step = [], ''
        for cell in self.cells:
            if heading := STEP.match(cell.source):
                step = heading[1] or heading[2]
            steps.append(step)
        return steps

    @cached_property
    def minutes_by_step(self) -> dict[str, int]:
        """The minutes of the instructor's notes: `1`, `2`, ... to their sum."""
        minutes_by_step: dict[str, int] = {}
        for cell, step in zip(self.cells, self.steps, strict=True):
            if minutes := minutes_of_note(cell.source):
                minutes_by_step[step] = minutes_by_step.get(step, 0) + minutes
        return minutes_by_step

    def minutes_of(self, steps: tuple[int, int] | None) -> int:
        """Return the minutes of some steps, the first and the last one, or of the whole lesson."""
        if steps is None:
            return self.minutes
        unknown = [step for step in steps if str(step) not in self.minutes_by_step]
        if unknown:
            raise ValueError(f'{self.file}: step {unknown[0]} has no note with its minutes.')
        return sum(self.minutes_by_step.get(str(n), 0) for n in range(steps[0], steps[1] + 1))

    @cached_property
    def starred(self) -> list[Node]:
        """The cells below a heading with a star, which a reader may leave out."""
        found, level = [], 0  # of the heading with a star that is open; 0: none is
        for cell in self.cells:
            headings = ANY_HEADING.finditer(cell.source) if cell.cell_type == 'markdown' else ()
            for heading in headings:
                if not level or len(heading['signs']) <= level:
                    level = len(heading['signs']) if '★' in heading['title'] else 0
            if level:
                found.append(cell)
        return found

    def code_cells(self) -> Iterator[Node]:
        return (cell for cell in self.cells if cell.cell_type == 'code')

    @property
    def _opening(self) -> str:
        return self.cells[0].source if self.cells else ''

    @property
    def _class_note(self) -> str:
        return '\n'.join(cell.source for cell in self.cells if cell.cell_type == 'raw')

    def _find(self, pattern: str, text: str, missing: str) -> re.Match:
        if match := re.search(pattern, text, re.MULTILINE):
            return match
        raise ValueError(f'{self.file} needs a {missing}.')
