"""Show information about ROS interfaces."""

from __future__ import annotations

import argparse
import contextlib
import io
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from helpers.ros2 import _index
from helpers.ros2._commands import Parser
from helpers.ros2._errors import CommandError

HEADINGS = {'msg': 'Messages', 'srv': 'Services', 'action': 'Actions'}
PLURALS = {'msg': 'msgs', 'srv': 'srvs', 'action': 'actions'}
SEPARATOR = '---'


def add_arguments(parser: Parser) -> None:
    """Add the commands below `ros2 interface`."""
    listing, show, package, packages, proto = parser.functions(
        _list, _show, _package, _packages, _proto
    )
    for command in (listing, package, packages):
        for kind, plural in PLURALS.items():
            help_ = f'Print out only the {HEADINGS[kind].lower()}'
            command.flag(f'-{kind[0]} --only-{plural}', help_)
    package.option('package_name', 'Name of the ROS package', _index.complete_packages)
    for command in (show, proto):
        help_ = "Name of an interface (e.g. 'std_msgs/msg/String')"
        command.option('type', help_, lambda **kwargs: _index.interfaces())
    show.flag('--all-comments', 'Show all comments, including for nested interface definitions')
    show.flag('--no-comments', 'Show no comments or whitespace')
    proto.flag('--no-quotes', 'Output without outer quotes')


def _kinds(args: argparse.Namespace) -> list[str]:
    chosen = [kind for kind, plural in PLURALS.items() if getattr(args, f'only_{plural}')]
    return chosen or list(PLURALS)


def _list(args: argparse.Namespace) -> None:
    """List all interface types available."""
    names = _index.interfaces()
    for kind in _kinds(args):
        print(f'{HEADINGS[kind]}:')
        for name in names:
            if name.split('/')[1] == kind:
                print(f'    {name}')


def _package(args: argparse.Namespace) -> None:
    """Output a list of available interface types within one package."""
    _index.prefix_of(args.package_name, "Unknown package '{}'")
    for name in _index.interfaces(args.package_name):
        if name.split('/')[1] in _kinds(args):
            print(name)


def _packages(args: argparse.Namespace) -> None:
    """Output a list of packages that provide interfaces."""
    kinds = _kinds(args)
    names = (name.split('/') for name in _index.interfaces())
    for package in sorted({package for package, kind, _ in names if kind in kinds}):
        print(package)


def _proto(args: argparse.Namespace) -> None:
    """Output an interface prototype."""
    from helpers.ros2._values import find_type, to_yaml

    kind = args.type.split('/')[1] if args.type.count('/') == 2 else 'msg'
    unknown = f"Unknown interface '{args.type}'"
    class_ = find_type(args.type, kind if kind in PLURALS else 'msg', unknown)
    part = {'msg': class_, 'srv': 'Request', 'action': 'Goal'}.get(kind, class_)
    text = to_yaml(getattr(class_, part)() if isinstance(part, str) else part())
    print(text if args.no_quotes else f'"{text}"')


def _show(args: argparse.Namespace) -> None:
    """Output the interface definition."""
    name = args.type
    if name == '-':
        name = '' if sys.stdin.isatty() else sys.stdin.readline().strip()
    if not name:
        raise CommandError('ros2 interface show: error: the passed value is empty', 2)
    if args.all_comments and args.no_comments:
        message = 'argument --no-comments: not allowed with argument --all-comments'
        raise CommandError(f'ros2 interface show: error: {message}', 2)
    for line in listing(name, not args.no_comments, args.all_comments):
        print(line)


def find(name: str) -> Path:
    """Return the .msg, .srv or .action file of an interface. Raises CommandError."""
    parts = name.split('/')
    if len(parts) != 3 or not all(parts) or '..' in parts:
        raise CommandError(f"Invalid name '{name}'. Expected three parts separated by '/'")
    prefix = _index.prefix_of(parts[0], "Unknown package '{}'")
    path = prefix / 'share' / name
    file = path.with_name(f'{path.name}.{parts[1]}')
    if not file.is_file():
        raise CommandError(f"Could not find the interface '{path}.idl'")
    return file


def listing(
    name: str, comments: bool = True, nested_comments: bool = False, depth: int = 0
) -> Iterator[str]:
    """Yield the lines of an interface, each nested message below its field, one tab deeper.

    Of the nested messages the real command hides the comments, and leaves remains of some: a `#`
    after a field, a comment line that is indented or empty. So does this function.
    """
    package = name.split('/')[0]
    for text in map(str.rstrip, find(name).read_text(encoding='utf-8').splitlines()):
        bare, nested = _read_line(package, text)
        shown = text if comments else bare
        if shown is not None:
            yield '\t' * depth + shown if shown else ''
        if nested:
            yield from listing(nested, nested_comments, nested_comments, depth + 1)


@cache
def _read_line(package: str, text: str) -> tuple[str | None, str | None]:
    """A line of an interface without its comment (None: the line vanishes), and what it nests.

    The command reads each line on its own. Where it hides a comment, it looks for the text which
    the parser gives, without `#`, unit and indentation, and cuts one character before it.
    """
    from rosidl_adapter import parser

    if text == SEPARATOR:
        return text, None
    with contextlib.redirect_stderr(io.StringIO()):  # the parser prints errors before it raises
        line: Any = parser.parse_message_string(package, 'Line', text)
    if not text or line.annotations['comment']:
        return None, None
    bare = text
    for element in (*line.fields, *line.constants):
        if comment := element.annotations['comment']:
            bare = text[: text.find(comment[0]) - 1].strip()
    nested = [f.type for f in line.fields if not f.type.is_primitive_type()]
    return bare, f'{nested[0].pkg_name}/msg/{nested[0].type}' if nested else None
