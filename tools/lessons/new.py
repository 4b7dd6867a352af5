"""Add a lesson, or take one out. The notebooks after it get new numbers.

    python -m tools.lessons.new count_the_losses                 at the end
    python -m tools.lessons.new count_the_losses --after 04      as lesson 05
    python -m tools.lessons.new count_the_losses --remove        out again

The new lesson is a copy of template.txt, a complete small lesson that keeps all rules. A notebook
that gets another number is renamed; its title, its workspace and the links to it follow. What is
said of it in words is printed: a person must look at these lines. All texts are computed before the
first file is touched.
"""

import argparse
import re
import subprocess
import sys
from pathlib import Path

import nbformat
from nbformat import NotebookNode

from tools.lessons import tables
from tools.lessons.clean import clean, text_of, write
from tools.lessons.lesson import GLOSSARY, ROOT, START
from tools.lessons.rules import FOLDED

TEMPLATE = Path(__file__).with_name('template.txt')
EXAMPLE = 'make lesson NAME=count_the_losses'


def template(stem: str = '90_write_a_lesson', part: str = 'nodes') -> NotebookNode:
    """Return the lesson of template.txt, where a line `%% TYPE TAG...` begins a cell."""
    text = TEMPLATE.read_text(encoding='utf-8').replace('Part: nodes', f'Part: {part}')
    title = f'# {stem[:2]} {stem[3:].replace("_", " ").capitalize()}'
    cells = []
    for cell in re.split('^%% ', text.replace('# 90 Write a lesson', title), flags=re.M)[1:]:
        head, _, source = cell.partition('\n')
        kind, *tags = head.split()
        metadata = {'tags': tags}
        if FOLDED.keys() & {*tags}:
            metadata['jupyter'] = {'source_hidden': True}
        new_cell = getattr(nbformat.v4, f'new_{kind}_cell')
        cells.append(new_cell(source.strip('\n'), metadata=metadata))
    return clean(nbformat.v4.new_notebook(cells=cells))


def renumbered(texts: tables.Texts, old: str, new: str) -> tables.Texts:
    """Return the texts after a notebook was renamed: its title, and the links that lead to it.

    `old` and `new` are file names without their ending, such as 05_run_a_long_job.
    """
    text = texts.pop(_path(old)).replace(f'"# {old[:2]} ', f'"# {new[:2]} ', 1)
    texts[_path(new)] = re.sub(rf'lesson_{old[:2]}\b', f'lesson_{new[:2]}', text)  # a workspace
    link = re.compile(rf'\[{old[:2]}(?=[^\]\n]*\]\((?:notebooks/)?{old}\.)')
    return {path: link.sub(f'[{new[:2]}', text).replace(old, new) for path, text in texts.items()}


def plan(name: str, after: str, remove: bool, root: Path) -> tuple[dict[str, str], tables.Texts]:
    """Return the renames of notebooks, and the texts of all files, by their new paths.

    A removed notebook is renamed to ''. Raises ValueError with one sentence if the wish cannot be
    met.
    """
    stems = [path.stem for path in sorted((root / 'notebooks').glob('*.ipynb'))]
    texts = _tracked(root) | tables.texts_of(root)
    inner = [stem for stem in stems if stem[:2] not in (START, GLOSSARY)]
    found = next((stem for stem in stems if stem[3:] == name), None)
    if remove:
        if found not in inner:
            known = ', '.join(stem[3:] for stem in inner)
            raise ValueError(f'There is no lesson {name!r} to remove. Give one of {known}.')
        del texts[_path(found)]
        texts |= tables.made(texts)
        if named := sorted(path for path, text in texts.items() if found in text):
            raise ValueError(
                f'{", ".join(named)}: these files name {found}. Take it out there, then try again.'
            )
        inner.remove(found)
    else:
        if not re.fullmatch(r'[a-z]+(_[a-z0-9]+)+', name):
            raise ValueError(
                'Name the lesson in small letters, a verb and what it is about, with _ between '
                f'the words: {EXAMPLE}'
            )
        if found:
            raise ValueError(f'There is {found}.ipynb already: choose another name.')
        places = [stem[:2] for stem in [stems[0], *inner]]
        if after and after not in places:
            raise ValueError(
                f'There is no lesson {after!r}. Give AFTER one of {", ".join(places)}.'
            )
        place = places.index(after) if after else len(inner)
        inner.insert(place, '')
    moved = {
        stem: f'{number:02d}{stem[2:]}'
        for number, stem in enumerate(inner, 1)
        if stem and stem[:2] != f'{number:02d}'
    }
    # If numbers grow the last notebook moves first, if they shrink the first one.
    for old in sorted(moved, reverse=not remove):
        texts = renumbered(texts, old, moved[old])
    if remove:
        moved[found] = ''
    else:
        new = f'{place + 1:02d}_{name}'
        before = tables.lessons_of(texts)[place]
        part = before.part if before.is_lesson else 'nodes'
        texts[_path(new)] = text_of(template(new, part))
    return moved, texts | tables.made(texts)


def to_look_at(texts: tables.Texts, moved: dict[str, str]) -> list[str]:
    """Return the lines that call a lesson by a number that it had: `path:line: text`."""
    old = '|'.join(stem[:2] for stem in moved)
    says = re.compile(rf'(?:[Ll]essons? |LESSON=)(?:\d\d(?:,| and| or| to)* )*(?:{old})\b')
    return [
        f'{path}:{number}: {line.strip()[:100]}'
        for path, text in sorted(texts.items())
        for number, line in enumerate(text.splitlines(), 1)
        if says.search(line)
    ]


def main(arguments: list[str] | None = None, root: Path = ROOT) -> int:
    """Run the tool; return its exit status."""
    parser = argparse.ArgumentParser(description='Add a lesson, or take one out.')
    parser.add_argument('name', help='for example count_the_losses')
    parser.add_argument('--after', default='', metavar='NN', help='the lesson before it')
    parser.add_argument('--remove', action='store_true', help='take the lesson out')
    options = parser.parse_args(arguments)
    try:
        before = _tracked(root) | tables.texts_of(root)
        moved, texts = plan(options.name, options.after, options.remove, root)
        if moved and _git(root, 'status', '--porcelain', '-uno'):
            raise ValueError('Commit your changes first: the new numbers would mix with them.')
        for old in sorted(moved, reverse=not options.remove):  # as above
            new = moved[old]
            _git(root, *(['mv', _path(old), _path(new)] if new else ['rm', '-q', _path(old)]))
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    back = {_path(new): _path(old) for old, new in moved.items() if new}
    for path, text in texts.items():
        if text != before.get(back.get(path, path)):
            write(root / path, text)
            print(f'{path}: written')
    if moved and (lines := to_look_at(texts, moved)):
        print('Look at these lines, which name a lesson by its old number:', *lines, sep='\n')
    new = next((path for path in texts if back.get(path, path) not in before), _path(START))
    print(f'Now run `make notebooks LESSON={Path(new).name[:2]}`.')
    return 0


def _path(stem: str) -> str:
    return f'notebooks/{stem}.ipynb'


def _tracked(root: Path) -> tables.Texts:
    """Return all texts that git knows, but those of this tool."""
    texts = {}
    for path in _git(root, 'ls-files', '-z').split('\0'):
        if path and not path.startswith('tools/lessons/') and (root / path).is_file():
            try:
                texts[path] = (root / path).read_text(encoding='utf-8')
            except UnicodeDecodeError:
                continue
    return texts


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(['git', *arguments], cwd=root, capture_output=True, text=True)
    if done.returncode:
        raise ValueError(f'git {arguments[0]} failed: {done.stderr.strip().splitlines()[0]}.')
    return done.stdout


if __name__ == '__main__':
    sys.exit(main())
