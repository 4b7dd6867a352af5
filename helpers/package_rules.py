"""What an interface package lacks, told before it is built.

`check_package` reads the package into one plain record, then asks a table of rules. A rule is here
where a lesson shows its mistake, where the build goes through in spite of it, or where the build's
answer is hard to read. All other mistakes are left to the build, which names them.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from catkin_pkg.package import InvalidPackage, Package, parse_package_string
from rosidl_adapter import parser

from helpers.cmake_lists import GENERATE, CMakeLists, read_cmake_lists
from helpers.interfaces import (
    KINDS,
    SEPARATOR,
    installed_names,
    read_fields,
    share_folder,
)
from helpers.text import wrap

MANIFEST = 'package.xml'
CMAKE = 'CMakeLists.txt'
GENERATORS = {'rosidl_default_generators', 'rosidl_core_generators'}
RUNTIMES = {'rosidl_default_runtime', 'rosidl_core_runtime'}
GROUP = 'rosidl_interface_packages'
BUILD_TYPE = 'ament_cmake'
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
    action. Variables of CMake are not followed. Raises ValueError if there is no such folder.
    """
    if not os.path.isdir(path):
        raise ValueError(f'There is no folder {str(path)!r}. Give the folder with package.xml.')
    folder = Path(path).resolve()
    findings: list[Finding] = []
    manifest, cmake = _read_manifest(folder, findings), _read_cmake(folder, findings)
    name = manifest.name if manifest else folder.name
    files = sorted(file for kind in KINDS for file in folder.glob(f'{kind}/*.{kind}'))
    source = Source(name, manifest, cmake, [_definition(name, folder, file) for file in files])
    findings += _definitions(source)
    for file, lacks, missing, error in RULES:
        lacking = lacks(source) if source.has(file) else []
        for it in [''] if lacking is True else lacking or []:
            texts = {'it': it, 'file': source.uses.get(it), 'name': name}
            findings.append(Finding(file, missing.format(**texts), error.format(**texts)))
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

    name: str
    manifest: Package | None
    cmake: CMakeLists | None
    definitions: list[Definition]

    def has(self, file: str) -> bool:
        """Whether package.xml or CMakeLists.txt could be read."""
        return bool(self.manifest if file == MANIFEST else self.cmake)

    @property
    def files(self) -> list[str]:
        """The interface files on the disk."""
        return [definition.file for definition in self.definitions]

    @property
    def given(self) -> list[str]:
        """The packages after DEPENDENCIES."""
        return self.cmake.dependencies if self.cmake else []

    @property
    def uses(self) -> dict[str, str]:
        """The other packages whose messages are used, each with the first file that does."""
        uses: dict[str, str] = {}
        for definition in self.definitions:
            for field in definition.fields:
                if field.type.pkg_name not in (None, self.name):
                    uses.setdefault(field.type.pkg_name, definition.file)
        return uses


def _read_manifest(folder: Path, findings: list[Finding]) -> Package | None:
    try:
        return _parse_manifest((folder / MANIFEST).read_bytes())
    except FileNotFoundError:
        findings.append(Finding(MANIFEST, 'the file', 'colcon does not see a ROS package here'))
    except InvalidPackage as error:
        message = f'InvalidPackage: {" ".join(str(error).splitlines()[1:])}'  # 0: the file's name
        findings.append(Finding(MANIFEST, 'a manifest that colcon can read', message))
    return None


@cache
def _parse_manifest(text: bytes) -> Package:
    return parse_package_string(text, MANIFEST, warnings=[])


def _read_cmake(folder: Path, findings: list[Finding]) -> CMakeLists | None:
    try:
        return read_cmake_lists((folder / CMAKE).read_text(encoding='utf-8', errors='replace'))
    except FileNotFoundError:
        error = 'CMake stops: the source directory "does not appear to contain CMakeLists.txt"'
        findings.append(Finding(CMAKE, 'the file', error))
    except ValueError:
        what = "a ')' for each '(', and no more"
        findings.append(Finding(CMAKE, what, 'CMake stops with "Parse error."'))
    return None


def _depends(manifest: Package, *kinds: str) -> set[str]:
    """The packages in the manifest's <..._depend> tags of these kinds, <depend> among them."""
    return {depend.name for kind in kinds for depend in manifest[f'{kind}_depends']}


def _with_brought(packages: Iterable[str]) -> set[str]:
    """These packages, and all that they bring with them, as far as they are installed."""
    brought, todo = set(), list(packages)
    while todo:
        package = todo.pop()
        if package not in brought and (share := share_folder(package)):
            manifest = _parse_manifest((share / MANIFEST).read_bytes())
            todo += _depends(manifest, 'buildtool_export', 'build_export', 'exec')
        brought.add(package)
    return brought


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
            short = field.type.type
            if field.type.pkg_name == source.name and f'msg/{short}.msg' not in source.files:
                file = f'.../{source.name}/msg/{short}.json'
                error = f"FileNotFoundError: [Errno 2] No such file or directory: '{file}'"
                yield Finding(definition.file, _without_package(field), error)


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


def _without_package(field: parser.Field) -> str:
    """What a field lacks whose message its own package does not have."""
    short = field.type.type
    others = [name for name in installed_names() if name.endswith(f'/msg/{short}')]
    example = f', for example {others[0].replace("/msg/", "/")}' if others else ''
    return f'the package of the type {short} of {field.name!r}{example}'


# --- rules of CMakeLists.txt and package.xml ---


class Rule(NamedTuple):
    """What a file must have.

    `lacks` tells whether it is missing, or lists what is. `{it}` in the texts is an element of this
    list, `{file}` the interface that uses it, `{name}` the name of the package.
    """

    file: str
    lacks: Callable[[Source], bool | list[str]]
    missing: str
    error: str


def _not_found(source: Source, packages: list[str]) -> list[str]:
    found = _with_brought(source.cmake.found)
    return [package for package in packages if package not in found]


def _not_handed_on(source: Source) -> list[str]:
    if GENERATE not in source.cmake.commands:
        return []
    kinds = {file.partition('/')[0] for file in source.files}
    implicit = [package for kind, package in BROUGHT_BY_KIND.items() if kind in kinds]
    brought = _with_brought([*source.given, *implicit])
    return [package for package in source.uses if package not in brought]


def _not_named(source: Source) -> list[str]:
    """The used packages without <depend>. Those of DEPENDENCIES must be named themselves."""
    build = _depends(source.manifest, 'buildtool', 'build')
    named = build & _depends(source.manifest, 'exec')  # who uses the interfaces needs them, too
    brought = _with_brought(build)
    packages = dict.fromkeys([*source.given, *source.uses])
    return [p for p in packages if p not in (named if p in source.given else brought)]


ONLY_WHERE_INSTALLED = (
    'it builds only where {} installed already; elsewhere "{}Config.cmake" is not found'
)
RULES = [
    Rule(
        CMAKE,
        lambda source: source.files[:1] if GENERATE not in source.cmake.commands else [],
        f'{GENERATE}(${{{{PROJECT_NAME}}}} "{{it}}" ...)',
        'it builds, but without any interface: "Could not find the interface"',
    ),
    Rule(
        CMAKE,
        lambda source: GENERATE in source.cmake.commands and not GENERATORS & source.cmake.found,
        f'find_package(rosidl_default_generators REQUIRED), before {GENERATE}()',
        f'Unknown CMake command "{GENERATE}"',
    ),
    Rule(
        CMAKE,
        lambda source: [
            file for file in source.files if source.cmake.files and file not in source.cmake.files
        ],
        f'"{{it}}" in {GENERATE}()',
        'it builds, but without this interface; another interface that uses it fails with '
        'FileNotFoundError',
    ),
    Rule(
        CMAKE,
        lambda source: _not_found(source, source.given),
        f'find_package({{it}} REQUIRED), before {GENERATE}()',
        '"the passed dependency \'{it}\' has not been found before using find_package()"',
    ),
    Rule(
        CMAKE,
        _not_handed_on,
        f'DEPENDENCIES {{it}} in {GENERATE}(), for {{file}}',
        'KeyError: {it!r}, from rosidl_generator_type_description (on Humble: '
        '"fatal error: {it}/msg/...: No such file or directory")',
    ),
    Rule(
        CMAKE,
        lambda source: _not_found(source, _not_handed_on(source)),
        f'find_package({{it}} REQUIRED), before {GENERATE}()',
        'with DEPENDENCIES alone: '
        '"the passed dependency \'{it}\' has not been found before using find_package()"',
    ),
    Rule(
        CMAKE,
        lambda source: 'ament_package' not in source.cmake.commands,
        'ament_package(), at the end',
        'it builds, but setup.bash then says "not found: .../local_setup.bash", and '
        '"ros2 interface show" "Unknown package {name!r}"',
    ),
    Rule(
        MANIFEST,
        lambda source: [kind for kind in [source.manifest.get_build_type()] if kind != BUILD_TYPE],
        '<build_type>ament_cmake</build_type> in <export>',
        'colcon builds it as {it!r}: setup.bash does not add it to AMENT_PREFIX_PATH, and '
        '"ros2 interface show" says "Unknown package {name!r}"',
    ),
    Rule(
        MANIFEST,
        lambda source: not GENERATORS & _depends(source.manifest, 'buildtool', 'build'),
        '<buildtool_depend>rosidl_default_generators</buildtool_depend>',
        ONLY_WHERE_INSTALLED.format('the generators are', 'rosidl_default_generators'),
    ),
    Rule(
        MANIFEST,
        lambda source: not RUNTIMES & _depends(source.manifest, 'exec', 'build_export'),
        '<exec_depend>rosidl_default_runtime</exec_depend>',
        'it builds; a machine that only runs it may lack the libraries which load it',
    ),
    Rule(
        MANIFEST,
        lambda source: GROUP not in [group.name for group in source.manifest.member_of_groups],
        f'<member_of_group>{GROUP}</member_of_group>',
        f'"Packages installing interfaces must include \'<member_of_group>{GROUP}'
        '</member_of_group>\'"',
    ),
    Rule(
        MANIFEST,
        _not_named,
        '<depend>{it}</depend>',
        ONLY_WHERE_INSTALLED.format('{it} is', '{it}'),
    ),
]
