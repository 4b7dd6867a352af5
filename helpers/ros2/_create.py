"""The files of a new package, as `ros2 pkg create` writes them."""

from __future__ import annotations

import argparse
import getpass
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

from helpers.ros2._errors import CommandError

TEMPLATES = Path(__file__).with_name('templates')
LICENSES = {'Apache-2.0': Path(__file__).resolve().parents[2] / 'LICENSE'}
SCHEMA = 'http://download.ros.org/schema/package_format{}.xsd'
LINTERS = {
    'copyright': "main(argv=['.', 'test'])",
    'flake8': 'main(argv=[])',
    'pep257': "main(argv=['.', 'test'])",
}
SKIP = "@pytest.mark.skip(reason='The source files have no copyright header yet.')\n"
NO_DEPENDENCIES = """\
# uncomment the following section in order to fill in
# further dependencies manually.
# find_package(<dependency> REQUIRED)"""
INSTALL_NODE = 'install(TARGETS {node}\n  DESTINATION lib/${{PROJECT_NAME}})\n'
EXPORT = """
ament_export_include_directories("include/${PROJECT_NAME}")
ament_export_targets(export_${PROJECT_NAME})
"""


def create(args: argparse.Namespace) -> None:
    """Write a package below the destination directory, and print what is written.

    Raises CommandError if it is there already, or cannot be made.
    """
    if args.license == '?':
        print('Supported licenses:', *LICENSES, sep='\n')
        return
    name, kind, node = args.package_name, args.build_type, args.node_name
    if node and node == args.library_name:
        node += '_node'
        print('[WARNING] node name can not be equal to the library name', file=sys.stderr)
        print(f'[WARNING] renaming node to {node}', file=sys.stderr)
    if kind == 'cmake':
        raise CommandError('Here --build-type is ament_cmake or ament_python, not cmake')
    if kind == 'ament_python' and name == 'test':
        raise CommandError(
            "Aborted since 'ament_python' packages can't be named 'test'. Please choose a "
            'different package name.'
        )
    package = f'{args.destination_directory}/{name}'
    if Path(package).exists():
        raise CommandError(
            f'\nAborted!\nThe directory already exists: {package}\nEither remove the directory or '
            'choose a different destination directory or package name'
        )
    maintainer = args.maintainer_name or getpass.getuser()
    email = args.maintainer_email or _git_email() or f'{maintainer}@todo.todo'
    print('going to create a new package')
    for what, value in {
        'package name': name,
        'destination directory': Path(args.destination_directory).resolve(),
        'package format': args.package_format,
        'version': '0.0.0',
        'description': args.description,
        'maintainer': [f'{maintainer} <{email}>'],
        'licenses': [args.license],
        'build type': kind,
        'dependencies': args.dependencies,
        **({'node_name': node} if node else {}),
        **({'library_name': args.library_name} if args.library_name else {}),
    }.items():
        print(f'{what}: {value}')
    try:
        _folder(package)
        _file(f'{package}/package.xml', _manifest(args, maintainer, email))
        if kind == 'ament_python':
            _python(args, package, node, maintainer, email)
        else:
            _cmake(args, package, node)
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


def _text(template: str, **values: Any) -> str:
    """Return a template with its values filled in."""
    return (TEMPLATES / f'{template}.txt').read_text(encoding='utf-8').format(**values)


def _folder(path: str) -> None:
    print('creating folder', path)
    Path(path).mkdir(parents=True, exist_ok=True)


def _file(path: str, text: str = '') -> None:
    print('creating', path)
    Path(path).write_text(text, encoding='utf-8')


def _git_email() -> str:
    if not (git := shutil.which('git')):
        return ''
    answer = subprocess.run([git, 'config', 'user.email'], capture_output=True, text=True)
    return answer.stdout.strip()


def _manifest(args: argparse.Namespace, maintainer: str, email: str) -> str:
    python = args.build_type == 'ament_python'
    tools = [] if python else ['ament_cmake_ros' if args.library_name else 'ament_cmake']
    tests = ['ament_copyright', 'ament_flake8', 'ament_pep257', 'python3-pytest']
    tests = tests if python else ['ament_lint_auto', 'ament_lint_common']
    groups = {'buildtool_depend': tools, 'depend': args.dependencies, 'test_depend': tests}
    lines = [
        '<?xml version="1.0"?>',
        f'<?xml-model href="{SCHEMA.format(args.package_format)}" '
        'schematypens="http://www.w3.org/2001/XMLSchema"?>',
        f'<package format="{args.package_format}">',
        f'  <name>{args.package_name}</name>',
        '  <version>0.0.0</version>',
        f'  <description>{escape(args.description)}</description>',
        f'  <maintainer email="{escape(email)}">{escape(maintainer)}</maintainer>',
        f'  <license>{escape(args.license)}</license>',
        '',
    ]
    for tag, names in groups.items():
        lines += [*(f'  <{tag}>{name}</{tag}>' for name in names), *([''] if names else [])]
    lines += ['  <export>', f'    <build_type>{args.build_type}</build_type>', '  </export>']
    return '\n'.join([*lines, '</package>', ''])


def _python(
    args: argparse.Namespace, package: str, node: str | None, maintainer: str, email: str
) -> None:
    name = args.package_name
    print('creating source folder')
    _folder(f'{package}/{name}')
    script = f"            '{node} = {name}.{node}:main'\n" if node else ''
    texts = {'description': args.description, 'license': args.license, 'scripts': script}
    setup = _text('setup.py', name=name, maintainer=maintainer, email=email, **texts)
    _file(f'{package}/setup.py', setup)
    scripts = f'$base/lib/{name}'
    configuration = f'[develop]\nscript_dir={scripts}\n[install]\ninstall_scripts={scripts}\n'
    _file(f'{package}/setup.cfg', configuration)
    _folder(f'{package}/resource')
    _file(f'{package}/resource/{name}')
    _file(f'{package}/{name}/__init__.py')
    _folder(f'{package}/test')
    for linter, call in LINTERS.items():
        skip = SKIP if linter == 'copyright' else ''
        test = _text('test.py', linter=linter, skip=skip, call=call)
        _file(f'{package}/test/test_{linter}.py', test)
    if node:
        _file(f'{package}/{name}/{node}.py', _text('main.py', name=name))
    if args.library_name:
        _folder(f'{package}/{name}/{args.library_name}')
        _file(f'{package}/{name}/{args.library_name}/__init__.py')


def _cmake(args: argparse.Namespace, package: str, node: str | None) -> None:
    name, library = args.package_name, args.library_name
    print('creating source and include folder')
    _folder(f'{package}/src')
    _folder(f'{package}/include/{name}')
    found = ['ament_cmake', *(['ament_cmake_ros'] if library else []), *args.dependencies]
    find = [f'find_package({one} REQUIRED)' for one in found]
    find += [] if args.dependencies else [NO_DEPENDENCIES]
    listed = '\n'.join(f'  "{one}"' for one in args.dependencies)
    needs = f'ament_target_dependencies(\n  {{}}\n{listed}\n)\n' if args.dependencies else ''
    parts = {'library': '', 'executable': '', 'export': ''}
    if library:
        target = _text('target', kind='library', target=library, needs=needs.format(library))
        parts['library'] = target + _text('install', library=library)
        parts['export'] = EXPORT
    if node:
        linked = f'target_link_libraries({node} {library})\n' if library else needs.format(node)
        target = _text('target', kind='executable', target=node, needs=linked)
        parts['executable'] = target + INSTALL_NODE.format(node=node)
    _file(
        f'{package}/CMakeLists.txt', _text('CMakeLists', name=name, find='\n'.join(find), **parts)
    )
    if node:
        _file(f'{package}/src/{node}.cpp', _text('main.cpp', name=name))
    if library:
        class_name = library.replace('_', ' ').title().replace(' ', '')
        guard = f'{name}__{library}_HPP_'.upper()
        texts = {'name': name, 'library': library, 'class_name': class_name, 'guard': guard}
        _file(f'{package}/include/{name}/{library}.hpp', _text('library.hpp', **texts))
        _file(f'{package}/src/{library}.cpp', _text('library.cpp', **texts))
