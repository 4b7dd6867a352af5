"""Begin a lesson: a copy of tools/lesson_template.ipynb, with its number and its title.

    python -m tools.new_lesson 10_count_the_losses

The template is a complete small lesson that keeps all rules, so the copy does, too.
"""

import re
import sys
from pathlib import Path

from tools.notebooks import FOLDER

TEMPLATE = Path(__file__).resolve().parent / 'lesson_template.ipynb'
NUMBER, TITLE = '90', 'Write a lesson'


def new_lesson(name: str, folder: Path = FOLDER) -> Path:
    """Write the lesson `name`, such as 10_count_the_losses, into a folder; return its file.

    Raises ValueError for a name of another form, and where a lesson has its number.
    """
    found = re.fullmatch(r'(\d\d)_([a-z]+(?:_[a-z0-9]+)+)', name.removesuffix('.ipynb'))
    if not found:
        raise ValueError(
            'Name the lesson with two digits, a verb and what it is about, '
            'for example: make lesson NAME=10_count_the_losses'
        )
    number, words = found.groups()
    for other in folder.glob(f'{number}_*.ipynb'):
        raise ValueError(f'There is {other.name} already: choose another number.')
    text = TEMPLATE.read_text(encoding='utf-8')
    for old, new in (
        (f'# {NUMBER} {TITLE}', f'# {number} {words.replace("_", " ").capitalize()}'),
        (f'of lesson {NUMBER}', f'of lesson {number}'),
        (f'"lesson-{NUMBER}-', f'"lesson-{number}-'),
        (f'"note-{NUMBER}-', f'"note-{number}-'),
    ):
        text = text.replace(old, new)
    path = folder / f'{found[0]}.ipynb'
    path.write_text(text, encoding='utf-8')
    return path


if __name__ == '__main__':
    try:
        path = new_lesson(*sys.argv[1:2] or [''])
    except ValueError as error:
        sys.exit(str(error))
    print(f'Wrote {path.relative_to(FOLDER.parent)}. CONTRIBUTING.md says what comes next.')
