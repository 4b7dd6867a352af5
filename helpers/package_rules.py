"""What an interface package lacks, told before it is built.

`check_package` reads the package into one plain record, then asks a table of rules. A rule is here
where a lesson shows its mistake, where the build goes through in spite of it, or where the build's
answer is hard to read. All other mistakes are left to the build, which names them.
"""

from __future__ import annotations

import contextlib
import difflib
import os
import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from catkin_pkg.package import InvalidPackage, Package, parse_package_string
from rosidl_adapter import parser

from helpers.cmake_lists import GENERATE, CMakeLists
from helpers.interfaces import (
    KINDS,
    SEPARATOR,
    installed_names,
    nearest,
    read_fields,
    share_folder,
)
from helpers.text import wrap
from helpers.values import shown

MANIFEST = 'package.xml'
CMAKE = 'CMakeLists.txt'
GENERATORS = {'rosidl_default_generators', 'rosidl_core_generators'}
RUNTIMES = {'rosidl_default_runtime', 'rosidl_core_runtime'}
GROUP = 'rosidl_interface_packages'
BROUGHT_BY_KIND = {'srv': 'service_msgs', 'action': 'action_msgs'}
# Types of Python and C++ that an interface does not have.
SLIPS = {
    'int': 'int32 or int64',
    'float': 'float32 or float64',
    'double': 'float64',
    'str': 'string',
    'boolean': 'bool',
}


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
        return '\n'.join(lines)


def check_package(path: str | os.PathLike) -> Findings:
    """Read an interface package and say, before any build, what is missing.

    `path` is the folder of the package: package.xml, CMakeLists.txt and the folders msg, srv and
    action. Packages beside it in the same folder count as present, though they are not built.
    What depends on a CMake variable that only a build knows is not judged.

    Raises TypeError if `path` is no path, and ValueError if there is no such folder.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f'path must be a folder, not {shown(path)}.')
    if not os.path.isdir(path):
        raise ValueError(f'There is no folder {str(path)!r}. Give the folder with package.xml.')
    source = _read(Path(path).resolve())
    findings = [*source.unreadable, *_definitions(source), *_packages(source)]
    if source.cmake:
        findings += _ask(CMAKE_RULES, CMAKE, source)
    if source.manifest:
        findings += _ask(MANIFEST_RULES, MANIFEST, source)
    return Findings(findings)


# --- the record ---


class Definition(NamedTuple):
    """An interface file: its path in the package, its text, and its fields or why it has none."""

    file: str
    text: str
    fields: list[parser.Field]
    error: Exception | None


class Source(NamedTuple):
    """A package as it was read. `manifest` and `cmake` are None where they cannot be read."""

    folder: Path
    manifest: Package | None
    cmake: CMakeLists | None
    definitions: list[Definition]
    unreadable: list[Finding]

    @property
    def name(self) -> str:
        """The name of the package."""
        return self.manifest.name if self.manifest else self.folder.name

    @property
    def files(self) -> list[str]:
        """The interface files on the disk."""
        return [definition.file for definition in self.definitions]

    @property
    def given(self) -> list[str]:
        """The packages after DEPENDENCIES, also where somebody has put commas between them."""
        words = self.cmake.dependencies if self.cmake else []
        return [name for word in words for name in word.split(',') if name and '$' not in name]

    @property
    def uses(self) -> dict[str, str]:
        """The other packages whose messages are used, each with the first file that does."""
        uses: dict[str, str] = {}
        for definition in self.definitions:
            for field in definition.fields:
                if field.type.pkg_name not in (None, self.name):
                    uses.setdefault(field.type.pkg_name, definition.file)
        return uses

    def where(self, package: str) -> Path | None:
        """The folder of another package: where it is installed, or beside this one."""
        beside = self.folder.parent / package
        return share_folder(package) or (beside if (beside / MANIFEST).is_file() else None)

    def with_brought(self, packages: Iterable[str]) -> set[str]:
        """These packages, and all that they bring with them."""
        brought, todo = set(), list(packages)
        while todo:
            package = todo.pop()
            if package in brought:
                continue
            brought.add(package)
            if where := self.where(package):
                with contextlib.suppress(InvalidPackage):  # of a package beside this one
                    manifest = _manifest(where / MANIFEST)
                    todo += _depends(manifest, 'buildtool_export', 'build_export', 'exec')
        return brought


def _read(folder: Path) -> Source:
    manifest = cmake = None
    unreadable = []
    try:
        manifest = _manifest(folder / MANIFEST)
    except FileNotFoundError:
        unreadable.append(Finding(MANIFEST, 'the file', 'colcon does not see a ROS package here'))
    except InvalidPackage as error:
        message = f'InvalidPackage: {" ".join(str(error).splitlines()[1:])}'  # 0: the file's name
        unreadable.append(Finding(MANIFEST, 'a manifest that colcon can read', message))
    try:
        cmake = CMakeLists((folder / CMAKE).read_text(encoding='utf-8', errors='replace'))
    except FileNotFoundError:
        error = 'CMake stops: the source directory "does not appear to contain CMakeLists.txt"'
        unreadable.append(Finding(CMAKE, 'the file', error))
    except ValueError:
        what = "a ')' for each '(', and no more"
        unreadable.append(Finding(CMAKE, what, 'CMake stops with "Parse error."'))
    source = Source(folder, manifest, cmake, [], unreadable)
    files = [file for kind in KINDS for file in folder.glob(f'{kind}/*.{kind}')]
    source.definitions.extend(_definition(source.name, folder, file) for file in sorted(files))
    return source


def _manifest(file: Path) -> Package:
    return _parse_manifest(file.read_bytes())


@cache
def _parse_manifest(text: bytes) -> Package:
    return parse_package_string(text, MANIFEST, warnings=[])


def _depends(manifest: Package, *kinds: str) -> set[str]:
    """The packages in the manifest's <..._depend> tags of these kinds, <depend> among them."""
    return {depend.name for kind in kinds for depend in manifest[f'{kind}_depends']}


def _definition(package: str, folder: Path, path: Path) -> Definition:
    file = path.relative_to(folder).as_posix()
    text = path.read_text(encoding='utf-8', errors='replace')
    try:
        parts = read_fields(package, path)
    except Exception as error:  # the parser raises many kinds, also Python's own
        return Definition(file, text, [], error)
    return Definition(file, text, [field for fields in parts.values() for field in fields], None)


# --- rules of msg, srv and action ---


def _definitions(source: Source) -> Iterator[Finding]:
    for definition in source.definitions:
        if definition.error:
            error = f'{type(definition.error).__name__}: {definition.error}'
            yield Finding(definition.file, _unlike_rosidl(definition), error)
        for field in definition.fields:
            if field.type.pkg_name and (missing := _no_message(source, field)):
                file = f'.../{field.type.pkg_name}/msg/{field.type.type}.json'
                error = f"FileNotFoundError: [Errno 2] No such file or directory: '{file}'"
                yield Finding(definition.file, missing, error)


def _unlike_rosidl(definition: Definition) -> str:
    """What a definition lacks that rosidl_adapter cannot read."""
    if isinstance(definition.error, parser.InvalidServiceSpecification):
        return f'one line that is exactly {SEPARATOR}, between request and response'
    if isinstance(definition.error, parser.InvalidActionSpecification):
        return f'two lines that are exactly {SEPARATOR}: goal, result and feedback'
    if not parser.is_valid_message_name(Path(definition.file).stem):
        return 'a name in CamelCase, of letters and digits, such as TurnCamera'
    for word in re.findall(r'^\s*([\w/]+)', definition.text, re.MULTILINE):
        if word in SLIPS:
            return f'a type that exists, {SLIPS[word]}, in place of {word}'
        if long := re.fullmatch(r'(\w+)/msg/(\w+)', word):
            return f'{long[1]}/{long[2]} in place of {word}: in a definition a type has no /msg/'
    return 'a definition that rosidl can read'


def _no_message(source: Source, field: parser.Field) -> str:
    """What a field lacks whose message is not in its package, or nothing."""
    package, short = field.type.pkg_name, field.type.type
    messages = [name for name in installed_names() if '/msg/' in name]
    if package == source.name:
        listed = source.cmake.files if source.cmake else []
        if f'msg/{short}.msg' in (*source.files, *listed):
            return ''
        others = [name for name in messages if name.endswith(f'/{short}')]
        hint = f', for example {others[0].replace("/msg/", "/")}' if others else ''
        return f'the package of the type {short} of {field.name!r}{hint}'
    where = source.where(package)
    if not where or any((where / f'msg/{short}.{end}').is_file() for end in ('msg', 'idl')):
        return ''
    near = nearest(f'{package}/msg/{short}', messages, 1)
    hint = f'. The nearest is {near[0].replace("/msg/", "/")}' if near else ''
    return f'a message that exists: {package} has no {short}{hint}'


def _packages(source: Source) -> Iterator[Finding]:
    for package in dict.fromkeys([*source.given, *source.uses]):
        if not source.where(package):
            names = {name.partition('/')[0] for name in installed_names()}
            near = difflib.get_close_matches(package, names, 1)
            hint = f'. Is it {near[0]}?' if near else ''
            yield Finding(
                source.uses.get(package, CMAKE),
                f'the package {package}, which is neither installed nor in this workspace{hint}',
                f'find_package() does not find "{package}Config.cmake"',
            )


# --- rules of CMakeLists.txt and package.xml ---


class Rule(NamedTuple):
    """What a file must have.

    `lacks` tells whether it is missing, or lists what is. `{it}` in the texts is an element of this
    list, `{file}` the interface that uses it, `{name}` the name of the package.
    """

    lacks: Callable[[Source], bool | list[str]]
    missing: str
    error: str


def _ask(rules: list[Rule], file: str, source: Source) -> Iterator[Finding]:
    for lacks, missing, error in rules:
        lacking = lacks(source)
        for it in [''] if lacking is True else lacking or []:
            texts = {'it': it, 'file': source.uses.get(it), 'name': source.name}
            yield Finding(file, missing.format(**texts), error.format(**texts))


def _knows_found(source: Source) -> bool:
    """Do we know all that CMake finds? ament_cmake_auto finds what package.xml names."""
    found = source.cmake.found
    return 'ament_cmake_auto' not in found and not any('$' in name for name in found)


def _has_ament_cmake(packages: set[str]) -> bool:
    """Is ament_cmake among these packages, or one that brings it, such as ament_cmake_ros?"""
    return any(package.startswith('ament_cmake') for package in packages)


def _not_listed(source: Source) -> list[str]:
    listed = source.cmake.files
    known = listed and not any('$' in file for file in listed)
    return [file for file in source.files if known and file not in listed]


def _not_found(source: Source, packages: list[str]) -> list[str]:
    if not _knows_found(source):
        return []
    found = source.with_brought(source.cmake.found)
    return [package for package in packages if package not in found]


def _not_handed_on(source: Source) -> list[str]:
    cmake = source.cmake
    if GENERATE not in cmake.commands or any('$' in name for name in cmake.dependencies):
        return []
    kinds = {file.partition('/')[0] for file in source.files}
    implicit = [package for kind, package in BROUGHT_BY_KIND.items() if kind in kinds]
    brought = source.with_brought([*source.given, *implicit])
    return [package for package in source.uses if package not in brought and source.where(package)]


def _other_build_type(source: Source) -> list[str]:
    build_type = source.manifest.get_build_type()
    return [build_type] if build_type != 'ament_cmake' else []


def _not_named(source: Source) -> list[str]:
    """The used packages without <depend>. Those of DEPENDENCIES must be named themselves."""
    named = _depends(source.manifest, 'buildtool', 'build')
    brought = source.with_brought(named)
    packages = [p for p in dict.fromkeys([*source.given, *source.uses]) if source.where(p)]
    return [p for p in packages if p not in (named if p in source.given else brought)]


CMAKE_RULES = [
    Rule(
        lambda source: _knows_found(source) and not _has_ament_cmake(source.cmake.found),
        'find_package(ament_cmake REQUIRED)',
        'it builds, only because rosidl_default_generators brings ament_cmake with it; without '
        'both: Unknown CMake command "ament_package"',
    ),
    Rule(
        lambda source: source.files[:1] if GENERATE not in source.cmake.commands else [],
        f'{GENERATE}(${{{{PROJECT_NAME}}}} "{{it}}" ...)',
        'it builds, but without any interface: "Could not find the interface"',
    ),
    Rule(
        lambda source: (
            GENERATE in source.cmake.commands
            and _knows_found(source)
            and not GENERATORS & source.cmake.found
        ),
        f'find_package(rosidl_default_generators REQUIRED), before {GENERATE}()',
        f'Unknown CMake command "{GENERATE}"',
    ),
    Rule(
        _not_listed,
        f'"{{it}}" in {GENERATE}()',
        'it builds, but without this interface; another interface that uses it fails with '
        'FileNotFoundError',
    ),
    Rule(
        lambda source: [word for word in source.cmake.dependencies if ',' in word],
        'blanks in place of commas after DEPENDENCIES: {it}',
        '"the passed dependency \'{it}\' has not been found before using find_package()"',
    ),
    Rule(
        lambda source: _not_found(source, source.given),
        f'find_package({{it}} REQUIRED), before {GENERATE}()',
        '"the passed dependency \'{it}\' has not been found before using find_package()"',
    ),
    Rule(
        _not_handed_on,
        f'DEPENDENCIES {{it}} in {GENERATE}(), for {{file}}',
        'KeyError: {it!r}, from rosidl_generator_type_description (on Humble: '
        '"fatal error: {it}/msg/...: No such file or directory")',
    ),
    Rule(
        lambda source: _not_found(source, _not_handed_on(source)),
        f'find_package({{it}} REQUIRED), before {GENERATE}()',
        'with DEPENDENCIES alone: '
        '"the passed dependency \'{it}\' has not been found before using find_package()"',
    ),
    Rule(
        lambda source: not source.cmake.commands & {'ament_package', 'ament_auto_package'},
        'ament_package(), at the end',
        'it builds, but setup.bash then says "not found: .../local_setup.bash", and '
        '"ros2 interface show" "Unknown package {name!r}"',
    ),
]
ONLY_WHERE_INSTALLED = (
    'it builds only where {} installed already; elsewhere "{}Config.cmake" is not found'
)
MANIFEST_RULES = [
    Rule(
        _other_build_type,
        '<build_type>ament_cmake</build_type> in <export>',
        'colcon builds it as {it!r}: setup.bash does not add it to AMENT_PREFIX_PATH, and '
        '"ros2 interface show" says "Unknown package {name!r}"',
    ),
    Rule(
        lambda source: not _has_ament_cmake(_depends(source.manifest, 'buildtool', 'build')),
        '<buildtool_depend>ament_cmake</buildtool_depend>',
        ONLY_WHERE_INSTALLED.format('ament_cmake is', 'ament_cmake'),
    ),
    Rule(
        lambda source: not GENERATORS & _depends(source.manifest, 'buildtool', 'build'),
        '<buildtool_depend>rosidl_default_generators</buildtool_depend>',
        ONLY_WHERE_INSTALLED.format('the generators are', 'rosidl_default_generators'),
    ),
    Rule(
        lambda source: not RUNTIMES & _depends(source.manifest, 'exec', 'build_export'),
        '<exec_depend>rosidl_default_runtime</exec_depend>',
        'it builds; a machine that only runs it may lack the libraries which load it',
    ),
    Rule(
        lambda source: GROUP not in [group.name for group in source.manifest.member_of_groups],
        f'<member_of_group>{GROUP}</member_of_group>',
        f'"Packages installing interfaces must include \'<member_of_group>{GROUP}'
        '</member_of_group>\'"',
    ),
    Rule(_not_named, '<depend>{it}</depend>', ONLY_WHERE_INSTALLED.format('{it} is', '{it}')),
]
