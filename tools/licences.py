"""Write the end of licences.md: every locked Python package, and the licence that it names.

python -m tools.licences
"""

import json
import re
import subprocess
import sys
from importlib.metadata import files
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / 'licences.md'
MADE = '<!-- made by `make licences` from what the packages say -->\n'
# What these say in a text or in their source only.
STATED = {
    'docutils': 'Public Domain, BSD License',  # its file for Emacs, GPL, is not in the wheel
    'empy': 'LGPL',
    'jupyterhub-idle-culler': 'BSD-3-Clause',
    'quickjs-ng': 'MIT',
    'ros-fastcdr': 'Apache-2.0',
    'ros-fastrtps': 'Apache-2.0',
    'setuptools': 'MIT',
    'uv': 'MIT OR Apache-2.0',  # in .uv
}
# Licences that ask for more than to be named.
COPYLEFT = re.compile('GPL|MPL|EPL|CDDL|Mozilla|General Public')


def locked() -> list[str]:
    """Return the names of all Python packages in the lock files."""
    files = [*ROOT.glob('requirements*.lock'), *ROOT.glob('classroom/*.lock')]
    text = ''.join(file.read_text() for file in files)
    return sorted(set(re.findall(r'^([a-z][\w.-]*)==', text, re.MULTILINE)))


def of_ros(name: str) -> str:
    """Return the licence in the package.xml that a wheel of ROS 2 installs."""
    # `ros-jazzy-rclpy` is empty, and asks for `ros-rclpy`.
    installed = files(name.replace('ros-jazzy-', 'ros-')) or ()
    xml = [file.locate() for file in installed if file.name == 'package.xml']
    tags = [tag.text.strip() for file in xml for tag in ElementTree.parse(file).iter('license')]
    return ', '.join(dict.fromkeys(tags))


def licences() -> dict[str, str]:
    """Return the licence of each locked package, in its own words.

    Raises KeyError with the name of a package that is not installed here, or names no licence.
    """
    command = ['pip-licenses', '--format=json', '--from=mixed', '--with-system']
    answer = subprocess.check_output([Path(sys.prefix, 'bin', command[0]), *command[1:]])
    said = {
        re.sub('[-_.]+', '-', package['Name']).lower(): package['License']
        for package in json.loads(answer)
    }
    found = {
        name: STATED.get(name) or (name.startswith('ros-') and of_ros(name)) or said[name]
        for name in locked()
    }
    if unknown := [name for name, licence in found.items() if licence in ('', 'UNKNOWN')]:
        raise KeyError(unknown[0])
    return found


def made(found: dict[str, str]) -> str:
    """Return the end of licences.md: the packages with copyleft, then all in a table."""
    copyleft = [f'`{name}`' for name, licence in found.items() if COPYLEFT.search(licence)]
    rows = [f'| `{name}` | {licence} |\n' for name, licence in found.items()]
    head = f'{MADE}\nWith copyleft: {", ".join(copyleft)}.\n\n'
    return head + '| Package | Licence, in its own words |\n|---|---|\n' + ''.join(rows)


if __name__ == '__main__':
    try:
        text = made(licences())
    except KeyError as error:
        sys.exit(f'{error}: install it with `make licences`, or find its licence, for STATED.')
    TABLE.write_text(TABLE.read_text().partition(MADE)[0] + text)
