"""The rules that every notebook keeps: what the tests, the tables and the tools build on.

A rule looks at a notebook and yields a sentence for each thing that is wrong. tables.py checks what
`make notebooks` writes.
"""

import builtins
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from nbformat import NotebookNode

from helpers.checks import questions
from helpers.checks.verdict import verdict_in
from helpers.lesson import (
    FOLDED,
    FOLDER,
    GLOSSARY,
    NOTE,
    TAGS,
    TASK,
    Lesson,
    Task,
    bare_mentions,
    called,
    check_call,
    code_of_solution,
    has_heading,
    is_question,
    links_to_tasks,
    name_of_solution,
    names_of_memory,
    starts_memory,
    step_number,
    tags,
)
from helpers.notebook import names_of
from tools.lessons.code import given_away
from tools.lessons.comparison import comment_markers, metadata_tags

MAX_CODE_LINES = 24  # what a screen has room for
PICTURE = re.compile('src="data:image/png;base64,([^"]*)"')
MIN_WORDS = 6  # of an alternative text
REASON = '# Not compared: '
THIS_MACHINE = {str(Path(__file__).resolve().parents[2]), str(Path.home()), sys.prefix} - {'/'}
PATH = re.compile(
    r'(?<![\w.])/(?:home|root|tmp|work|usr|opt|var|mnt|srv|Users|private)\b(?:/\S*)?'
    # What follows `python3/` is a tree that Workspace.print_tree wrote, below the workspace.
    r'|\b[A-Z]:\\\S+|(?<!\S)(?!python3/)\S*(?:site|dist)-packages\S*|'
    + '|'.join(rf'{re.escape(folder)}\b' for folder in sorted(THIS_MACHINE))
)
BEHIND_AN_API = re.compile(r'^\s*(?:from|import) (helpers\.(\w+)\.(?!lessons\.)\w+)', re.MULTILINE)
# Of the module with its checks a lesson needs one name: all others belong to a package's API.
OF_THE_CHECKS = re.compile(
    r'^\s*(?:from|import) (helpers\.checks\.lessons\b.*(?<! import check)$)', re.MULTILINE
)
Rule = Callable[[Lesson], Iterator[str]]


# What the rules look at


def prose(lesson: Lesson) -> str:
    """Return the Markdown of all cells, without fenced code."""
    cells = (cell.source for cell in lesson.cells if cell.cell_type == 'markdown')
    return re.sub(r'^(```|~~~).*?^\1', '', '\n'.join(cells), flags=re.MULTILINE | re.DOTALL)


def texts(cell: NotebookNode) -> Iterator[str]:
    """Yield every output of a code cell that is text."""
    for output in cell.outputs:
        if output.output_type == 'stream':
            yield output.text
        yield from output.get('traceback', [])
        for kind, data in output.get('data', {}).items():
            if not kind.startswith('image/'):
                yield PICTURE.sub('', str(data))


def verdicts(cell: NotebookNode) -> list[dict]:
    """Return what the checks of a cell found, as data."""
    return list(filter(None, map(verdict_in, cell.outputs)))


def said(found: list[dict]) -> str:
    """Return what verdicts say is not right, to follow a sentence."""
    sentences = [verdict['note'] for verdict in found if verdict.get('note')]
    for verdict in found:
        for point in verdict['points']:
            if not point['ok']:
                sentences.append(f'"{point["what"]}": {point.get("found", "False")}')
    return f' {"; ".join(sentences)}' if sentences else ''


def alternative_texts(cell: NotebookNode) -> Iterator[str]:
    """Yield the text of each picture in a cell and in its outputs, an empty one if it has none."""
    if cell.cell_type == 'markdown':
        yield from re.findall(r'!\[([^\]]*)\]', cell.source)
    bundles = [output.get('data', {}) for output in cell.get('outputs', [])]
    yield from ['' for data in bundles for kind in data if kind.startswith('image/')]
    htmls = [cell.source] if cell.cell_type == 'markdown' else []
    htmls += [data.get('text/html', '') for data in bundles]
    for tag in re.findall(r'<img\b[^>]*>', '\n'.join(htmls)):
        alt = re.search(r'\balt="([^"]*)"', tag)
        yield alt[1] if alt else ''


# Outputs


def executed_in_order(lesson: Lesson) -> Iterator[str]:
    for count, cell in enumerate(lesson.code_cells(), 1):
        if cell.execution_count != count:
            yield (
                f'The cell {called(cell)} was run as number {cell.execution_count}, not {count}: '
                'run the whole notebook.'
            )


def prints_what_stays(lesson: Lesson) -> Iterator[str]:
    for cell in lesson.code_cells():
        for output in cell.outputs:
            plain = output.get('data', {}).get('text/plain', '')
            if output.get('name') == 'stderr':
                yield f'The cell {called(cell)} writes to stderr: {output.text.strip()!r}.'
            elif set(output.get('data', {})) == {'text/plain'} and re.match(
                r'[\[(]?(<|Text\(|array\(\[<)', plain
            ):
                yield f'The cell {called(cell)} leaves {plain!r}: assign the value to a name.'
        if path := next(filter(None, map(PATH.search, texts(cell))), None):
            yield f'The cell {called(cell)} shows {path[0]}, a path of this machine.'


def compared(lesson: Lesson) -> Iterator[str]:
    """All outputs are compared, but for the tag nbval-ignore-output with its reason."""
    for cell in lesson.code_cells():
        lines = [line.strip() for line in cell.source.splitlines()]
        comments = {line.lstrip('#').strip() for line in lines if line.startswith('#')}
        for marker in sorted(comments & set(comment_markers) | tags(cell) & set(metadata_tags)):
            if marker != 'nbval-ignore-output':
                yield (
                    f'The cell {called(cell)} has the marker {marker}: only the tag '
                    'nbval-ignore-output is used.'
                )
            elif not any(line.startswith(REASON) and line != REASON.strip() for line in lines):
                yield f'The cell {called(cell)} has the marker {marker} without "{REASON}...".'


def pictures_described(lesson: Lesson) -> Iterator[str]:
    """Every picture has a text of its own, for those who do not see it."""
    known: set[str] = set()
    for cell in lesson.cells:
        for alt in alternative_texts(cell):
            if len(alt.split()) < MIN_WORDS:
                yield (
                    f'The cell {called(cell)} has a picture without an alternative text of '
                    f'{MIN_WORDS} words or more: {alt!r}. helpers.plots.alt_text gives one to a '
                    'figure.'
                )
            elif alt in known:
                yield f'The cell {called(cell)}: another picture has the alternative text {alt!r}.'
            known.add(alt)


# Cells


def imports_from_apis(lesson: Lesson) -> Iterator[str]:
    for cell in lesson.code_cells():
        if found := BEHIND_AN_API.search(cell.source):
            yield (
                f'The cell {called(cell)} imports {found[1]}: a lesson imports from the API, '
                f'helpers.{found[2]}.'
            )
        if found := OF_THE_CHECKS.search(cell.source):
            yield (
                f'The cell {called(cell)} has `{found[0].strip()}`: a lesson imports its check '
                'alone from there, `import check`. What it needs to run is in the API of a package.'
            )


def names_stay(lesson: Lesson) -> Iterator[str]:
    """A cell that is run again, after the last one, takes from others what it took before."""
    cells = [
        (called(cell), names_of(cell.source))
        for cell in lesson.code_cells()
        if 'solution' not in tags(cell)
    ]
    for place, (reader, names) in enumerate(cells):
        for name in sorted(names.taken):
            before = [giver for giver, own in cells[:place] if name in own.given]
            after = [giver for giver, own in cells[place:] if name in own.given]
            if before and after:
                yield (
                    f'The cell {reader} takes {name!r} from {before[-1]}, and {after[0]} gives '
                    'the name to something else: run again, it takes that. Choose another name.'
                )


def solutions_import_what_they_use(lesson: Lesson) -> Iterator[str]:
    """A cell that begins with a magic is one that ruff does not read."""
    known = {*dir(builtins), '__name__', 'get_ipython', 'display'}
    for cell in lesson.code_cells():
        names = names_of(cell.source)
        known |= names.given | names.imported
    for cell in lesson.code_cells():
        source = code_of_solution(cell.source)
        if 'solution' in tags(cell) and not source.startswith('%%'):
            names = names_of(source)
            for name in sorted(names.taken - known):
                yield f'The cell {called(cell)} uses {name!r}, which no cell defines or imports.'


def steps_begin_cells(lesson: Lesson) -> Iterator[str]:
    """The title of a step is the first line of its cell: there a slide begins."""
    for cell in lesson.cells:
        if cell.cell_type == 'markdown' and (title := re.search(r'\n## (.*)', cell.source)):
            yield f'The step "{title[1]}" is inside a cell: let a cell of its own begin with it.'


def tagged(lesson: Lesson) -> Iterator[str]:
    """JupyterLab shows the first line of a folded cell, and unfolds Markdown when it runs it."""
    for cell in lesson.cells:
        name = f'The cell {called(cell)}'
        for tag in sorted(tags(cell) - TAGS):
            yield f'{name} has the unknown tag {tag!r}.'
        folded = tags(cell) & FOLDED.keys()
        if ('jupyter' in cell.metadata) != bool(folded):
            yield (
                f'{name}: fold cells with the tag {" or ".join(FOLDED)}, by a click on the bar '
                'at their left, and no others.'
            )
        for tag in folded - {'notes'}:
            if not cell.source.startswith(FOLDED[tag]):
                yield f'{name} has the tag {tag}: begin it with `{FOLDED[tag].strip()}`.'
        raw, noted = cell.cell_type == 'raw', 'notes' in tags(cell)
        if (raw or noted) and not (raw and noted and cell.source.startswith(f'{NOTE}: ')):
            yield (
                f'{name} is a note: make it a raw cell with the tag notes that begins with '
                f'`{NOTE}: `.'
            )


def fits_a_screen(lesson: Lesson) -> Iterator[str]:
    for cell in lesson.cells:
        lines = len(cell.source.splitlines())
        hidden = tags(cell) & FOLDED.keys()
        if cell.cell_type == 'code' and lines > MAX_CODE_LINES and not hidden:
            yield (
                f'The cell {called(cell)} has {lines} lines of code, more than {MAX_CODE_LINES}: '
                'make two cells of it. A file can stand in two: `%%write PATH part 1`, then '
                '`part 2`.'
            )


# The lesson


def named(lesson: Lesson) -> Iterator[str]:
    """The title is that of the file, and the opening says what the tables take from it."""
    try:
        words = lesson.title.lower().replace('c++', 'cpp')
        noted = sum(lesson.minutes_by_step.values())
        if lesson.is_lesson and lesson.can and lesson.part and noted != lesson.minutes:
            yield f'The notes take {noted} minutes, not {lesson.minutes}.'
    except ValueError as error:
        yield str(error)
        return
    if not lesson.cells[0].source.startswith(f'# {lesson.number} '):
        yield f'The title must begin with "# {lesson.number} ", as the file does.'
    if re.sub(r'[^a-z0-9]+', '_', words).strip('_') != lesson.name:
        yield f'The title {lesson.title!r} is not that of {lesson.file}.'


def links_lead_somewhere(lesson: Lesson) -> Iterator[str]:
    """Every relative link names a file, seen from the notebook's folder."""
    text = re.sub(r'`[^`\n]*`', '', prose(lesson))  # `[this](const auto & scan)` is no link
    for target in re.findall(r'\]\(([^)\s]+)', text):
        file = target.partition('#')[0]
        if not re.match(r'[a-z]+:|#', target) and not (FOLDER / file).exists():
            yield f'The link {target} leads nowhere.'


def mentions_are_links(lesson: Lesson) -> Iterator[str]:
    """A lesson or a task that a text calls by its number is a link: its number follows."""
    anchors = {task.anchor for task in lesson.tasks}
    for cell in lesson.cells:
        source = cell.source if cell.cell_type != 'code' else _comments(cell.source)
        for mention in bare_mentions(source):
            yield (
                f'The cell {called(cell)} says "{mention}", a number that no tool changes: write a '
                'link, [lesson 05](05_keep_what_is_fresh.ipynb) or [task 3](#✎-Task-3:-A-driver), '
                'or in code the name.'
            )
        for target in links_to_tasks(source):
            if target not in anchors:
                yield f'The link {target} leads to no task of this lesson.'


def _comments(source: str) -> str:
    return '\n'.join(line.partition('#')[2] for line in source.splitlines() if '#' in line)


def guesses_are_compared(lesson: Lesson) -> Iterator[str]:
    """The class is asked the question with which the guess is compared: no two are the same."""
    asked: set[str] = set()
    known = {guess.cell.id for guess in lesson.guesses}
    for cell in lesson.code_cells():
        if 'predict' in tags(cell) and cell.id not in known:
            yield (
                f'The cell {called(cell)} must end like this: '
                "`my_guess = guess('How many are heard?', ...)`."
            )
    for guess in lesson.guesses:
        if guess.value is not ...:
            yield f'The cell {called(guess.cell)} answers its question: write `...` for a student.'
        if not guess.shows_answers:
            yield (
                f'The cell {called(guess.cell)} does not show what may be answered: write `on=`, '
                'such as `on=bool`.'
            )
        if guess.question in asked:
            yield (
                f'The cell {called(guess.cell)} asks what another guess asks: {guess.question!r}.'
            )
        asked.add(guess.question)
        if lesson.comparison_of(guess) is None:
            yield (
                f'No later cell has compare_prediction({guess.question!r}, {guess.variable}, ...).'
            )


def answers_come_after_guesses(lesson: Lesson) -> Iterator[str]:
    """Between a question and its answer, no code and no heading says the answer: both are read."""
    for guess in lesson.guesses:
        compared = lesson.comparison_of(guess)
        if compared is None:
            continue  # guesses_are_compared says it
        said = re.search(r'^  The answer is (.+)\.$', '\n'.join(texts(compared)), re.MULTILINE)
        answer = said[1] if said else ''
        places = [place for place, c in enumerate(lesson.cells) if c is guess.cell or c is compared]
        for other in lesson.cells[places[0] + 1 : places[-1] + 1]:
            if other.cell_type == 'code' and 'solution' not in tags(other):
                for found in given_away(other.source, guess.question, answer):
                    yield (
                        f'The cell {called(other)} gives the answer of {guess.question!r} away '
                        f'before it is guessed: {found}. Let the code compute it.'
                    )
            elif len(answer) > 3 and has_heading(other, rf'#+ .*\b{re.escape(answer)}\b'):
                title = other.source.partition('\n')[0].lstrip('# ')
                yield f'The heading {title!r} has the answer of {guess.question!r}.'


def asks_from_memory(lesson: Lesson) -> Iterator[str]:
    """The first two lessons have nothing to ask about; all others open with two questions."""
    if not lesson.is_lesson:
        return
    cells = lesson.cells
    place = next((i for i, cell in enumerate(cells) if starts_memory(cell)), None)
    step = next((i for i, cell in enumerate(cells) if step_number(cell) == 1), len(cells))
    names = None
    if place is not None and place < step and place + 1 < len(cells):
        names = names_of_memory(cells[place + 1].source)
    if names is None or len({*names}) != 2:
        if place is not None or lesson.number > '02':
            yield (
                'Before step 1 the lesson needs a cell that begins with `## From memory`, and '
                'below it one of code with two questions: `remember(one_name=..., other_name=...)`.'
            )
        return
    for name in sorted({*names} - questions().keys()):
        yield f'The question {name} is not in helpers/checks/questions.yaml.'


def tasks_are_checked(lesson: Lesson) -> Iterator[str]:
    """The check finds the starter wanting and the solution right."""
    inside, names = 0, set()
    titles = [task.title for task in lesson.tasks]
    for place, task in enumerate(lesson.tasks, 1):
        said_by = f'"Task {task.number}"'
        if task.number != place or not task.title:
            yield (
                f'{said_by} must be called "### ✎ Task {place}: ...", or "Task {place} ★: ..." if '
                'it is beyond the core.'
            )
        if titles.count(task.title) > 1:
            yield f'{said_by} has the title of another task, and links know it by its title.'
        inside += len(task.cells)
        if not _has_its_cells(lesson, task):
            yield f'{said_by} needs cells with the tags {", ".join(TASK)}, in this order.'
            continue
        [check], [solution] = task.checks, task.solutions
        if check_call(check.source) is None or len(check.source.splitlines()) != 1:
            yield f"{said_by}: its check must be one line, `check('its_name', ...)`."
            continue
        if task.name in names:
            yield f'{said_by} is called {task.name}, as another task is.'
        names.add(task.name)
        if name_of_solution(solution.source) != task.name:
            yield f'{said_by}: its solution must begin with `%%solution {task.name}`.'
        starters, solutions = verdicts(check), verdicts(solution)
        if [verdict['solved'] for verdict in starters] != [False]:
            yield f'{said_by}: its check finds nothing missing in the starter.{said(starters)}'
        if [verdict['solved'] for verdict in solutions] != [True]:
            yield f'{said_by}: its solution does not pass its check.{said(solutions)}'
    if sum(bool(tags(cell) & set(TASK)) for cell in lesson.cells) != inside:
        yield 'A cell has the tag of a task, but is under no "### ✎ Task".'


def _has_its_cells(lesson: Lesson, task: Task) -> bool:
    """Return whether a task has starters, then one check, then one solution."""
    ids = [cell.id for cell in task.cells]
    in_order = [cell.id for cell in lesson.cells if cell.id in ids]
    one_each = len(task.checks) == len(task.solutions) == 1
    return bool(task.exercises) and one_each and in_order == ids


def questions_have_one_right_answer(lesson: Lesson) -> Iterator[str]:
    for cell in lesson.cells:
        if is_question(cell) and cell.source.count('**Right.**') != 1:
            yield f'The cell {called(cell)}: a question needs exactly one right answer.'


RULES: list[Rule] = [
    executed_in_order,
    prints_what_stays,
    compared,
    pictures_described,
    imports_from_apis,
    names_stay,
    solutions_import_what_they_use,
    steps_begin_cells,
    tagged,
    fits_a_screen,
    named,
    links_lead_somewhere,
    mentions_are_links,
    guesses_are_compared,
    answers_come_after_guesses,
    asks_from_memory,
    tasks_are_checked,
    questions_have_one_right_answer,
]


def problems(lesson: Lesson) -> list[str]:
    """Return what is wrong with a notebook, a sentence each."""
    return [sentence for rule in RULES for sentence in rule(lesson)]


def problems_of_all(lessons: list[Lesson]) -> list[str]:
    """Return what is wrong with the numbers and names of all notebooks, a sentence each."""
    sentences = [
        f'{lesson.file} is not of the form NN_verb_phrase.ipynb.'
        for lesson in lessons
        if not re.fullmatch(r'\d\d(_[a-z0-9]+)+\.ipynb', lesson.file)
    ]
    numbers = [lesson.number for lesson in lessons]
    wanted = [f'{count:02d}' for count in range(len(lessons) - 1)] + [GLOSSARY]
    if numbers != wanted:
        sentences.append(f'The numbers of the notebooks are {numbers}, and should be {wanted}.')
    return sentences
