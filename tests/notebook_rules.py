"""The rules that every lesson keeps.

A rule takes a notebook (an nbformat node) and returns sentences about what is wrong, none where
all is well. GROUPS holds the rules by subject; test_notebooks.py applies them to the lessons.
The rules at the end need more than one notebook, and stand outside GROUPS.
"""

import ast
import re
import sys
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

from IPython.core.displayhook import DisplayHook
from IPython.core.inputtransformer2 import TransformerManager
from nbformat import NotebookNode
from nbval.plugin import comment_markers, metadata_tags

from helpers.progress import title_of
from tools.notebooks import clean, text_of
from tools.slides import PICTURE, SKIPPED, SLIDE, height, slide_types

MAX_CODE_LINES = 25
MAX_FILE_LINES = 36  # of a cell that writes a file, which cannot be cut in two
MAX_WORDS = 180
LEAST_WORDS = 6  # of an alternative text
EXERCISES = {'01': 1, '02': 2, '03': 2, '04': 2, '05': 2}  # at least; one in any other lesson
TAGS = {'predict', 'exercise', 'check', 'solution', 'nbval-ignore-output', 'deck-break', *SKIPPED}
LABELS = ['You will do', 'You will learn', 'You need', 'Time']
QUESTIONS = 3  # in each lesson's quiz
ANSWER = re.compile(
    r'<details><summary>([A-D])\. \S.*</summary>\n\n\*\*(Right|No)\.\*\* \S.*\n\n</details>'
)
NO_LESSON = {'00': 'the start', '99': 'the glossary'}
LABELS_OF_NO_LESSON = ['You will do', 'You need', 'Time']
REASON = '# Not compared: '
NOTE = 'For the instructor'
PATH_OF_A_MACHINE = re.compile(
    r'(?<![\w.])/(?:home|root|tmp|work|usr|opt|var|mnt|srv|Users|private)\b(?:/\S*)?'
    # What follows `python3/` is a tree that Workspace.print_tree wrote, below the workspace.
    r'|\b[A-Z]:\\\S+|(?<!\S)(?!python3/)\S*(?:site|dist)-packages\S*'
)
MOVES = {
    'a memory address': re.compile(r'\b0x[0-9a-fA-F]{6,}'),
    'a thread name that counts': re.compile(r'\b(?:Thread|Dummy|ThreadPoolExecutor)-\d\w*'),
}
THIS_MACHINE = {str(Path(__file__).resolve().parent.parent), str(Path.home()), sys.prefix} - {'/'}

Rule = Callable[[NotebookNode], list[str]]


# What the rules look at


def number(notebook: NotebookNode) -> str:
    """Return the two digits of the title, or an empty string."""
    found = re.match(r'# (\d\d) ', notebook.cells[0].source) if notebook.cells else None
    return found[1] if found else ''


def code_cells(notebook: NotebookNode) -> list[tuple[str, NotebookNode]]:
    """Return every code cell with its name for a reader: `code cell 1` and so on."""
    cells = [cell for cell in notebook.cells if cell.cell_type == 'code']
    return [(f'code cell {count}', cell) for count, cell in enumerate(cells, 1)]


def tags(cell: NotebookNode) -> list[str]:
    return cell.metadata.get('tags', [])


def prose(notebook: NotebookNode) -> Iterator[tuple[int, list[str]]]:
    """Yield each Markdown cell's index and its lines, without fenced code."""
    for index, cell in enumerate(notebook.cells):
        if cell.cell_type == 'markdown':
            text = re.sub(r'^(```|~~~).*?^\1', '', cell.source, flags=re.MULTILINE | re.DOTALL)
            yield index, text.splitlines()


def headings(notebook: NotebookNode) -> list[tuple[int, int, str]]:
    """Return (cell index, level, text) of every heading."""
    found = []
    for index, lines in prose(notebook):
        matches = (re.match(r'(#{1,6}) +(.*)', line) for line in lines)
        found += [(index, len(match[1]), match[2].strip()) for match in matches if match]
    return found


def sections(notebook: NotebookNode) -> dict[str, list[str]]:
    """Return the prose under the title ('') and under each second-level heading."""
    found: dict[str, list[str]] = {'': []}
    name = ''
    for _, lines in prose(notebook):
        for line in lines:
            if line.startswith('## '):
                name = line[3:].strip()
                found[name] = []
            else:
                found[name].append(line)
    return found


def label(line: str) -> str:
    """Return which of LABELS a line of prose opens with, or an empty string."""
    return next((name for name in LABELS if re.match(rf'\*\*{name}\b', line)), '')


def bold_bullets(lines: list[str]) -> list[str]:
    """Return the bold phrase of each bullet; a bullet that does not start bold gives ''."""
    bullets = [re.match(r'[-*] +(?:\*\*(.+?)\*\*)?', line) for line in lines]
    return [(bullet[1] or '').strip(' :.') for bullet in bullets if bullet]


def texts(cell: NotebookNode) -> Iterator[str]:
    """Yield every output of a code cell that is text."""
    for output in cell.outputs:
        if output.output_type == 'stream':
            yield output.text
        yield from output.get('traceback', [])
        for kind, data in output.get('data', {}).items():
            if not kind.startswith('image/'):
                yield PICTURE.sub('', str(data))


def printed(cell: NotebookNode, start: str) -> int:
    """Return how many lines of a cell's text outputs start with `start`."""
    return sum(line.startswith(start) for text in texts(cell) for line in text.splitlines())


# Execution and outputs


def executed_in_order(notebook: NotebookNode) -> list[str]:
    return [
        f'{name} has execution count {cell.execution_count}: execute the notebook top to bottom.'
        for count, (name, cell) in enumerate(code_cells(notebook), 1)
        if cell.execution_count != count
    ]


def no_errors(notebook: NotebookNode) -> list[str]:
    return [
        f'{name} shows the error {output.ename}.'
        for name, cell in code_cells(notebook)
        for output in cell.outputs
        if output.output_type == 'error'
    ]


def no_stderr(notebook: NotebookNode) -> list[str]:
    return [
        f'{name} writes to stderr: {output.text.strip()!r}.'
        for name, cell in code_cells(notebook)
        for output in cell.outputs
        if output.get('name') == 'stderr'
    ]


def no_machine_paths(notebook: NotebookNode) -> list[str]:
    found = []
    for name, cell in code_cells(notebook):
        for text in texts(cell):
            paths = [match[0] for match in PATH_OF_A_MACHINE.finditer(text)]
            paths += [path for path in THIS_MACHINE if path in text]
            found += [f'{name} shows {path}, a path of one machine.' for path in paths[:1]]
    return found


def nothing_moves(notebook: NotebookNode) -> list[str]:
    return [
        f'{name} shows {what}, {match[0]}: it changes from run to run.'
        for name, cell in code_cells(notebook)
        for text in texts(cell)
        for what, pattern in MOVES.items()
        if (match := pattern.search(text))
    ]


def no_object_echo(notebook: NotebookNode) -> list[str]:
    """A cell that ends with a plotting call must not leave `<Axes: ...>` behind."""
    return [
        f'{name} leaves {output.data["text/plain"]!r}: assign the value to a name.'
        for name, cell in code_cells(notebook)
        for output in cell.outputs
        if output.output_type == 'execute_result'
        and set(output.data) == {'text/plain'}
        and re.match(r'[\[(]?(<|Text\(|array\(\[<)', output.data['text/plain'])
    ]


def no_last_semicolon(notebook: NotebookNode) -> list[str]:
    """IPython finds the `;` in its history; nbval keeps none, and then sees the value."""
    return [
        f'{name} hides its value with ";", which nbval does not obey: assign it to a name.'
        for name, cell in code_cells(notebook)
        if (last := last_statement(cell.source))
        and isinstance(last, ast.Expr)
        and DisplayHook.semicolon_at_end_of_expression(cell.source)
    ]


def last_statement(source: str) -> ast.stmt | None:
    plain = TransformerManager().transform_cell(source)  # a magic becomes a call
    return next(reversed(ast.parse(plain).body), None)


def no_changed_outputs(notebook: NotebookNode) -> list[str]:
    """Jupyter clears and updates outputs; nbval compares them as they were first shown."""
    calls = re.compile(r'\bclear_output\(|\bupdate_display\(|\bdisplay_id=')
    return [
        f'{name} uses {match[0]}...): nbval does not follow it.'
        for name, cell in code_cells(notebook)
        if (match := calls.search(cell.source))
    ]


def pictures_described(notebook: NotebookNode) -> list[str]:
    """Every picture has a text of its own, for those who do not see it."""
    found, known = [], set()
    for index, cell in enumerate(notebook.cells, 1):
        for alt in alternative_texts(cell):
            if len(alt.split()) < LEAST_WORDS:
                found.append(
                    f'Cell {index} has a picture without an alternative text of {LEAST_WORDS} '
                    f'words or more: {alt!r}. helpers.alt_text gives one to a figure.'
                )
            elif alt in known:
                found.append(f'Cell {index}: another picture has the alternative text {alt!r}.')
            known.add(alt)
    return found


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


# What is compared


def nothing_ignored(notebook: NotebookNode) -> list[str]:
    """Only NBVAL_IGNORE_OUTPUT is allowed, and only with its reason beside it."""
    found = []
    for name, cell in code_cells(notebook):
        lines = [line.strip() for line in cell.source.splitlines()]
        comments = {line.lstrip('#').strip() for line in lines if line.startswith('#')}
        markers = comments & set(comment_markers) | set(tags(cell)) & set(metadata_tags)
        for marker in sorted(markers):
            if marker.upper().replace('-', '_') != 'NBVAL_IGNORE_OUTPUT':
                found.append(f'{name} has the marker {marker}, which no lesson may use.')
            elif not any(line.startswith(REASON) and line != REASON.strip() for line in lines):
                found.append(f'{name} has the marker {marker} without "{REASON}...".')
        if lines and lines[0].startswith('%%capture'):
            found.append(f'{name} hides its output with %%capture.')
    return found


def known_tags(notebook: NotebookNode) -> list[str]:
    return [
        f'Cell {index} has the unknown tag {tag!r}.'
        for index, cell in enumerate(notebook.cells, 1)
        for tag in tags(cell)
        if tag not in TAGS
    ]


# The file


def saved_clean(notebook: NotebookNode) -> list[str]:
    """A notebook is saved as tools/notebooks.py leaves it."""
    cleaned = clean(notebook)
    parts = ('id', 'metadata', 'outputs')
    found = [
        f'Cell {index} has {part} that `make notebooks` would clean.'
        for index, (cell, kept) in enumerate(zip(notebook.cells, cleaned.cells, strict=True), 1)
        for part in parts
        if cell.get(part) != kept.get(part)
    ]
    if notebook.metadata != cleaned.metadata:
        extra = ', '.join(sorted(set(notebook.metadata) - set(cleaned.metadata)))
        found.append(f'The notebook has metadata that `make notebooks` would clean: {extra}.')
    if (notebook.nbformat, notebook.nbformat_minor) != (4, 5):
        found.append('The notebook is not in nbformat 4.5.')
    return found


def hides_solutions_and_notes_only(notebook: NotebookNode) -> list[str]:
    return [
        f'Cell {index}: hide the source of a solution or of a note, and of nothing else.'
        for index, cell in enumerate(notebook.cells, 1)
        if ('jupyter' in cell.metadata) == {'solution', 'notes'}.isdisjoint(tags(cell))
    ]


def folded_solutions_keep_their_secret(notebook: NotebookNode) -> list[str]:
    """JupyterLab shows the first line of a folded cell."""
    return [
        f'{name} is a solution: begin it with `# Solution of exercise N`.'
        for name, cell in code_cells(notebook)
        if 'solution' in tags(cell) and not re.match(r'# Solution of exercise \d', cell.source)
    ]


# The spine


def has_title(notebook: NotebookNode) -> list[str]:
    first = notebook.cells[0] if notebook.cells else NotebookNode(cell_type='', source='')
    if first.cell_type == 'markdown' and re.match(r'# \d\d [A-Z][a-z]+ \w+', first.source):
        return []
    return ['The first cell must start with a title such as "# 02 Lose messages".']


def has_labels(notebook: NotebookNode) -> list[str]:
    wanted = LABELS_OF_NO_LESSON if number(notebook) in NO_LESSON else LABELS
    found = [name for line in sections(notebook)[''] if (name := label(line))]
    if [name for name in found if name in wanted] == wanted:
        return []
    return [f'Before the first step must stand, in bold and once each: {", ".join(wanted)}.']


def has_steps(notebook: NotebookNode) -> list[str]:
    """`## 1. ...` and so on, perhaps Exercises, then Recap, Quiz and In practice."""
    if number(notebook) in NO_LESSON:
        return []
    names = [text for _, level, text in headings(notebook) if level == 2]
    steps = [name for name in names if re.match(r'\d+\. \S', name)]
    found = []
    if not steps or [name.partition('.')[0] for name in steps] != [
        str(count) for count in range(1, len(steps) + 1)
    ]:
        found.append(f'The steps must be numbered from "## 1. ..." on: {steps}.')
    rest = names[len(steps) :]
    if names[: len(steps)] != steps or [name for name in rest if name != 'Exercises'] != [
        'Recap',
        'Quiz',
        'In practice',
    ]:
        found.append('After the steps must come "## Recap", "## Quiz" and, last, "## In practice".')
    return found


def headings_in_order(notebook: NotebookNode) -> list[str]:
    levels = [(0, '')] + [(level, text) for _, level, text in headings(notebook)]
    found = [
        f'The heading {text!r} is of level {level}, after one of level {before}.'
        for (before, _), (level, text) in pairwise(levels)
        if level > before + 1
    ]
    if [level for level, _ in levels].count(1) > 1:
        found.append('There is more than one heading of level 1.')
    return found


def recap_answers_opening(notebook: NotebookNode) -> list[str]:
    if number(notebook) in NO_LESSON:
        return []
    parts = sections(notebook)
    opening, name = [], ''
    for line in parts['']:
        name = label(line) or name
        opening += [line] if name == 'You will learn' else []
    promised, answered = bold_bullets(opening), bold_bullets(parts.get('Recap', []))
    found = []
    if not promised or not all(promised + answered):
        found.append('Each bullet of "You will learn" and of the recap must start with bold words.')
    if promised != answered:
        found.append(f'The recap answers {answered}, but the opening promised {promised}.')
    return found


def predicts(notebook: NotebookNode) -> list[str]:
    """A lesson asks for a guess, and every guess is compared in a later cell."""
    cells = code_cells(notebook)
    guesses = [count for count, (_, cell) in enumerate(cells) if 'predict' in tags(cell)]
    if not guesses and number(notebook) not in NO_LESSON:
        return ['There is no cell with the tag "predict".']
    found = []
    for count in guesses:
        name, cell = cells[count]
        last = last_statement(cell.source)
        targets = [ast.unparse(target) for target in getattr(last, 'targets', [])]
        later = [cell.source for _, cell in cells[count + 1 :]]
        if not targets:
            found.append(f'{name} must end with the guess, such as `my_guess = 41`.')
        elif not any(
            'compare_prediction(' in s and re.search(rf'\b{targets[0]}\b', s) for s in later
        ):
            found.append(f'No later cell gives {targets[0]} of {name} to compare_prediction.')
    return found


def words_to_read(source: str) -> int:
    """Return the number of words without markup; of texts in several languages, the longest."""
    texts = re.split(r'<details[^>]*>', source)
    return max(len(re.sub(r'<[^>]+>|\|', ' ', text).split()) for text in texts)


def fits_a_slide(notebook: NotebookNode) -> list[str]:
    found = []
    for index, cell in enumerate(notebook.cells, 1):
        lines, words = len(cell.source.splitlines()), words_to_read(cell.source)
        most = MAX_FILE_LINES if cell.source.startswith('%%write ') else MAX_CODE_LINES
        if cell.cell_type == 'code' and lines > most:
            found.append(f'Cell {index} has {lines} lines of code, more than {most}.')
        if cell.cell_type == 'markdown' and words > MAX_WORDS:
            found.append(f'Cell {index} has {words} words, more than {MAX_WORDS}.')
        if (percent := height(cell)) > SLIDE:
            found.append(f'Cell {index} with its outputs takes {percent:.0f} % of the height.')
    return found


def on_its_slide(notebook: NotebookNode) -> list[str]:
    """Every cell has the slide type that the rule of tools/slides.py gives it."""
    return [
        f'Cell {index} is not a {slide_type}: run tools/notebooks.py --clean-only.'
        for index, (cell, slide_type) in enumerate(
            zip(notebook.cells, slide_types(notebook), strict=True), 1
        )
        if cell.metadata.get('slideshow') != {'slide_type': slide_type}
    ]


def notes_name_the_reader(notebook: NotebookNode) -> list[str]:
    """JupyterLab shows the first line of a folded cell, and unfolds Markdown when it runs it."""
    return [
        f'Cell {index} is a note: make it a raw cell that begins with `{NOTE}`.'
        for index, cell in enumerate(notebook.cells, 1)
        if 'notes' in tags(cell) and not (cell.cell_type == 'raw' and cell.source.startswith(NOTE))
    ]


# Exercises


def exercises(notebook: NotebookNode) -> dict[str, list[NotebookNode]]:
    """Return the code cells of each exercise, by its heading."""
    found = {}
    marks = headings(notebook)
    for (index, level, text), following in zip(marks, [*marks[1:], None], strict=True):
        if level == 3 and text.startswith('Exercise '):
            end = following[0] if following else len(notebook.cells)
            found[text] = [c for c in notebook.cells[index:end] if c.cell_type == 'code']
    return found


def enough_exercises(notebook: NotebookNode) -> list[str]:
    names = list(exercises(notebook))
    least = 0 if number(notebook) in NO_LESSON else EXERCISES.get(number(notebook), 1)
    found = []
    if len(names) < least:
        found.append(f'There are {len(names)} exercises, fewer than {least}.')
    for count, name in enumerate(names, 1):
        if not re.match(rf'Exercise {count}: \S', name):
            found.append(f'{name!r} must be called "### Exercise {count}: ...".')
    return found


def exercises_complete(notebook: NotebookNode) -> list[str]:
    """Starter, check and solution stand in this order, and nowhere else."""
    letters = {'exercise': 'e', 'check': 'c', 'solution': 's'}
    found, inside = [], 0
    for name, cells in exercises(notebook).items():
        kinds = [
            next((letters[tag] for tag in tags(cell) if tag in letters), '-') for cell in cells
        ]
        inside += len(kinds) - kinds.count('-')
        if not re.fullmatch('e+cs+', ''.join(kinds)):
            found.append(f'{name!r} needs the tags exercise, check and solution, in this order.')
    if sum(not letters.keys().isdisjoint(tags(cell)) for cell in notebook.cells) != inside:
        found.append('A cell has the tag of an exercise, but stands under no "### Exercise".')
    return found


def exercises_checked(notebook: NotebookNode) -> list[str]:
    """The check finds the starter wanting, and the solution right, in every point."""
    found = []
    for name, cells in exercises(notebook).items():
        check = [cell for cell in cells if 'check' in tags(cell)]
        solution = [cell for cell in cells if 'solution' in tags(cell)]
        missing = sum(printed(cell, '[not yet]') for cell in check)
        points = missing + sum(printed(cell, '[ok]') for cell in check)
        passed = sum(printed(cell, '[ok]') for cell in solution)
        if not missing:
            found.append(f'{name!r}: its check finds nothing missing in the starter.')
        if passed != points or any(printed(cell, '[not yet]') for cell in solution):
            found.append(f'{name!r}: its solution does not pass all {points} points of the check.')
    return found


def exercises_recorded(notebook: NotebookNode) -> list[str]:
    """The check has the title that counts as the reader's progress, the solution has not."""
    found = []
    for count, (name, cells) in enumerate(exercises(notebook).items(), 1):
        title = title_of(number(notebook), count)
        counting = [cell for cell in cells if printed(cell, f'{title}: ')]
        if not any('check' in tags(cell) for cell in counting):
            found.append(f'{name!r}: give its check the title {title!r}.')
        if any('solution' in tags(cell) for cell in counting):
            found.append(f'{name!r}: give its solution another title than {title!r}.')
    return found


# The quiz


def questions(notebook: NotebookNode) -> list[str]:
    """Return the text of each question, with its answers."""
    found, inside = [], False
    for cell in notebook.cells:
        if cell.source.startswith('## '):
            inside = cell.source.startswith('## Quiz')
        elif inside and cell.cell_type == 'markdown':
            found.append(cell.source)
    return found


def enough_questions(notebook: NotebookNode) -> list[str]:
    found = questions(notebook)
    if 'Quiz' in sections(notebook) and len(found) != QUESTIONS:
        return [f'The quiz has {len(found)} questions, and not {QUESTIONS}, a cell each.']
    return [
        f'Question {count} must be called "### Question {count}: ...".'
        for count, text in enumerate(found, 1)
        if not re.match(rf'### Question {count}: \S', text)
    ]


def answers_with_reasons(notebook: NotebookNode) -> list[str]:
    """Three or four answers, one of them right, each with its reason, and nothing behind them."""
    found = []
    for count, text in enumerate(questions(notebook), 1):
        answers = ANSWER.findall(text)
        letters = ''.join(letter for letter, _ in answers)
        if letters not in ('ABC', 'ABCD') or not text.endswith('</details>'):
            found.append(f'Question {count} needs three or four answers, from A on, and no more.')
        if len(answers) != text.count('<details>'):
            found.append(
                f'Question {count}: an answer is not of the form A. answer, Right or No, why.'
            )
        if [verdict for _, verdict in answers].count('Right') != 1:
            found.append(f'Question {count} needs exactly one right answer.')
    return found


def right_answers_vary(notebook: NotebookNode) -> list[str]:
    """Who always chooses B must not always be right."""
    right = [
        letter for text in questions(notebook) for letter, v in ANSWER.findall(text) if v == 'Right'
    ]
    return ['The right answers all have the same letter.'] if right and len(set(right)) == 1 else []


GROUPS: dict[str, list[Rule]] = {
    'execution': [executed_in_order, no_errors, no_stderr],
    'outputs': [
        no_machine_paths,
        nothing_moves,
        no_object_echo,
        no_last_semicolon,
        no_changed_outputs,
        pictures_described,
    ],
    'compared': [nothing_ignored, known_tags],
    'file': [saved_clean, hides_solutions_and_notes_only, folded_solutions_keep_their_secret],
    'spine': [has_title, has_labels, has_steps, headings_in_order, recap_answers_opening, predicts],
    'exercises': [enough_exercises, exercises_complete, exercises_checked, exercises_recorded],
    'quiz': [enough_questions, answers_with_reasons, right_answers_vary],
    'slides': [fits_a_slide, on_its_slide, notes_name_the_reader],
}


def problems(notebook: NotebookNode, group: str) -> list[str]:
    """Return what is wrong by the rules of one group."""
    return [sentence for rule in GROUPS[group] for sentence in rule(notebook)]


# Rules for more than one notebook


def saved_as_jupyter_does(text: str, notebook: NotebookNode) -> list[str]:
    """`text` is what the file holds, `notebook` what was read from it."""
    if text == text_of(clean(notebook)):
        return []
    return ['The file is not what `make notebooks` would save: run it for this lesson.']


def teaching_order(names: list[str]) -> list[str]:
    """`names` are the file names in notebooks/, in any order."""
    if not names:
        return ['The folder notebooks/ holds no notebook.']
    pattern = re.compile(r'\d\d(_[a-z0-9]+)+\.ipynb')
    found = [
        f'{name} is not of the form NN_verb_phrase.ipynb.'
        for name in names
        if not pattern.fullmatch(name)
    ]
    numbers = sorted(name[:2] for name in names)
    if numbers[0] != '00':
        found.append(f'The first notebook is {numbers[0]}, not 00.')
    # A gap is a lesson that is not written yet.
    found += [f'Two notebooks have the number {a}.' for a, b in pairwise(numbers) if a == b]
    return found


def title_matches(name: str, notebook: NotebookNode) -> list[str]:
    """The file 02_lose_messages.ipynb has the title `# 02 Lose messages`; C++ is `cpp` in it."""
    title = notebook.cells[0].source.splitlines()[0].removeprefix('# ') if notebook.cells else ''
    words = title.lower().replace('c++', 'cpp')
    if re.sub(r'[^a-z0-9]+', '_', words).strip('_') == name.removesuffix('.ipynb'):
        return []
    return [f'The title {title!r} is not that of {name}.']


def links_lead_somewhere(notebook: NotebookNode, folder: Path) -> list[str]:
    """Every relative link names a file, seen from the notebook's folder."""
    return [
        f'The link {target} leads nowhere.'
        for target in links(notebook)
        if not re.match(r'[a-z]+:|#', target) and not (folder / target.partition('#')[0]).exists()
    ]


def maps_every_lesson(notebook: NotebookNode, names: list[str]) -> list[str]:
    """Lesson 00 holds the map: a link to every other notebook."""
    if number(notebook) != '00':
        return []
    others = sorted(name for name in names if not name.startswith('00'))
    return [f'The map has no link to {name}.' for name in others if name not in links(notebook)]


def links(notebook: NotebookNode) -> list[str]:
    """Return the targets of all Markdown links."""
    text = '\n'.join(line for _, lines in prose(notebook) for line in lines)
    return re.findall(r'\]\(([^)\s]+)', text)
