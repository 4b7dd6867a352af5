"""What is known of a lesson. All of it stands in the cells of its notebook.

The file name gives the number, and the lesson's name: `02_lose_messages.ipynb` is lesson 02, with
the name `lose_messages`, which stays when numbers change. The opening cell gives the title, the
minutes, and what the reader can do at the end. A note for the instructor, after the summary, says
where the lesson belongs:

    For the instructor: the lesson in a class

    Part: nodes
    When time runs out, leave out: step 8, task 2
"""

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import nbformat
from nbformat import NotebookNode

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / 'notebooks'
PICTURES = 'images'  # of the lessons, beside them
START, GLOSSARY = '00', '99'  # the notebooks that are no lessons
PARTS = ('nodes', 'packages', 'robot')
NOTE = 'For the instructor'
WORKSPACE = re.compile(r"\bWorkspace\('([\w-]+)'\)")
LONGEST_NAME = 40  # letters of a cell's first line that are enough to find it


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
    def leave_out(self) -> str:
        """What a class leaves out first when time runs out; empty where nothing is named."""
        line = re.search(r'^When time runs out, leave out: (.+)$', self._class_note, re.MULTILINE)
        return line[1] if line else ''

    @property
    def next_link(self) -> str:
        """The link to this notebook, with number and title."""
        return f'[{self.number} {self.title}]({self.file})'

    @property
    def tasks(self) -> list[str]:
        """The headings such as `Task 1: Two robots`, in their order."""
        text = '\n'.join(c.source for c in self.notebook.cells if c.cell_type == 'markdown')
        return re.findall(r'^### ✎ (Task \d.*)', text, re.MULTILINE)

    @cached_property
    def steps(self) -> list[str]:
        """The step of each cell, such as `1`; empty before the first one."""
        steps, step = [], ''
        for cell in self.notebook.cells:
            if heading := re.match(r'## (\w+)', cell.source):
                step = heading[1]
            steps.append(step)
        return steps

    @cached_property
    def minutes_by_step(self) -> dict[str, int]:
        """The minutes of the instructor's notes: `1`, `2`, ... to their sum."""
        minutes_by_step: dict[str, int] = {}
        for cell, step in zip(self.notebook.cells, self.steps, strict=True):
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

    @property
    def _opening(self) -> str:
        return self.notebook.cells[0].source if self.notebook.cells else ''

    @property
    def _class_note(self) -> str:
        return '\n'.join(cell.source for cell in self.notebook.cells if cell.cell_type == 'raw')

    def _find(self, pattern: str, text: str, missing: str) -> re.Match:
        if match := re.search(pattern, text, re.MULTILINE):
            return match
        raise ValueError(f'{self.file} needs a {missing}.')


def tags(cell: NotebookNode) -> set[str]:
    return set(cell.metadata.get('tags', []))


def called(cell: NotebookNode) -> str:
    """Return how a cell is called: by its first words, and by its id.

    JupyterLab finds the words with Ctrl+F, and the id at the end of its address, such as
    02_lose_messages.ipynb#cell-id=check-02-1.
    """
    words = next((line.strip() for line in cell.source.splitlines() if line.strip()), '')
    return f'"{words[:LONGEST_NAME]}" ({cell.id})'


def workspace_of(notebook: NotebookNode) -> str:
    """Return the name that a lesson gives to its workspace, an empty text if it has none.

    An overlay, `Workspace('copy', underlay=workspace)`, is part of another one.
    """
    for cell in notebook.cells:
        if cell.cell_type == 'code' and (named := WORKSPACE.search(cell.source)):
            return named[1]
    return ''


def minutes_of_note(source: str) -> int:
    """Return the minutes that a note for the instructor names; 0 for what is none."""
    minutes = re.match(rf'{NOTE}: (\d+) minutes', source)
    return int(minutes[1]) if minutes else 0


def has_heading(cell: NotebookNode, form: str) -> bool:
    """Return whether a cell of text begins with a heading of this form, a regular expression."""
    return cell.cell_type == 'markdown' and bool(re.match(form, cell.source))


def first_heading(text: str) -> str:
    return text.splitlines()[0].lstrip('# ')


def read(text: str, file: str) -> Lesson:
    """Return the lesson of a notebook's text. Raises ValueError if it is none."""
    try:
        return Lesson(file, nbformat.reads(text, as_version=4))
    except (nbformat.reader.NotJSONError, nbformat.ValidationError, AttributeError) as error:
        raise ValueError(f'{file} is no notebook: {str(error).splitlines()[0][:80]}.') from None


def paths(folder: Path = FOLDER) -> list[Path]:
    return sorted(folder.glob('*.ipynb'))


def lessons(folder: Path = FOLDER) -> list[Lesson]:
    return [read(path.read_text(encoding='utf-8'), path.name) for path in paths(folder)]


def chosen(words: str, folder: Path = FOLDER) -> list[Path]:
    """Return the notebooks with these numbers or names, such as '02 set_parameters'.

    An empty text chooses all. Raises ValueError if a word is not that of exactly one notebook.
    """
    known = paths(folder)
    if not known:
        raise ValueError(f'There is no notebook in {folder}.')
    notebooks = set()
    for word in words.split():
        number = f'{word:0>2}'
        match = [
            path for path in known if word in (path.stem, path.stem[3:]) or number == path.stem[:2]
        ]
        if len(match) != 1:
            names = ', '.join(path.stem for path in known)
            raise ValueError(
                f'There is no single lesson {word!r}. Give a number or a name: {names}.'
            )
        notebooks |= {*match}
    return sorted(notebooks) or known
