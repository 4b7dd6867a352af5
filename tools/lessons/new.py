"""Add a lesson, or take one out. The notebooks after it get new numbers, wherever these stand.

    python -m tools.lessons.new count_the_losses                 at the end
    python -m tools.lessons.new count_the_losses --after 04      as lesson 05
    python -m tools.lessons.new count_the_losses --remove        out again

The new lesson is a copy of template.ipynb, a complete small lesson that keeps all rules. All texts
are computed before the first file is touched.
"""

import argparse
import re
import subprocess
import sys
from pathlib import Path

from tools.lessons import tables
from tools.lessons.clean import write
from tools.lessons.lesson import GLOSSARY, ROOT, START

TEMPLATE = Path(__file__).resolve().parent / 'template.ipynb'
TEMPLATE_STEM = '90_write_a_lesson'
EXAMPLE = 'make lesson NAME=count_the_losses'

# A link such as [02 Lose messages](02_lose_messages.ipynb), the name of a file, and a number in
# words: lesson 02, lessons 02, 03 and 04, LESSON=02, lesson_02, and the ids of cells, note-02-05.
LINK = re.compile(r'\[(\d\d)(?=( [^\]\n]*)?\]\((notebooks/)?\1_)')
STEM = re.compile(r'(?<!\w)\d\d(?:_[a-z0-9]+)+')
ONE = re.compile(r'\b(?:[Ll]esson[ _-]|note-|quiz-)(\d\d)\b(?!\.\d)|\b(?:[Ll]esson_)(\d\d)')
MANY = re.compile(
    r'\b(?:[Ll]essons |LESSON=(?:\\?["\'])?)\d\d(?:(?:, and|,| and| or| to)? \d\d\b)*'
)


def renumbered(text: str, stems: dict[str, str]) -> str:
    """Return a text in which notebooks are called by their new names and numbers.

    `stems` gives for each old name, such as 05_run_a_long_job, the new one.
    """
    numbers = {old[:2]: new[:2] for old, new in stems.items()}

    def new(match: re.Match) -> str:
        return re.sub(r'\d\d', lambda n: numbers.get(n[0], n[0]), match[0])

    text = LINK.sub(new, text)
    text = STEM.sub(lambda match: stems.get(match[0], match[0]), text)
    return MANY.sub(new, ONE.sub(new, text))


def mentions(text: str, stem: str) -> bool:
    """Say whether a text names the notebook, or a lesson by its number."""
    return renumbered(text, {stem: f'XX{stem[2:]}'}) != text


def plan(name: str, after: str, remove: bool, root: Path) -> tuple[dict[str, str], tables.Texts]:
    """Return the renames of notebooks, and the texts of all files that change, by their new paths.

    A removed notebook is renamed to ''. Raises ValueError with one sentence where the wish cannot
    be met.
    """
    stems = [path.stem for path in sorted((root / 'notebooks').glob('*.ipynb'))]
    texts = _tracked(root) | tables.texts_of(root)
    inner = [stem for stem in stems if stem[:2] not in (START, GLOSSARY)]
    found = next((stem for stem in stems if stem[3:] == name), None)
    if remove:
        if found not in inner:
            known = ', '.join(stem[3:] for stem in inner)
            raise ValueError(f'There is no lesson {name!r} to remove. Give one of {known}.')
        place = inner.index(found)
        moved = dict.fromkeys([found], '')
        del texts[_path(found)]
        texts |= tables.made(texts)
        if named := [path for path, text in texts.items() if mentions(text, found)]:
            raise ValueError(
                f'Lesson {found[:2]} is named in {", ".join(sorted(named))}: '
                'take it out there first, then try again.'
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
        moved = {}
        inner.insert(place, '')
    for number, stem in enumerate(inner, 1):
        if stem and stem[:2] != f'{number:02d}':
            moved[stem] = f'{number:02d}{stem[2:]}'
    texts = _moved(texts, {old: new for old, new in moved.items() if new})
    if not remove:
        new = f'{place + 1:02d}_{name}'
        before = tables.lessons_of(texts)[place]
        part = before.part if before.is_lesson else 'nodes'
        texts[_path(new)] = _from_template(new, part)
    return moved, texts | tables.made(texts)


def main(arguments: list[str] | None = None, root: Path = ROOT) -> int:
    """Run the tool; return its exit status."""
    parser = argparse.ArgumentParser(description='Add a lesson, or take one out.')
    parser.add_argument('name', help='for example count_the_losses')
    parser.add_argument('--after', default='', metavar='NN', help='the lesson before it')
    parser.add_argument('--remove', action='store_true', help='take the lesson out')
    options = parser.parse_args(arguments)
    try:
        if options.remove and options.after:
            raise ValueError('Give AFTER or REMOVE, not both.')
        before = _tracked(root) | tables.texts_of(root)
        moved, texts = plan(options.name, options.after, options.remove, root)
        back = {_path(new): _path(old) for old, new in moved.items() if new}
        changed = {
            path: text for path, text in texts.items() if text != before.get(back.get(path, path))
        }
        if moved:
            touched = [back.get(path, path) for path in changed] + [_path(old) for old in moved]
            _refuse_to_mix(root, touched)
        # Where numbers grow the last notebook moves first, where they shrink the first one.
        for old in sorted(moved, reverse=not options.remove):
            new = moved[old]
            _git(root, *(['mv', _path(old), _path(new)] if new else ['rm', '-q', _path(old)]))
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    for path, text in changed.items():
        write(root / path, text)
        print(f'{path}: written')
    print(f'Now run `{tables.COMMAND}`. CONTRIBUTING.md says what comes next.')
    return 0


def _path(stem: str) -> str:
    return f'notebooks/{stem}.ipynb'


def _from_template(stem: str, part: str) -> str:
    text = renumbered(TEMPLATE.read_text(encoding='utf-8'), {TEMPLATE_STEM: stem})
    title = f'# {stem[:2]} {stem[3:].replace("_", " ").capitalize()}'
    text = text.replace('# 90 Write a lesson', title, 1)
    return text.replace('Part: nodes', f'Part: {part}', 1)


def _moved(texts: tables.Texts, stems: dict[str, str]) -> tables.Texts:
    """Return the texts with the new numbers, those of notebooks at their new paths."""
    paths = {_path(old): _path(new) for old, new in stems.items()}
    result = {}
    for path, text in texts.items():
        text = renumbered(text, stems)
        if path in paths:
            old, new = Path(path).stem[:2], Path(paths[path]).stem[:2]
            text = text.replace(f'"# {old} ', f'"# {new} ', 1)
        result[paths.get(path, path)] = text
    return result


def _tracked(root: Path) -> tables.Texts:
    """Return all texts that git knows, but those of this tool and its test."""
    own = ('tools/lessons/', 'tests/tools/test_new_lesson.py')
    texts = {}
    for path in _git(root, 'ls-files', '-z').split('\0'):
        if path and not path.startswith(own) and (root / path).is_file():
            try:
                texts[path] = (root / path).read_text(encoding='utf-8')
            except UnicodeDecodeError:
                continue
    return texts


def _refuse_to_mix(root: Path, paths: list[str]) -> None:
    state = _git(root, 'status', '--porcelain', '--no-renames', '-uall', '-z').split('\0')
    mixed = sorted({line[3:] for line in state} & set(paths))
    if mixed:
        raise ValueError(
            f'Commit your changes first, the new numbers would mix with them: {", ".join(mixed)}.'
        )


def _git(root: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(['git', *arguments], cwd=root, capture_output=True, text=True)
    except FileNotFoundError:
        raise ValueError('Numbers are changed with git: install it, then try again.') from None
    if done.returncode:
        raise ValueError(f'git {arguments[0]} failed: {done.stderr.strip().splitlines()[0]}.')
    return done.stdout


if __name__ == '__main__':
    sys.exit(main())
