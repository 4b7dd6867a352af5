"""Interfaces as the ros2 command line shows them, what they need, and what a package still lacks.

`show` and `list_interfaces` print what `ros2 interface show` and `ros2 interface list` print on
Jazzy: those commands have no wheels. `dependencies` and `needed_packages` tell which packages an
interface needs. `check_package` reads a package before it is built.

An interface has a name of three parts, such as `sensor_msgs/msg/Image`. It is found through the
ament index: first in the prefixes of AMENT_PREFIX_PATH, in their order, then in this environment.
"""

from __future__ import annotations

import contextlib
import difflib
import glob
import io
import os
import re
import sys
from collections.abc import Iterable, Iterator
from functools import cache, lru_cache
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from catkin_pkg.package import InvalidPackage, Package, parse_package_string
from rosidl_adapter import parser

from helpers.cmake_lists import GENERATE, CMakeLists, CMakeListsError
from helpers.text import wrap
from helpers.values import shown

KINDS = {'msg': 'Messages', 'srv': 'Services', 'action': 'Actions'}
COMMENTS = ('default', 'all', 'none')
SEPARATOR = parser.SERVICE_REQUEST_RESPONSE_SEPARATOR  # an action uses the same one
INDEX = 'share/ament_index/resource_index'


def show(name: str, comments: str = 'default') -> None:
    r"""Print an interface, with each nested message below its field, one tab deeper.

    `comments` is 'default' (the comments of the interface itself), 'all' (also those of the nested
    messages, as --all-comments) or 'none' (as --no-comments).

    Where comments are hidden, the command leaves remains of some: a `#` after a field, a comment
    line that is indented or empty. So does this function. Version 0.32.11 of the command (July
    2026) hides the comment lines among them. An interface that exists only as .idl is printed
    as it is.

    Raises TypeError if `name` is no text, and ValueError if there is no such interface or if
    `comments` is none of the three.
    """
    if not isinstance(comments, str) or comments not in COMMENTS:
        raise ValueError(f'comments must be one of {", ".join(COMMENTS)}, not {shown(comments)}.')
    print(''.join(_listing(name, comments != 'none', comments == 'all')), end='')


def list_interfaces(containing: str = '') -> None:
    """Print the names of all interfaces: first messages, then services, then actions.

    With `containing`, print only the lines that contain this text, as
    `ros2 interface list | grep containing` does.

    Raises TypeError if `containing` is no text.
    """
    if not isinstance(containing, str):
        raise TypeError(f'containing must be a text, not {shown(containing)}.')
    names = _names()
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

    Raises TypeError if `name` is no text, and ValueError if there is no such interface or if it
    exists only as .idl.
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


class Finding(NamedTuple):
    """One thing that a package lacks.

    `file`: where, relative to the package. `missing`: what should be there. `error`: what Jazzy
    answers, or does, without it.
    """

    file: str
    missing: str
    error: str


class Findings(tuple):
    """What `check_package` found: a tuple of Finding, which shows itself as text."""

    __slots__ = ()

    def __repr__(self) -> str:
        if not self:
            return '[ok] Nothing is missing.'
        indent = ' ' * 10
        lines = []
        for finding in self:
            lines += wrap(f'[missing] {finding.file}: {finding.missing}', rest=indent)
            lines += wrap(f'Without it: {finding.error}', first=indent, rest=indent)
        # The name of a file need not be UTF-8.
        return '\n'.join(lines).encode('utf-8', 'backslashreplace').decode()


def check_package(path: str | os.PathLike) -> Findings:
    """Read an interface package and say, before any build, what is missing.

    `path` is the folder of the package: package.xml, CMakeLists.txt and the folders msg, srv and
    action. Packages beside it in the same folder count as present, though they are not built.
    What depends on a CMake variable that only a build knows is not judged.

    Raises TypeError if `path` is no path, and ValueError if there is no such folder or if it holds
    an ament_python package without interfaces.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f'path must be a folder, not {shown(path)}.')
    folder = Path(path)
    if not os.path.isdir(folder):
        raise ValueError(f'There is no folder {str(path)!r}. Give the folder with package.xml.')
    check = _Check(folder)
    findings = Findings(dict.fromkeys(check.findings()))
    python = check.manifest and check.manifest.get_build_type() == 'ament_python'
    if python and not check.on_disk and not check.cmake:
        raise ValueError(
            f'{check.manifest.name} is an ament_python package: only CMake ones have interfaces.'
        )
    return findings


# --- the ament index ---


def _prefixes() -> list[Path]:
    """Where packages are installed, the first wins. The wheels do not set AMENT_PREFIX_PATH."""
    named = [Path(p) for p in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if p]
    return [p for p in dict.fromkeys([*named, Path(sys.prefix)]) if (p / INDEX).is_dir()]


def _share(package: str) -> Path | None:
    """The share folder of an installed package."""
    for prefix in _prefixes():
        if os.path.isfile(prefix / INDEX / 'packages' / package):
            return prefix / 'share' / package
    return None


def _interface_packages() -> dict[str, Path]:
    """Each installed package that has interfaces, with its file in the ament index."""
    files = {}
    for prefix in _prefixes():
        for file in glob.glob(f'{glob.escape(str(prefix / INDEX))}/rosidl_interfaces/*'):
            files.setdefault(os.path.basename(file), Path(file))
    return files


def _names() -> list[str]:
    """The names of all installed interfaces, in the order of `ros2 interface list`."""
    names = set()
    for package, file in _interface_packages().items():
        for line in file.read_text(encoding='utf-8').splitlines():
            stem, _, suffix = line.rpartition('.')
            kind = stem.partition('/')[0]
            # A name with an underscore is a part of a service or an action.
            if kind in KINDS and suffix in (kind, 'idl') and '_' not in stem:
                names.add(f'{package}/{stem}')
    return sorted(names, key=lambda name: name.split('/', 1))


def _find(name: str) -> Path:
    """The file of an interface: .msg, .srv or .action, or else .idl."""
    if not isinstance(name, str):
        raise TypeError(
            f'An interface has a name such as "sensor_msgs/msg/Image", not {shown(name)}.'
        )
    match = re.fullmatch(r'(\w+)/(msg|srv|action)/(\w+)', name)
    share = match and _share(match[1])
    if share:
        for suffix in (match[2], 'idl'):
            file = share / match[2] / f'{match[3]}.{suffix}'
            if os.path.isfile(file):
                return file
    names = _names()
    if not names:
        raise ValueError(
            'No interface is installed here: AMENT_PREFIX_PATH must name a ROS 2 installation, or '
            'this Python must be that of an environment with ROS 2 in it.'
        )
    near = _nearest(name, names)
    hint = f'The nearest: {", ".join(near)}.' if near else 'list_interfaces() prints all names.'
    raise ValueError(f'There is no interface {name!r}. {hint}')


def _nearest(name: str, names: Iterable[str], number: int = 3) -> list[str]:
    """The names most like `name`: first those that differ only in package, kind or case."""
    lower = {n.lower(): n for n in names}
    last = name.lower().rpartition('/')[2]
    same = [n for n in lower if n.rpartition('/')[2] == last]
    same = difflib.get_close_matches(name.lower(), same, number, 0.0)
    close = difflib.get_close_matches(name.lower(), lower, number, 0.6)
    return [lower[n] for n in dict.fromkeys([*same, *close])][:number]


# --- show and dependencies ---


def _listing(name: str, own_comments: bool, nested_comments: bool, depth: int = 0) -> Iterator[str]:
    """The lines of `show`, each with its line end."""
    file = _find(name)
    package = name.split('/')[0]
    with file.open(encoding='utf-8') as lines:
        if file.suffix == '.idl':
            yield from lines
            return
        for text in map(str.rstrip, lines):
            bare, nested = _read_line(package, text)
            shown = text if own_comments else bare
            if shown is not None:
                yield '\t' * depth + shown + '\n' if shown else '\n'
            if nested:
                yield from _listing(nested, nested_comments, nested_comments, depth + 1)


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
    file = _find(name)
    if file.suffix == '.idl':
        raise ValueError(f'{name} exists only as .idl. Give a message, a service or an action.')
    return _parse(name.split('/')[0], file)


def _parse(package: str, file: Path) -> dict[str, list[parser.Field]]:
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


# --- check_package ---

GENERATORS = ('rosidl_default_generators', 'rosidl_core_generators')
RUNTIMES = ('rosidl_default_runtime', 'rosidl_core_runtime')
# Types of Python and C++ that an interface does not have.
SLIPS = {
    'int': 'int32 or int64',
    'float': 'float32 or float64',
    'double': 'float64',
    'str': 'string',
    'boolean': 'bool',
}
GROUP = 'rosidl_interface_packages'
FIRST_PART = {
    'msg': '',
    'srv': parser.SERVICE_REQUEST_MESSAGE_SUFFIX,
    'action': parser.ACTION_GOAL_SUFFIX,
}
AUTO_FIND = 'ament_auto_find_build_dependencies'


class _Check:
    """One look at one package. Each method yields findings of one file."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.manifest: Package | None = None
        self.cmake: CMakeLists | None = None
        self.uses: dict[str, str] = {}  # package of a field's type -> the file that uses it first
        files = (f for f in folder.glob('*/*') if f.parent.name in KINDS and os.path.isfile(f))
        files = (self._relative(f) for f in files)
        self.on_disk = sorted(f for f in files if Path(f).suffix == f'.{Path(f).parent}')

    def findings(self) -> Iterator[Finding]:
        # Each step needs what the earlier ones have read.
        yield from self._read_manifest()
        yield from self._read_cmake()
        for file in sorted({*self.on_disk, *self._listed()}):
            yield from self._check_interface(file)
        if self.cmake:
            yield from self._check_cmake(self.cmake)
        if self.manifest:
            yield from self._check_manifest(self.manifest)

    def _relative(self, file: Path) -> str:
        return file.relative_to(self.folder).as_posix()

    def _listed(self) -> list[str]:
        """The files that rosidl_generate_interfaces() is given, as far as they are known."""
        calls = self.cmake.generate if self.cmake else []
        return [f for call in calls for f in call.files if not _unknown(f)]

    def _given(self) -> list[str]:
        """The packages behind DEPENDENCIES, also where somebody has put commas between them."""
        given = self.cmake.dependencies if self.cmake else []
        return [package for word in given for package in word.split(',') if package]

    def _unsure(self) -> bool:
        """May rosidl_generate_interfaces() be given more files than are listed?"""
        calls = self.cmake.generate if self.cmake else []
        return any(_unknown(f) for call in calls for f in call.files)

    # package.xml

    def _read_manifest(self) -> Iterator[Finding]:
        name = 'package.xml'
        try:
            text = (self.folder / name).read_bytes()
        except FileNotFoundError:
            yield Finding(name, 'the file itself', 'colcon does not see a ROS package here')
            return
        except OSError as error:  # a folder, a link to nothing, ...
            yield _unreadable(name, error)
            return
        try:
            self.manifest = parse_package_string(text, name, warnings=[])
            self.manifest.evaluate_conditions({'ROS_VERSION': '2', 'ROS_DISTRO': 'jazzy'})
        except InvalidPackage as error:
            # The first line is only the name of the file.
            message = str(error).partition('\n')[2].replace('\n', ' ')
            missing = _missing_in_manifest(message, text.decode('utf-8', 'replace'))
            yield Finding(name, missing, f'InvalidPackage: {message}')
        except Exception as error:  # the condition or the encoding of a tag cannot be read
            message = f'{type(error).__name__}: {error}'
            yield Finding(name, 'text that can be read as a manifest', message)

    def _check_manifest(self, manifest: Package) -> Iterator[Finding]:
        name = 'package.xml'
        build = _depends(manifest, 'buildtool', 'build')
        if manifest.get_build_type() != 'ament_cmake':
            yield Finding(
                name, '<build_type>ament_cmake</build_type> in <export>',
                f'colcon builds it as {manifest.get_build_type()!r}: setup.bash does not add it to '
                f'AMENT_PREFIX_PATH, and "ros2 interface show" says '
                f'"Unknown package {manifest.name!r}"',
            )  # fmt: skip
        if not any(package.startswith('ament_cmake') for package in build):
            yield Finding(
                name, '<buildtool_depend>ament_cmake</buildtool_depend>',
                'it builds only where ament_cmake is installed already; elsewhere '
                '"ament_cmakeConfig.cmake" is not found',
            )  # fmt: skip
        if not self.on_disk:
            return
        if not build & {*GENERATORS}:
            yield Finding(
                name, f'<buildtool_depend>{GENERATORS[0]}</buildtool_depend>',
                'it builds only where the generators are installed already; elsewhere '
                f'"{GENERATORS[0]}Config.cmake" is not found',
            )  # fmt: skip
        if not _depends(manifest, 'exec', 'build_export') & {*RUNTIMES}:
            yield Finding(
                name, f'<exec_depend>{RUNTIMES[0]}</exec_depend>',
                'it builds; a machine that only runs it may lack the libraries which load it',
            )  # fmt: skip
        if GROUP not in [group.name for group in manifest.member_of_groups]:
            tag = f'<member_of_group>{GROUP}</member_of_group>'
            yield Finding(name, tag, f'"Packages installing interfaces must include \'{tag}\'"')
        reached = self._reached(build)
        given = self._given()
        for package in dict.fromkeys([*given, *self.uses]):
            if package == manifest.name or '$' in package or not self._where(package):
                continue
            if package not in (build if package in given else reached):
                yield Finding(
                    name, f'<depend>{package}</depend>',
                    f'it builds only where {package} is installed already; elsewhere '
                    f'"{package}Config.cmake" is not found',
                )  # fmt: skip

    # CMakeLists.txt

    def _read_cmake(self) -> Iterator[Finding]:
        name = 'CMakeLists.txt'
        try:
            text = (self.folder / name).read_text(encoding='utf-8', errors='replace')
        except FileNotFoundError:
            error = 'CMake stops: the source directory "does not appear to contain CMakeLists.txt"'
            yield Finding(name, 'the file itself', error)
            return
        except OSError as error:
            yield _unreadable(name, error)
            return
        try:
            self.cmake = CMakeLists(text)
        except CMakeListsError as error:
            yield Finding(name, *error.args)

    def _check_cmake(self, cmake: CMakeLists) -> Iterator[Finding]:
        name = 'CMakeLists.txt'
        package = self.manifest.name if self.manifest else None
        if 'cmake_minimum_required' not in cmake.lines:
            yield Finding(
                name, 'cmake_minimum_required(VERSION 3.8)',
                'CMake stops with "No cmake_minimum_required command is present", after errors '
                'in the files of other packages',
            )  # fmt: skip
        if cmake.project is None:
            yield Finding(
                name, f'project({package or "the name of the package"})',
                'CMake takes the name \'Project\': "InvalidResourceName: \'Project\' is an '
                'invalid package name"',
            )  # fmt: skip
        elif package and '$' not in cmake.project and cmake.project != package:
            yield Finding(
                name, f'project({package}), the <name> of package.xml',
                f'CMake stops: the package name {package!r} does not match the current '
                f'PROJECT_NAME {cmake.project!r}',
            )  # fmt: skip

        found = dict(cmake.found)
        unsure = any('$' in package for package in found)
        if AUTO_FIND in cmake.lines:  # it finds what package.xml names
            unsure |= self.manifest is None
            named = _depends(self.manifest, 'buildtool', 'build')
            found |= dict.fromkeys(named - found.keys(), cmake.lines[AUTO_FIND])
        if not unsure and not any(package.startswith('ament_cmake') for package in found):
            yield Finding(
                name, 'find_package(ament_cmake REQUIRED)',
                f'it builds, only because {GENERATORS[0]} brings ament_cmake with it; without '
                'both: Unknown CMake command "ament_package"',
            )  # fmt: skip
        yield from self._check_generate(cmake, found, unsure)
        last = cmake.lines.get('ament_package') or cmake.lines.get('ament_auto_package')
        if not last:
            yield Finding(
                name, 'ament_package(), at the end',
                'it builds, but setup.bash then says "not found: .../local_setup.bash", and '
                f'"ros2 interface show" "Unknown package {package!r}"',
            )  # fmt: skip
        elif any(call.line > last for call in cmake.generate):
            yield Finding(
                name, f'ament_package() after {GENERATE}()',
                f'"{GENERATE}() must be called before ament_package()"',
            )  # fmt: skip

    def _check_generate(
        self, cmake: CMakeLists, found: dict[str, int], unsure: bool
    ) -> Iterator[Finding]:
        name = 'CMakeLists.txt'
        if not cmake.generate:
            if self.on_disk:
                yield Finding(
                    name, f'{GENERATE}(${{PROJECT_NAME}} "{self.on_disk[0]}" ...)',
                    'it builds, but without any interface: "Could not find the interface"',
                )  # fmt: skip
            return
        first = cmake.generate[0].line
        if not unsure and not any(found.get(g, first) < first for g in GENERATORS):
            yield Finding(
                name, f'find_package({GENERATORS[0]} REQUIRED), before {GENERATE}()',
                f'Unknown CMake command "{GENERATE}"',
            )  # fmt: skip
        listed = {f for call in cmake.generate for f in call.files}
        for call in cmake.generate:
            if not call.files:
                file = self.on_disk[0] if self.on_disk else 'srv/Name.srv'
                yield Finding(
                    name, f'"{file}" in {GENERATE}(${{PROJECT_NAME}} ...)',
                    f'"{GENERATE}() called without any interface files"',
                )  # fmt: skip
        for file in self._listed():
            if not os.path.isfile(self.folder / file):
                yield Finding(
                    file, f'the file, which CMakeLists.txt line {first} names',
                    f'"{GENERATE}() the passed file \'{file}\' doesn\'t exist"',
                )  # fmt: skip
        if listed and not self._unsure():
            for file in self.on_disk:
                if file not in listed:
                    yield Finding(
                        name, f'"{file}" in {GENERATE}()',
                        'it builds, but without this interface; another interface that uses it '
                        'fails with FileNotFoundError',
                    )  # fmt: skip

        for given in cmake.dependencies:
            if ',' in given:
                yield Finding(
                    name, f'blanks in place of commas after DEPENDENCIES: {given}',
                    f'"the passed dependency \'{given}\' has not been found before using '
                    'find_package()"',
                )  # fmt: skip
        given = self._given()
        before = {package for package, line in found.items() if line < first}
        brought = self._reached(before)
        for package in given:
            if '$' not in package and not unsure and package not in brought:
                yield from self._not_found(package)
                yield Finding(
                    name, f'find_package({package} REQUIRED), before {GENERATE}()',
                    f'"the passed dependency \'{package}\' has not been found before using '
                    'find_package()"',
                )  # fmt: skip
        if any('$' in package for package in given):
            return
        kinds = {file.partition('/')[0] for file in self.on_disk}
        implicit = {'service_msgs'} if kinds & {'srv', 'action'} else set()
        implicit |= {'action_msgs'} if 'action' in kinds else set()
        reached = self._reached({*given, *implicit})
        for package, file in self.uses.items():
            if package in reached:
                continue
            if self._where(package):
                yield Finding(
                    name, f'DEPENDENCIES {package} in {GENERATE}(), for {file}',
                    f'KeyError: {package!r}, from rosidl_generator_type_description (on Humble: '
                    f'"fatal error: {package}/msg/...: No such file or directory")',
                )  # fmt: skip
            if self._where(package) and not unsure and package not in brought:
                yield Finding(
                    name, f'find_package({package} REQUIRED), before {GENERATE}()',
                    f'with DEPENDENCIES alone: "the passed dependency \'{package}\' has not been '
                    'found before using find_package()"',
                )  # fmt: skip

    # msg, srv, action

    def _check_interface(self, file: str) -> Iterator[Finding]:
        path = self.folder / file
        kind, short = Path(file).parent.name, Path(file).stem
        if path.suffix == '.idl' or not os.path.isfile(path):
            return
        if path.suffix != f'.{kind}':
            error = 'it builds, but "ros2 interface list" does not show it'
            if not kind:
                error = '"get_filename_component called with incorrect number of arguments"'
            folder = path.suffix[1:]
            yield Finding(
                file, f'its folder: {folder}/{path.name}, and so in CMakeLists.txt', error
            )
            return
        if not parser.is_valid_message_name(short):
            yield Finding(
                file, 'a name in CamelCase, of letters and digits, such as TurnCamera',
                f"InvalidResourceName: '{short}{FIRST_PART[kind]}' is an invalid message name",
            )  # fmt: skip
            return
        own = self.manifest.name if self.manifest else self.cmake and self.cmake.project
        if not own or not parser.is_valid_package_name(own):
            own = 'own_package'
        try:
            parts = _parse(own, path)
        except parser.InvalidServiceSpecification as error:
            what = f'one line that is exactly {SEPARATOR}, between request and response'
            yield Finding(file, what, _described(error))
        except parser.InvalidActionSpecification as error:
            what = f'two lines that are exactly {SEPARATOR}: goal, result and feedback'
            yield Finding(file, what, _described(error))
        except NameError as error:  # of a field; the parser raises Python's own
            what = 'a field name in lower case with underscores, such as deg_turn'
            yield Finding(file, what, _described(error))
        except Exception as error:  # the parser raises many kinds
            missing = _wrong_type(path) or 'a definition that rosidl can read'
            yield Finding(file, missing, _described(error))
        else:
            for field in (field for fields in parts.values() for field in fields):
                yield from self._check_field(file, field, own)

    def _check_field(self, file: str, field: parser.Field, own: str) -> Iterator[Finding]:
        package, short = field.type.pkg_name, field.type.type
        if package is None:
            return
        message = f'msg/{short}'
        if package == own:
            files = [Path(f) for f in (*self.on_disk, *self._listed())]
            if any(f.stem == short and f.parent.name == 'msg' for f in files) or self._unsure():
                return
            others = [n for n in _names() if n.endswith(f'/{message}')]
            hint = f', for example {others[0].replace("/msg/", "/")}' if others else ''
            yield Finding(
                file, f'the package of the type {short} of {field.name!r}{hint}',
                _no_file(f'{own}/{message}.json'),
            )  # fmt: skip
            return
        self.uses.setdefault(package, file)
        where = self._where(package)
        if not where:
            yield from self._not_found(package)
        elif not any(os.path.isfile(where / f'{message}.{suffix}') for suffix in ('msg', 'idl')):
            near = _nearest(f'{package}/{message}', [n for n in _names() if '/msg/' in n], 1)
            hint = f'. The nearest is {near[0].replace("/msg/", "/")}' if near else ''
            yield Finding(
                file, f'a message that exists: {package} has no {short}{hint}',
                _no_file(f'{package}/{message}.json'),
            )  # fmt: skip

    # other packages

    def _where(self, package: str) -> Path | None:
        """The folder of another package's interfaces: installed, or beside this package."""
        return _share(package) or self._beside().get(package)

    def _beside(self) -> dict[str, Path]:
        packages = {}
        for file in self.folder.resolve().parent.glob('*/package.xml'):
            manifest = _manifest(file)
            if manifest:
                packages[manifest.name] = file.parent
        return packages

    def _reached(self, packages: Iterable[str]) -> set[str]:
        """These packages, and all that they bring with them."""
        reached, todo = set(), list(packages)
        while todo:
            package = todo.pop()
            if package in reached:
                continue
            reached.add(package)
            where = self._where(package)
            manifest = _manifest(where / 'package.xml') if where else None
            todo += _depends(manifest, 'buildtool_export', 'build_export', 'exec')
        return reached

    def _not_found(self, package: str) -> Iterator[Finding]:
        if self._where(package):
            return
        near = difflib.get_close_matches(package, _interface_packages(), 1)
        hint = f'. Is it {near[0]}?' if near else ''
        yield Finding(
            self.uses.get(package, 'CMakeLists.txt'),
            f'the package {package}, which is neither installed nor in this workspace{hint}',
            f'find_package() does not find "{package}Config.cmake"',
        )


def _wrong_type(file: Path) -> str:
    """What an interface should have in place of the first type that is known to be a slip."""
    for word in re.findall(r'^\s*([\w/]+)', file.read_text('utf-8', 'replace'), re.MULTILINE):
        if word in SLIPS:
            return f'a type that exists, {SLIPS[word]}, in place of {word}'
        if long := re.fullmatch(r'(\w+)/msg/(\w+)', word):
            return f'{long[1]}/{long[2]} in place of {word}: in a definition a type has no /msg/'
    return ''


def _unknown(file: str) -> bool:
    return '$' in file or os.path.isabs(file)


def _no_file(name: str) -> str:
    return f"FileNotFoundError: [Errno 2] No such file or directory: '.../{name}'"


def _unreadable(file: str, error: OSError) -> Finding:
    return Finding(file, 'a file that can be read', f'{type(error).__name__}: {error.strerror}')


def _described(error: Exception) -> str:
    return f'{type(error).__name__}: {error}'


def _manifest(file: Path) -> Package | None:
    try:
        stat = file.stat()
        return _read_manifest(file, stat.st_mtime_ns, stat.st_size)
    except (OSError, InvalidPackage):
        return None


@lru_cache(maxsize=512)
def _read_manifest(file: Path, *_changed: int) -> Package:
    return parse_package_string(file.read_bytes(), str(file), warnings=[])


def _depends(manifest: Package | None, *kinds: str) -> set[str]:
    """The packages in the manifest's <..._depend> tags of these kinds, <depend> among them."""
    if manifest is None:
        return set()
    return {d.name for kind in kinds for d in manifest[f'{kind}_depends']}


def _missing_in_manifest(message: str, text: str) -> str:
    """What a manifest lacks that catkin_pkg refuses with `message`."""
    if 'invalid XML' in message:
        return _missing_tag(text)
    tag = re.search(r'"(\w+)" tag|at least one (maintainer)|Package (version|description)', message)
    if tag and 'must not contain' not in message:
        return f'<{next(filter(None, tag.groups()))}>...'
    return 'what its error says'


def _missing_tag(text: str) -> str:
    """The tag that an XML text neither opens nor closes, but should."""
    text = re.sub(r'<!--.*?-->|<\?.*?\?>|<[^<>]*/>', '', text, flags=re.DOTALL)
    opened = []
    for end, name in re.findall(r'<(/?)([\w.-]+)[^<>]*>', text):
        if not end:
            opened.append(name)
        elif name not in opened:
            return f'<{name}>, which </{name}> closes'
        elif opened[-1] != name:
            return f'</{opened[-1]}>'
        else:
            opened.pop()
    return f'</{opened[-1]}>' if opened else 'text that is XML'
