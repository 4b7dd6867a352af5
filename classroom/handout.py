"""Make a student's edition of this course: one archive, for `make lab` and `make update`.

    python -m classroom.handout                       without notes for the instructor
    python -m classroom.handout --no-solutions        and without solutions
    python -m classroom.handout --wheels 3.11 3.12    with all packages for these Pythons

README.md is without what is between `<!-- not in the handout -->` and `<!-- end -->`.
`.handed_out` in it holds the same files once more, so that `make update` can see what the student
has written since. An archive with solutions brings them to those who have one without.
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
from packaging.requirements import Requirement

from classroom.update import BASE, committed
from tools.lessons.clean import text_of
from tools.lessons.lesson import ROOT, tags

NAME = 'ros2_notebooks'
LOCK = 'tools/locks/requirements.lock'
WHEELS = 'wheels'
LEFT_OUT = ('tests', '.ci', '.github', 'classroom/hub', 'classroom/tests')
NOT_HANDED_OUT = re.compile(r'<!-- not in the handout -->.*?<!-- end -->\n\n?', re.DOTALL)
GLIBC = ('_2_28', '_2_27', '_2_26', '_2_24', '_2_17', '_2_12', '_2_5', '2014', '2010', '1')


def handout(root: Path, output: Path, *, solutions: bool = True, pythons: tuple = ()) -> Path:
    """Write the archive of the checkout `root`, and return it.

    `pythons` are versions such as '3.12', whose wheels are added. Raises ValueError with one
    sentence.
    """
    with tempfile.TemporaryDirectory() as folder:
        course = committed(root, 'HEAD', Path(folder, NAME))
        for name in LEFT_OUT:
            shutil.rmtree(course / name, ignore_errors=True)
        readme = course / 'README.md'
        readme.write_text(for_students(readme.read_text(encoding='utf-8')), encoding='utf-8')
        left_out = {'notes'} if solutions else {'notes', 'solution'}
        for path in course.glob('notebooks/*.ipynb'):
            notebook = nbformat.read(path, as_version=4)
            notebook.cells = [cell for cell in notebook.cells if not left_out & tags(cell)]
            path.write_text(text_of(notebook), encoding='utf-8')
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


def not_committed(root: Path) -> list[str]:
    """Return the files with changes, which are left out. Raises ValueError without a clone."""
    status = ['git', 'status', '--porcelain']
    said = subprocess.run(status, cwd=root, capture_output=True, text=True)
    if said.returncode:
        raise ValueError('A handout is made in a clone of the repository: git finds none here.')
    return [line[3:] for line in said.stdout.splitlines()]


def for_students(readme: str) -> str:
    """Return README.md without what only a clone has."""
    return NOT_HANDED_OUT.sub('', readme)


def download(lock: Path, folder: Path, pythons: tuple) -> None:
    """Fetch all packages of a lock file for some Pythons, as tools/set_up.sh reads them."""
    with_uv = f'{lock.read_text()}\n{lock.with_name("requirements-uv.lock").read_text()}'
    head, *blocks = re.split(r'\n(?=[a-z])', with_uv)
    [known] = re.findall('for Python (.+)', head)
    if unknown := set(pythons) - {*known.split()}:
        raise ValueError(f'Not every package has a wheel for Python {min(unknown)}: take {known}.')
    print('Fetching the packages, about 200 MB', file=sys.stderr)
    folder.mkdir()
    wanted, fetched = folder / 'wanted.lock', set()
    for python in pythons:
        for version in (f'{python}.0', f'{python}.99'):  # a few packages ask for the last number
            pins = {pin for block in blocks if (pin := _for(block, version))}
            wanted.write_text('\n'.join(pins - fetched))
            fetched = pins if version.endswith('.0') else set()
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
    parser.add_argument('--no-solutions', action='store_true')
    parser.add_argument('--wheels', nargs='+', default=(), metavar='PYTHON', help='such as 3.12')
    parser.add_argument('--root', type=Path, default=ROOT)
    options = parser.parse_args(arguments)
    output = options.root / 'handout' / f'{NAME}.tar.gz'
    try:
        solutions, pythons = not options.no_solutions, tuple(options.wheels)
        left_out = not_committed(options.root)
        handout(options.root, output, solutions=solutions, pythons=pythons)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    what = f'for Python {" and ".join(pythons)}, no network needed' if pythons else 'no packages'
    print(f'{output}: {output.stat().st_size / 1e6:.1f} MB, {what}.')
    if left_out:
        print('Not committed, so not in it:', ', '.join(left_out))
    print(f'Students: tar xf {output.name} && cd {NAME} && make lab')
    return 0


if __name__ == '__main__':
    sys.exit(main())
