"""Write licences.md: every locked package, and the licence that it names.

    python -m tools.licences

A Python package names its licence in its metadata. The wheels of ROS 2 name it in the package.xml
that they install, and a few packages only bring its text. npm writes it into its lock files.
"""

import json
import re
import sys
import sysconfig
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / 'licences.md'
# The lock files, and what installs the packages that they name.
LOCKS = {
    'requirements.lock': 'make lab',
    'requirements-browser.lock': 'make test-browser',
    'requirements-hub.lock': 'make hub',
    'tools/hub/package-lock.json': 'make hub',
    'tools/deck_template/package-lock.json': 'make slides',
}
# Licences that ask for more than to be named, and what the packages under them are for.
COPYLEFT = re.compile('GPL|MPL|EPL|CDDL|Mozilla|General Public')
PURPOSES = {
    'certifi': 'The certificates that HTTPS clients trust. JupyterLab asks for it.',
    'docutils': 'Reads reStructuredText. `catkin-pkg` asks for it. Under the GPL is a file for '
    'Emacs, which the wheel leaves out.',
    'empy': 'The templates of the code generators of ROS 2.',
    'fqdn': 'Checks host names. JupyterLab asks for it.',
    'hypothesis': 'Tests of this repository.',
    'pytest-repeat': '`colcon-core` asks for it. Nothing here uses it.',
    'pytest-rerunfailures': '`colcon-core` asks for it. Nothing here uses it.',
}
# The libraries inside the wheels of ROS 2, which do not name them. Other wheels do so, in the text
# of their licence.
BUNDLED = {
    'libcrypto': 'OpenSSL 1.1.1k: OpenSSL',
    'libfmt': 'fmt: MIT',
    'liblttng-ust': 'LTTng-UST: LGPL-2.1',
    'libspdlog': 'spdlog: MIT',
    'libssl': 'OpenSSL 1.1.1k: OpenSSL',
    'libtinyxml2': 'TinyXML-2: zlib',
    'liburcu': 'Userspace RCU: LGPL-2.1',
    'libyaml': 'LibYAML: MIT',
}
# What a package says elsewhere. With its version, so that a newer one is looked at again.
STATED = {'empy==3.3.4': 'LGPL'}  # __license__ in em.py
TEXTS = {
    r'\s*Apache License\s+Version 2\.0': 'Apache-2.0',
    r'Permission is hereby granted, free of charge': 'MIT',
}
OPENING = """# Licences

Made by `make licences` from the lock files, and from what the packages say about themselves.

This repository is under [Apache-2.0](LICENSE) and holds none of these packages: each machine gets
them from a package index. So their licences matter to those who pass the packages on, for example
in an image of a machine for a class. `make slides` copies reveal.js and MathJax beside the slides,
with their licences.

Most licences here ask for one thing: to stay beside the package. Who passes on the packages of this
table must also offer their source, with all changes. Programs that only use them keep their own
licence.
"""
INSIDE = """
The wheels of ROS 2 also hold libraries of the machine that they were built on: {libraries}.
"""


class Package(NamedTuple):
    """A row of the table: `versions` are those of the lock, `lock` is its file."""

    name: str
    versions: str
    licence: str
    lock: str


def pins(lock: str) -> dict[str, str]:
    """Return the version of each package in the text of a lock file, of Python or of npm.

    A package that has several versions has them separated by a comma.
    """
    if lock.startswith('{'):
        found = [(name, package['version']) for name, package in npm_packages(lock)]
    else:
        found = re.findall(r'^([a-z][\w.-]*)==(\S+)', lock, re.MULTILINE)
    versions: dict[str, str] = {}
    for name, version in sorted(found):
        versions[name] = f'{versions[name]}, {version}' if name in versions else version
    return versions


def npm_packages(lock: str) -> list[tuple[str, dict]]:
    """Return the name and the entry of each package in the text of a package-lock.json."""
    entries = json.loads(lock)['packages'].items()
    return [(path.rpartition('node_modules/')[2], package) for path, package in entries if path]


def licence_of(name: str) -> str:
    """Return the licence of an installed Python package, in its own words.

    Raises PackageNotFoundError where it is not installed, ValueError where it names no licence.
    """
    package = distribution(name)
    found = (
        STATED.get(f'{name}=={package.version}')
        or _in_metadata(package)
        or _in_package_xml(package)
        or _in_text(package)
    )
    if found:
        return found
    # `ros-jazzy-rclpy` is empty, and asks for `ros-rclpy`.
    needed = [Requirement(text) for text in package.requires or ()]
    needed = [requirement.name for requirement in needed if requirement.marker is None]
    if len(needed) != 1:
        raise ValueError(f'{name} names no licence: find it, and write it into STATED.')
    return licence_of(needed[0])


def _in_metadata(package: Distribution) -> str:
    short = package.metadata.get('License', '').strip()
    if len(short) > 60 or short == 'UNKNOWN':  # the whole text, or nothing
        short = ''
    classifiers = package.metadata.get_all('Classifier', [])
    names = [line.rpartition(' :: ')[2] for line in classifiers if line.startswith('License ::')]
    return package.metadata.get('License-Expression') or short or ', '.join(names)


def _in_package_xml(package: Distribution) -> str:
    files = [file for file in package.files or () if file.name == 'package.xml']
    tags = [
        tag
        for file in files
        for tag in ElementTree.parse(package.locate_file(file)).iter('license')
    ]
    return ', '.join(dict.fromkeys(tag.text.strip() for tag in tags))


def _in_text(package: Distribution) -> str:
    files = [file for file in package.files or () if file.name == 'LICENSE']
    found = {
        licence
        for file in files
        for start, licence in TEXTS.items()
        if file.parts[0].endswith('.dist-info') and re.match(start, file.read_text())
    }
    return ', '.join(sorted(found))


def packages() -> list[Package]:
    """Return every locked package.

    Raises ValueError where one is not installed here, or names no licence.
    """
    found = {}
    for file, command in LOCKS.items():
        lock = (ROOT / file).read_text()
        npm = dict(npm_packages(lock)) if lock.startswith('{') else {}
        for name, versions in pins(lock).items():
            try:
                licence = npm[name]['license'] if npm else licence_of(name)
            except PackageNotFoundError:
                raise ValueError(f'{name} is not installed: run `{command}` once.') from None
            # A package in two lock files of Python is one package.
            found.setdefault((name, bool(npm)), Package(name, versions, licence, file))
    return [found[key] for key in sorted(found)]


def bundled() -> set[str]:
    """Return the names and licences of the libraries inside the installed wheels of ROS 2.

    Raises ValueError where BUNDLED does not know one.
    """
    found = set()
    for file in Path(sysconfig.get_path('purelib')).glob('ros_*.libs/*'):
        own = file.name.rpartition('-')[0] + '.so'
        if Path(sys.prefix, 'lib', own).exists():  # a copy of what a package with a row brings
            continue
        name = re.match(r'[a-z]+[a-z0-9]*(-ust)?', file.name)[0]
        if name not in BUNDLED:
            raise ValueError(
                f'{file.name} in {file.parent.name} is not in BUNDLED: write its licence there.'
            )
        found.add(BUNDLED[name])
    return found


def text_of(rows: list[Package]) -> str:
    """Return the text of licences.md.

    Raises ValueError where a copyleft package has no line in PURPOSES.
    """
    copyleft = [row for row in rows if COPYLEFT.search(row.licence)]
    missing = {row.name for row in copyleft} - PURPOSES.keys()
    if missing:
        raise ValueError(f'Write into PURPOSES what this is for: {", ".join(sorted(missing))}.')
    lines = [OPENING, '| Package | Licence | What it is for |', '|---|---|---|']
    lines += [f'| `{row.name}` | {row.licence} | {PURPOSES[row.name]} |' for row in copyleft]
    lines += [INSIDE.format(libraries=', '.join(sorted(bundled()))), '## All packages', '']
    lines += ['| Package | Version | Licence, in its own words | Lock file |', '|---|---|---|---|']
    lines += [f'| `{row.name}` | {row.versions} | {row.licence} | {row.lock} |' for row in rows]
    return '\n'.join(lines) + '\n'


if __name__ == '__main__':
    try:
        TABLE.write_text(text_of(packages()))
    except ValueError as error:
        sys.exit(str(error))
