"""Make a student's edition of this course: one archive, for `make lab` and `make update`.

    python -m classroom.handout                       without notes for the instructor
    python -m classroom.handout --solutions no        and without solutions
    python -m classroom.handout --solutions "00 01"   with the solutions of these lessons only
    python -m classroom.handout --solutions no --borrow no    and nothing can be borrowed
    python -m classroom.handout --wheels 3.11 3.12    with all packages for these Pythons
    python -m classroom.handout --lessons FOLDER      the lessons only, into this folder

It is a student's: KEPT, with students.md as its README and handout.mk as its Makefile.
environment.md is without what is between `<!-- not in the handout -->` and `<!-- end -->`. The
notebooks have no outputs. `.handed_out` holds the same files once more, so that `make update` can
see what the student has written since. An archive with more solutions brings them to those who have
one with fewer.

Without solutions a student who is stuck may borrow what the next steps need, after some tries:
`%borrow be_the_queue`. For that each check keeps its solution in its metadata, unreadable at a
glance; with `--borrow no` it is left out.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

import nbformat
from nbformat import NotebookNode
from packaging.requirements import Requirement

from classroom.update import BASE, committed
from helpers.lesson import (
    PICTURES,
    ROOT,
    Lesson,
    chosen,
    code_of_solution,
    is_for_instructors,
    keep_solution,
    tags,
)
from helpers.notebook import MARK
from tools.lessons.clean import text_of

NAME = 'ros2_notebooks'
ALL = 'yes'  # SOLUTIONS=: of all lessons
LOCK = 'tools/locks/requirements.lock'
WHEELS = 'wheels'
# What `make lab` and `make update` need. The lock of uv is that of the installer itself.
KEPT = (
    *('LICENSE', 'environment.md', 'pyproject.toml', 'helpers', 'notebooks', 'ros2'),
    *('tools/environment.mk', 'tools/set_up.sh', 'tools/troubles.sh', 'tools/uv.sh'),
    *('tools/pip.py', 'tools/jupyter', 'tools/lab.py', 'tools/lab.css'),
    *(LOCK, 'tools/locks/requirements-uv.lock', 'tools/locks/files.sh'),
    *('classroom/__init__.py', 'classroom/update.py'),
)
LEFT_OUT = ('ros2/tests',)
README, STUDENTS = 'README.md', 'classroom/students.md'
ENVIRONMENT = 'environment.md'
MAKEFILE, COMMANDS = 'Makefile', 'classroom/handout.mk'
LESSONS = re.compile(
    r'<!-- made by `make notebooks`: lessons -->\n\n(.*?)\n\n<!-- end -->', re.DOTALL
)
NOT_HANDED_OUT = re.compile(r'<!-- not in the handout -->.*?<!-- end -->\n\n?', re.DOTALL)
# The line of notebook 00 that says how to use solutions, and the one that takes its place.
OF_SOLUTIONS = re.compile(r'^- The \*\*solution\*\* .*\n?', re.MULTILINE)
OF_BORROWING = (
    '- Are you **stuck**? After three tries the check names a line, such as `%borrow a_driver`. It '
    'puts what the next steps need into place. The task counts as borrowed, not as solved, and you '
    'can come back to it.\n'
)
GTEST = 'ros-gtest-vendor=='
GTEST_PYTHON = '3.12'  # whose wheel holds the sources: see tools/set_up.sh
GLIBC = ('_2_28', '_2_27', '_2_26', '_2_24', '_2_17', '_2_12', '_2_5', '2014', '2010', '1')


def handout(
    root: Path, output: Path, *, solutions: str = ALL, borrow: bool = True, pythons: tuple = ()
) -> Path:
    """Write the archive of the checkout `root`, and return it.

    `solutions` is what SOLUTIONS= says; `borrow` whether what is left out may be borrowed;
    `pythons` are versions such as '3.12', whose wheels are
    added. Raises ValueError with one sentence.
    """
    with tempfile.TemporaryDirectory() as folder:
        course = committed(root, 'HEAD', Path(folder, NAME))
        texts = {
            README: readme_for_students(course),
            MAKEFILE: (course / COMMANDS).read_text(encoding='utf-8'),
        }
        if (course / ENVIRONMENT).exists():
            texts[ENVIRONMENT] = for_students((course / ENVIRONMENT).read_text(encoding='utf-8'))
        _keep_only(course)
        for name, text in texts.items():
            (course / name).write_text(text, encoding='utf-8')
        write_lessons(
            course / 'notebooks', course / 'notebooks', solutions=solutions, borrow=borrow
        )
        shutil.copytree(course, Path(folder, BASE))
        Path(folder, BASE).rename(course / BASE)
        if pythons:
            download(course / LOCK, course / WHEELS, pythons)
        output.parent.mkdir(parents=True, exist_ok=True)
        new = output.with_name(f'{output.name}.new')
        with tarfile.open(new, 'w:gz', compresslevel=6, dereference=True) as archive:
            archive.add(course, NAME)
        new.replace(output)
    return output


def write_lessons(source: Path, to: Path, *, solutions: str = ALL, borrow: bool = True) -> None:
    """Write the lessons of a folder as students get them: all may read them, and no others stay.

    `solutions` is what SOLUTIONS= says: yes, no, or the lessons whose solutions are handed out.
    `borrow` is whether a student who is stuck may borrow those that are left out.
    Raises ValueError with one sentence if there is no such lesson.
    """
    solved = [] if solutions == 'no' else chosen('' if solutions == ALL else solutions, source)
    paths = sorted(source.glob('*.ipynb'))
    to.mkdir(parents=True, exist_ok=True)
    to.chmod(0o755)
    for other in {path.name for path in to.glob('*.ipynb')} - {path.name for path in paths}:
        (to / other).unlink()
    for path in paths:
        left_out = {'notes'} if path in solved else {'notes', 'solution'}
        notebook = nbformat.read(path, as_version=4)
        if 'solution' in left_out:
            _without_solutions(Lesson(path.name, notebook), borrow)
        lesson = lesson_for_students(notebook, left_out)
        (to / path.name).write_text(text_of(lesson), encoding='utf-8')
        (to / path.name).chmod(0o644)
    if to != source:
        (to / PICTURES).mkdir(exist_ok=True)
        (to / PICTURES).chmod(0o755)
        for picture in (source / PICTURES).glob('*'):
            (to / PICTURES / picture.name).write_bytes(picture.read_bytes())
            (to / PICTURES / picture.name).chmod(0o644)


def not_committed(root: Path) -> list[str]:
    """Return the files with changes, which are left out. Raises ValueError without a clone."""
    status = ['git', 'status', '--porcelain']
    said = subprocess.run(status, cwd=root, capture_output=True, text=True)
    if said.returncode:
        raise ValueError('A handout is made in a clone of the repository: git finds none here.')
    return [line[3:] for line in said.stdout.splitlines()]


def _keep_only(course: Path) -> None:
    """Remove what no student needs."""
    for path in sorted(course.rglob('*'), reverse=True):
        name = path.relative_to(course).as_posix()
        kept = any(name == one or name.startswith(f'{one}/') for one in KEPT)
        if kept and not any(name == one or name.startswith(f'{one}/') for one in LEFT_OUT):
            continue
        if path.is_symlink() or not path.is_dir():
            path.unlink()
        elif not any(path.iterdir()):
            path.rmdir()


def readme_for_students(course: Path) -> str:
    """Return the README of an archive: students.md, with the table of the lessons."""
    lessons = LESSONS.search((course / README).read_text(encoding='utf-8'))
    text = (course / STUDENTS).read_text(encoding='utf-8')
    return text.replace('<!-- the lessons -->', lessons[1] if lessons else '')


def for_students(text: str) -> str:
    """Return a document without what only a clone has."""
    return NOT_HANDED_OUT.sub('', text)


def _without_solutions(lesson: Lesson, borrow: bool) -> None:
    """Take out the sentence about solutions; let checks keep what can be borrowed."""
    for cell in lesson.cells:
        if cell.cell_type == 'markdown':
            cell.source = OF_SOLUTIONS.sub(OF_BORROWING if borrow else '', cell.source)
    for task in lesson.tasks if borrow else ():
        for check, solution in zip(task.checks, task.solutions, strict=False):
            keep_solution(check, code_of_solution(solution.source))


def lesson_for_students(notebook: NotebookNode, left_out: set[str]) -> NotebookNode:
    """Return a notebook without outputs, and without what is for instructors."""
    notebook.cells = [
        cell
        for cell in notebook.cells
        if not left_out & tags(cell) and not is_for_instructors(cell)
    ]
    notebook.metadata.pop(MARK, None)  # what hides outputs of the repository
    for cell in notebook.cells:
        if cell.cell_type == 'code':
            cell.outputs, cell.execution_count = [], None
    return notebook


def download(lock: Path, folder: Path, pythons: tuple) -> None:
    """Fetch all packages of a lock file for some Pythons, as tools/set_up.sh reads them."""
    with_uv = f'{lock.read_text()}\n{lock.with_name("requirements-uv.lock").read_text()}'
    head, *blocks = re.split(r'\n(?=[a-z])', with_uv)
    [known] = re.findall('for Python (.+)', head)
    if unknown := set(pythons) - {*known.split()}:
        raise ValueError(f'Not every package has a wheel for Python {min(unknown)}: take {known}.')
    print('Fetching the packages, about 200 MB', file=sys.stderr)
    folder.mkdir()
    wanted, fetched, jobs = folder / 'wanted.lock', set(), []
    for python in pythons:
        for version in (f'{python}.0', f'{python}.99'):  # a few packages ask for the last number
            pins = {pin for block in blocks if (pin := _for(block, version))}
            jobs.append((version, pins - fetched))
            fetched = pins if version.endswith('.0') else set()
    if GTEST_PYTHON not in pythons:
        version = f'{GTEST_PYTHON}.0'
        jobs.append(
            (version, {_for(block, version) for block in blocks if block.startswith(GTEST)})
        )
    for version, pins in jobs:
        wanted.write_text('\n'.join(pins))
        command = [sys.executable, '-I', ROOT / 'tools/pip.py']
        command += ['download', '--quiet', '--no-deps']
        command += ['--disable-pip-version-check', '--no-build-isolation', '--require-hashes']
        command += [f'--platform=manylinux{glibc}_x86_64' for glibc in GLIBC]
        command += ['--implementation=cp', f'--python-version={version}']
        command += ['--requirement', wanted, '--dest', folder]
        if subprocess.run(command).returncode:
            raise ValueError('pip could not fetch the packages: what it said stands above.')
    wanted.unlink()
    Path(folder, 'pythons').write_text(' '.join(sorted(pythons, key=known.index)))


def _for(block: str, version: str) -> str:
    """Return a pin with its hashes if this version of Python takes it, without the condition."""
    first, _, hashes = block.partition(' \\\n')
    requirement = Requirement(first)
    environment = {'python_full_version': version, 'python_version': version.rpartition('.')[0]}
    if requirement.marker and not requirement.marker.evaluate(environment):
        return ''
    return f'{first.partition(" ;")[0]} \\\n{hashes}'


def main(arguments: list[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = argparse.ArgumentParser(description="Make a student's edition of this course.")
    parser.add_argument('--solutions', default=ALL, metavar='yes|no|"00 01"')
    parser.add_argument('--borrow', choices=('yes', 'no'), default='yes', help='without solutions')
    parser.add_argument('--wheels', nargs='+', default=(), metavar='PYTHON', help='such as 3.12')
    parser.add_argument('--lessons', type=Path, metavar='FOLDER', help='no archive: lessons only')
    parser.add_argument('--root', type=Path, default=ROOT)
    options = parser.parse_args(arguments)
    output = options.root / 'handout' / f'{NAME}.tar.gz'
    pythons, borrow = tuple(options.wheels), options.borrow == 'yes'
    try:
        if options.lessons:
            notebooks = options.root / 'notebooks'
            write_lessons(notebooks, options.lessons, solutions=options.solutions, borrow=borrow)
            return 0
        left_out = not_committed(options.root)
        handout(options.root, output, solutions=options.solutions, borrow=borrow, pythons=pythons)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    what = f'for Python {" and ".join(pythons)}, no network needed' if pythons else 'no packages'
    of = {ALL: 'all lessons', 'no': 'no lesson'}.get(options.solutions, options.solutions)
    print(f'{output}: {output.stat().st_size / 1e6:.1f} MB, {what}. Solutions of {of}.')
    if left_out:
        print('Not committed, so not in it:', ', '.join(left_out))
    print(f'Students: tar xf {output.name} && cd {NAME} && make lab')
    return 0


if __name__ == '__main__':
    sys.exit(main())
