"""Write licences.md: every locked package, and the licence that it names.

    python -m tools.licences

Not pip-licenses: it reads the metadata of wheels, and those of ROS 2 name their licence only in the
package.xml that they install. npm writes it into its lock files.
"""

import json
import re
import sys
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from xml.etree import ElementTree

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
# What these say in a text or in their source only.
STATED = {
    'empy': 'LGPL',
    'ros-fastcdr': 'Apache-2.0',
    'ros-fastrtps': 'Apache-2.0',
    'setuptools': 'MIT',
}
# Licences that ask for more than to be named.
COPYLEFT = re.compile('GPL|MPL|EPL|CDDL|Mozilla|General Public')
TEXT = """# Licences

Made by `make licences` from the lock files, and from what the packages say about themselves.

This repository is under [Apache-2.0](LICENSE) and holds none of these packages: each machine gets
them from a package index. So their licences matter to those who pass the packages on, for example
in an image of a machine for a class. `make slides` copies reveal.js and MathJax beside the slides,
with their licences.

Most licences here ask for one thing: to stay beside the package. Who passes on the following ones
must also offer their source, with all changes. Programs that only use them keep their own licence.
Under the GPL is one file of docutils, for Emacs, which its wheel leaves out.

{copyleft}

The wheels of ROS 2 also hold libraries of the machine that they were built on, in the folders
`ros_*.libs` of `site-packages`: LTTng-UST and Userspace RCU (LGPL-2.1), OpenSSL, fmt, LibYAML,
spdlog and TinyXML-2. Others who pack libraries name them in the text of their licence.

| Package | Version | Licence, in its own words | Lock file |
|---|---|---|---|
{rows}
"""


def licence_of(name: str) -> str:
    """Return the licence of an installed Python package, in its own words.

    Raises PackageNotFoundError where it is not installed, ValueError where it names no licence.
    """
    # `ros-jazzy-rclpy` is empty, and asks for `ros-rclpy`.
    package = distribution(name.replace('ros-jazzy-', 'ros-'))
    short = package.metadata.get('License', '').strip()
    classifiers = package.metadata.get_all('Classifier', [])
    names = [line.rpartition(' :: ')[2] for line in classifiers if line.startswith('License ::')]
    xml = [package.locate_file(f) for f in package.files or () if f.name == 'package.xml']
    tags = [tag.text.strip() for file in xml for tag in ElementTree.parse(file).iter('license')]
    found = (
        STATED.get(name)
        or package.metadata.get('License-Expression')
        or (short if len(short) <= 60 and short != 'UNKNOWN' else '')  # else the whole text
        or ', '.join(names)
        or ', '.join(dict.fromkeys(tags))
    )
    if not found:
        raise ValueError(f'{name} names no licence: find it, and write it into STATED.')
    return found


def locked(file: str) -> dict[str, dict[str, str]]:
    """Return the versions of each package in a lock file, with npm's licence or an empty one."""
    text = (ROOT / file).read_text()
    found: dict[str, dict[str, str]] = {}
    if file.endswith('.json'):
        for path, package in json.loads(text)['packages'].items():
            if path:
                name = path.rpartition('node_modules/')[2]
                found.setdefault(name, {})[package['version']] = package['license']
    else:
        for name, version in re.findall(r'^([a-z][\w.-]*)==(\S+)', text, re.MULTILINE):
            found.setdefault(name, {})[version] = ''
    return found


def rows() -> list[tuple[str, str, str, str]]:
    """Return name, versions, licence and lock file of every locked package.

    Raises ValueError where one is not installed here, or names no licence.
    """
    found = {}
    for file, command in LOCKS.items():
        for name, versions in locked(file).items():
            try:
                licences = sorted(filter(None, versions.values())) or [licence_of(name)]
            except PackageNotFoundError:
                raise ValueError(f'{name} is not installed: run `{command}` once.') from None
            row = (name, ', '.join(sorted(versions)), ', '.join(dict.fromkeys(licences)), file)
            # A package in two lock files of Python is one package.
            found.setdefault((name, file.endswith('.json')), row)
    return [found[key] for key in sorted(found)]


def text_of(packages: list[tuple[str, str, str, str]]) -> str:
    """Return the text of licences.md."""
    copyleft = [f'`{name}`' for name, _, licence, _ in packages if COPYLEFT.search(licence)]
    lines = [f'| `{name}` | {" | ".join(rest)} |' for name, *rest in packages]
    return TEXT.format(copyleft=', '.join(copyleft), rows='\n'.join(lines))


if __name__ == '__main__':
    try:
        TABLE.write_text(text_of(rows()))
    except ValueError as error:
        sys.exit(str(error))
