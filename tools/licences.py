"""Write licences.md: every locked Python package, and the licence that it names.

    python -m tools.licences

Not pip-licenses: it reads the metadata of wheels, and those of ROS 2 name their licence only in the
package.xml that they install.
"""

import re
import sys
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / 'licences.md'
LOCKS = sorted(ROOT.glob('requirements*.lock'))
# What these say in a text or in their source only.
STATED = {
    'docutils': 'Public Domain, BSD License',  # its file for Emacs, GPL, is not in the wheel
    'empy': 'LGPL',
    'jupyterhub-idle-culler': 'BSD-3-Clause',
    'quickjs-ng': 'MIT',
    'ros-fastcdr': 'Apache-2.0',
    'ros-fastrtps': 'Apache-2.0',
    'setuptools': 'MIT',
}
# Licences that ask for more than to be named.
COPYLEFT = re.compile('GPL|MPL|EPL|CDDL|Mozilla|General Public')
TEXT = """# Licences

Made by `make licences` from what the packages say about themselves.

This repository is under [Apache-2.0](LICENSE) and holds none of these packages: each machine gets
them from a package index. So their licences matter to those who pass the packages on, for example
in an image of a machine for a class. `make slides` copies reveal.js and MathJax beside the slides,
with their licences, `make site` the letters of Urdu (OFL-1.1) and the scripts of Sphinx and furo.

Most licences here ask for one thing: to stay beside the package. Whoever passes on the following
ones must also offer their source, with all changes. Programs that only use them keep their own
licence.

{copyleft}

The wheels of ROS 2 also hold libraries of the machine that they were built on, in the folders
`ros_*.libs` of `site-packages`: LTTng-UST and Userspace RCU (LGPL-2.1), OpenSSL, fmt, LibYAML,
spdlog and TinyXML-2. Others who pack libraries name them in the text of their licence. What npm
brings has its licence in `tools/hub/package-lock.json` and `tools/deck_template/package-lock.json`.

| Package | Licence, in its own words |
|---|---|
{rows}
"""


def locked() -> list[str]:
    """Return the names of all Python packages in the lock files."""
    text = ''.join(file.read_text() for file in LOCKS)
    return sorted(set(re.findall(r'^([a-z][\w.-]*)==', text, re.MULTILINE)))


def licence_of(name: str) -> str:
    """Return the licence of an installed package, in its own words; empty where it names none.

    Raises PackageNotFoundError where it is not installed.
    """
    # `ros-jazzy-rclpy` is empty, and asks for `ros-rclpy`.
    package = distribution(name.replace('ros-jazzy-', 'ros-'))
    short = package.metadata.get('License', '').strip()
    classifiers = package.metadata.get_all('Classifier', [])
    names = [line.rpartition(' :: ')[2] for line in classifiers if line.startswith('License ::')]
    xml = [package.locate_file(f) for f in package.files or () if f.name == 'package.xml']
    tags = [tag.text.strip() for file in xml for tag in ElementTree.parse(file).iter('license')]
    return (
        STATED.get(name)
        or package.metadata.get('License-Expression')
        or (short if len(short) <= 60 and short != 'UNKNOWN' else '')  # else the whole text
        or ', '.join(names)
        or ', '.join(dict.fromkeys(tags))
    )


def text_of(licences: dict[str, str]) -> str:
    """Return the text of licences.md."""
    copyleft = [f'`{name}`' for name, licence in licences.items() if COPYLEFT.search(licence)]
    rows = [f'| `{name}` | {licence} |' for name, licence in licences.items()]
    return TEXT.format(copyleft=', '.join(copyleft), rows='\n'.join(rows))


if __name__ == '__main__':
    try:
        found = {name: licence_of(name) for name in locked()}
    except PackageNotFoundError as error:
        sys.exit(f'{error.name} is not installed here: run `make licences`.')
    if unknown := [name for name, licence in found.items() if not licence]:
        sys.exit(f'{", ".join(unknown)} name no licence: find it, and write it into STATED.')
    TABLE.write_text(text_of(found))
