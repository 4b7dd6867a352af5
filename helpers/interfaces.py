"""Interfaces as the ros2 command line shows them, and what they need.

`show` and `list_interfaces` print what `ros2 interface show` and `ros2 interface list` print on
Jazzy: those commands have no wheels. `dependencies` and `needed_packages` tell which packages an
interface needs.

An interface has a name of three parts, such as `sensor_msgs/msg/Image`. It is found through the
ament index: first in the prefixes of AMENT_PREFIX_PATH, in their order, then in this environment.
"""

from __future__ import annotations

import contextlib
import difflib
import io
import os
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pandas as pd
from rosidl_adapter import parser

SEPARATOR = parser.SERVICE_REQUEST_RESPONSE_SEPARATOR  # an action uses the same one
KINDS = {'msg': 'Messages', 'srv': 'Services', 'action': 'Actions'}
INDEX = 'share/ament_index/resource_index'


def show(name: str) -> None:
    r"""Print an interface, with each nested message below its field, one tab deeper.

    Of the nested messages the command hides the comments, and leaves remains of some: a `#` after
    a field, a comment line that is indented or empty. So does this function. Version 0.32.11 of
    the command (July 2026) hides the comment lines among them.

    Raises ValueError if there is no such interface.
    """
    print(''.join(_listing(name)), end='')


def list_interfaces(containing: str = '') -> None:
    """Print the names of all interfaces: first messages, then services, then actions.

    With `containing`, print only the lines that contain this text, as
    `ros2 interface list | grep containing` does.
    """
    names = installed_names()
    for kind, heading in KINDS.items():
        own = [f'    {name}' for name in names if name.split('/')[1] == kind]
        for line in (f'{heading}:', *own):
            if containing in line:
                print(line)


def dependencies(name: str) -> pd.DataFrame:
    """The tree of an interface's fields down to the primitive types, one row a field.

    Columns: `depth` (int; 0 is the interface itself, and its row is the first), `field` (its name),
    `type` (a full name such as 'sensor_msgs/msg/Image', or a primitive type such as 'uint8'),
    `package` (the package of the type, empty for a primitive type), and `array` ('' or the
    brackets: '[]', '[9]', '[<=5]'). The fields of a row follow it, one deeper. The parts of a
    service (request, response) and of an action (goal, result, feedback) are rows too.

    Raises ValueError if there is no such interface.
    """
    _find(name)
    package, kind, short = name.split('/')
    rows = [(0, short, name, package, '')]
    for part, fields in _parts(name).items():
        if part:
            rows.append((1, part, f'{name}_{part.capitalize()}', package, ''))
        rows += _rows(fields, 1 if kind == 'msg' else 2)
    return pd.DataFrame(rows, columns=['depth', 'field', 'type', 'package', 'array'])


def needed_packages(name: str) -> list[str]:
    """The other packages whose messages an interface, or a message of its own package, uses.

    These are the packages which a package with this interface must name after DEPENDENCIES, in
    find_package() and in <depend>. What those packages need in turn comes with them.

    Raises the errors of `dependencies`.
    """
    tree = dependencies(name)
    own = tree.package[0]
    needed, packages = set(), []
    for row in tree.itertuples():
        packages[row.depth :] = [row.package]  # of the row and of all rows above it
        if row.depth and packages[-2] == own and row.package not in ('', own):
            needed.add(row.package)
    return sorted(needed)


# --- the ament index ---


def _prefixes() -> list[Path]:
    """Where packages are installed, the first wins. The wheels do not set AMENT_PREFIX_PATH."""
    named = [Path(p) for p in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if p]
    return [p for p in dict.fromkeys([*named, Path(sys.prefix)]) if (p / INDEX).is_dir()]


def share_folder(package: str) -> Path | None:
    """The share folder of an installed package."""
    for prefix in _prefixes():
        if os.path.isfile(prefix / INDEX / 'packages' / package):
            return prefix / 'share' / package
    return None


def installed_names() -> list[str]:
    """The names of all installed interfaces, in the order of `ros2 interface list`."""
    files = {}
    for prefix in _prefixes():
        for file in (prefix / INDEX / 'rosidl_interfaces').glob('*'):
            files.setdefault(file.name, file)  # the first prefix wins
    names = set()
    for package, file in files.items():
        for line in file.read_text(encoding='utf-8').splitlines():
            stem, _, suffix = line.rpartition('.')
            kind = stem.partition('/')[0]
            # A name with an underscore is a part of a service or an action.
            if kind in KINDS and suffix == kind and '_' not in stem:
                names.add(f'{package}/{stem}')
    return sorted(names, key=lambda name: name.split('/', 1))


def _find(name: str) -> Path:
    """The .msg, .srv or .action file of an interface."""
    if match := re.fullmatch(r'(\w+)/(msg|srv|action)/(\w+)', str(name)):
        file = (share_folder(match[1]) or Path()) / match[2] / f'{match[3]}.{match[2]}'
        if file.is_file():
            return file
    near = _nearest(str(name))
    hint = f'The nearest: {near}.' if near else 'list_interfaces() prints all names.'
    raise ValueError(f'There is no interface {name!r}. {hint}')


def _nearest(name: str) -> str:
    """The name most like `name`, rather one that differs only in package, kind or case, or ''."""
    lower = {known.lower(): known for known in installed_names()}
    last = name.lower().rpartition('/')[2]
    same = [known for known in lower if known.rpartition('/')[2] == last]
    near = difflib.get_close_matches(name.lower(), same, cutoff=0)
    near = near or difflib.get_close_matches(name.lower(), lower)
    return lower[near[0]] if near else ''


# --- show and dependencies ---


def _listing(name: str, depth: int = 0) -> Iterator[str]:
    """The lines of `show`, each with its line end."""
    file = _find(name)
    package = name.split('/')[0]
    with file.open(encoding='utf-8') as lines:
        for text in map(str.rstrip, lines):
            bare, nested = _read_line(package, text)
            if depth == 0:
                yield f'{text}\n'
            elif bare is not None:
                yield '\t' * depth + f'{bare}\n' if bare else '\n'
            if nested:
                yield from _listing(nested, depth + 1)


@cache
def _read_line(package: str, text: str) -> tuple[str | None, str | None]:
    """A line of an interface without its comment (None: the line vanishes), and what it nests.

    The command reads each line on its own. Where it hides a comment, it looks for the text which
    the parser gives, without `#`, unit and indentation, and cuts one character before it.
    """
    if text == SEPARATOR:
        return text, None
    line = _quietly(parser.parse_message_string, package, 'Line', text)
    if not text or line.annotations['comment']:
        return None, None
    bare = text
    for element in (*line.fields, *line.constants):
        comment = element.annotations['comment']
        if comment:
            bare = text[: text.find(comment[0]) - 1].strip()
    nested = [_full_name(f.type) for f in line.fields if not f.type.is_primitive_type()]
    return bare, nested[0] if nested else None


def _quietly(function, *arguments):
    """Call one of the parser's functions, which print errors before they raise them."""
    with contextlib.redirect_stderr(io.StringIO()):
        return function(*arguments)


def _full_name(type_: parser.BaseType) -> str:
    if type_.is_primitive_type():
        return parser.BaseType.__str__(type_)
    return f'{type_.pkg_name}/msg/{type_.type}'


def _parts(name: str) -> dict[str, list[parser.Field]]:
    """The fields of each part of an interface. A message has one part without a name."""
    return read_fields(name.split('/')[0], _find(name))


def read_fields(package: str, file: Path) -> dict[str, list[parser.Field]]:
    """Read a .msg, .srv or .action file with rosidl_adapter, which raises many kinds of errors."""
    kind = file.suffix[1:]
    read = {
        'msg': parser.parse_message_file,
        'srv': parser.parse_service_file,
        'action': parser.parse_action_file,
    }[kind]
    spec = _quietly(read, package, str(file))
    if kind == 'msg':
        return {'': spec.fields}
    parts = ('request', 'response') if kind == 'srv' else ('goal', 'result', 'feedback')
    return {part: getattr(spec, part).fields for part in parts}


def _rows(fields: list[parser.Field], depth: int) -> Iterator[tuple]:
    for field in fields:
        full, package = _full_name(field.type), field.type.pkg_name or ''
        array = str(field.type).removeprefix(parser.BaseType.__str__(field.type))
        yield depth, field.name, full, package, array
        if package:
            yield from _rows(_parts(full)[''], depth + 1)
