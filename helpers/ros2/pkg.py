"""Various package related sub-commands."""

from __future__ import annotations

import argparse
from pathlib import Path
from xml.etree import ElementTree

from helpers.ros2 import _index
from helpers.ros2._commands import Parser
from helpers.ros2._errors import CommandError


def add_arguments(parser: Parser) -> None:
    """Add the commands below `ros2 pkg`."""
    _, prefix, executables, xml, create = parser.functions(
        _list, _prefix, _executables, _xml, _create
    )
    for command in (prefix, executables, xml):
        nargs = '?' if command is executables else None
        complete = _index.complete_packages
        command.option('package_name', 'The package name', complete, nargs=nargs)
    prefix.flag('--share', 'Show share directory for the package')
    executables.flag('--full-path', 'Show full path of each executable')
    xml.option('-t --tag', "The XML tag to output (e.g. 'version')")
    _add_create_arguments(create)


def _add_create_arguments(create: Parser) -> None:
    create.option('package_name', 'The package name')
    versions = {'type': int, 'default': 3, 'choices': [2, 3]}
    create.option('--package-format --package_format', 'The package.xml format', **versions)
    todo = 'TODO: Package description'
    create.option('--description', 'The description given in the package.xml', default=todo)
    todo = 'TODO: License declaration'
    create.option('--license', "The license of this package ('?' lists the known)", default=todo)
    create.option('--destination-directory', 'Where to create the package', default='.')
    types = {'default': 'ament_cmake', 'choices': ['cmake', 'ament_cmake', 'ament_python']}
    create.option('--build-type', 'The build type to process the package with', **types)
    create.option('--dependencies', 'list of dependencies', nargs='+', default=[])
    create.option('--maintainer-email', 'email address of the maintainer of this package')
    create.option('--maintainer-name', 'name of the maintainer of this package')
    create.option('--node-name', 'name of the empty executable')
    create.option('--library-name', 'name of the empty library')


def _list(args: argparse.Namespace) -> None:
    """Output a list of available packages."""
    for name in sorted(_index.packages()):
        print(name)


def _prefix(args: argparse.Namespace) -> None:
    """Output the prefix path of a package."""
    prefix = _index.prefix_of(args.package_name, 'Package not found')
    print(prefix / 'share' / args.package_name if args.share else prefix)


def _executables(args: argparse.Namespace) -> None:
    """Output a list of package specific executables."""
    for package in [args.package_name] if args.package_name else sorted(_index.packages()):
        for file in sorted(_index.executables(package)):
            print(file if args.full_path else f'{package} {file.name}')


def _xml(args: argparse.Namespace) -> None:
    """Output the XML of the package manifest or a specific tag."""
    name = args.package_name
    file = Path(_index.prefix_of(name, 'Package not found'), 'share', name, 'package.xml')
    if not file.is_file():
        raise CommandError('Package XML manifest not found')
    tree = ElementTree.parse(file)
    if args.tag is None:
        ElementTree.dump(tree)
        return
    found = tree.getroot().findall(args.tag)
    if not found:
        raise CommandError('XML tag not found')
    for element in found:
        print(element.text)


def _create(args: argparse.Namespace) -> None:
    """Create a new ROS 2 package."""
    from helpers.ros2._create import create

    create(args)
