"""Make the copies of the lessons that `make present` shows, and print the path of one of them.

    python -m tools.lessons.present 02                     without outputs
    python -m tools.lessons.present 02 --saved-outputs     with those of the lesson
    python -m tools.lessons.present 02 --new               throws away what was typed in the copy

What happens in front of a class stays in the copies. All lessons have one, because slides link to
each other. A copy in which nothing has happened follows its lesson. Any other is kept.
"""

import argparse
import hashlib
import json
import sys
import time
from pathlib import Path

import nbformat

from tools.lessons import lesson
from tools.lessons.clean import text_of
from tools.lessons.slides import folded

FOLDER = 'presentation'
MADE = '.made.json'  # the hash of each copy as it was made, and of what it was made from


def _copy_of(source: str, outputs: bool) -> str:
    notebook = nbformat.reads(source, as_version=4)
    for cell in notebook.cells:
        if folded(cell):
            cell.metadata.jupyter = {'source_hidden': True}
        if cell.cell_type == 'code' and not outputs:
            cell.outputs, cell.execution_count = [], None
    return text_of(notebook)


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def present(number: str, root: Path, *, new: bool = False, outputs: bool = False) -> Path:
    """Make or keep the copies below `root`; return that of the lesson with this number.

    `new` makes that one anew, whatever was typed in it. Raises ValueError with one sentence where
    there is no such lesson.
    """
    if len(number.split()) != 1:
        raise ValueError('Name one lesson, for example: make present LESSON=02')
    [wanted] = lesson.chosen(number, root / 'notebooks')
    folder = root / FOLDER
    folder.mkdir(exist_ok=True)
    record = folder / MADE
    made = json.loads(record.read_text()) if record.is_file() else {}
    for path in lesson.paths(root / 'notebooks'):
        copy = folder / path.name
        touched = copy.is_file() and _hash(copy.read_text(encoding='utf-8')) != made.get(path.name)
        if touched and not (new and path == wanted):
            continue
        source, origin = path.read_text(encoding='utf-8'), f'{path.name}, made from'
        wanted_from = _hash(f'{outputs} {source}')
        if copy.is_file() and path != wanted and made.get(origin) == wanted_from:
            continue
        text = _copy_of(source, outputs)
        copy.write_text(text, encoding='utf-8')
        made[path.name], made[origin] = _hash(text), wanted_from
    record.write_text(json.dumps(made, indent=1))
    return folder / wanted.name


def main(arguments: list[str] | None = None) -> int:
    """Run the tool; return its exit status. What is no path goes to stderr."""
    parser = argparse.ArgumentParser(description='Make the copies that `make present` shows.')
    parser.add_argument('lesson', help='a number, such as 02')
    parser.add_argument('--root', type=Path, default=lesson.ROOT)
    parser.add_argument('--new', action='store_true', help='throw away what was typed')
    parser.add_argument('--saved-outputs', action='store_true', help='with the saved outputs')
    options = parser.parse_args(arguments)
    start = time.time()
    try:
        copy = present(options.lesson, options.root, new=options.new, outputs=options.saved_outputs)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    changed = copy.stat().st_mtime
    if changed < start:
        when = time.strftime('%Y-%m-%d %H:%M', time.localtime(changed))
        print(f'{copy} goes on as it was saved on {when}. NEW=yes begins anew.', file=sys.stderr)
    else:
        print(f'{copy} is a copy: the lesson stays as it is.', file=sys.stderr)
    print(copy.relative_to(options.root))
    return 0


if __name__ == '__main__':
    sys.exit(main())
