"""In which notebooks somebody has solved tasks, since the last commit.

python -m tools.lessons.answers          their paths as ruff's settings want them, for `make test`
"""

import subprocess
import sys
from pathlib import Path

import nbformat

from helpers.lesson import FOLDER, WRITTEN, names_of_memory, tags


def answered() -> list[str]:
    """Return the file names of the notebooks whose answers differ from those of the last commit.

    Without git, as in a handout, there is nothing to compare with.
    """
    changed = _git('diff', '--name-only', '--relative', '--diff-filter=M', 'HEAD').splitlines()
    return [
        file
        for file in changed
        if file.endswith('.ipynb')
        and _answers((FOLDER / file).read_text(encoding='utf-8')) != delivered(FOLDER / file)
    ]


def delivered(path: Path) -> dict[str, str]:
    """Return the sources of the cells in which a student writes, as committed, by their id.

    There are none without git, or for a lesson that it does not have.
    """
    text = _git('show', f'HEAD:./{path.name}', folder=path.parent)
    return _answers(text) if text else {}


def _answers(text: str) -> dict[str, str]:
    """Return the sources of the cells in which a student writes, by their id."""
    cells = nbformat.reads(text, as_version=4).cells
    return {
        cell.id: cell.source
        for cell in cells
        if WRITTEN & tags(cell) or names_of_memory(cell.source)
    }


def _git(*arguments: str, folder: Path = FOLDER) -> str:
    try:
        return subprocess.run(
            ['git', *arguments], cwd=folder, capture_output=True, text=True
        ).stdout
    except OSError:  # there is no git
        return ''


if __name__ == '__main__':
    files = answered()
    if files:
        print(
            f'Answers of yours, or new tasks, are in {", ".join(files)}: ruff does not read these '
            'until you commit them. `make lint` reads all.',
            file=sys.stderr,
        )
    print(', '.join(f"'notebooks/{file}'" for file in files))
