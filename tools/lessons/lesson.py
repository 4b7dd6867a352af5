"""What is known of a lesson. All of it stands in the cells of its notebook.

The file name gives the number, and the lesson's name: `02_lose_messages.ipynb` is lesson 02, with
the name `lose_messages`, which stays when numbers change. The opening cell gives the title, the
minutes, and what the reader can do at the end. A note for the instructor, after the summary, says
where the lesson belongs:

    For the instructor: the lesson in a class

    Part: nodes
    Timetables: 90 minutes (steps 1 to 5), half a day
    When time runs out, leave out: step 8, exercise 2
"""

import re
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from pathlib import Path

import nbformat
from nbformat import NotebookNode

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / 'notebooks'
START, GLOSSARY = '00', '99'  # the notebooks that are no lessons
PARTS = ('nodes', 'packages', 'robot')
WORDS_A_MINUTE = 110  # of text that asks something
MINUTES_A_RUN = 3  # to run an exercise, and to read what its check says
LANGUAGES = {'fr': 'French', 'ur': 'Urdu', 'vi': 'Vietnamese'}  # of the summaries, beside English
NOTE = 'For the instructor'
FOLDED = re.compile(
    r'<details lang="(?P<lang>\w+)"(?P<rtl> dir="rtl")?>\n'
    r'<summary>[^<]+</summary>\n(?P<text>[^\n]+)\n</details>'
)


@dataclass(frozen=True)
class Lesson:
    """A notebook and its file name. What cannot be read raises ValueError with one sentence."""

    file: str
    notebook: NotebookNode

    @property
    def number(self) -> str:
        """The two digits of the file name."""
        return self.file[:2]

    @property
    def name(self) -> str:
        """What the file is called after its number."""
        return Path(self.file).stem[3:]

    @property
    def is_lesson(self) -> bool:
        """Whether this is neither the start nor the glossary."""
        return self.number not in (START, GLOSSARY)

    @property
    def title(self) -> str:
        """The title without its number."""
        return self._find(r'# \d\d (.+)', self._opening, 'title such as `# 02 Lose messages`')[1]

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
    def timetables(self) -> dict[str, tuple[int, int] | None]:
        """The timetables with this lesson, and its first and last step there; None for all."""
        found = {}
        line = re.search(r'^Timetables: (.+)$', self._class_note, re.MULTILINE)
        for entry in line[1].split(', ') if line else []:
            form = r'^([^()]+?)(?: \(steps? (\d+)(?: to (\d+))?\))?$'
            name, first, last = self._find(
                form, entry, 'timetable such as `half a day (steps 1 to 3)` in its first note'
            ).groups()
            found[name] = (int(first), int(last or first)) if first else None
        return found

    @property
    def leave_out(self) -> str:
        """What a class leaves out first when time runs out; empty where nothing is named."""
        found = re.search(r'^When time runs out, leave out: (.+)$', self._class_note, re.MULTILINE)
        return found[1] if found else ''

    @property
    def next_link(self) -> str:
        """The link to this notebook, with number and title."""
        return f'[{self.number} {self.title}]({self.file})'

    @property
    def summaries(self) -> dict[str, str]:
        """The texts of the cell after the opening by their languages, `en` among them."""
        source = self.notebook.cells[1].source if len(self.notebook.cells) > 1 else ''
        english = re.match(r'\*\*In short\*\*: ([^\n]+)', source)
        return ({'en': english[1]} if english else {}) | {
            found['lang']: found['text'] for found in FOLDED.finditer(source)
        }

    @property
    def exercises(self) -> list[str]:
        """The headings such as `Exercise 1: Two robots`, in their order."""
        text = '\n'.join(c.source for c in self.notebook.cells if c.cell_type == 'markdown')
        return re.findall(r'^### (Exercise \d.*)', text, re.MULTILINE)

    @cached_property
    def minutes_by_step(self) -> dict[str, int]:
        """The minutes of the instructor's notes: `1`, `2`, ..., `Exercises` to their sum."""
        found: dict[str, int] = {}
        step = ''
        for cell in self.notebook.cells:
            if heading := re.match(r'## (\w+)', cell.source):
                step = heading[1]
            if minutes := minutes_of_note(cell.source):
                found[step] = found.get(step, 0) + minutes
        return found

    @cached_property
    def minutes_alone(self) -> dict[str, int]:
        """The minutes of `Exercise 1`, ..., `Recap` and `Quiz` for one who works alone.

        They are computed, not measured: the words, and for an exercise MINUTES_A_RUN and a minute
        for each line of its solution that its starter does not have.
        """
        words: Counter[str] = Counter()
        work: Counter[str] = Counter()
        part, given = '', set()
        for cell in self.notebook.cells:
            new = {line.strip() for line in cell.source.splitlines()} - given - {''}
            if cell.cell_type == 'markdown':
                headings = re.findall(r'^###? (Exercise \d+|\w+)', cell.source, re.MULTILINE)
                part = next((one for one in reversed(headings) if one != 'Question'), part)
                words[part] += len(re.sub(r'<[^>]+>', ' ', cell.source).split())
            elif 'exercise' in tags(cell):
                given |= new
            elif 'solution' in tags(cell):
                work[part] += sum(not line.startswith(('#', 'check_')) for line in new)
            if part.startswith('Exercise ') and part not in work:
                work[part] = MINUTES_A_RUN
        return {
            name: ceil(words[name] / WORDS_A_MINUTE) + work[name]
            for name in words
            if name in work or name in ('Recap', 'Quiz')
        }

    def minutes_of(self, steps: tuple[int, int] | None) -> int:
        """Return the minutes of some steps, the first and the last one, or of the whole lesson."""
        if steps is None:
            return self.minutes
        unknown = [step for step in steps if str(step) not in self.minutes_by_step]
        if unknown:
            raise ValueError(f'{self.file}: step {unknown[0]} has no note with its minutes.')
        return sum(self.minutes_by_step.get(str(n), 0) for n in range(steps[0], steps[1] + 1))

    @property
    def _opening(self) -> str:
        return self.notebook.cells[0].source if self.notebook.cells else ''

    @property
    def _class_note(self) -> str:
        return '\n'.join(cell.source for cell in self.notebook.cells if cell.cell_type == 'raw')

    def _find(self, pattern: str, text: str, what: str) -> re.Match:
        if found := re.search(pattern, text, re.MULTILINE):
            return found
        raise ValueError(f'{self.file} needs a {what}.')


def tags(cell: NotebookNode) -> set[str]:
    """Return the tags of a cell."""
    return set(cell.metadata.get('tags', []))


def minutes_of_note(source: str) -> int:
    """Return the minutes that a note for the instructor names; 0 for what is none."""
    found = re.match(rf'{NOTE}: (\d+) minutes', source)
    return int(found[1]) if found else 0


def first_heading(text: str) -> str:
    """Return the words of the heading with which a text begins."""
    return text.splitlines()[0].lstrip('# ')


def read(text: str, file: str) -> Lesson:
    """Return the lesson of a notebook's text. Raises ValueError where it is no notebook."""
    try:
        return Lesson(file, nbformat.reads(text, as_version=4))
    except (nbformat.reader.NotJSONError, nbformat.ValidationError, AttributeError) as error:
        raise ValueError(f'{file} is no notebook: {str(error).splitlines()[0][:80]}.') from None


def paths(folder: Path = FOLDER) -> list[Path]:
    """Return the notebooks of a folder, in teaching order."""
    return sorted(folder.glob('*.ipynb'))


def lessons(folder: Path = FOLDER) -> list[Lesson]:
    """Return what the notebooks of a folder hold, in teaching order."""
    return [read(path.read_text(encoding='utf-8'), path.name) for path in paths(folder)]


def chosen(numbers: str, folder: Path = FOLDER) -> list[Path]:
    """Return the notebooks with these numbers, such as '02 03'; all of them for an empty text.

    Raises ValueError where a number is not that of exactly one notebook.
    """
    known = paths(folder)
    if not known:
        raise ValueError(f'There is no notebook in {folder}.')
    found = []
    for number in numbers.split():
        match = [path for path in known if path.name.startswith(f'{number}_')]
        if len(match) != 1:
            names = ', '.join(path.name[:2] for path in known)
            raise ValueError(f'There is no single lesson {number!r}. Give one of {names}.')
        found += match
    return sorted(set(found)) or known
