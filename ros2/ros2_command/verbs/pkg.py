"""Various package related sub-commands."""

from __future__ import annotations

import argparse
import getpass
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.sax.saxutils import escape

from ros2_command import index
from ros2_command.commands import CommandError, command, flag, option

TEMPLATES = Path(__file__).parents[1] / 'templates'
LICENSES = {'Apache-2.0': TEMPLATES / 'Apache-2.0.txt'}
# What a package is made of, by its build type. A file without a template is empty.
FILES = {
    'ament_python': (
        *('{name}/', 'setup.py', 'setup.cfg', 'resource/', 'resource/{name}'),
        *('{name}/__init__.py', 'test/', 'test/test_copyright.py', 'test/test_flake8.py'),
        *('test/test_pep257.py', '{name}/{node}.py'),
    ),
    'ament_cmake': ('src/', 'include/{name}/', 'CMakeLists.txt', 'src/{node}.cpp'),
}
TOOLS = {'ament_python': [], 'ament_cmake': ['ament_cmake']}
TESTS = {
    'ament_python': ['ament_copyright', 'ament_flake8', 'ament_pep257', 'python3-pytest'],
    'ament_cmake': ['ament_lint_auto', 'ament_lint_common'],
}
NO_DEPENDENCIES = """\
# uncomment the following section in order to fill in
# further dependencies manually.
# find_package(<dependency> REQUIRED)"""
PACKAGE = 'package_name', 'The package name', index.complete_packages


@command()
def _list(args: argparse.Namespace) -> None:
    """Output a list of available packages."""
    for name in sorted(index.packages()):
        print(name)


@command(option(*PACKAGE), flag('--share', 'Show share directory for the package'))
def _prefix(args: argparse.Namespace) -> None:
    """Output the prefix path of a package."""
    prefix = index.prefix_of(args.package_name, 'Package not found')
    print(prefix / 'share' / args.package_name if args.share else prefix)


@command(option(*PACKAGE, nargs='?'))
def _executables(args: argparse.Namespace) -> None:
    """Output a list of package specific executables."""
    for package in [args.package_name] if args.package_name else sorted(index.packages()):
        for file in sorted(index.executables(package)):
            print(f'{package} {file.name}')


@command(option(*PACKAGE), option('-t --tag', "The XML tag to output (e.g. 'version')"))
def _xml(args: argparse.Namespace) -> None:
    """Output the XML of the package manifest or a specific tag."""
    name = args.package_name
    file = index.prefix_of(name, 'Package not found') / 'share' / name / 'package.xml'
    if not file.is_file():
        raise CommandError('Package XML manifest not found')
    tree = ElementTree.parse(file)
    if args.tag is None:
        ElementTree.dump(tree)
        return
    elements = tree.getroot().findall(args.tag)
    if not elements:
        raise CommandError('XML tag not found')
    for element in elements:
        print(element.text)


@command(
    option('package_name', 'The package name'),
    option('--description', 'Of the package', default='TODO: Package description'),
    option('--license', 'Of the package', default='TODO: License declaration'),
    option('--destination-directory', 'Where to create the package', default='.'),
    option('--build-type', 'ament_cmake if not given', choices=FILES, default='ament_cmake'),
    option('--dependencies', 'list of dependencies', nargs='+', default=[]),
    option('--maintainer-email', 'email address of the maintainer of this package'),
    option('--maintainer-name', 'name of the maintainer of this package'),
    option('--node-name', 'name of the empty executable'),
)
def _create(args: argparse.Namespace) -> None:
    """Create a new ROS 2 package."""
    name, kind, node = args.package_name, args.build_type, args.node_name
    package = f'{args.destination_directory}/{name}'
    if Path(package).exists():
        raise CommandError(
            f'\nAborted!\nThe directory already exists: {package}\nEither remove the directory or '
            'choose a different destination directory or package name'
        )
    maintainer = args.maintainer_name or getpass.getuser()
    email = args.maintainer_email or _git_email() or f'{maintainer}@todo.todo'
    print('going to create a new package')
    for title, value in {
        'package name': name,
        'destination directory': Path(args.destination_directory).resolve(),
        'package format': 3,
        'version': '0.0.0',
        'description': args.description,
        'maintainer': [f'{maintainer} <{email}>'],
        'licenses': [args.license],
        'build type': kind,
        'dependencies': args.dependencies,
        **({'node_name': node} if node else {}),
    }.items():
        print(f'{title}: {value}')
    values = {'description': args.description, 'license': args.license}
    values |= {'name': name, 'maintainer': maintainer, 'email': email, 'kind': kind}
    depends = {
        'buildtool_depend': TOOLS[kind],
        'depend': args.dependencies,
        'test_depend': TESTS[kind],
    }
    try:
        escaped = {name: escape(value) for name, value in values.items()}
        _write(package, ('', 'package.xml'), escaped | {'depends': _tags(depends)})
        folders = 'source and include' if kind == 'ament_cmake' else 'source'
        print(f'creating {folders} folder')
        values |= {'node': node, **_parts(name, node, args.dependencies)}
        _write(package, [file for file in FILES[kind] if node or 'node' not in file], values)
        if args.license in LICENSES:
            shutil.copyfile(LICENSES[args.license], f'{package}/LICENSE')
    except OSError as error:
        raise CommandError(f'unable to create {package}: {error.strerror}') from None
    if args.license not in LICENSES:
        known = '\n'.join(LICENSES)
        print(
            f"\n[WARNING]: Unknown license '{args.license}'.  This has been set in the package.xml,"
            ' but no LICENSE file has been created.\nIt is recommended to use one of the ament '
            f'license identifiers:\n{known}'
        )


def _git_email() -> str:
    if not (git := shutil.which('git')):
        return ''
    answer = subprocess.run([git, 'config', 'user.email'], capture_output=True, text=True)
    return answer.stdout.strip()


def _write(package: str, paths: Iterable[str], values: dict[str, Any]) -> None:
    """Write files below a package, and make the folders, whose names end with a slash."""
    for path in paths:
        new = f'{package}/{path.format(**values)}'.rstrip('/')
        if path.endswith('/') or not path:
            print('creating folder', new)
            Path(new).mkdir(parents=True)
        else:
            print('creating', new)
            template = path.rpartition('/')[2].replace('{', '').replace('}', '')
            Path(new).write_text(_filled(template, values), encoding='utf-8')


def _filled(template: str, values: dict[str, Any]) -> str:
    """Return a template with its values filled in, or nothing if there is none."""
    file = TEMPLATES / f'{template}.txt'
    return file.read_text(encoding='utf-8').format(**values) if file.exists() else ''


def _tags(depends: dict[str, list[str]]) -> str:
    """Return the lines of package.xml for the packages of each tag."""
    groups = [[f'  <{tag}>{name}</{tag}>\n' for name in names] for tag, names in depends.items()]
    return ''.join(''.join(group) + '\n' for group in groups if group)


def _parts(name: str, node: str | None, dependencies: list[str]) -> dict[str, str]:
    """Return what differs in setup.py and CMakeLists.txt."""
    find = [f'find_package({package} REQUIRED)' for package in ('ament_cmake', *dependencies)]
    if not dependencies:
        find.append(NO_DEPENDENCIES)
    parts = {'find': '\n'.join(find)}
    if not node:
        return parts | {'scripts': '', 'executable': ''}
    listed = '\n'.join(f'  "{package}"' for package in dependencies)
    needs = f'ament_target_dependencies(\n  {node}\n{listed}\n)\n' if dependencies else ''
    parts['executable'] = _filled('executable', {'node': node, 'needs': needs})
    return parts | {'scripts': f"            '{node} = {name}.{node}:main'\n"}
