"""Show information about ROS interfaces."""

from __future__ import annotations

import argparse

from ros2_command import index
from ros2_command.commands import command, flag, option
from ros2_command.index import interfaces
from ros2_command.interfaces import interface_file, interface_lines
from ros2_command.values import find_type, to_yaml

HEADINGS = {'msg': 'Messages', 'srv': 'Services', 'action': 'Actions'}
ONLY = tuple(
    flag(f'-{kind[0]} --only-{kind}s', f'Print out only the {heading.lower()}')
    for kind, heading in HEADINGS.items()
)
PACKAGE = option('package_name', 'Name of the ROS package', index.complete_packages)
TYPE = option('type', "Its name (e.g. 'std_msgs/msg/String')", lambda **kwargs: interfaces())


@command(*ONLY)
def _list(args: argparse.Namespace) -> None:
    """List all interface types available."""
    chosen = [kind for kind in HEADINGS if getattr(args, f'only_{kind}s')]
    for kind in chosen or HEADINGS:
        print(f'{HEADINGS[kind]}:')
        for name in interfaces():
            if name.split('/')[1] == kind:
                print(f'    {name}')


@command(PACKAGE)
def _package(args: argparse.Namespace) -> None:
    """Output a list of available interface types within one package."""
    index.prefix_of(args.package_name, "Unknown package '{}'")
    for name in interfaces(args.package_name):
        print(name)


@command()
def _packages(args: argparse.Namespace) -> None:
    """Output a list of packages that provide interfaces."""
    for package in sorted({name.split('/')[0] for name in interfaces()}):
        print(package)


@command(TYPE)
def _proto(args: argparse.Namespace) -> None:
    """Output an interface prototype."""
    kind = interface_file(args.type).suffix[1:]
    class_ = find_type(args.type, kind, f"Unknown interface '{args.type}'")
    part = {'srv': 'Request', 'action': 'Goal'}.get(kind)
    prototype = getattr(class_, part)() if part else class_()
    print(f'"{to_yaml(prototype)}"')


@command(
    TYPE,
    flag('--all-comments', 'Show all comments, including for nested interface definitions'),
    flag('--no-comments', 'Show no comments or whitespace'),
)
def _show(args: argparse.Namespace) -> None:
    """Output the interface definition."""
    for line in interface_lines(args.type, not args.no_comments, args.all_comments):
        print(line)
