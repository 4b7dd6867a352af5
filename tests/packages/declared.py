"""What a package uses in its files, and its package.xml does not name.

Another dependency may bring it along today, as `sensor_msgs` brings `std_msgs`, so that the package
builds and runs in an environment of what it names. Its own manifest must name it all the same.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from catkin_pkg.package import Package
from support.environments import SHARE
from support.imports import imported_packages

KEYS = {'numpy': 'python3-numpy', 'pytest': 'python3-pytest', 'yaml': 'python3-yaml'}


def undeclared(package: Package, folder: Path, ours: set[str]) -> Iterator[str]:
    """Yield a sentence for each package that a file uses and the manifest does not name.

    `ours` are packages of the workspace. In it, only those of ROS are known by their name.
    """

    def names(*moments: str) -> set[str]:
        return {d.name for moment in moments for d in getattr(package, f'{moment}_depends')}

    to_run, to_test = names('exec'), names('exec', 'test')
    to_build = names('build', 'buildtool', 'test')
    said = set()
    for file in sorted(path for path in folder.rglob('*') if path.is_file()):
        part = file.relative_to(folder)
        text = file.read_text(errors='replace') if file.suffix in READERS else ''
        uses, verb = READERS.get(file.suffix, (lambda _: set(), ''))
        if file.suffix == '.txt' and file.name != 'CMakeLists.txt' or file.name == 'setup.py':
            continue
        if file.suffix == '.py':
            named = to_test if part.parts[0] == 'test' else to_run
        else:
            named = to_run if 'launch' in part.parts else to_build
        for name in sorted(uses(text)):
            key = KEYS.get(name, name)
            known = name in KEYS or name in ours or (SHARE / name / 'package.xml').is_file()
            if name == package.name or key in named or not known:
                continue
            sentence = (
                f'{package.name}: {part} {verb} {name}, and its package.xml does not name {key}'
            )
            if (key, verb) not in said:
                said.add((key, verb))
                yield f'{sentence}.'
    if [*folder.glob('test/test_*.py')] and 'python3-pytest' not in to_test:
        yield f'{package.name} has tests, and its package.xml does not name python3-pytest.'
    starts = [*folder.glob('launch/*launch.*')]
    if starts and 'ros2launch' not in to_run:
        yield f'{package.name} has launch files, and its package.xml does not name ros2launch.'


def _includes(text: str) -> set[str]:
    return {*re.findall(r'^\s*#include [<"](\w+)/', text, re.MULTILINE)}


def _found_by_cmake(text: str) -> set[str]:
    return {*re.findall(r'^\s*find_package\(\s*(\w+)', text, re.MULTILINE)}


def _started(text: str) -> set[str]:
    return {*re.findall(r'\bpkg(?:="|: *|=\')(\w+)', text)}


READERS = {
    '.py': (imported_packages, 'imports'),
    '.cpp': (_includes, 'includes'),
    '.hpp': (_includes, 'includes'),
    '.txt': (_found_by_cmake, 'finds'),
    '.xml': (_started, 'starts'),
    '.yaml': (_started, 'starts'),
}
