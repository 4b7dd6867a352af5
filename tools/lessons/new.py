"""Add a lesson, or take one out. The notebooks after it get new numbers.

    python -m tools.lessons.new measure_the_delay                 at the end
    python -m tools.lessons.new measure_the_delay --after 04      as lesson 05
    python -m tools.lessons.new measure_the_delay --remove        out again

The new lesson is a copy of a complete small lesson that keeps all rules: template.txt is its
notebook, template.yaml the answers with which its checks are tested. A notebook that gets another
number is renamed; its title and all links to it follow. Its other files have no number, and stay.
All texts are computed before the first file is touched.
"""

import argparse
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import nbformat
from nbformat import NotebookNode

from helpers.lesson import FOLD, FOLDED, GLOSSARY, ROOT, START, chosen, paths
from tools.lessons import tables
from tools.lessons.clean import clean, text_of, write

TEMPLATE = Path(__file__).with_name('template.txt')
# What a lesson has besides its notebook, and the template of it, if there is one.
BESIDE = {
    'tests/answers/{name}.yaml': TEMPLATE.with_suffix('.yaml'),
    'helpers/checks/lessons/{name}.py': TEMPLATE.with_suffix('.py'),
}
OF_NO_LESSON = 'tests/', 'classroom/tests/', 'tools/lessons/new.py', 'tools/lessons/template'
EXAMPLE = 'measure_the_delay'


def template(stem: str = '90_write_a_lesson', part: str = 'nodes') -> NotebookNode:
    """Return the lesson of template.txt, where a line `%% TYPE TAG...` begins a cell."""
    text = TEMPLATE.read_text(encoding='utf-8').replace('Part: nodes', f'Part: {part}')
    title = f'# {stem[:2]} {stem[3:].replace("_", " ").capitalize()}'
    cells = []
    text = text.replace('# 90 Write a lesson', title)
    text = text.replace('lessons.write_a_lesson import', f'lessons.{stem[3:]} import')
    for cell in re.split('^%% ', text, flags=re.M)[1:]:
        head, _, source = cell.partition('\n')
        kind, *tags = head.split()
        metadata = {'tags': tags}
        if FOLDED.keys() & {*tags}:
            metadata |= FOLD
        new_cell = getattr(nbformat.v4, f'new_{kind}_cell')
        cells.append(new_cell(source.strip('\n'), metadata=metadata))
    return clean(nbformat.v4.new_notebook(cells=cells))


@dataclass
class Plan:
    """What becomes of a checkout when a lesson is added or removed."""

    texts: tables.Texts  # of all files, by their new paths
    moved: dict[str, str]  # the notebooks that get another number, by their stems
    removed: list[str]  # paths
    run: str = START  # the number of the notebook to run next


def plan_to_add(name: str, after: str, root: Path) -> Plan:
    """Plan a new lesson. Raises ValueError with one sentence if it cannot be added."""
    if not re.fullmatch(r'[a-z]+(_[a-z0-9]+)+', name):
        raise ValueError(
            'Name the lesson in small letters, a verb and what it is about, with _ between '
            f'the words: make lesson NAME={EXAMPLE}'
        )
    stems = [path.stem for path in paths(root / 'notebooks')]
    there = [_path(stem) for stem in stems if name in (stem, stem[3:])] + _existing(name, root)
    if there:
        raise ValueError(f'There is {there[0]} already: choose another name.')
    texts = tables.texts_of(root)
    for lesson in tables.lessons_of(texts):  # in the code nothing could tell the two apart
        if name in (task.name for task in lesson.tasks):
            raise ValueError(f'{lesson.file} has a task {name}: choose another name.')
    numbered = _numbered(root)
    place = len(numbered)
    if after:
        before = chosen(after, root / 'notebooks')[0]
        if before.name[:2] == GLOSSARY:
            raise ValueError('The glossary stays at the end: name another lesson with AFTER.')
        place = numbered.index(before.stem) + 1 if before.stem in numbered else 0
    numbered.insert(place, '')
    texts, moved = _move(texts, numbered)
    new = f'{place + 1:02d}_{name}'
    before = tables.lessons_of(texts)[place]
    part = before.part if before.is_lesson else 'nodes'
    texts[_path(new)] = text_of(template(new, part))
    for path, of_template in _beside(name).items():
        if of_template.exists():
            texts[path] = of_template.read_text(encoding='utf-8')
    return Plan(texts | tables.updated(texts), moved, removed=[], run=new[:2])


def plan_to_remove(lesson: str, root: Path) -> Plan:
    """Plan a removal. Raises ValueError with one sentence if the lesson must stay."""
    old = chosen(lesson, root / 'notebooks')[0].stem
    numbered = _numbered(root)
    if old not in numbered:
        raise ValueError(f'{old} is no lesson: it stays.')
    numbered.remove(old)
    removed = [_path(old), *_existing(old[3:], root)]
    texts = {path: text for path, text in tables.texts_of(root).items() if path not in removed}
    texts |= tables.updated(texts)
    code = {path: text for path, text in _code(root).items() if path not in removed}
    # The map of progress in notebook 00 links each lesson, and its next run makes it anew.
    start = _path(chosen(START, root / 'notebooks')[0].stem)
    cells = nbformat.reads(texts[start], as_version=4).cells
    linking = texts | {start: '\n'.join(cell.source for cell in cells)}
    link, name = re.compile(rf'\b\d\d_{old[3:]}\b'), re.compile(rf'\b(?:\d\d_)?{old[3:]}\b')
    named = [path for path, text in linking.items() if link.search(text)]
    if named := sorted({*named, *(path for path, text in code.items() if name.search(text))}):
        raise ValueError(
            f'{", ".join(named)}: these files name {old[3:]}. Take it out there, then try again.'
        )
    texts, moved = _move(texts, numbered)
    return Plan(texts | tables.updated(texts), moved, removed)


def _numbered(root: Path) -> list[str]:
    """Return the stems of the notebooks whose number is their place."""
    stems = [path.stem for path in paths(root / 'notebooks')]
    return [stem for stem in stems if stem[:2] not in (START, GLOSSARY)]


def _move(texts: tables.Texts, stems: list[str]) -> tuple[tables.Texts, dict[str, str]]:
    """Give each notebook the number of its place; return the texts, and the stems that change.

    What stands in them follows in tables.updated.
    """
    moved = {
        stem: f'{number:02d}{stem[2:]}'
        for number, stem in enumerate(stems, 1)
        if stem and stem[:2] != f'{number:02d}'
    }
    paths_of = {_path(old): _path(new) for old, new in moved.items()}
    return {paths_of.get(path, path): text for path, text in texts.items()}, moved


def _free_first(moved: dict[str, str]) -> list[str]:
    """Return the stems in an order in which each new name is free: the last one first to grow."""
    return sorted(moved, reverse=any(new > old for old, new in moved.items()))


def _beside(name: str) -> dict[str, Path]:
    """Return the paths of what a lesson has besides its notebook, and their templates."""
    return {path.format(name=name): of_template for path, of_template in BESIDE.items()}


def _existing(name: str, root: Path) -> list[str]:
    """Return the paths of what a lesson has besides its notebook."""
    answers = root / f'tests/answers/{name}.yaml'
    files = [answers] if answers.exists() else []
    return [file.relative_to(root).as_posix() for file in [*files, *judges_of(name, root)]]


def judges_of(name: str, root: Path) -> list[Path]:
    """Return the files of a lesson's judges: a module, or those of a package."""
    folder = root / 'helpers/checks/lessons'
    module = folder / f'{name}.py'
    return [module] if module.exists() else sorted((folder / name).glob('*.py'))


def main(arguments: list[str] | None = None, root: Path = ROOT) -> int:
    parser = argparse.ArgumentParser(description='Add a lesson, or take one out.')
    parser.add_argument('name', help=f'for example {EXAMPLE}; to remove, also a number')
    parser.add_argument('--after', default='', metavar='LESSON', help='the lesson before it')
    parser.add_argument('--remove', action='store_true', help='take the lesson out')
    options = parser.parse_args(arguments)
    try:
        before = tables.texts_of(root)
        if options.remove:
            plan = plan_to_remove(options.name, root)
        else:
            plan = plan_to_add(options.name, options.after, root)
        if plan.moved or plan.removed:
            _committed(root, plan)
        if plan.removed:
            _git(root, 'rm', '-q', *plan.removed)
        for old in _free_first(plan.moved):
            _git(root, 'mv', _path(old), _path(plan.moved[old]))
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    for path in plan.removed:
        print(f'{path}: removed')
    back = {_path(new): _path(old) for old, new in plan.moved.items()}
    for path, text in plan.texts.items():
        if text != before.get(back.get(path, path)):
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            write(root / path, text)
            print(f'{path}: written')
    print(f'Now run `make notebooks LESSON={plan.run}`.')
    return 0


def _committed(root: Path, plan: Plan) -> None:
    """Raise ValueError if git could not bring back what the plan changes."""
    back = '`git reset --hard` is then the way back.'
    if _git(root, 'status', '--porcelain', '-uno'):
        raise ValueError(f'Commit your changes first, with `git add -A`: {back}')
    files = [*plan.removed, *map(_path, plan.moved)]
    known = _git(root, 'ls-files', '-z', '--', *files).split('\0')
    if new := [path for path in files if path not in known]:
        raise ValueError(f'Commit {", ".join(new)} first, with `git add -A`: {back}')


def _path(stem: str) -> str:
    return f'notebooks/{stem}.ipynb'


def _code(root: Path) -> tables.Texts:
    """Return the texts of code and data that git knows, but those of this tool and of tests."""
    texts = {}
    for path in _git(root, 'ls-files', '-z').split('\0'):
        is_code = Path(path).suffix in ('.py', '.yaml', '.sh', '.toml')
        left_out = path == 'helpers/lesson/earlier.py' or path.startswith(OF_NO_LESSON)
        if is_code and not left_out and (root / path).is_file():
            texts[path] = (root / path).read_text(encoding='utf-8')
    return texts


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(['git', *arguments], cwd=root, capture_output=True, text=True)
    if done.returncode:
        raise ValueError(f'git {arguments[0]} failed: {done.stderr.strip().splitlines()[0]}.')
    return done.stdout


if __name__ == '__main__':
    sys.exit(main())
