"""The rules that every lesson keeps.

A rule looks at a lesson and yields a sentence for each thing that is wrong. EVERY holds the rules
for all notebooks, LESSON those for lessons only. What `make notebooks` writes, tables.py compares.
"""

import re
import sys
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

from nbformat import NotebookNode
from nbval.plugin import comment_markers, metadata_tags

from helpers.progress import title_of
from tools.lessons.code import guess_of, names_of
from tools.lessons.lesson import FOLDED, FOLDER, GLOSSARY, LANGUAGES, NOTE, Lesson, tags
from tools.lessons.slides import PICTURE, SKIPPED, SLIDE, height

MAX_CODE_LINES = 24  # what a slide has room for
MAX_WORDS = 180
MIN_WORDS = 6  # of an alternative text
QUESTIONS = 3  # in each lesson's quiz
EXERCISE = ('exercise', 'check', 'solution')
TAGS = {'predict', 'nbval-ignore-output', 'deck-break', *EXERCISE, *SKIPPED}
LABELS = ['You will do', 'At the end you can', 'You will learn', 'You need', 'Time']
LABELS_OF_NO_LESSON = ['You will do', 'You need', 'Time']
LAST_SECTIONS = ['Recap', 'Quiz', 'In practice']
REASON = '# Not compared: '
ANSWER = re.compile(  # a summary is HTML, where backticks are shown as they are
    r'<details><summary>([A-D])\. [^`\n]+</summary>\n\n\*\*(Right|No)\.\*\* \S.*\n\n</details>'
)
THIS_MACHINE = {str(Path(__file__).resolve().parents[2]), str(Path.home()), sys.prefix} - {'/'}
PATH = re.compile(
    r'(?<![\w.])/(?:home|root|tmp|work|usr|opt|var|mnt|srv|Users|private)\b(?:/\S*)?'
    # What follows `python3/` is a tree that Workspace.print_tree wrote, below the workspace.
    r'|\b[A-Z]:\\\S+|(?<!\S)(?!python3/)\S*(?:site|dist)-packages\S*|'
    + '|'.join(rf'{re.escape(folder)}\b' for folder in sorted(THIS_MACHINE))
)
TERM = re.compile(
    r'\| \*\*(?P<term>[^*]+)\*\* \| (?P<meaning>[^|]+) \| <span lang="fr">(?P<fr>[^|]+)</span>'
    r' \| <span dir="rtl" lang="ur">(?P<ur>[^|]+)</span> \| <span lang="vi">(?P<vi>[^|]+)</span>'
    r' \| \[(?P<lesson>\d\d)\]\((?P=lesson)_\w+\.ipynb\) \|'
)

Rule = Callable[[Lesson], Iterator[str]]


# What the rules look at


def code_cells(lesson: Lesson) -> list[tuple[str, NotebookNode]]:
    """Return every code cell with its name for a reader: `code cell 1` and so on."""
    cells = [cell for cell in lesson.notebook.cells if cell.cell_type == 'code']
    return [(f'code cell {count}', cell) for count, cell in enumerate(cells, 1)]


def prose(lesson: Lesson) -> Iterator[tuple[int, str]]:
    """Yield each line of Markdown with its cell's index, without fenced code."""
    for index, cell in enumerate(lesson.notebook.cells):
        if cell.cell_type == 'markdown':
            text = re.sub(r'^(```|~~~).*?^\1', '', cell.source, flags=re.MULTILINE | re.DOTALL)
            yield from ((index, line) for line in text.splitlines())


def headings(lesson: Lesson) -> list[tuple[int, int, str]]:
    """Return (cell index, level, text) of every heading."""
    found = ((index, re.match(r'(#{1,6}) +(.*)', line)) for index, line in prose(lesson))
    return [(index, len(match[1]), match[2].strip()) for index, match in found if match]


def sections(lesson: Lesson) -> dict[str, list[str]]:
    """Return the prose under the title ('') and under each second-level heading."""
    found: dict[str, list[str]] = {'': []}
    name = ''
    for _, line in prose(lesson):
        if line.startswith('## '):
            name = line[3:].strip()
        found.setdefault(name, []).append(line)
    return found


def label(line: str) -> str:
    """Return which of LABELS a line of prose opens with, or an empty string."""
    return next((name for name in LABELS if re.match(rf'\*\*{name}\b', line)), '')


def labelled(lesson: Lesson, wanted: str) -> list[str]:
    """Return the lines of the opening that stand under one of LABELS."""
    found, name = [], ''
    for line in sections(lesson)['']:
        name = label(line) or name
        found += [line] if name == wanted else []
    return found


def section_names(lesson: Lesson) -> list[str]:
    """Return what is before the dot in each second-level heading: `1`, `2`, `Exercises`, ..."""
    return [text.partition('.')[0] for _, level, text in headings(lesson) if level == 2]


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


def printed(cells: list[NotebookNode], start: str) -> int:
    """Return how many lines of the cells' text outputs start with `start`."""
    lines = [line for cell in cells for text in texts(cell) for line in text.splitlines()]
    return sum(line.startswith(start) for line in lines)


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


def exercises(lesson: Lesson) -> dict[str, list[NotebookNode]]:
    """Return the code cells of each exercise, by its heading."""
    found = {}
    marks = headings(lesson)
    cells = lesson.notebook.cells
    for (index, level, text), following in zip(marks, [*marks[1:], None], strict=True):
        if level == 3 and text.startswith('Exercise '):
            end = following[0] if following else len(cells)
            found[text] = [cell for cell in cells[index:end] if cell.cell_type == 'code']
    return found


# Outputs


def executed_in_order(lesson: Lesson) -> Iterator[str]:
    for count, (name, cell) in enumerate(code_cells(lesson), 1):
        if cell.execution_count != count:
            yield f'{name} has execution count {cell.execution_count}: run the whole notebook.'


def prints_what_stays(lesson: Lesson) -> Iterator[str]:
    for name, cell in code_cells(lesson):
        for output in cell.outputs:
            plain = output.get('data', {}).get('text/plain', '')
            if output.get('name') == 'stderr':
                yield f'{name} writes to stderr: {output.text.strip()!r}.'
            elif set(output.get('data', {})) == {'text/plain'} and re.match(
                r'[\[(]?(<|Text\(|array\(\[<)', plain
            ):
                yield f'{name} leaves {plain!r}: assign the value to a name.'
        if found := next(filter(None, map(PATH.search, texts(cell))), None):
            yield f'{name} shows {found[0]}, a path of one machine.'


def compared(lesson: Lesson) -> Iterator[str]:
    """All outputs are compared, but for the tag nbval-ignore-output with its reason."""
    for name, cell in code_cells(lesson):
        lines = [line.strip() for line in cell.source.splitlines()]
        comments = {line.lstrip('#').strip() for line in lines if line.startswith('#')}
        for marker in sorted(comments & set(comment_markers) | tags(cell) & set(metadata_tags)):
            if marker != 'nbval-ignore-output':
                yield f'{name} has the marker {marker}: only the tag nbval-ignore-output is used.'
            elif not any(line.startswith(REASON) and line != REASON.strip() for line in lines):
                yield f'{name} has the marker {marker} without "{REASON}...".'


def pictures_described(lesson: Lesson) -> Iterator[str]:
    """Every picture has a text of its own, for those who do not see it."""
    known: set[str] = set()
    for index, cell in enumerate(lesson.notebook.cells, 1):
        for alt in alternative_texts(cell):
            if len(alt.split()) < MIN_WORDS:
                yield (
                    f'Cell {index} has a picture without an alternative text of {MIN_WORDS} '
                    f'words or more: {alt!r}. helpers.alt_text gives one to a figure.'
                )
            elif alt in known:
                yield f'Cell {index}: another picture has the alternative text {alt!r}.'
            known.add(alt)


# Cells


def names_stay(lesson: Lesson) -> Iterator[str]:
    """A cell that is run again, after the last one, takes from others what it took before."""
    cells = [
        (name, *names_of(cell)) for name, cell in code_cells(lesson) if 'solution' not in tags(cell)
    ]
    for place, (name, _, taken) in enumerate(cells):
        for word in sorted(taken):
            before = [one for one, given, _ in cells[:place] if word in given]
            after = [one for one, given, _ in cells[place:] if word in given]
            if before and after:
                yield (
                    f'{name} takes {word!r} from {before[-1]}, and {after[0]} gives the name to '
                    f'something else: who runs {name} again gets that. Choose another name.'
                )


def tagged(lesson: Lesson) -> Iterator[str]:
    """JupyterLab shows the first line of a folded cell, and unfolds Markdown when it runs it."""
    for index, cell in enumerate(lesson.notebook.cells, 1):
        for tag in sorted(tags(cell) - TAGS):
            yield f'Cell {index} has the unknown tag {tag!r}.'
        folded = tags(cell) & {'solution', 'notes'}
        if ('jupyter' in cell.metadata) != bool(folded):
            yield f'Cell {index}: hide the source of a solution or a note, and of nothing else.'
        raw, noted = cell.cell_type == 'raw', 'notes' in tags(cell)
        if (raw or noted) and not (raw and noted and cell.source.startswith(f'{NOTE}: ')):
            yield (
                f'Cell {index} is a note: make it a raw cell with the tag notes that begins with '
                f'`{NOTE}: `.'
            )
        if 'solution' in tags(cell) and not re.match(r'# Solution of exercise \d', cell.source):
            yield f'Cell {index} is a solution: begin it with `# Solution of exercise N`.'


def fits_a_slide(lesson: Lesson) -> Iterator[str]:
    for index, cell in enumerate(lesson.notebook.cells, 1):
        lines = len(cell.source.splitlines())
        if cell.cell_type == 'code' and lines > MAX_CODE_LINES:
            yield (
                f'Cell {index} has {lines} lines of code, more than {MAX_CODE_LINES}: make two '
                'cells of it. A file can stand in two: `%%write PATH part 1`, then `part 2`.'
            )
        # Of a text in several languages, which a reader unfolds one by one, the longest counts.
        parts = re.split(r'<details[^>]*>', cell.source)
        words = max(len(re.sub(r'<[^>]+>|\|', ' ', part).split()) for part in parts)
        if cell.cell_type == 'markdown' and words > MAX_WORDS:
            yield f'Cell {index} has {words} words, more than {MAX_WORDS}.'
        if (percent := height(cell)) > SLIDE:
            yield f'Cell {index} with its outputs takes {percent:.0f} % of the height.'


# The spine


def opens(lesson: Lesson) -> Iterator[str]:
    try:
        words = lesson.title.lower().replace('c++', 'cpp')
    except ValueError as error:
        yield str(error)
        return
    if not lesson.notebook.cells[0].source.startswith(f'# {lesson.number} '):
        yield f'The title must begin with "# {lesson.number} ", as the file does.'
    if re.sub(r'[^a-z0-9]+', '_', words).strip('_') != lesson.name:
        yield f'The title {lesson.title!r} is not that of {lesson.file}.'
    wanted = LABELS if lesson.is_lesson else LABELS_OF_NO_LESSON
    if [name for line in sections(lesson)[''] if (name := label(line)) in wanted] != wanted:
        yield f'Before the first step must stand, in bold and once each: {", ".join(wanted)}.'


def headings_in_order(lesson: Lesson) -> Iterator[str]:
    levels = [(0, '')] + [(level, text) for _, level, text in headings(lesson)]
    for (before, _), (level, text) in pairwise(levels):
        if level > before + 1:
            yield f'The heading {text!r} is of level {level}, after one of level {before}.'
    if [level for level, _ in levels].count(1) > 1:
        yield 'There is more than one heading of level 1.'


def links_lead_somewhere(lesson: Lesson) -> Iterator[str]:
    """Every relative link names a file, seen from the notebook's folder."""
    for target in re.findall(r'\]\(([^)\s]+)', '\n'.join(line for _, line in prose(lesson))):
        file = target.partition('#')[0]
        if not re.match(r'[a-z]+:|#', target) and not (FOLDER / file).exists():
            yield f'The link {target} leads nowhere.'


def steps(lesson: Lesson) -> Iterator[str]:
    """`## 1. ...` and so on, perhaps Exercises, then Recap, Quiz and In practice."""
    names = [text for _, level, text in headings(lesson) if level == 2]
    numbered = [name for name in names if re.match(r'\d+\. \S', name)]
    if not numbered or any(
        not name.startswith(f'{count}. ') for count, name in enumerate(numbered, 1)
    ):
        yield f'The steps must be numbered from "## 1. ..." on: {numbered}.'
    rest = [name for name in names[len(numbered) :] if name != 'Exercises']
    if names[: len(numbered)] != numbered or rest != LAST_SECTIONS:
        yield f'After the steps must come, each with "## ": {", ".join(LAST_SECTIONS)}.'


def says_where_it_belongs(lesson: Lesson) -> Iterator[str]:
    """The notes take the minutes that the opening promises, and the first one names the part."""
    try:
        noted = sum(lesson.minutes_by_step.values())
        if lesson.part and noted != lesson.minutes:
            yield f'The notes take {noted} minutes, not {lesson.minutes}.'
        for bounds in lesson.timetables.values():
            lesson.minutes_of(bounds)
    except ValueError as error:
        yield str(error)


def steps_have_minutes(lesson: Lesson) -> Iterator[str]:
    """A note says how long a step takes, or several: `8 minutes, for steps 1 and 2`."""
    noted = {*lesson.minutes_by_step, *LAST_SECTIONS}
    text = '\n'.join(cell.source for cell in lesson.notebook.cells if 'notes' in tags(cell))
    for first, last in re.findall(r'minutes, for steps (\d+) (?:and|to) (\d+)', text):
        noted |= {str(step) for step in range(int(first), int(last) + 1)}
    for name in section_names(lesson):
        if name not in noted:
            yield f'No note below "## {name}" says how many minutes it takes.'


def leaves_out_what_is_there(lesson: Lesson) -> Iterator[str]:
    there = {f'Step {name}' for name in section_names(lesson)}
    there |= {name.partition(':')[0] for name in exercises(lesson)}
    named = re.findall(r'(step|exercise)s? (\d+)(?: (?:and|to) (\d+))?', lesson.leave_out)
    for kind, *numbers in named:
        for number in filter(None, numbers):
            if f'{kind.capitalize()} {number}' not in there:
                yield f'The first note leaves out {kind} {number}, which is not there.'


def needs_what_came_before(lesson: Lesson) -> Iterator[str]:
    needed = ' '.join(labelled(lesson, 'You need'))
    for number in re.findall(r'(?:[Ll]essons?|,| and| to) (\d\d)\b', needed):
        if number >= lesson.number:
            yield f'"You need" names lesson {number}, which does not come before this one.'


def recap_answers_opening(lesson: Lesson) -> Iterator[str]:
    promised = bold_bullets(labelled(lesson, 'You will learn'))
    answered = bold_bullets(sections(lesson).get('Recap', []))
    if not promised or not all(promised + answered):
        yield 'Each bullet of "You will learn" and of the recap must start with bold words.'
    if promised != answered:
        yield f'The recap answers {answered}, but the opening promised {promised}.'


def practice_is_backed(lesson: Lesson) -> Iterator[str]:
    """A bullet of "In practice" names the step that shows it, or has a link to what says so."""
    known = set(section_names(lesson))
    text = '\n'.join(sections(lesson).get('In practice', []))
    for bullet in re.findall(r'^[-*] .*(?:\n +\S.*)*', text, re.MULTILINE):
        shown = known & set(re.findall(r'\b[Ss]teps? (\d+)', bullet))
        if not shown and not re.search(r'\]\((https?://|\d\d_\w+\.ipynb)', bullet):
            yield f'"In practice" gives no source, link or step of this lesson for: {bullet[:60]}.'


def has_what_a_lesson_has(lesson: Lesson) -> Iterator[str]:
    if not any('predict' in tags(cell) for _, cell in code_cells(lesson)):
        yield 'There is no cell with the tag "predict".'
    if not exercises(lesson):
        yield 'There is no "### Exercise 1: ...".'
    if len(questions(lesson)) != QUESTIONS:
        yield f'The quiz needs {QUESTIONS} questions, a cell each.'


def guesses_are_compared(lesson: Lesson) -> Iterator[str]:
    """The class is asked the question with which the guess is compared: no two are the same."""
    cells, asked = code_cells(lesson), set()
    for count, (name, cell) in enumerate(cells, 1):
        if 'predict' not in tags(cell):
            continue
        if (found := guess_of(cell)) is None:
            yield f"{name} must end like this: `my_guess = guess('How many are heard?', 41)`."
            continue
        guess, question, _ = found
        if question in asked:
            yield f'{name} asks what another guess asks: {question!r}.'
        asked.add(question)
        compared = rf'compare_prediction\(\s*{re.escape(repr(question))},\s*{guess}\b'
        if not any(re.search(compared, later.source) for _, later in cells[count:]):
            yield f'No later cell has compare_prediction({question!r}, {guess}, ...).'


def exercises_are_checked(lesson: Lesson) -> Iterator[str]:
    """The check finds the starter wanting and the solution right, and counts as progress."""
    inside = 0
    for count, (name, cells) in enumerate(exercises(lesson).items(), 1):
        if not re.match(rf'Exercise {count}: \S', name):
            yield f'{name!r} must be called "### Exercise {count}: ...".'
        kinds = [tag[0] for cell in cells for tag in EXERCISE if tag in tags(cell)]
        inside += len(kinds)
        if len(kinds) != len(cells) or not re.fullmatch('e+c+s+', ''.join(kinds)):
            yield f'{name!r} needs cells with the tags {", ".join(EXERCISE)}, in this order.'
        check = [cell for cell in cells if 'check' in tags(cell)]
        solution = [cell for cell in cells if 'solution' in tags(cell)]
        missing, title = printed(check, '[not yet]'), title_of(lesson.number, count)
        if not missing:
            yield f'{name!r}: its check finds nothing missing in the starter.'
        points = missing + printed(check, '[ok]')
        if printed(solution, '[ok]') != points or printed(solution, '[not yet]'):
            yield f'{name!r}: its solution does not pass all {points} points of the check.'
        if not printed(check, f'{title}: '):
            yield f'{name!r}: give its check the title {title!r}.'
        if printed(solution, f'{title}: '):
            yield f'{name!r}: give its solution another title than {title!r}.'
    if sum(bool(tags(cell) & set(EXERCISE)) for cell in lesson.notebook.cells) != inside:
        yield 'A cell has the tag of an exercise, but stands under no "### Exercise".'


# The quiz


def questions(lesson: Lesson) -> list[str]:
    """Return the text of each question, with its answers."""
    found, inside = [], False
    for cell in lesson.notebook.cells:
        if cell.source.startswith('## '):
            inside = cell.source.startswith('## Quiz')
        elif inside and cell.cell_type == 'markdown':
            found.append(cell.source)
    return found


def answers_have_reasons(lesson: Lesson) -> Iterator[str]:
    """Three or four answers, one of them right, each with its reason, and nothing after them."""
    right = []
    for count, text in enumerate(questions(lesson), 1):
        if not re.match(rf'### Question {count}: \S', text):
            yield f'Question {count} must be called "### Question {count}: ...".'
        answers = ANSWER.findall(text)
        letters = ''.join(letter for letter, _ in answers)
        if letters not in ('ABC', 'ABCD') or not text.endswith('</details>'):
            yield f'Question {count} needs three or four answers, from A on, and no more.'
        if len(answers) != text.count('<details>'):
            yield f'Question {count}: an answer is not A. text (<code>, no `), Right or No, why.'
        right += [letter for letter, verdict in answers if verdict == 'Right']
        if len(right) != count:
            yield f'Question {count} needs exactly one right answer.'
            return
    if right and len(set(right)) == 1:  # who always chooses B must not always be right
        yield 'The right answers all have the same letter.'


# The languages


def summary_in_languages(lesson: Lesson) -> Iterator[str]:
    """English is needed; what there is in other languages is checked."""
    found = lesson.summaries
    source = lesson.notebook.cells[1].source if len(lesson.notebook.cells) > 1 else ''
    if 'en' not in found:
        yield 'The second cell must begin with "**In short**: " and the summary in English.'
    if source.count('<details') != len(found.keys() & LANGUAGES.keys()):
        yield f'A summary is not folded as the others are, in one of {", ".join(LANGUAGES)}.'
    for match in FOLDED.finditer(source):
        if (match['lang'] == 'ur') != bool(match['rtl']):
            yield 'Urdu, and nothing else, is written right to left.'
    for language, text in found.items():
        if not 1 <= len(re.findall(r'[.?؟۔](?=\s|$)', text)) <= 3:
            yield f'{language}: write one to three sentences.'
        yield from written_left_to_right(language, text)


def written_left_to_right(language: str, text: str) -> Iterator[str]:
    """Urdu would turn Latin letters around."""
    plain = re.sub(r'<bdi dir="ltr">.*?</bdi>', '', text)
    if language == 'ur' and (latin := re.search('[A-Za-z+]+', plain)):
        yield f'ur: write <bdi dir="ltr">{latin[0]}</bdi>.'


def terms(glossary: Lesson) -> list[dict[str, str]]:
    """Return the rows of the glossary's tables; a row that is not as TERM wants it gives {}."""
    rows = [line for _, line in prose(glossary) if line.startswith('| **')]
    return [found.groupdict() if (found := TERM.fullmatch(line)) else {} for line in rows]


def glossary_fits(glossary: Lesson, lessons: list[Lesson]) -> Iterator[str]:
    """Each term is said in the lesson that it names, and summaries use the glossary's words."""
    rows, seen = terms(glossary), set()
    spoken = {one.number: '\n'.join(line for _, line in prose(one)) for one in lessons}
    for number, row in enumerate(rows, 1):
        if not row:
            yield f'Row {number} of the glossary is not term, meaning, fr, ur, vi, lesson.'
            continue
        stem = re.escape(row['term'].removesuffix('y'))
        words = rf'\b{stem}(y|s|es|ies)?\b'
        if not re.search(words, spoken.get(row['lesson'], ''), re.IGNORECASE):
            yield f'Lesson {row["lesson"]} never says {row["term"]}.'
        if row['term'].lower() in seen:
            yield f'{row["term"]} stands twice in the glossary.'
        seen.add(row['term'].lower())
        yield from written_left_to_right('ur', row['ur'])
    for one in lessons:
        for language in LANGUAGES.keys() & one.summaries.keys():
            text, known = one.summaries[language], [row[language] for row in rows if row]
            for bracket in re.findall(r'\((?:<bdi[^>]*>)?.+?\)', text):
                if not any(w.endswith(bracket) and w.lower() in text.lower() for w in known):
                    yield (f'{one.file}: {bracket} stands after another word than in the glossary.')


def notes_name_what_was_shown(lessons: list[Lesson]) -> Iterator[str]:
    """A note names lessons that come before its own, in each timetable that holds its own."""
    known = {one.number: set(map(days_of, one.timetables)) for one in lessons if one.is_lesson}
    for one in lessons:
        notes = [cell.source for cell in one.notebook.cells if 'notes' in tags(cell)]
        for number in re.findall(r'[Ll]essons? (\d\d)', '\n'.join(notes)):
            missing = known.get(one.number, set()) - known.get(number, set())
            if number > one.number:
                yield f'{one.file}: a note names lesson {number}, which comes later.'
            elif missing:
                yield f'{one.file}: a note names lesson {number}, which is not in {min(missing)}.'


def days_of(timetable: str) -> str:
    """Return the name of a timetable without its day: `two days` for `the second of two days`."""
    return timetable.rpartition(' of ')[2]


EVERY: list[Rule] = [
    executed_in_order,
    prints_what_stays,
    compared,
    pictures_described,
    names_stay,
    tagged,
    fits_a_slide,
    opens,
    headings_in_order,
    links_lead_somewhere,
    guesses_are_compared,
    exercises_are_checked,
    summary_in_languages,
]
LESSON: list[Rule] = [
    steps,
    says_where_it_belongs,
    steps_have_minutes,
    leaves_out_what_is_there,
    needs_what_came_before,
    recap_answers_opening,
    has_what_a_lesson_has,
    practice_is_backed,
    answers_have_reasons,
]


def problems(lesson: Lesson) -> list[str]:
    """Return what is wrong with a notebook, a sentence each."""
    rules = EVERY + (LESSON if lesson.is_lesson else [])
    return [sentence for rule in rules for sentence in rule(lesson)]


def problems_of_all(lessons: list[Lesson]) -> list[str]:
    """Return what is wrong among all notebooks: their numbers, and the glossary."""
    numbers = [lesson.number for lesson in lessons]
    found = [
        f'{lesson.file} is not of the form NN_verb_phrase.ipynb.'
        for lesson in lessons
        if not re.fullmatch(r'\d\d(_[a-z0-9]+)+\.ipynb', lesson.file)
    ]
    wanted = [f'{count:02d}' for count in range(len(lessons) - 1)] + [GLOSSARY]
    if numbers != wanted:
        found.append(f'The numbers of the notebooks are {numbers}, and should be {wanted}.')
    found += notes_name_what_was_shown(lessons)
    glossary = [lesson for lesson in lessons if lesson.number == GLOSSARY]
    return found + [sentence for one in glossary for sentence in glossary_fits(one, lessons)]
